"""Settings of the whole-body rating: the drawn model and the priors.

Values without a source were chosen on recorded sessions with ground truth (``docs/research``).
"""

from __future__ import annotations

from dataclasses import dataclass

from cardbox_tracker.estimation.cost.pose_prior import FLOOR_NATS
from cardbox_tracker.settings import check, setting


@dataclass(frozen=True)
class WholeBodyCostConfig:
    """The drawn model, the part of the image that counts, and the priors.

    A prior is a sum of squared values, each divided by its unit and limited by a cap, so that a
    clear image outweighs the prior of an unusual posture.
    """

    neck_to_head: float = setting(
        0.65, "width of the neck as a fraction of the head's", limits=(0.0, 1.0), restarts=True
    )
    # If a person bows or comes nearer, trousers or skirt fill the rows below the hips.
    waist_extension_m: float = setting(
        0.35,
        "distance by which the drawn waist extends below the middle of the hips",
        unit="m",
        limits=(0.0, 1.0),
        restarts=True,
    )
    # The keypoint "hand" is the middle of a fist, but hands are mostly open.
    fingers_m: float = setting(
        0.05,
        "distance by which the drawn forearm extends beyond the keypoint of the hand",
        unit="m",
        limits=(0.0, 0.3),
        restarts=True,
    )
    # Clavicle and shoulder blade contribute about a third of an arm's elevation, and a part of it
    # moves the joint; the gain was fitted to motion capture.
    clavicle: float = setting(
        0.43,
        "radius of the circle on which the girdle lifts a shoulder joint, as a fraction of the "
        "shoulder breadth",
        limits=(0.0, 1.0),
        restarts=True,
    )
    lift_gain: float = setting(
        0.18, "lift on this circle, rad per rad of elevation", limits=(0.0, 1.0), restarts=True
    )
    lift_from_deg: float = setting(
        30.0,
        "elevation of the upper arm above which the shoulder is lifted",
        unit="deg",
        limits=(0.0, 180.0),
        restarts=True,
    )
    below_hips_m: float = setting(
        0.35,
        "distance below the hips up to which rows of the image count, so that hanging hands count",
        unit="m",
        limits=(0.0, 1.0),
        restarts=True,
    )
    legs: float = setting(
        0.75,
        "half width of the ignored columns below the hips, as a fraction of the waist's width",
        limits=(0.0, 3.0),
        restarts=True,
    )
    weight: float = setting(
        0.012,
        "weight of the priors, as a fraction of the silhouette's pixels per unit",
        limits=(0.0, 1.0),
        restarts=True,
    )
    roll_deg: float = setting(
        20.0, "unit of the torso's roll", unit="deg", limits=(0.1, 180.0), restarts=True
    )
    # Postures are relative to the front reference, in which a person rests. With a positive value,
    # a person at rest would lean forward and be too far away, which hardly changes the outline.
    pitch_rest_deg: float = setting(
        0.0, "pitch of a person at rest", unit="deg", limits=(-30.0, 30.0), restarts=True
    )
    # Leaning forward and back lower the head alike in the image, but people lean forward.
    pitch_forward_deg: float = setting(
        13.0, "unit of a pitch above this value", unit="deg", limits=(0.1, 180.0), restarts=True
    )
    pitch_back_deg: float = setting(
        8.0, "unit of a pitch below this value", unit="deg", limits=(0.1, 180.0), restarts=True
    )
    yaw_deg: float = setting(
        14.0, "unit of the torso's yaw", unit="deg", limits=(0.1, 180.0), restarts=True
    )
    angle_cap: float = setting(
        9.0, "largest cost of one of the torso's angles", limits=(0.1, 1000.0), restarts=True
    )
    x_step_m: float = setting(
        0.06,
        "unit of the torso's motion along the line of sight from frame to frame",
        unit="m",
        limits=(0.001, 10.0),
        restarts=True,
    )
    z_step_m: float = setting(
        0.015,
        "unit of the torso's motion up and down from frame to frame",
        unit="m",
        limits=(0.001, 10.0),
        restarts=True,
    )
    step_cap: float = setting(2.0, "largest cost of a motion", limits=(0.1, 1000.0), restarts=True)
    x_home_m: float = setting(
        0.08,
        "unit of the torso's distance from its usual place along the line of sight",
        unit="m",
        limits=(0.001, 10.0),
        restarts=True,
    )
    z_home_m: float = setting(
        0.06,
        "unit of the torso's distance from the measured height",
        unit="m",
        limits=(0.001, 10.0),
        restarts=True,
    )
    home_cap: float = setting(
        4.0, "largest cost of such a distance", limits=(0.1, 1000.0), restarts=True
    )
    penetration: float = setting(
        3.0,
        "cost of a hand, forearm or elbow on the axis of trunk or head; 0 at the surface",
        limits=(0.0, 1000.0),
        restarts=True,
    )
    unknown_nats: float = setting(
        FLOOR_NATS,
        "largest cost of the learned prior of an arm",
        limits=(0.1, 50.0),
        restarts=True,
    )

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            ValueError: a value is out of range; the text names it.
        """
        check(self)
