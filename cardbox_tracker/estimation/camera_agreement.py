"""Whether the cameras agree about where they stand, asked of the person whom they see.

With wrong extrinsics no posture fits all silhouettes: the person's size, place and height in one
image contradict the other's. Now and then a frame is kept; from a window of them the pose of each
further camera is estimated anew (:mod:`cardbox_tracker.estimation.camera_pose`), turned only. Where
that turns it by more than a degree up, down or aside, the extrinsics are said to be wrong.

A turn about the camera's own axis makes the model lean, and the posture no worse. That is told by
planes through both cameras that touch the person
(:mod:`cardbox_tracker.estimation.silhouette_tangents`). ``docs/two-cameras.md`` has the rates.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.errors import CameraError
from cardbox_tracker.estimation.camera_pose import ROTATION, PoseProblem, Sighting, turned_by
from cardbox_tracker.estimation.cost.terms import Silhouette
from cardbox_tracker.estimation.cost.view import View
from cardbox_tracker.estimation.silhouette_tangents import TopTangents, roll_of
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.extrinsics import Extrinsics

DOUBTFUL_DEG, DOUBTFUL_ROLL_DEG = 0.85, 1.5
"""Cameras that are turned by more, aside or about their own axis, are told of."""

# Every so many frames one is kept, so many make a window: 12 s at 15 images a second. The first one
# is checked, then every fourth.
_EVERY, _WINDOW, _AGAIN = 12, 15, 60
# Frames of which a short recording is judged.
_LEAST = 8
_STEPS = 4
# Windows of whose results the median is said.
_REMEMBERED = 3
# For the turn about its own axis every so many frames are used, so many of them, and it counts if
# its standard deviation is less, degrees.
_TOPS_EVERY, _TOPS, _SURE_DEG = 6, 70, 0.5


class CameraAgreement:
    """Compares each further camera's extrinsics with what the person's outlines say.

    Feeding it is cheap; :meth:`check`, which costs about as much as tracking 100 frames for each
    further camera, is for whoever has the time: call it when :attr:`is_due`, in any thread.
    """

    def __init__(self, body: BodyModel, first: Camera, views: Sequence[View]) -> None:
        """Prepare for further cameras as ``views`` see ``body``, who stands before ``first``."""
        self._body, self._first, self._views = body, first, tuple(views)
        self._kept = [deque[Sighting](maxlen=_WINDOW) for _ in views]
        self._missing = [_WINDOW] * len(self._views)
        self._frames = 0
        self._found = [deque[float](maxlen=_REMEMBERED) for _ in views]
        self._tops = [TopTangents(first, view.camera, most=_TOPS) for view in views]
        self._rolls = [deque[float](maxlen=_REMEMBERED) for _ in views]

    def see(
        self, state: FloatArray, first: Silhouette, others: Sequence[Silhouette | None]
    ) -> None:
        """Take a frame whose posture is found.

        Args:
            state: of the first camera, (14,).
            first: what of its silhouette is the person, (H, W), 0 or 255.
            others: the same of the further cameras, turned upright; None of one without.
        """
        self._frames += 1
        if self._frames % _TOPS_EVERY or not np.any(first):
            return
        for number, other in enumerate(others):
            if other is None or not np.any(other):
                continue
            self._tops[number].add(first, other)
            if self._frames % _EVERY == 0:
                self._kept[number].append(Sighting(state.copy(), first.copy(), other.copy()))
                self._missing[number] -= 1

    @property
    def is_due(self) -> bool:
        """Whether a window of new frames is there for :meth:`check`."""
        return any(count <= 0 for count in self._missing)

    def check(self, is_last: bool = False) -> None:
        """Estimate how the cameras are turned that have a new window.

        Args:
            is_last: no more frames come, so that a camera without a window is judged by the frames
                that there are, if they are not too few.
        """
        for number, view in enumerate(self._views):
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
        """How far each further camera seems to be turned, up, down or aside, degrees.

        Against its extrinsics, and the median of its latest windows; None of one not yet checked.
        """
        return [float(np.median(found)) if found else None for found in self._found]

    @property
    def rolled_deg(self) -> list[float | None]:
        """How far each further camera seems to be turned about its own axis, degrees.

        As :attr:`turned_deg`, with its sign; None also where people have moved too little.
        """
        return [float(np.median(found)) if found else None for found in self._rolls]

    def remarks(self, names: Sequence[str]) -> list[str]:
        """Return a text for each further camera whose extrinsics are doubtful.

        Args:
            names: of the further cameras.
        """
        turned = [
            f"the extrinsics of {name} seem to be wrong by {_shown(degrees)} degrees: the person "
            "does not look from there as from the first camera. Was a camera moved? Calibrate them "
            "anew; a person's distance that was measured wrongly looks the same"
            for name, degrees in zip(names, self.turned_deg, strict=True)
            if degrees is not None and degrees > DOUBTFUL_DEG
        ]
        rolled = [
            f"{name} seems to be turned about its own axis by {_shown(abs(degrees))} degrees "
            "against its extrinsics: heads and hands do not reach as high there as the first "
            "camera shows them. Was a camera moved? Calibrate them anew"
            for name, degrees in zip(names, self.rolled_deg, strict=True)
            if degrees is not None and abs(degrees) > DOUBTFUL_ROLL_DEG
        ]
        return turned + rolled

    def _turn_of(self, view: View, sightings: Sequence[Sighting]) -> float:
        """Return by how much a camera is turned, up, down or aside, degrees; infinite if beyond."""
        upright = self._upright(view)
        try:
            problem = PoseProblem(self._body, self._first, view.camera, upright, sightings)
            found = upright
            for _ in range(_STEPS):
                found = problem.step(found, ROTATION).extrinsics
        except (CameraError, np.linalg.LinAlgError):
            return float("inf")
        return float(np.degrees(np.linalg.norm(turned_by(upright, found)[:2])))

    def _upright(self, view: View) -> Extrinsics:
        """Return where a camera stands, as if it were turned upright."""
        axes = view.level_axes() @ self._first.reference_to_optical_rotation().T
        return Extrinsics(axes, view.camera.reference_to_optical_rotation() @ view.offset_m)


def _shown(degrees: float) -> str:
    return f"about {degrees:.1f}" if np.isfinite(degrees) else "many"
