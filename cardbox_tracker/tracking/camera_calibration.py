"""Calibration of a further camera's pose by a person in reference postures who then moves.

:mod:`.camera_guess` gives the initial pose from the reference postures. Then, twice, both cameras
track the person, and :mod:`.camera_pose` refines the pose and the postures together. The person's
sizes and distance come from the first camera, so an error of that distance scales all lengths.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.view import OtherCamera
from cardbox_tracker.common.errors import CameraError, InitializationError
from cardbox_tracker.measuring.camera_guess import guessed_extrinsics, reference_states
from cardbox_tracker.measuring.camera_pose import PoseProblem, Sighting
from cardbox_tracker.measuring.silhouette_tangents import TopTangents
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.terms.term import Image, Silhouette
from cardbox_tracker.tracking.camera_agreement import LEAST_SIGHTINGS
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.tracker import Tracker

_PASSES, _SIGHTINGS = 2, 30
# Weight of a reference posture in frames, and its standard deviations. The small ones use that
# the person faces the first camera, which an outline shows less precisely.
_STILL = 5
_REFERENCE_STDDEV = np.array([0.1, 0.05, 0.08, 0.05, *[0.3] * 8, 0.1, 0.05])

Pair = tuple[Silhouette, Silhouette]


class MovingFrame(NamedTuple):
    """The silhouettes and images of both cameras at one time."""

    silhouettes: Pair  #: (H, W), 0 or 255, of the first and of the further camera
    #: (H, W) or (H, W, 3) of the first and of the further camera; None if missing.
    images: tuple[Image | None, Image | None]


class CalibratedCamera(NamedTuple):
    """The pose of a further camera and its uncertainty."""

    #: transform from the first camera's optical frame to the further camera's.
    extrinsics: Extrinsics
    halves_deg: float  #: angle between the poses estimated from each half of the frames, degrees
    halves_m: float  #: distance between the camera centres of these poses, metres
    iou: float  #: mean intersection over union of model and silhouettes while both cameras track
    frames: int  #: number of frames that were used

    def __str__(self) -> str:
        """Return the pose and its uncertainty as text."""
        return (
            f"{self.extrinsics}; the two halves of {self.frames} frames differ by "
            f"{self.halves_deg:.1f} degrees ({1000 * np.radians(self.halves_deg):.0f} mrad) and "
            f"{100 * self.halves_m:.1f} cm; mean IoU of both cameras {self.iou:.3f}"
        )


def calibrated_camera(
    body: BodyModel,
    cameras: tuple[Camera, Camera],
    references: Mapping[str, Pair],
    moving: Sequence[MovingFrame],
    side_turn: str = "left",
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> CalibratedCamera:
    """Return the pose of a further camera; the two ``cameras`` lack their pitch.

    ``body`` was measured by the first camera; ``references`` are silhouettes of both by the names
    of the postures; in the frames ``moving`` the person moves, from the front posture on. Raises
    InitializationError if the silhouettes do not show the same person, or too few frames show them
    in both cameras.
    """
    first, other = cameras
    states = reference_states(body, side_turn)
    still = [Sighting(states[name], *pair, _REFERENCE_STDDEV) for name, pair in references.items()]
    pose = guessed_extrinsics(body, first, other, references, side_turn)
    pairs = [*references.values(), *(frame.silhouettes for frame in moving)]
    level = first.with_pitch(body.camera_pose.pitch_rad)
    tangents = TopTangents(level, other, pairs)
    iou = float("nan")
    try:
        for number in range(_PASSES):
            tracked, iou = _tracked(body, first, OtherCamera(other, pose), moving, seed)
            if progress is not None:
                progress((number + 0.8) / _PASSES)
            if len(tracked) < LEAST_SIGHTINGS:
                raise InitializationError(
                    f"both cameras track the person in {len(tracked)} of {len(moving)} frames; "
                    f"expected {LEAST_SIGHTINGS} or more: let the person move for ten seconds or "
                    "longer after the reference postures, visible to both cameras"
                )
            sightings = [*still * _STILL, *tracked]
            pose = _improved(body, first, other, pose, sightings, tangents)
        halves = [
            _improved(
                *(body, first, other, pose, sightings[start::2]),
                TopTangents(level, other, pairs[start::2]),
            )
            for start in (0, 1)
        ]
    except (CameraError, np.linalg.LinAlgError) as error:
        raise InitializationError(
            f"the further camera's pose cannot be estimated from these frames: {error}; expected "
            "one person whom both cameras see from the hips to the head"
        ) from None
    angle_rad, away_m = halves[0].difference(halves[1])
    if progress is not None:
        progress(1.0)
    return CalibratedCamera(pose, float(np.degrees(angle_rad)), away_m, iou, len(sightings))


def _tracked(
    body: BodyModel, first: Camera, other: OtherCamera, moving: Sequence[MovingFrame], seed: int
) -> tuple[list[Sighting], float]:
    """Track with both cameras; return evenly spaced frames with states, and the mean IoU."""
    tracker = Tracker(body, first, default_preset(), np.random.default_rng(seed), others=[other])
    found, ious = [], []
    for silhouettes, images in moving:
        estimate = tracker.track(list(map(Observation, silhouettes, images)))
        if estimate.posture is None or estimate.offset_m is None or estimate.iou is None:
            continue
        found.append(Sighting(estimate.placed_posture, *silhouettes))
        ious.append(estimate.iou)
    every = max(1, len(found) // _SIGHTINGS)
    return found[every - 1 :: every], float(np.mean(ious)) if ious else float("nan")


def _improved(
    body: BodyModel,
    first: Camera,
    other: Camera,
    pose: Extrinsics,
    sightings: Sequence[Sighting],
    tangents: TopTangents,
) -> Extrinsics:
    return PoseProblem(body, first, other, pose, sightings, tangents).solve()[0]
