"""Detection of wrong extrinsics from the tracked person.

With wrong extrinsics no posture fits all silhouettes: size, place and height of the person in one
image contradict those in the other. A window of sampled frames gives a new estimate of the rotation
of each further camera (:mod:`cardbox_tracker.measuring.camera_pose`). A difference of about a
degree in pitch or yaw from the extrinsics is reported.

A roll of the camera hardly changes the fit, because the model leans with it. It is estimated from
the planes through both cameras that touch the person
(:mod:`cardbox_tracker.measuring.silhouette_tangents`), which show an inverted pose and exchanged
images within seconds.
``docs/research.md#several-cameras`` has detection rates.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.view import View
from cardbox_tracker.common.errors import CameraError
from cardbox_tracker.measuring.camera_pose import ROTATION, PoseProblem, Sighting, turned_by
from cardbox_tracker.measuring.silhouette_tangents import (
    PoseDirection,
    PoseFault,
    TopTangents,
    roll_of,
)
from cardbox_tracker.person.model import MEASURED, BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.term import Frame

DOUBTFUL_DEG, DOUBTFUL_ROLL_DEG = 0.85, 1.5
"""Pitch or yaw, and roll, beyond which extrinsics are reported as wrong."""
DOUBTFUL_UNMEASURED_DEG, DOUBTFUL_HEIGHT_DEG = 6.0, 1.0
"""Pitch or yaw, and heights of head and hands, for a person who was not measured: wrong sizes turn
the estimate by up to 3.7 degrees, but not the heights."""

# Frames between samples, samples in a window (12 s at 15 Hz), and samples between two checks.
_EVERY, _WINDOW, _AGAIN = 12, 15, 60
# Least number of samples at the end of a recording.
_LEAST = 8
_STEPS = 4
# Windows over which the median is taken.
_REMEMBERED = 3
# Roll: frames between samples, samples, and the largest accepted standard deviation in degrees.
_TOPS_EVERY, _TOPS, _SURE_DEG = 6, 70, 0.5


class CameraAgreement:
    """Compares extrinsics with silhouettes; :meth:`check` takes as long as about 100 frames.

    Frames in which others hide pixels of the person show no outline, so they do not count.
    """

    def __init__(
        self,
        body: BodyModel,
        first: Camera,
        views: Sequence[View],
        earlier: CameraAgreement | None = None,
    ) -> None:
        """Begin to compare ``views`` of further cameras with ``first``, which includes its pitch.

        ``body`` was measured by the first camera. ``earlier`` is a comparison of the same cameras
        with another body; tops need no body, so their samples remain.
        """
        self._body, self._first, self.views = body, first, tuple(views)
        self._kept = [deque[Sighting](maxlen=_WINDOW) for _ in views]
        self._missing = [_WINDOW] * len(self.views)
        self._frames = 0
        self._found = [deque[float](maxlen=_REMEMBERED) for _ in views]
        self._tops = [TopTangents(first, view.camera, most=_TOPS) for view in views]
        self._rolls = [deque[float](maxlen=_REMEMBERED) for _ in views]
        self._directions: list[PoseDirection] = (
            [PoseDirection(first, v.camera, self._upright(v), v.roll_rad) for v in self.views]
            if earlier is None
            else earlier._directions
        )

    def look(self, frames: Sequence[Frame]) -> bool:
        """Compare upright frames, whether or not a posture fits; return whether they count."""
        first, *others = frames
        if not _are_whole(frames):
            return False
        for direction, other in zip(self._directions, others, strict=True):
            direction.see(first.silhouette, other.silhouette)
        return True

    @property
    def are_contradicted(self) -> list[bool]:
        """Whether the silhouettes show a gross error of the pose of each further camera."""
        return [direction.fault is not None for direction in self._directions]

    def see(self, state: FloatArray, frames: Sequence[Frame]) -> None:
        """Add tracked frames, as for :meth:`look`: state (14,) for the first camera."""
        if not _are_whole(frames):
            return
        first, *others = (frame.silhouette for frame in frames)
        self._frames += 1
        if self._frames % _TOPS_EVERY or not np.any(first):
            return
        for number, other in enumerate(others):
            if not np.any(other):
                continue
            self._tops[number].add(first, other)
            if self._frames % _EVERY == 0:
                self._kept[number].append(Sighting(state.copy(), first.copy(), other.copy()))
                self._missing[number] -= 1

    @property
    def is_due(self) -> bool:
        """Whether a further camera has a full window for :meth:`check`."""
        return any(count <= 0 for count in self._missing)

    def check(self, is_last: bool = False) -> None:
        """Estimate rotations of cameras with a full window, of others too if no frames follow."""
        for number, view in enumerate(self.views):
            is_enough = is_last and not self._found[number] and len(self._kept[number]) >= _LEAST
            if self._missing[number] > 0 and not is_enough:
                continue
            self._missing[number] = _AGAIN
            self._found[number].append(self._turn_of(view, list(self._kept[number])))
            roll_rad, stddev_rad = roll_of(self._tops[number].copy(), self._upright(view))
            if np.degrees(stddev_rad) < _SURE_DEG:
                self._rolls[number].append(float(np.degrees(roll_rad)))

    @property
    def turned_deg(self) -> list[float | None]:
        """Pitch and yaw of each further camera against its extrinsics, as one angle, degrees.

        The median of the latest windows; None before the first check.
        """
        return [float(np.median(found)) if found else None for found in self._found]

    @property
    def rolled_deg(self) -> list[float | None]:
        """Median roll against the extrinsics, signed degrees; None before it, or without motion."""
        return [float(np.median(found)) if found else None for found in self._rolls]

    def remarks(self, names: Sequence[str]) -> list[str]:
        """Return a warning for each further camera, by ``names``, with doubtful extrinsics."""
        told = []
        measured = zip(names, self._directions, self.turned_deg, self.rolled_deg, strict=True)
        for name, direction, turned, rolled in measured:
            if direction.fault is not None:
                told.append(_gross(name, direction))
                continue
            is_measured = self._body.source == MEASURED
            if turned is not None and turned > (
                DOUBTFUL_DEG if is_measured else DOUBTFUL_UNMEASURED_DEG
            ):
                told.append(
                    f"the extrinsics of {name} seem to be wrong by {_shown(turned)} degrees: the "
                    "silhouettes of the cameras contradict each other. Was a camera moved? "
                    "Calibrate them again. A wrong distance of the person has the same effect"
                )
            elif not is_measured and direction.height_rad > np.radians(DOUBTFUL_HEIGHT_DEG):
                told.append(
                    f"the extrinsics of {name} seem to be wrong: head and hands differ by "
                    f"{np.degrees(direction.height_rad):.1f} degrees in height between the "
                    "cameras. Was a camera moved? Calibrate them again"
                )
            if rolled is not None and abs(rolled) > DOUBTFUL_ROLL_DEG:
                told.append(
                    f"{name} seems to be turned about its own axis by {_shown(abs(rolled))} "
                    "degrees against its extrinsics: head and hands have other heights than in "
                    "the first camera. Was a camera moved? Calibrate them again"
                )
        return told

    def _turn_of(self, view: View, sightings: Sequence[Sighting]) -> float:
        """Return pitch and yaw of a camera as one angle, degrees; inf if no pose fits."""
        upright = self._upright(view)
        try:
            problem = PoseProblem(self._body, self._first, view.camera, upright, sightings)
            found = upright
            for _ in range(_STEPS):
                found, _ = problem.step(found, ROTATION)
        except (CameraError, np.linalg.LinAlgError):
            return float("inf")
        return float(np.degrees(np.linalg.norm(turned_by(upright, found)[:2])))

    def _upright(self, view: View) -> Extrinsics:
        """Return the pose of a camera without its roll."""
        axes = view.level_axes() @ self._first.reference_to_optical_rotation().T
        return Extrinsics(axes, view.camera.reference_to_optical_rotation() @ view.offset_m)


def _are_whole(frames: Sequence[Frame]) -> bool:
    # What others hide is missing in the outline, and networks mix people.
    return all(frame["covered"] is None for frame in frames)


def _gross(name: str, direction: PoseDirection) -> str:
    """Return the warning about a gross error of a camera's pose."""
    degrees = f"{np.degrees(direction.height_rad):.1f} degrees"
    if direction.fault is PoseFault.INVERTED:
        return (
            f"the extrinsics of {name} seem to be inverted, or the images of the two cameras "
            f"exchanged: head and hands differ by {degrees} in height, and the inverse pose fits "
            "the silhouettes. The pose must transform points from the first camera's frame into "
            f"that of {name}; check its direction and the topics' order"
        )
    return (
        f"the extrinsics of {name} contradict the silhouettes: head and hands differ by {degrees} "
        "in height. Were the images of two cameras exchanged, or was a camera moved? Check the "
        "topics' order, or calibrate the cameras again"
    )


def _shown(degrees: float) -> str:
    return f"about {degrees:.1f}" if np.isfinite(degrees) else "many"


class AgreementWatch:
    """Checks the extrinsics in a separate thread, one window of images after the other."""

    def __init__(self, cameras: Sequence[str]) -> None:
        """Prepare for the names of all ``cameras``, of which the first one is the reference."""
        self._names = list(cameras)[1:]
        self._thread: threading.Thread | None = None
        self._agreement: CameraAgreement | None = None

    def see(self, agreement: CameraAgreement | None) -> None:
        """Start a check if one is due and none is running."""
        self._agreement = agreement
        if agreement is None or not agreement.is_due:
            return
        if self._thread is None or not self._thread.is_alive():
            # No daemon thread: one that runs compiled code while Python ends aborts the process.
            # interrupts.py limits the wait at the end.
            self._thread = threading.Thread(target=agreement.check, name="agreement", daemon=False)
            self._thread.start()

    def wait(self) -> None:
        """Wait for a check that is running."""
        if self._thread is not None:
            self._thread.join()

    def values(self) -> dict[str, str]:
        """Return the estimated rotation error of each further camera, for the diagnostics."""
        if self._agreement is None:
            return {}
        errors = {"turned": self._agreement.turned_deg, "rolled": self._agreement.rolled_deg}
        return {
            f"{name} {how} (deg)": "not yet known" if degrees is None else f"{degrees:.1f}"
            for how, found in errors.items()
            for name, degrees in zip(self._names, found, strict=True)
        }
