"""The parameters of the nodes that use a measured posture."""

from __future__ import annotations

from dataclasses import dataclass

from cardbox_tracker.ergonomics.config import RulaConfig
from cardbox_tracker.ros.runtime.parameter_fields import NodeParameters, parameter, shared
from cardbox_tracker.settings import settings_of


@dataclass(frozen=True)
class RulaParameters(NodeParameters):
    """Score the strain on arms, neck and trunk (RULA)."""

    neck: int = shared(RulaConfig, "neck")
    wrist: int = shared(RulaConfig, "wrist")
    wrist_twist: int = shared(RulaConfig, "wrist_twist")
    legs: int = shared(RulaConfig, "legs")
    arm_muscle_use: int = shared(RulaConfig, "arm_muscle_use")
    arm_load: int = shared(RulaConfig, "arm_load")
    body_muscle_use: int = shared(RulaConfig, "body_muscle_use")
    body_load: int = shared(RulaConfig, "body_load")
    shoulders_raised: bool = shared(RulaConfig, "shoulders_raised")
    arms_supported: bool = shared(RulaConfig, "arms_supported")
    trunk_twisted: bool = shared(RulaConfig, "trunk_twisted")
    abducted_deg: float = shared(RulaConfig, "abducted_deg")
    outwards_deg: float = shared(RulaConfig, "outwards_deg")
    side_bent_deg: float = shared(RulaConfig, "side_bent_deg")
    upright_deg: float = shared(RulaConfig, "upright_deg")
    seed: int = parameter(
        0, "random seed of the postures that are drawn", limits=(0, 2**31 - 1), read_only=True
    )

    def config(self) -> RulaConfig:
        """Return the settings of the core."""
        return RulaConfig(**{name: getattr(self, name) for name in settings_of(RulaConfig)})
