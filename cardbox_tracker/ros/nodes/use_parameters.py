"""The parameters of the nodes that use a measured posture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from cardbox_tracker.ergonomics.config import RulaConfig
from cardbox_tracker.retargeting.config import RetargetConfig
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


def _fixed(name: str) -> Any:
    """Return a setting of the retargeting, which stays as it is while a robot moves."""
    return shared(RetargetConfig, name, read_only=True)


@dataclass(frozen=True)
class RetargetParameters(NodeParameters):
    """Move a robot arm as the tracked person moves theirs."""

    robot_file: str = parameter("", "URDF of the robot; has to be given", read_only=True)
    joint_map_file: str = parameter(
        "",
        "which joint moves which, as in config/example_joint_map.yaml; empty: the robot's hand "
        "follows the person's by inverse kinematics",
        read_only=True,
    )
    hand_link: str = parameter(
        "", "the robot's hand; empty: the link with the most joints before it", read_only=True
    )
    timeout_s: float = parameter(
        0.5,
        "dead-man: without a posture for so long the robot stands still",
        unit="s",
        limits=(0.05, 10.0),
        read_only=True,
    )
    side: str = _fixed("side")
    max_speed: float = _fixed("max_speed")
    max_stddev_rad: float = _fixed("max_stddev_rad")
    longest_step_s: float = _fixed("longest_step_s")
    reach: float = _fixed("reach")
    mount_roll_deg: float = _fixed("mount_roll_deg")
    mount_pitch_deg: float = _fixed("mount_pitch_deg")
    mount_yaw_deg: float = _fixed("mount_yaw_deg")

    def config(self) -> RetargetConfig:
        """Return the settings of the core."""
        return RetargetConfig(**{name: getattr(self, name) for name in settings_of(RetargetConfig)})
