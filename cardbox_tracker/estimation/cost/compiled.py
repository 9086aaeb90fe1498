"""The cost of equation (2), compiled: equal results, a fraction of the time.

What it equals is in :mod:`cardbox_tracker.estimation.cost.silhouette`; see
:mod:`cardbox_tracker.estimation.cost.kernels` for how it works.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost import kernels
from cardbox_tracker.estimation.cost.kernel_arguments import (
    place_of,
    shape_of,
    view_of,
)
from cardbox_tracker.estimation.cost.row_sums import fill_row_sums
from cardbox_tracker.estimation.cost.silhouette import (
    CostArray,
    Silhouette,
    check_silhouette,
    rows_above_hips,
)
from cardbox_tracker.vision.camera import Camera

_NO_WORDS = np.zeros((1, 0), np.uint64)
_SIDE_SIGN = {"left": 1.0, "right": -1.0}


class CompiledCost:
    """Implements ``SilhouetteCost`` with compiled kernels."""

    def __init__(self, body: BodyModel, camera: Camera) -> None:
        """Prepare for one body before one camera, and compile the kernels if they are not yet."""
        self.body, self.camera = body, camera
        self.rows = rows_above_hips(body, camera)
        self.silhouette_px = 0
        self._parts, self._shoulder = shape_of(body.sizes)
        self._place = place_of(body)
        self._view = view_of(camera)
        # Sums along a row fit 16 bits for any image narrower than 32768 px, and stay in cache.
        sums = np.int16 if camera.width < 2**15 else np.int32
        self._table = np.zeros((self.rows, camera.width + 1), sums)
        self._covered = np.zeros_like(self._table)
        self._torso_table = self._table
        self._torso_base = 0
        self._beside_arms = np.zeros_like(self._table)
        self._torso = np.zeros(4)
        self._base = 0
        self.warm_up()

    def warm_up(self) -> None:
        """Run every kernel once, so that no live image waits for the compiler."""
        empty = np.zeros((self.camera.height, self.camera.width), np.uint8)
        self.observe(empty)
        # Pixels out of a message are read-only, which is another type to the compiler.
        empty.setflags(write=False)
        self.observe(empty)
        self.fix_arms(np.zeros(12))
        self.torso(np.zeros((1, 4)))
        self.fix_arms(None)
        self.fix_torso(np.zeros(4))
        self.arm("left", np.zeros((1, 4)))
        self.full(np.zeros((1, 12)))
        self.bodies(self.body.sizes[None], np.zeros((1, 12)))

    def observe(self, silhouette: Silhouette) -> None:
        """See :class:`SilhouetteCost`."""
        check_silhouette(silhouette, self.camera)
        seen = np.ascontiguousarray(silhouette[: self.rows])
        words = seen.view(np.uint64) if seen.shape[1] % 8 == 0 else _NO_WORDS
        self.silhouette_px = int(fill_row_sums(seen, words, self._table))
        self.fix_arms(None)

    def torso(self, torso_postures: FloatArray) -> CostArray:
        """See :class:`SilhouetteCost`."""
        postures = np.ascontiguousarray(torso_postures, dtype=np.float64)
        costs = np.empty(len(postures), np.int64)
        kernels.trunk_costs(
            postures,
            self._parts,
            self._place,
            self._view,
            self._torso_table,
            self._torso_base,
            costs,
        )
        return costs

    def fix_arms(self, posture: FloatArray | None) -> None:
        """See :class:`SilhouetteCost`."""
        self._torso_table, self._torso_base = self._table, self.silhouette_px
        if posture is not None:
            self._torso_table = self._beside_arms
            self._torso_base += int(
                kernels.cover_arms(
                    np.array(posture, dtype=np.float64),
                    self._parts,
                    self._shoulder,
                    self._place,
                    self._view,
                    self._table,
                    self._beside_arms,
                )
            )

    def fix_torso(self, torso_posture: FloatArray) -> None:
        """See :class:`SilhouetteCost`."""
        self._torso = np.array(torso_posture, dtype=np.float64)
        self._base = self.silhouette_px + int(
            kernels.cover_trunk(
                self._torso,
                self._parts,
                self._place,
                self._view,
                self._table,
                self._covered,
            )
        )

    def arm(self, side: str, arm_postures: FloatArray) -> CostArray:
        """See :class:`SilhouetteCost`."""
        postures = np.ascontiguousarray(arm_postures, dtype=np.float64)
        costs = np.empty(len(postures), np.int64)
        kernels.arm_costs(
            postures,
            _SIDE_SIGN[side],
            self._torso,
            self._parts,
            self._shoulder,
            self._place,
            self._view,
            self._covered,
            self._base,
            costs,
        )
        return costs

    def full(self, postures: FloatArray) -> CostArray:
        """See :class:`SilhouetteCost`."""
        return self._full(postures)[0]

    def overlap(self, posture: FloatArray) -> tuple[int, float]:
        """See :class:`SilhouetteCost`."""
        costs, areas = self._full(np.asarray(posture)[None])
        cost, area = int(costs[0]), int(areas[0])
        common = (self.silhouette_px + area - cost) // 2
        union = self.silhouette_px + area - common
        return cost, common / union if union else 0.0

    def bodies(self, sizes: FloatArray, postures: FloatArray) -> CostArray:
        """Costs (N,) of bodies with ``sizes`` (N, 18) in ``postures`` (N, 12), in one place."""
        costs = np.empty(len(sizes), np.int64)
        kernels.body_costs(
            np.ascontiguousarray(postures, dtype=np.float64),
            *shape_of(np.asarray(sizes, dtype=np.float64)),
            self._place,
            self._view,
            self._table,
            self.silhouette_px,
            costs,
        )
        return costs

    def polygons(self, corners_m: FloatArray) -> CostArray:
        """Costs (N,) of any planar quadrilaterals (N, K, 4, 3), metres in the optical frame."""
        costs = np.empty(len(corners_m), np.int64)
        kernels.polygon_costs(
            np.ascontiguousarray(corners_m, dtype=np.float64),
            self._view,
            self._table,
            self.silhouette_px,
            costs,
        )
        return costs

    def _full(self, postures: FloatArray) -> tuple[CostArray, CostArray]:
        contiguous = np.ascontiguousarray(postures, dtype=np.float64)
        costs = np.empty(len(contiguous), np.int64)
        areas = np.empty(len(contiguous), np.int64)
        kernels.full_costs(
            contiguous,
            self._parts,
            self._shoulder,
            self._place,
            self._view,
            self._table,
            self.silhouette_px,
            costs,
            areas,
        )
        return costs, areas


class CompiledKeypoints:
    """Keypoints as :func:`cardbox_tracker.body.kinematics.keypoints_m` has them, but optical."""

    def __init__(self, body: BodyModel, camera: Camera) -> None:
        """Prepare for one body before one camera, and compile the kernel if it is not yet."""
        self._constants = (*shape_of(body.sizes), place_of(body), view_of(camera))
        self(np.zeros(12))

    def __call__(self, posture: FloatArray) -> FloatArray:
        """Return the keypoints (6, 3) of a posture (12,), metres in the optical frame."""
        points = np.empty((6, 3))
        kernels.keypoints(np.array(posture, dtype=np.float64), *self._constants, points)
        return points
