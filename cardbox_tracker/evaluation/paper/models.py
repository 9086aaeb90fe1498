"""The cardbox against the volumetric model (experiment 6): equal tools, different planes.

:class:`PlaneCost` draws any set of planes with OpenCV and counts the pixels of the XOR, so the two
models differ in nothing but the planes they are made of. Both take the same 18 sizes; the boxes
span the very sizes of the patches.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.cardbox import (
    LEFT_ARM_PATCHES,
    N_PATCHES,
    RIGHT_ARM_PATCHES,
    TORSO_PATCHES,
    cardbox_patches,
)
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import N_JOINTS, TORSO, clip_to_limits, reference_posture
from cardbox_tracker.body.volumetric import (
    LEFT_ARM_FACES,
    N_FACES,
    RIGHT_ARM_FACES,
    TRUNK_FACES,
    volumetric_faces,
)
from cardbox_tracker.estimation.cost.compiled import CompiledCost
from cardbox_tracker.estimation.cost.silhouette import (
    ARMS,
    CostArray,
    Silhouette,
    SilhouetteCost,
    check_silhouette,
    rows_above_hips,
)
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.rasterisation import NEAR_PLANE_M, clip_near, in_front

FloatArray = NDArray[np.float64]


class Planes(NamedTuple):
    """A model of the body: its planes, and which of them belong to trunk and arms."""

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


class PlaneCost:
    """Implements ``SilhouetteCost`` for any planes."""

    def __init__(self, planes: Planes, body: BodyModel, camera: Camera) -> None:
        """Prepare for one body before one camera."""
        self.body, self.camera = body, camera
        self.rows = rows_above_hips(body, camera)
        self.silhouette_px = 0
        self._planes = planes
        self._silhouette = np.zeros((self.rows, camera.width), np.uint8)
        self._model = np.zeros_like(self._silhouette)
        self._differing = np.zeros_like(self._silhouette)
        self._torso = np.zeros(4)
        self._fixed = np.zeros_like(self._silhouette)

    def observe(self, silhouette: Silhouette) -> None:
        """See :class:`SilhouetteCost`."""
        check_silhouette(silhouette, self.camera)
        self._silhouette = np.ascontiguousarray(silhouette[: self.rows])
        self.silhouette_px = cv2.countNonZero(self._silhouette)
        self.fix_arms(None)

    def fix_arms(self, posture: FloatArray | None) -> None:
        """See :class:`SilhouetteCost`."""
        self._fixed[:] = 0
        if posture is not None:
            corners = self._project(np.asarray(posture)[None])[0]
            for arm in self._planes.arms.values():
                _fill(self._fixed, corners[arm])

    def torso(self, torso_postures: FloatArray) -> CostArray:
        """See :class:`SilhouetteCost`."""
        postures = np.zeros((len(torso_postures), N_JOINTS))
        postures[:, TORSO] = torso_postures
        return self._costs(self._project(postures)[:, self._planes.trunk], self._fixed)

    def fix_torso(self, torso_posture: FloatArray) -> None:
        """See :class:`SilhouetteCost`."""
        self._torso = np.array(torso_posture, dtype=np.float64)

    def arm(self, side: str, arm_postures: FloatArray) -> CostArray:
        """See :class:`SilhouetteCost`; not safe in threads."""
        postures = np.zeros((len(arm_postures), N_JOINTS))
        postures[:, TORSO] = self._torso
        postures[:, ARMS[side]] = arm_postures
        corners = self._project(postures)
        trunk = np.zeros_like(self._fixed)
        _fill(trunk, corners[0, self._planes.trunk])
        return self._costs(corners[:, self._planes.arms[side]], trunk)

    def full(self, postures: FloatArray) -> CostArray:
        """See :class:`SilhouetteCost`."""
        return self._costs(self._project(np.asarray(postures)), np.zeros_like(self._fixed))

    def overlap(self, posture: FloatArray) -> tuple[int, float]:
        """See :class:`SilhouetteCost`."""
        cost = int(self.full(np.asarray(posture)[None])[0])
        area = cv2.countNonZero(self._model)
        union = (self.silhouette_px + area + cost) // 2
        return cost, (union - cost) / union if union else 0.0

    def _project(self, postures: FloatArray) -> NDArray[np.int32]:
        """Outlines (N, planes, n, 2) in pixels with ``_SHIFT`` fractional bits.

        n is 4 unless the near plane cuts any of them.
        """
        optical = self.camera.reference_to_optical(self._planes.corners_m(self.body, postures))
        if not in_front(optical).all():
            optical = _cut(optical)
        pixels = np.clip(self.camera.project(optical), -30_000, 30_000)
        return np.asarray(np.round(pixels * (1 << _SHIFT)), dtype=np.int32)

    def _costs(self, corners: NDArray[np.int32], beside: NDArray[np.uint8]) -> CostArray:
        costs = np.empty(len(corners), np.int64)
        for i, polygons in enumerate(corners):
            np.copyto(self._model, beside)
            _fill(self._model, polygons)
            cv2.bitwise_xor(self._model, self._silhouette, dst=self._differing)
            costs[i] = cv2.countNonZero(self._differing)
        return costs


def _cut(corners_m: FloatArray) -> FloatArray:
    """Cut planes (N, planes, 4, 3) at the near plane: (N, planes, 6, 3), the last corner repeated.

    Of what is behind it all corners lie far aside, outside of any image.
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


def make_cost(name: str, body: BodyModel, camera: Camera) -> SilhouetteCost:
    """Return a cost: ``compiled`` is the tracker's own, the others are a :class:`PlaneCost`."""
    if name == "compiled":
        return CompiledCost(body, camera)
    return PlaneCost(MODELS[name], body, camera)


def microseconds_a_particle(
    body: BodyModel, camera: Camera, silhouette: Silhouette, particles: int, rounds: int
) -> dict[str, float]:
    """Measure how long the full cost of one posture takes with each model, microseconds.

    The models take turns, so that a busy machine is unfair to none of them; the median counts.
    """
    rng = np.random.default_rng(0)
    front = reference_posture("front")
    postures = clip_to_limits(front + rng.normal(0.0, 0.25, (particles, N_JOINTS)))
    costs = {name: make_cost(name, body, camera) for name in ("compiled", *MODELS)}
    seconds: dict[str, list[float]] = {name: [] for name in costs}
    for cost in costs.values():
        cost.observe(silhouette)
        cost.full(postures)
    for _ in range(rounds):
        for name, cost in costs.items():
            start = time.perf_counter()
            cost.full(postures)
            seconds[name].append(time.perf_counter() - start)
    return {name: 1e6 * float(np.median(s)) / particles for name, s in seconds.items()}
