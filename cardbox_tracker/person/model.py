"""Body model: sizes and placement of a person, and pose of the camera (paper, section II-A).

A model file and the topic ``body_model`` contain this model, which is constant while the person is
tracked. Its parts are separate, since a second camera adds a pose and another place changes the
placement, and neither changes the person.

Placement and pose are given in the reference frame: origin at the camera's centre, X towards the
camera, Y to the right of the image, Z up; level, independent of the camera's pitch.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, fields, replace
from operator import index
from typing import Any

import numpy as np

from cardbox_tracker.common.errors import BodyModelError, quoted
from cardbox_tracker.person.appearance import Appearance
from cardbox_tracker.person.posture import N_STATE, POSTURE, SIDE_TURNS, TORSO_Y, reference_posture
from cardbox_tracker.person.proportions import BREADTHS, STATURE_LIMITS_M, sizes_of_stature
from cardbox_tracker.person.sizes import (
    DEFAULT_SIZES,
    N_SIZES,
    SIZE_INDEX,
    SIZE_NAMES,
    SIZES,
    FloatArray,
)
from cardbox_tracker.person.skeleton import SHOULDER_RISE

# name: (lowest, highest, unit, meaning)
PLACEMENT = {
    "distance_m": (0.3, 20.0, "m", "level distance from the camera to the middle of the hips"),
    "hip_height_m": (-5.0, 5.0, "m", "height of the middle of the hips above the camera's centre"),
    "lateral_m": (-5.0, 5.0, "m", "torso_y in the front reference posture"),
}
PLACE = "distance_m", "hip_height_m"
"""Names of what is fitted to the first images of a person whose sizes are known."""
CAMERA_POSE = {"camera_pitch_rad": (-1.4, 1.4, "rad", "how far the camera looks down")}
CAMERA_ROLL = "camera_roll_rad"
"""Name of the camera's roll, which a model file has only if it is not 0."""
CAMERA_HEIGHT = "camera_height_m"
"""Name of the camera's height above the floor, which a model file has only if it is known."""
CONSTANTS = {**PLACEMENT, **CAMERA_POSE}
"""Range, unit and meaning of the numbers of placement and camera pose, by name."""

MEASURED, PROPORTIONS = SOURCES = ("measured", "proportions")
"""Origin of the sizes: reference postures, or the proportions of people of a stature."""


def check_range(name: str, value: float, lowest: float, highest: float, unit: str) -> None:
    """Raise BodyModelError, with unit and range, if a value is not finite or out of range."""
    try:
        is_finite = math.isfinite(value)
    except Exception:  # of what programs give
        is_finite = False
    if not is_finite:
        raise BodyModelError(f"{name} is {quoted(value)}; expected a finite number of {unit}")
    if not lowest <= value <= highest:
        hint = ""
        if unit == "m" and lowest <= value / 100 <= highest and value > 1:
            hint = " (is it given in centimetres?)"
        elif unit == "m" and lowest <= value / 1000 <= highest and value > 10:
            hint = " (is it given in millimetres?)"
        raise BodyModelError(
            f"{name} is {value:g} {unit}; expected {lowest:g} to {highest:g} {unit}{hint}"
        )


@dataclass(frozen=True, eq=False)
class Person:
    """Sizes of one person, independent of place and camera.

    Raises BodyModelError if a size is not finite or outside of its range; the text names it.
    """

    #: shape (18,), metres, ordered as ``SIZE_NAMES``; kept read-only
    sizes: FloatArray = field(default_factory=lambda: DEFAULT_SIZES.copy())

    def __post_init__(self) -> None:
        """Check every size and freeze a copy of the vector."""
        try:
            sizes = np.array(self.sizes, dtype=np.float64)
        except Exception:  # of what programs give
            raise BodyModelError(
                f"sizes are {quoted(self.sizes)}; expected {N_SIZES} numbers of m"
            ) from None
        if sizes.shape != (N_SIZES,):
            raise BodyModelError(f"sizes has shape {sizes.shape}; expected ({N_SIZES},)")
        for size, value in zip(SIZES, sizes, strict=True):
            check_range(size.name, float(value), size.minimum_m, size.maximum_m, "m")
        sizes.setflags(write=False)
        object.__setattr__(self, "sizes", sizes)

    def size(self, name: str) -> float:
        """Return the size of that name in metres."""
        return float(self.sizes[SIZE_INDEX[name]])

    def __eq__(self, other: object) -> bool:
        """Return whether all sizes are equal."""
        if not isinstance(other, Person):
            return NotImplemented
        return np.array_equal(self.sizes, other.sizes)

    def __hash__(self) -> int:
        """Return a hash of all sizes."""
        return hash(self.sizes.tobytes())

    def __str__(self) -> str:
        """Return a line per size, in centimetres."""
        return "\n".join(
            f"{name:20s} {100 * value:6.1f} cm"
            for name, value in zip(SIZE_NAMES, self.sizes, strict=True)
        )


@dataclass(frozen=True)
class Placement:
    """Position of mid-hip in the front reference posture, metres in the reference frame.

    Raises BodyModelError if a value is not finite or outside of its range; the text names it.
    """

    distance_m: float = 2.0  #: level distance from the camera: X is ``-distance_m``
    hip_height_m: float = -0.5  #: Z, usually negative
    lateral_m: float = 0.0  #: Y, which is ``torso_y`` where tracking starts

    def __post_init__(self) -> None:
        """Check every value."""
        for entry in fields(self):
            lowest, highest, unit, _ = PLACEMENT[entry.name]
            check_range(entry.name, getattr(self, entry.name), lowest, highest, unit)


FOUND_STDDEV = math.radians(9.5)
"""Standard deviation from which on a pitch is mostly that of most cameras, and not found, rad."""


@dataclass(frozen=True)
class CameraPose:
    """Pose of the camera in the reference frame, whose origin is the camera's centre.

    Raises BodyModelError if a value is not finite or outside of its range.
    """

    pitch_rad: float = 0.0  #: downward pitch, rad
    #: its standard deviation, rad; it is no part of a model file.
    pitch_stddev_rad: float = math.radians(2.0)
    #: how far the camera is turned clockwise about its axis, seen from behind it. The tracker's
    #: images are turned back, and its results are those of the camera as it stands.
    roll_rad: float = 0.0
    height_m: float | None = None  #: height above the floor, metres; None if it is not known
    height_stddev_m: float = 0.1  #: its standard deviation, metres; it is no part of a model file
    #: what contradicts the pose, in words, so that no result is sure; it is no part of a model file
    contradiction: str = ""
    #: whether it moves, so that no place is sure; it is no part of a model file
    moves: bool = False

    def __post_init__(self) -> None:
        """Check the values."""
        lowest, highest, unit, _ = CAMERA_POSE["camera_pitch_rad"]
        check_range("camera_pitch_rad", self.pitch_rad, lowest, highest, unit)
        check_range(CAMERA_ROLL, self.roll_rad, -math.pi, math.pi, "rad")
        check_range("pitch_stddev_rad", self.pitch_stddev_rad, 0.0, math.pi, "rad")
        check_range("height_stddev_m", self.height_stddev_m, 0.0, 40.0, "m")
        if self.height_m is not None:
            check_range(CAMERA_HEIGHT, self.height_m, -20.0, 20.0, "m")


@dataclass(frozen=True)
class BodyModel:
    """One person in one place before one camera.

    Raises BodyModelError if ``side_turn``, ``source`` or a name in ``unknown`` is not valid.
    """

    person: Person = field(default_factory=Person)  #: the 18 sizes
    placement: Placement = Placement()  #: position of mid-hip
    camera_pose: CameraPose = CameraPose()  #: pose of the camera
    side_turn: str = "left"  #: turn of the person for the side reference, ``left`` or ``right``
    #: the colours of the person's parts; None if they were not learned
    appearance: Appearance | None = None
    source: str = MEASURED  #: one of ``SOURCES``; sizes from proportions are less exact
    #: names of sizes and of ``PLACEMENT`` whose values are guesses; a tracker fits them to the
    #: first silhouette of a person
    unknown: tuple[str, ...] = ()
    #: relative standard deviation of a stature that is only that of most people, which a model file
    #: has only if it is not 0
    stature_stddev: float = 0.0
    #: rise of a shoulder joint per radian of elevation of its arm, in shoulder breadths
    #: (:mod:`.skeleton`); it is no part of a model file
    shoulder_rise: float = SHOULDER_RISE
    #: whether the images show the distance, and nobody has given it; it is no part of a model file
    is_distance_found: bool = field(default=False, compare=False)
    #: number of a body that is measured while it is tracked live, from 1 on; 0 for others. Equal
    #: bodies may have different ones.
    version: int = field(default=0, compare=False)
    #: stamp of the first image to which this version belongs, ns; 0 without one
    stamp_ns: int = field(default=0, compare=False)

    def __post_init__(self) -> None:
        """Check the names; the parts check themselves."""
        if self.side_turn not in SIDE_TURNS:
            raise BodyModelError(
                f"side_turn is {quoted(self.side_turn)}; expected one of {SIDE_TURNS}"
            )
        if self.source not in SOURCES:
            raise BodyModelError(f"source is {quoted(self.source)}; expected one of {SOURCES}")
        check_range("stature_stddev", self.stature_stddev, 0.0, 1.0, "statures")
        check_range("shoulder_rise", self.shoulder_rise, 0.0, 1.0, "shoulder breadths")
        if not isinstance(self.appearance, Appearance | None):
            raise BodyModelError(f"appearance is {quoted(self.appearance)}; expected an Appearance")
        for name in ("version", "stamp_ns"):
            try:
                object.__setattr__(self, name, index(getattr(self, name)))
            except TypeError:
                raise BodyModelError(
                    f"{name} is {quoted(getattr(self, name))}; expected a whole number"
                ) from None
        for name in self.unknown if isinstance(self.unknown, Iterable) else [self.unknown]:
            if name not in (*PLACEMENT, *SIZE_NAMES):
                raise BodyModelError(
                    f"unknown names {quoted(name)}; expected sizes, or any of "
                    + ", ".join(PLACEMENT)
                )

    @classmethod
    def of(cls, sizes: FloatArray | None = None, **values: Any) -> BodyModel:
        """Create a model from sizes (18,), metres, and numbers; what is missing has its default.

        ``values`` are any of ``CONSTANTS``, ``CAMERA_ROLL``, ``side_turn``, ``appearance``,
        ``source``, ``unknown`` and ``shoulder_rise``. Raises BodyModelError for one out of range.
        """
        model = cls() if sizes is None else cls(Person(sizes))
        return model.with_values(**values)

    def with_values(self, **values: Any) -> BodyModel:
        """Return the same model with other numbers.

        ``values`` are those of :meth:`of`, ``sizes``, ``CAMERA_HEIGHT``, ``height_stddev_m``,
        ``camera_contradiction`` and ``camera_moves``. Raises BodyModelError for one out of range.
        """
        changed: dict[str, Any] = {}
        if "sizes" in values:
            changed["person"] = Person(values.pop("sizes"))
        tilt = {
            "camera_pitch_rad": "pitch_rad",
            "pitch_stddev_rad": "pitch_stddev_rad",
            CAMERA_ROLL: "roll_rad",
            CAMERA_HEIGHT: "height_m",
            "height_stddev_m": "height_stddev_m",
            "camera_contradiction": "contradiction",
            "camera_moves": "moves",
        }
        tilted = {tilt[name]: values.pop(name) for name in tilt if name in values}
        place = {name: values.pop(name) for name in PLACEMENT if name in values}
        changed["camera_pose"] = replace(self.camera_pose, **tilted)
        changed["placement"] = replace(self.placement, **place)
        return replace(self, **changed, **values)

    @property
    def rigid(self) -> BodyModel:
        """The same body with rigid shoulders, as in the paper."""
        return replace(self, shoulder_rise=0.0)

    @property
    def constants(self) -> dict[str, float]:
        """Numbers of placement and camera pose by name, ordered as ``CONSTANTS``."""
        return {**asdict(self.placement), "camera_pitch_rad": self.camera_pose.pitch_rad}

    @property
    def sizes(self) -> FloatArray:
        """The person's sizes, shape (18,), metres, ordered as ``SIZE_NAMES``; read-only."""
        return self.person.sizes

    def size(self, name: str) -> float:
        """Return the person's size of that name in metres."""
        return self.person.size(name)

    def reference_state(self, name: str = "front", side_turn: str = "left") -> FloatArray:
        """Return the state (14,) of a reference posture at the measured place, rad and metres."""
        state = np.zeros(N_STATE)
        state[POSTURE] = reference_posture(name, side_turn)
        state[TORSO_Y] = self.placement.lateral_m
        return state

    def __str__(self) -> str:
        """Return a line per size, in centimetres, and a remark if they were not measured."""
        return f"{self.person}\n{self.doubt}" if self.doubt else str(self.person)

    @property
    def doubt(self) -> str:
        """Remark on sizes that were not measured; empty for measured ones."""
        if self.source == MEASURED:
            return ""
        text = "sizes from the proportions of people, not measured: less exact"
        return f"{text}; unknown: {', '.join(self.unknown)}" if self.unknown else text


def body_from_proportions(
    stature_m: float,
    distance_m: float | None = None,
    shoulder_breadth_m: float | None = None,
    hip_height_m: float | None = None,
    camera_pitch_rad: float = 0.0,
) -> BodyModel:
    """Return a body of the given stature; values that are not given are marked as unknown.

    The distance is level, the breadth between the shoulder joints, the height that of the middle of
    the hips above the camera's centre. Raises BodyModelError if one is out of range.
    """
    check_range("stature", stature_m, *STATURE_LIMITS_M, "m")
    sizes = sizes_of_stature(stature_m)
    given = {"distance_m": distance_m, "hip_height_m": hip_height_m}
    unknown = [name for name, value in given.items() if value is None]
    breadths = list(BREADTHS)
    if shoulder_breadth_m is not None:
        breadth, top = SIZE_INDEX["shoulder_breadth"], SIZE_INDEX["torso_top_width"]
        limits = SIZES[breadth].minimum_m, SIZES[breadth].maximum_m
        check_range("shoulder_breadth", shoulder_breadth_m, *limits, "m")
        sizes[top] *= shoulder_breadth_m / sizes[breadth]
        sizes[breadth] = shoulder_breadth_m
        breadths.remove("shoulder_breadth")
    return BodyModel.of(
        sizes.round(4),
        camera_pitch_rad=camera_pitch_rad,
        source=PROPORTIONS,
        unknown=(*unknown, *breadths),
        **{name: value for name, value in given.items() if value is not None},
    )
