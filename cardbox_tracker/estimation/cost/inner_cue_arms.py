"""Image coordinates of one person's arms, and the gains of the inner cue."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import POSTURE, TORSO
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.body.skeleton import PLACE_NAMES
from cardbox_tracker.estimation.cost import inner_cue_kernels as kernels
from cardbox_tracker.estimation.cost.drawn_body import body_tuple
from cardbox_tracker.estimation.cost.kernel_arguments import BodyTuple
from cardbox_tracker.vision.camera import Camera

_SIDE_SIGN = {"left": 1.0, "right": -1.0}

N_TORSO = TORSO.stop + len(PLACE_NAMES)
"""Number of values of a torso: d1..d4, ``torso_x`` and ``torso_z``."""


@dataclass(frozen=True, eq=False)
class ArmView:
    """One person before one camera: the arguments that are constant over frames.

    Attributes:
        person: fields of :class:`~cardbox_tracker.estimation.cost.kernel_arguments.Body`.
        forearm: fields of :class:`~cardbox_tracker.estimation.cost.inner_cue_kernels.Forearm`.
        weights: weight of a nat of hand and forearm, px of the outline, (2,).
    """

    person: BodyTuple
    forearm: kernels.ForearmTuple
    weights: FloatArray

    @classmethod
    def of(cls, body: BodyModel, camera: Camera, weights: FloatArray) -> ArmView:
        """Return the view of ``body`` before a working camera that includes the pitch."""
        forearm = body.size("forearm_length"), body.size("forearm_width")
        px_per_m = float(camera.fx) / body.placement.distance_m
        return cls(body_tuple(body, camera), (*forearm, px_per_m), weights)

    def project(
        self, torsos: FloatArray, arms: FloatArray, side: str
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Return elbow and hand (N, 2, 3) in the image, and whether the hand is hidden (N,)."""
        points, hidden = np.empty((len(arms), 2, 3)), np.empty(len(arms), np.bool_)
        kernels.project_arms(
            torsos,
            np.ascontiguousarray(arms, dtype=np.float64),
            _SIDE_SIGN[side],
            self.person,
            points,
            hidden,
        )
        return points, hidden

    def gains(
        self,
        points: FloatArray,
        hidden: NDArray[np.bool_],
        others: FloatArray,
        maps: NDArray[np.float32],
        corner: tuple[int, int],
    ) -> FloatArray:
        """Return the gains (N,), px, of arms at ``points`` (N, 2, 3).

        Args:
            points: see :meth:`project`.
            hidden: (N,), see :meth:`project`.
            others: points of the other arm, (N, 2, 3), or (1, 2, 3) for all.
            maps: ratios of hand and forearm, (2, h, w), nats.
            corner: column and row of the image where the maps begin.
        """
        gains = np.empty(len(points))
        seen = maps, *corner
        kernels.arm_gains(points, hidden, others, seen, self.forearm, self.weights, gains)
        return gains

    def zones(self, posture: FloatArray) -> FloatArray:
        """Return the places of head and torso of a posture (12,) or (14,) in the image, (6,), px.

        The values are the head's centre (u, v), the half axes of an ellipse around it, the row of
        the hips, and the row of the torso's top.
        """
        zones = np.empty(6)
        kernels.torso_zones(torsos_of(posture[None])[0], self.person, zones)
        return zones


def torsos_of(postures: FloatArray) -> FloatArray:
    """Return the torsos (N, 6) of postures (N, 12), or states (N, 14)."""
    torsos = np.zeros((len(postures), N_TORSO))
    places = postures[:, POSTURE.stop :]
    torsos[:, TORSO] = postures[:, TORSO]
    torsos[:, TORSO.stop : TORSO.stop + places.shape[1]] = places
    return torsos
