"""Settings of the whole-body rating: the drawn model and the priors.

Values without a source were chosen on recorded sessions with ground truth (``docs/research``).
"""

from __future__ import annotations

from dataclasses import dataclass

from cardbox_tracker.estimation.cost.pose_prior import FLOOR_NATS
from cardbox_tracker.settings import Settings, restarting


@dataclass(frozen=True)
class WholeBodyCostConfig(Settings):
    """The drawn model, the part of the image that counts, and the priors.

    A prior is a sum of squared values, each divided by its unit and limited by a cap, so that a
    clear image outweighs the prior of an unusual posture.
    """

    neck_to_head: float = restarting(
        0.65, "width of the neck as a fraction of the head's", limits=(0.0, 1.0)
    )
    # If a person bows or comes nearer, trousers or skirt fill the rows below the hips.
    waist_extension_m: float = restarting(
        0.35,
        "distance by which the drawn waist extends below the middle of the hips",
        unit="m",
        limits=(0.0, 1.0),
    )
    # The keypoint "hand" is the middle of a fist, but hands are mostly open.
    fingers_m: float = restarting(
        0.05,
        "distance by which the drawn forearm extends beyond the keypoint of the hand",
        unit="m",
        limits=(0.0, 0.3),
    )
    below_hips_m: float = restarting(
        0.35,
        "distance below the hips up to which rows of the image count, so that hanging hands count",
        unit="m",
        limits=(0.0, 1.0),
    )
    legs: float = restarting(
        0.75,
        "half width of the ignored columns below the hips, as a fraction of the waist's width",
        limits=(0.0, 3.0),
    )
    weight: float = restarting(
        0.012,
        "weight of the priors, as a fraction of the silhouette's pixels per unit",
        limits=(0.0, 1.0),
    )
    roll_deg: float = restarting(20.0, "unit of the torso's roll", unit="deg", limits=(0.1, 180.0))
    # Postures are relative to the front reference, in which a person rests. With a positive value,
    # a person at rest would lean forward and be too far away, which hardly changes the outline.
    pitch_rest_deg: float = restarting(
        0.0, "pitch of a person at rest", unit="deg", limits=(-30.0, 30.0)
    )
    # Leaning forward and back lower the head alike in the image, but people lean forward.
    pitch_forward_deg: float = restarting(
        13.0, "unit of a pitch above this value", unit="deg", limits=(0.1, 180.0)
    )
    pitch_back_deg: float = restarting(
        8.0, "unit of a pitch below this value", unit="deg", limits=(0.1, 180.0)
    )
    yaw_deg: float = restarting(14.0, "unit of the torso's yaw", unit="deg", limits=(0.1, 180.0))
    angle_cap: float = restarting(
        9.0, "largest cost of one of the torso's angles", limits=(0.1, 1000.0)
    )
    x_step_m: float = restarting(
        0.1,
        "unit of the torso's motion along the line of sight from frame to frame",
        unit="m",
        limits=(0.001, 10.0),
    )
    z_step_m: float = restarting(
        0.015,
        "unit of the torso's motion up and down from frame to frame",
        unit="m",
        limits=(0.001, 10.0),
    )
    step_cap: float = restarting(2.0, "largest cost of a motion", limits=(0.1, 1000.0))
    x_home_m: float = restarting(
        0.08,
        "unit of the torso's distance from its usual place along the line of sight",
        unit="m",
        limits=(0.001, 10.0),
    )
    z_home_m: float = restarting(
        0.06,
        "unit of the torso's distance from the measured height",
        unit="m",
        limits=(0.001, 10.0),
    )
    home_cap: float = restarting(4.0, "largest cost of such a distance", limits=(0.1, 1000.0))
    penetration: float = restarting(
        3.0,
        "cost of a hand, forearm or elbow on the axis of trunk or head; 0 at the surface",
        limits=(0.0, 1000.0),
    )
    unknown_nats: float = restarting(
        FLOOR_NATS,
        "largest cost of the learned prior of an arm",
        limits=(0.1, 50.0),
    )
