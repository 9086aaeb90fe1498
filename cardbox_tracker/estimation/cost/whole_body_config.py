"""Settings of the whole-body rating: what is drawn, and which postures are usual.

Unless a text names another source, values come from trials on recorded sessions with motion capture
or scripted truth (``docs/research``).
"""

from __future__ import annotations

from dataclasses import dataclass

from cardbox_tracker.estimation.cost.pose_prior import FLOOR_NATS
from cardbox_tracker.settings import Settings, setting


@dataclass(frozen=True)
class WholeBodyCostConfig(Settings):
    """The drawn model, the part of the image that counts, and the priors.

    A prior is a sum of squares, each of a value in its unit and none above its cap, so that an
    unusual posture that the image shows clearly is found all the same.
    """

    neck_to_head: float = setting(
        0.65, "width of the neck as a fraction of the head's", limits=(0.0, 1.0), restarts=True
    )
    # Where a person bows or comes nearer, trousers and skirt fill the rows below the hips.
    waist_extension_m: float = setting(
        0.35,
        "how far below the middle of the hips the waist is drawn",
        unit="m",
        limits=(0.0, 1.0),
        restarts=True,
    )
    # Keypoint "hand" is the middle of a fist; recorded hands are mostly open.
    fingers_m: float = setting(
        0.05,
        "how far beyond the hand a forearm is drawn",
        unit="m",
        limits=(0.0, 0.3),
        restarts=True,
    )
    # Clavicle and shoulder blade: about a third of an arm's elevation, of which part moves the
    # joint; the gain is fitted to motion capture.
    clavicle: float = setting(
        0.43,
        "radius of the circle on which the girdle lifts a shoulder joint, as a fraction of the "
        "shoulder breadth",
        limits=(0.0, 1.0),
        restarts=True,
    )
    lift_gain: float = setting(
        0.18, "how far it is lifted, rad per rad of elevation", limits=(0.0, 1.0), restarts=True
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
        "how far below the hips rows of the image count, so that hanging hands do",
        unit="m",
        limits=(0.0, 1.0),
        restarts=True,
    )
    legs: float = setting(
        0.75,
        "half width of what is left out below the hips, as a fraction of the waist's width",
        limits=(0.0, 3.0),
        restarts=True,
    )
    weight: float = setting(
        0.012,
        "weight of a prior's unit, as a share of the silhouette's pixels",
        limits=(0.0, 1.0),
        restarts=True,
    )
    roll_deg: float = setting(
        20.0, "unit of the torso's roll", unit="deg", limits=(0.1, 180.0), restarts=True
    )
    # Postures are measured against the front reference, which is where a person rests. With 3, the
    # median of motion capture, a person at rest is found leaning 5 degrees forward and 5 cm too far
    # away, for the two hardly change the outline together.
    pitch_rest_deg: float = setting(
        0.0, "pitch of a person at rest", unit="deg", limits=(-30.0, 30.0), restarts=True
    )
    # A bow and leaning back lower the head alike in the image, but people bow.
    pitch_forward_deg: float = setting(
        13.0, "unit of the pitch beyond it", unit="deg", limits=(0.1, 180.0), restarts=True
    )
    pitch_back_deg: float = setting(
        8.0, "unit of the pitch below it", unit="deg", limits=(0.1, 180.0), restarts=True
    )
    yaw_deg: float = setting(
        14.0, "unit of the torso's yaw", unit="deg", limits=(0.1, 180.0), restarts=True
    )
    angle_cap: float = setting(
        9.0, "most that one of the torso's angles costs", limits=(0.1, 1000.0), restarts=True
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
    step_cap: float = setting(2.0, "most that a motion costs", limits=(0.1, 1000.0), restarts=True)
    x_home_m: float = setting(
        0.08,
        "unit of the torso's distance from where it mostly was along the line of sight",
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
        4.0, "most that such a distance costs", limits=(0.1, 1000.0), restarts=True
    )
    penetration: float = setting(
        3.0,
        "cost of hand, forearm or elbow on the axis of trunk or head; less towards the surface",
        limits=(0.0, 1000.0),
        restarts=True,
    )
    unknown_nats: float = setting(
        FLOOR_NATS,
        "most that the learned prior of an arm costs",
        limits=(0.1, 50.0),
        restarts=True,
    )
