"""Compiled silhouette term (:mod:`.cardbox_kernels`), equal to ``lab/experiments/reference.py``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.array_checks import ANY, check_array
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import shape_of
from cardbox_tracker.person.posture import LEFT_ARM, N_JOINTS, TORSO
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.segmentation.regions import NO_WORDS
from cardbox_tracker.terms import cardbox_kernels as kernels
from cardbox_tracker.terms.bit_planes import Planes, fill_planes, new_planes
from cardbox_tracker.terms.kernel_arguments import CardboxTuple, intrinsics_of, place_of
from cardbox_tracker.terms.silhouette import SilhouetteObservation, SilhouetteTerm
from cardbox_tracker.terms.term import ArmCosts, Frame, Silhouette, TorsoCosts

CountArray = NDArray[np.int64]

_SIDE_SIGN = {"left": 1.0, "right": -1.0}


class CompiledSilhouette(SilhouetteTerm):
    """The silhouette's term with compiled kernels."""

    def __init__(self, body: BodyModel, camera: Camera) -> None:
        """Prepare for one body and one camera."""
        super().__init__(body, camera)
        self._cardbox = (*shape_of(body.sizes), place_of(body), intrinsics_of(camera))

    def warm_up(self) -> None:
        """Run every kernel once, so that no live image waits for the compiler."""
        empty = np.zeros((self.camera.height, self.camera.width), np.uint8)
        self.look(empty)
        # The pixels of a message are read-only, which is another type for the compiler.
        empty.setflags(write=False)
        observation = self.look(empty)
        posture = np.zeros((1, N_JOINTS))
        observation.torsos_beside(posture[0])(posture[:, TORSO])
        observation.arms_beside(posture[0, TORSO])("left", posture[:, LEFT_ARM])
        observation.postures(posture)
        observation.bodies(self.body.sizes[None], posture)

    def observe(self, frame: Frame) -> CompiledObservation:
        """See :class:`SilhouetteTerm`."""
        size = self.camera.height, self.camera.width
        check_array("silhouette", frame.silhouette, size)
        upper = np.ascontiguousarray(frame.silhouette[: self.rows])
        words = upper.view(np.uint64) if upper.shape[1] % 8 == 0 else NO_WORDS
        planes = new_planes(self.camera.width, self.rows)
        fill_planes(upper, words, planes)
        return CompiledObservation(frame, planes, (self.rows, self.camera.width), self._cardbox)

    def look(self, silhouette: Silhouette) -> CompiledObservation:
        """See :class:`SilhouetteTerm`."""
        return self.observe(self.frame(silhouette))


@dataclass(frozen=True, eq=False)
class CompiledObservation(SilhouetteObservation):
    """One silhouette as bits."""

    frame: Frame  #: the frame
    planes: Planes  #: pixels that count, and foreground, (2, words, rows)
    size: tuple[int, int]  #: number of rows that count, and width, px
    cardbox: CardboxTuple  #: fields of :class:`~cardbox_tracker.terms.kernel_arguments.Cardbox`

    def torsos_beside(self, arms: FloatArray | None) -> TorsoCosts:
        """See :class:`SilhouetteObservation`."""
        planes, base = self.planes, self.frame.foreground_px
        if arms is not None:
            planes = np.empty_like(self.planes)
            posture = np.array(arms, dtype=np.float64)
            base += kernels.cover_arms(posture, self.cardbox, self.size, self.planes, planes)

        def costs(torsos: FloatArray) -> FloatArray:
            particles = np.ascontiguousarray(torsos, dtype=np.float64)
            counts = np.empty(len(particles), np.int64)
            kernels.trunk_costs(particles, self.cardbox, self.size, planes, base, counts)
            return counts.astype(np.float64)

        return costs

    def arms_beside(self, torso: FloatArray) -> ArmCosts:
        """See :class:`SilhouetteObservation`."""
        pose = np.array(torso, dtype=np.float64)
        covered = np.empty_like(self.planes)
        gain = kernels.cover_trunk(pose, self.cardbox, self.size, self.planes, covered)
        base = self.frame.foreground_px + gain

        def costs(side: str, arms: FloatArray) -> FloatArray:
            particles = np.ascontiguousarray(arms, dtype=np.float64)
            counts = np.empty(len(particles), np.int64)
            beside = _SIDE_SIGN[side], pose, self.cardbox, self.size
            kernels.arm_costs(particles, *beside, covered, base, counts)
            return counts.astype(np.float64)

        return costs

    def postures(self, postures: FloatArray) -> FloatArray:
        """See :class:`SilhouetteObservation`."""
        return self._full(postures)[0].astype(np.float64)

    def overlap(self, posture: FloatArray) -> tuple[int, float]:
        """See :class:`SilhouetteObservation`."""
        costs, areas = self._full(np.asarray(posture)[None])
        cost, area = int(costs[0]), int(areas[0])
        foreground = self.frame.foreground_px
        common = (foreground + area - cost) // 2
        union = foreground + area - common
        return cost, common / union if union else 0.0

    def bodies(self, sizes: FloatArray, postures: FloatArray) -> CountArray:
        """Return costs (N,) of bodies with ``sizes`` (N, 18) in ``postures`` (N, 12)."""
        costs = np.empty(len(sizes), np.int64)
        kernels.body_costs(
            np.ascontiguousarray(postures, dtype=np.float64),
            (*shape_of(np.asarray(sizes, dtype=np.float64)), *self.cardbox[2:]),
            self.size,
            self.planes,
            self.frame.foreground_px,
            costs,
        )
        return costs

    def polygons(self, corners_m: FloatArray) -> CountArray:
        """Return costs (N,) of planar quadrilaterals (N, K, 4, 3), metres in the optical frame."""
        contiguous = np.ascontiguousarray(corners_m, dtype=np.float64)
        check_array("corners_m", contiguous, (ANY, ANY, 4, 3), np.float64)
        costs = np.empty(len(contiguous), np.int64)
        kernels.polygon_costs(
            contiguous,
            self.cardbox[3],
            self.size,
            self.planes,
            self.frame.foreground_px,
            costs,
        )
        return costs

    def _full(self, postures: FloatArray) -> tuple[CountArray, CountArray]:
        contiguous = np.ascontiguousarray(postures, dtype=np.float64)
        check_array("postures", contiguous, (ANY, N_JOINTS), np.float64)
        costs = np.empty(len(contiguous), np.int64)
        areas = np.empty(len(contiguous), np.int64)
        kernels.full_costs(
            contiguous,
            self.cardbox,
            self.size,
            self.planes,
            self.frame.foreground_px,
            costs,
            areas,
        )
        return costs, areas
