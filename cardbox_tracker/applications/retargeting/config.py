"""Settings of retargeting."""

from __future__ import annotations

from dataclasses import dataclass

from cardbox_tracker.common.settings import Settings, setting


@dataclass(frozen=True)
class RetargetConfig(Settings):
    """Settings of how a robot follows a person and when it stands still.

    Raises:
        ValueError: a value is out of its range; the text names it.
    """

    side: str = setting("right", "arm of the person that is followed", choices=("left", "right"))
    max_speed: float = setting(
        1.0,
        "no joint of the robot moves faster, nor faster than its URDF says",
        unit="rad/s or m/s",
        limits=(0.01, 20.0),
    )
    max_stddev_rad: float = setting(
        0.7,
        "dead-man: the robot stands still while the standard deviation of a followed joint is "
        "larger",
        unit="rad",
        limits=(0.05, 3.2),
    )
    rate_hz: float = setting(
        50.0,
        "positions and velocities a second, between those of two images",
        unit="Hz",
        limits=(10.0, 1000.0),
    )
    longest_step_s: float = setting(
        0.2,
        "after a longer gap between two images the robot moves as if it had been this long",
        unit="s",
        limits=(0.01, 1.0),
    )
    reach: float = setting(
        0.95,
        "the stretched arm of the person is this much of the robot's stretched arm",
        limits=(0.1, 1.0),
    )
    mount_roll_deg: float = setting(
        0.0, "how the robot's root is turned in the person's torso", unit="deg", limits=(-180, 180)
    )
    mount_pitch_deg: float = setting(0.0, "see mount_roll_deg", unit="deg", limits=(-180, 180))
    mount_yaw_deg: float = setting(0.0, "see mount_roll_deg", unit="deg", limits=(-180, 180))
