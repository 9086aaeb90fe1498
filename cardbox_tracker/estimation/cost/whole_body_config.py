"""Settings of the whole-body rating: what is drawn, and which postures are usual.

Unless a text names another source, values come from trials on recorded sessions with motion capture
or scripted truth (``docs/research``).
"""

from __future__ import annotations

from dataclasses import dataclass

from cardbox_tracker.estimation.cost.pose_prior import FLOOR_NATS
from cardbox_tracker.settings import Settings, restarting


@dataclass(frozen=True)
class WholeBodyCostConfig(Settings):
    """The drawn model, the part of the image that counts, and the priors.

    A prior is a sum of squares, each of a value in its unit and none above its cap, so that an
    unusual posture that the image shows clearly is found all the same.
    """

    neck_to_head: float = restarting(
        0.65, "width of the neck as a fraction of the head's", limits=(0.0, 1.0)
    )
    # Where a person bows or comes nearer, trousers and skirt fill the rows below the hips.
    waist_extension_m: float = restarting(
        0.35, "how far below the middle of the hips the waist is drawn", unit="m", limits=(0.0, 1.0)
    )
    # Keypoint "hand" is the middle of a fist; recorded hands are mostly open.
    fingers_m: float = restarting(
        0.05, "how far beyond the hand a forearm is drawn", unit="m", limits=(0.0, 0.3)
    )
    # Clavicle and shoulder blade: about a third of an arm's elevation, of which part moves the
    # joint; the gain is fitted to motion capture.
    clavicle: float = restarting(
        0.43,
        "radius of the circle on which the girdle lifts a shoulder joint, as a fraction of the "
        "shoulder breadth",
        limits=(0.0, 1.0),
    )
    lift_gain: float = restarting(
        0.18, "how far it is lifted, rad per rad of elevation", limits=(0.0, 1.0)
    )
    lift_from_deg: float = restarting(
        30.0,
        "elevation of the upper arm above which the shoulder is lifted",
        unit="deg",
        limits=(0.0, 180.0),
    )
    below_hips_m: float = restarting(
        0.35,
        "how far below the hips rows of the image count, so that hanging hands do",
        unit="m",
        limits=(0.0, 1.0),
    )
    legs: float = restarting(
        0.75,
        "half width of what is left out below the hips, as a fraction of the waist's width",
        limits=(0.0, 3.0),
    )
    weight: float = restarting(
        0.012, "weight of a prior's unit, as a share of the silhouette's pixels", limits=(0.0, 1.0)
    )
    roll_deg: float = restarting(20.0, "unit of the torso's roll", unit="deg", limits=(0.1, 180.0))
    # Postures are measured against the front reference, which is where a person rests. With 3, the
    # median of motion capture, a person at rest is found leaning 5 degrees forward and 5 cm too far
    # away, for the two hardly change the outline together.
    pitch_rest_deg: float = restarting(
        0.0, "pitch of a person at rest", unit="deg", limits=(-30.0, 30.0)
    )
    # A bow and leaning back lower the head alike in the image, but people bow.
    pitch_forward_deg: float = restarting(
        13.0, "unit of the pitch beyond it", unit="deg", limits=(0.1, 180.0)
    )
    pitch_back_deg: float = restarting(
        8.0, "unit of the pitch below it", unit="deg", limits=(0.1, 180.0)
    )
    yaw_deg: float = restarting(14.0, "unit of the torso's yaw", unit="deg", limits=(0.1, 180.0))
    angle_cap: float = restarting(
        9.0, "most that one of the torso's angles costs", limits=(0.1, 1000.0)
    )
    x_step_m: float = restarting(
        0.06,
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
    step_cap: float = restarting(2.0, "most that a motion costs", limits=(0.1, 1000.0))
    x_home_m: float = restarting(
        0.08,
        "unit of the torso's distance from where it mostly was along the line of sight",
        unit="m",
        limits=(0.001, 10.0),
    )
    z_home_m: float = restarting(
        0.06,
        "unit of the torso's distance from the measured height",
        unit="m",
        limits=(0.001, 10.0),
    )
    home_cap: float = restarting(4.0, "most that such a distance costs", limits=(0.1, 1000.0))
    penetration: float = restarting(
        3.0,
        "cost of hand, forearm or elbow on the axis of trunk or head; less towards the surface",
        limits=(0.0, 1000.0),
    )
    unknown_nats: float = restarting(
        FLOOR_NATS, "most that the learned prior of an arm costs", limits=(0.1, 50.0)
    )
