"""Placement of a person and pose of the camera, the parts of a body model beside the sizes.

Both are given in the reference frame: origin at the camera's centre, X towards the camera, Y to the
right of the image, Z up; level, independent of the camera's pitch.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

from cardbox_tracker.body.ranges import check_range

# name: (lowest, highest, unit, meaning)
PLACEMENT = {
    "distance_m": (0.3, 20.0, "m", "level distance from the camera to the middle of the hips"),
    "hip_height_m": (-5.0, 5.0, "m", "height of the middle of the hips above the camera's centre"),
    "lateral_m": (-5.0, 5.0, "m", "torso_y in the front reference posture"),
}
CAMERA_POSE = {"camera_pitch_rad": (-1.4, 1.4, "rad", "how far the camera looks down")}


@dataclass(frozen=True)
class Placement:
    """Position of mid-hip in the front reference posture, metres in the reference frame.

    Attributes:
        distance_m: level distance from the camera: X is ``-distance_m``.
        hip_height_m: Z, usually negative.
        lateral_m: Y, which is ``torso_y`` where tracking starts.

    Raises:
        BodyModelError: a value is not finite or outside of its range; the text names it.
    """

    distance_m: float = 2.0
    hip_height_m: float = -0.5
    lateral_m: float = 0.0

    def __post_init__(self) -> None:
        """Check every value."""
        for entry in fields(self):
            lowest, highest, unit, _ = PLACEMENT[entry.name]
            check_range(entry.name, getattr(self, entry.name), lowest, highest, unit)


@dataclass(frozen=True)
class CameraPose:
    """Pose of the camera in the reference frame, whose origin is the camera's centre.

    Attributes:
        pitch_rad: downward pitch, rad.

    Raises:
        BodyModelError: the pitch is not finite or outside of its range.
    """

    pitch_rad: float = 0.0

    def __post_init__(self) -> None:
        """Check the pitch."""
        lowest, highest, unit, _ = CAMERA_POSE["camera_pitch_rad"]
        check_range("camera_pitch_rad", self.pitch_rad, lowest, highest, unit)
