"""The rest prior's term: what an outline hardly shows stays near rest.

    cost = weight * foreground_px * sum over the joints of (angle / unit)^2

An outline shows well how far an arm is raised aside, so abduction hardly needs a prior; flexion,
which moves an arm towards the camera or away, does. So does the torso, for a person before a camera
mostly faces it upright. The torso's place has no rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import JOINT_LIMITS, JOINT_NAMES, TORSO
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.prior_kernels import squared_distances
from cardbox_tracker.estimation.cost.terms import ARMS, ArmCosts, Frame, TorsoCosts
from cardbox_tracker.settings import check, setting
from cardbox_tracker.vision.camera import Camera

_FLEXION_UNIT, _ABDUCTION_UNIT = 1 / 6, 1.0
"""Units of an arm's angles, as fractions of each joint's range."""
_TORSO_UNITS_RAD = np.radians([20.0, 26.0, 20.0])
"""Units of roll, pitch and yaw."""
_LEANING_BACK = 3.0
"""A bow and leaning back lower the head alike in the image, but people bow: backwards the unit of
the pitch is smaller by this factor."""


def _units() -> tuple[FloatArray, FloatArray]:
    """Reciprocal units (14,) for angles below and above rest; places have none."""
    ranges = JOINT_LIMITS[:, 1] - JOINT_LIMITS[:, 0]
    is_flexion = [name.endswith("flexion") for name in JOINT_NAMES]
    units = np.where(is_flexion, ranges * _FLEXION_UNIT, ranges * _ABDUCTION_UNIT)
    units[JOINT_NAMES.index("torso_y")] = np.inf
    units[1:4] = _TORSO_UNITS_RAD
    # The last two are torso_x and torso_z, which only some filters have.
    above = np.append(1.0 / units, [0.0, 0.0])
    below = above.copy()
    below[JOINT_NAMES.index("torso_pitch")] *= _LEANING_BACK
    return below, above


_BELOW_REST, _ABOVE_REST = _units()


@dataclass(frozen=True)
class RestPrior:
    """Settings of the rest prior, and the term itself."""

    weight: float = setting(
        0.012,
        "weight of the squared distance of each angle from rest, in units of that angle, as a "
        "fraction of the silhouette's foreground pixels",
        limits=(0.0, 1.0),
    )

    def __post_init__(self) -> None:
        """Check the range.

        Raises:
            ValueError: ``weight`` is out of range.
        """
        check(self)

    def build(self, body: BodyModel, camera: Camera) -> RestPrior:
        """Return the term; it is the same for any body and camera."""
        return self

    def observe(self, frame: Frame) -> RestPriorObservation:
        """Return the prior, scaled to the size of the person in the image."""
        return RestPriorObservation(self.weight * frame.foreground_px)


@dataclass(frozen=True)
class RestPriorObservation:
    """The prior of one frame; see :class:`~cardbox_tracker.estimation.cost.terms.TermObservation`.

    Attributes:
        weight_px: weight of the squared distance from rest, in units of each angle.
    """

    weight_px: float

    def torsos_beside(self, arms: FloatArray | None) -> TorsoCosts:
        """Rate torsos by their own angles; the arms do not matter."""
        return lambda torsos: self._costs(torsos[:, TORSO], TORSO)

    def arms_beside(self, torso: FloatArray) -> ArmCosts:
        """Rate arms by their own angles; the torso does not matter."""
        return lambda side, arms: self._costs(arms, ARMS[side])

    def postures(self, postures: FloatArray) -> FloatArray:
        """Rate all angles."""
        return self._costs(postures, slice(None))

    def _costs(self, particles: FloatArray, joints: slice) -> FloatArray:
        costs: FloatArray = squared_distances(
            particles, _BELOW_REST[joints], _ABOVE_REST[joints], self.weight_px
        )
        return costs
