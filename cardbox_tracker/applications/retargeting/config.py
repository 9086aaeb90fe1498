"""Settings of retargeting."""

from __future__ import annotations

from dataclasses import dataclass

from cardbox_tracker.common.settings import Settings, setting


@dataclass(frozen=True)
class RetargetConfig(Settings):
    """Settings of how a robot follows a person and when it stands still."""

    side: str = setting(
        "right",
        "arm of the person that is followed; both: one robot with two arms, and its head",
        choices=("left", "right", "both"),
    )
    base: str = setting("", "link at which the robot's arm begins; empty: it is found")
    hand: str = setting("", "link of the robot's hand; empty: it is found")
    gripper: str = setting("", "joint that opens the robot's hand; empty: it is found")
    gripper_open: str = setting(
        "upper", "limit of the gripper at which it is open", choices=("lower", "upper")
    )
    follow: str = setting(
        "arm",
        "what is followed. arm: the directions of upper arm, forearm and hand; hand: the hand's "
        "place from the shoulder, while the robot's hand keeps the tilt that it has at rest",
        choices=("arm", "hand"),
    )
    hand_scale: float = setting(
        1.0,
        "with follow hand: reach of the robot's hand from its shoulder divided by that of the "
        "person's, both in lengths of the stretched arm",
        limits=(0.05, 2.0),
    )
    rest: str = setting(
        "",
        "positions to which joints of the arm return as far as they are free, JOINT=VALUE,...; "
        "others: the middle of their range",
    )
    max_speed: float = setting(
        1.0,
        "no joint of the robot moves faster, nor faster than its URDF says",
        unit="rad/s or m/s",
        limits=(0.01, 20.0),
    )
    max_acceleration: float = setting(
        0.0,
        "no joint of the robot changes its speed faster; 0: 20 times max_speed, so the time to "
        "reach any max_speed is the same",
        unit="rad/s² or m/s²",
        limits=(0.0, 1000.0),
    )
    max_jerk: float = setting(
        0.0,
        "no joint of the robot changes its acceleration faster; 0: 20 times max_acceleration",
        unit="rad/s³ or m/s³",
        limits=(0.0, 1e6),
    )
    soft_start_s: float = setting(
        1.0,
        "time in which the robot's speed rises to max_speed after it begins to follow",
        unit="s",
        limits=(0.0, 60.0),
    )
    clutch: bool = setting(
        False, "the robot begins where it is and follows movements from there, not postures"
    )
    enable_after_lost: bool = setting(
        True,
        "after a loss, of the person, of postures or of the robot's joint states for timeout_s, "
        "the robot has to be enabled again",
    )
    max_following_error: float = setting(
        0.2,
        "all joints of the robot hold while one is farther from where it was sent than this, or a "
        "quarter of its range",
        unit="rad or m",
        limits=(0.01, 10.0),
    )
    start: str = setting(
        "",
        "positions of the robot's joints at the beginning, JOINT=VALUE,..., where it does not tell "
        "them; others begin at 0 or the limit nearest to it",
    )
    max_stddev_rad: float = setting(
        0.7,
        "dead-man: a joint of the robot stands still while the standard deviation of one behind "
        "it is larger",
        unit="rad",
        limits=(0.05, 3.2),
    )
    max_chance: float = setting(
        0.5,
        "dead-man: a joint of the robot stands still while elbow or hand behind it is more "
        "probably wrong than this, or not tracked",
        limits=(0.0, 1.0),
    )
    rate_hz: float = setting(
        50.0,
        "positions and velocities a second, between those of two images",
        unit="Hz",
        limits=(10.0, 1000.0),
    )
    longest_step_s: float = setting(
        0.2,
        "after a longer gap between two images the robot moves as if it had been this long; an "
        "unsure joint goes on for this time to where it was last sure, and then holds",
        unit="s",
        limits=(0.01, 1.0),
    )
    trunk_radius_m: float = setting(
        0.1,
        "forearm and hand stay so far from the Z axis of the robot's root, up to its shoulder, "
        "or as far as the shoulder is",
        unit="m",
        limits=(0.0, 2.0),
    )
    arms_apart_m: float = setting(
        0.1,
        "with both sides, the axes of one arm's forearm and hand come no nearer to those of the "
        "other than this; the arms hold meanwhile",
        unit="m",
        limits=(0.0, 2.0),
    )
    lowest_m: float = setting(
        -10.0,
        "forearm and hand stay above this height in the robot's root, as above a table",
        unit="m",
        limits=(-10.0, 10.0),
    )
    mount_roll_deg: float = setting(
        0.0, "how the robot's root is turned in the person's torso", unit="deg", limits=(-180, 180)
    )
    mount_pitch_deg: float = setting(0.0, "see mount_roll_deg", unit="deg", limits=(-180, 180))
    mount_yaw_deg: float = setting(0.0, "see mount_roll_deg", unit="deg", limits=(-180, 180))
