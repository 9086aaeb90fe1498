"""Compare the cardbox with the volumetric model (experiment 6); the same code draws both.

:class:`PlaneSilhouette` draws any set of planes with OpenCV and counts the pixels of the XOR, so
the two models differ only in their planes. Both take the same 18 sizes; the boxes are as large as
the patches.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import NEAR_PLANE_M, clip_near, in_front
from cardbox_tracker.person.cardbox import (
    LEFT_ARM_PATCHES,
    N_PATCHES,
    RIGHT_ARM_PATCHES,
    TORSO_PATCHES,
    cardbox_patches,
)
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_JOINTS, TORSO, clip_to_limits, reference_posture
from cardbox_tracker.terms.compiled import CompiledSilhouette
from cardbox_tracker.terms.silhouette import SilhouetteObservation, SilhouetteTerm
from cardbox_tracker.terms.term import ARMS, ArmCosts, Frame, Silhouette, TorsoCosts
from lab.experiments.volumetric import (
    LEFT_ARM_FACES,
    N_FACES,
    RIGHT_ARM_FACES,
    TRUNK_FACES,
    volumetric_faces,
)

FloatArray = NDArray[np.float64]


class Planes(NamedTuple):
    """The planes of a body model, and the slices of trunk and arms."""

    corners_m: Callable[[BodyModel, FloatArray], FloatArray]
    n_planes: int
    trunk: slice
    arms: dict[str, slice]


MODELS: dict[str, Planes] = {
    "cardbox": Planes(
        cardbox_patches,
        N_PATCHES,
        TORSO_PATCHES,
        {"left": LEFT_ARM_PATCHES, "right": RIGHT_ARM_PATCHES},
    ),
    "volumetric": Planes(
        volumetric_faces,
        N_FACES,
        TRUNK_FACES,
        {"left": LEFT_ARM_FACES, "right": RIGHT_ARM_FACES},
    ),
}

_SHIFT = 8


class PlaneSilhouette(SilhouetteTerm):
    """The silhouette's term for any planes."""

    def __init__(self, planes: Planes, body: BodyModel, camera: Camera) -> None:
        """Prepare for one body before one camera."""
        super().__init__(body, camera)
        self._planes = planes

    def observe(self, frame: Frame) -> PlaneObservation:
        """See :class:`SilhouetteTerm`."""
        return PlaneObservation(frame, self._planes, self.body, self.camera)


@dataclass(frozen=True)
class PlaneObservation(SilhouetteObservation):
    """One silhouette, compared with drawn planes."""

    frame: Frame
    planes: Planes
    body: BodyModel
    camera: Camera

    def torsos_beside(self, arms: FloatArray | None) -> TorsoCosts:
        """See :class:`SilhouetteObservation`."""
        fixed = self._empty()
        if arms is not None:
            corners = self._project(np.asarray(arms)[None])[0]
            for arm in self.planes.arms.values():
                _fill(fixed, corners[arm])

        def costs(torsos: FloatArray) -> FloatArray:
            postures = np.zeros((len(torsos), N_JOINTS))
            postures[:, TORSO] = torsos
            return self._costs(self._project(postures)[:, self.planes.trunk], fixed)

        return costs

    def arms_beside(self, torso: FloatArray) -> ArmCosts:
        """See :class:`SilhouetteObservation`."""

        def costs(side: str, arms: FloatArray) -> FloatArray:
            postures = np.zeros((len(arms), N_JOINTS))
            postures[:, TORSO] = torso
            postures[:, ARMS[side]] = arms
            corners = self._project(postures)
            trunk = self._empty()
            _fill(trunk, corners[0, self.planes.trunk])
            return self._costs(corners[:, self.planes.arms[side]], trunk)

        return costs

    def postures(self, postures: FloatArray) -> FloatArray:
        """See :class:`SilhouetteObservation`."""
        return self._costs(self._project(np.asarray(postures)), self._empty())

    def overlap(self, posture: FloatArray) -> tuple[int, float]:
        """See :class:`SilhouetteObservation`."""
        corners = self._project(np.asarray(posture)[None])
        cost = int(self._costs(corners, self._empty())[0])
        model = self._empty()
        _fill(model, corners[0])
        union = (self.frame.foreground_px + cv2.countNonZero(model) + cost) // 2
        return cost, (union - cost) / union if union else 0.0

    def _empty(self) -> NDArray[np.uint8]:
        return np.zeros((self.frame.rows, self.camera.width), np.uint8)

    def _project(self, postures: FloatArray) -> NDArray[np.int32]:
        """Return outlines (N, planes, n, 2) in pixels with ``_SHIFT`` fractional bits.

        n is 4, or 6 if the near plane cuts any of them.
        """
        optical = self.camera.reference_to_optical(self.planes.corners_m(self.body, postures))
        if not in_front(optical).all():
            optical = _cut(optical)
        pixels = np.clip(self.camera.project(optical), -30_000, 30_000)
        return np.asarray(np.round(pixels * (1 << _SHIFT)), dtype=np.int32)

    def _costs(self, corners: NDArray[np.int32], beside: NDArray[np.uint8]) -> FloatArray:
        seen = np.ascontiguousarray(self.frame.silhouette[: self.frame.rows])
        model, differing = self._empty(), self._empty()
        costs = np.empty(len(corners))
        for i, polygons in enumerate(corners):
            np.copyto(model, beside)
            _fill(model, polygons)
            cv2.bitwise_xor(model, seen, dst=differing)
            costs[i] = cv2.countNonZero(differing)
        return costs


def _cut(corners_m: FloatArray) -> FloatArray:
    """Clip planes (N, planes, 4, 3) at the near plane; return (N, planes, 6, 3).

    The last corner is repeated; a plane behind the near plane gets corners outside of any image.
    """
    cut = np.empty((*corners_m.shape[:-2], 6, 3))
    for index in np.ndindex(corners_m.shape[:-2]):
        polygon = clip_near(corners_m[index])
        if len(polygon) < 3:
            cut[index] = (1e3, 1e3, NEAR_PLANE_M)
        else:
            cut[index][: len(polygon)] = polygon
            cut[index][len(polygon) :] = polygon[-1]
    return cut


def _fill(mask: NDArray[np.uint8], polygons: NDArray[np.int32]) -> None:
    for polygon in polygons:
        cv2.fillConvexPoly(mask, polygon, 255, cv2.LINE_8, _SHIFT)


def make_silhouette_term(name: str, body: BodyModel, camera: Camera) -> SilhouetteTerm:
    """Return the tracker's own term, ``compiled``, or one that draws the planes of a model."""
    if name == "compiled":
        return CompiledSilhouette(body, camera)
    return PlaneSilhouette(MODELS[name], body, camera)


def microseconds_a_particle(
    body: BodyModel, camera: Camera, silhouette: Silhouette, particles: int, rounds: int
) -> dict[str, float]:
    """Measure the time of the full cost of one posture with each model, microseconds.

    The models take turns, so that other load on the machine affects both; medians are compared.
    """
    rng = np.random.default_rng(0)
    front = reference_posture("front")
    postures = clip_to_limits(front + rng.normal(0.0, 0.25, (particles, N_JOINTS)))
    seen = {
        name: make_silhouette_term(name, body, camera).look(silhouette)
        for name in ("compiled", *MODELS)
    }
    seconds: dict[str, list[float]] = {name: [] for name in seen}
    for observation in seen.values():
        observation.postures(postures)
    for _ in range(rounds):
        for name, observation in seen.items():
            start = time.perf_counter()
            observation.postures(postures)
            seconds[name].append(time.perf_counter() - start)
    return {name: 1e6 * float(np.median(s)) / particles for name, s in seconds.items()}
