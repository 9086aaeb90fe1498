"""Constants of the whole-body rating: the drawn model and the priors (``docs/research.md``)."""

from __future__ import annotations

from dataclasses import dataclass

from cardbox_tracker.terms.pose_prior import FLOOR_NATS


@dataclass(frozen=True)
class WholeBodyCostConfig:
    """The drawn model, the part of the image that counts, and the priors.

    A prior is a sum of squared values, each divided by its unit and limited by a cap, so that a
    clear image outweighs the prior of an unusual posture.
    """

    neck_to_head: float = 0.65  #: width of the neck as a fraction of the head's
    # If a person bows or comes nearer, trousers or skirt fill the rows below the hips.
    #: distance by which the drawn waist extends below the middle of the hips, m.
    waist_extension_m: float = 0.35
    # The keypoint "hand" is the middle of a fist, but hands are mostly open.
    #: distance by which the drawn forearm extends beyond the keypoint of the hand, m.
    fingers_m: float = 0.05
    #: distance below the hips up to which rows of the image count, so that hanging hands count, m.
    below_hips_m: float = 0.35
    #: half width of the ignored columns below the hips, as a fraction of the waist's width.
    legs: float = 0.75
    #: weight of the priors, as a fraction of the silhouette's pixels per unit.
    weight: float = 0.012
    roll_deg: float = 20.0  #: unit of the torso's roll, deg
    # Leaning forward and back lower the head alike in the image, but people lean forward.
    pitch_forward_deg: float = 13.0  #: unit of a pitch above the expected one, deg
    pitch_back_deg: float = 8.0  #: unit of a pitch below the expected one, deg
    yaw_deg: float = 14.0  #: unit of the torso's yaw, deg
    #: the same with points of a detector, which show a turn better than an outline, deg.
    located_yaw_deg: float = 40.0
    angle_cap: float = 9.0  #: largest cost of one of the torso's angles
    #: unit of the torso's motion along the line of sight from frame to frame, m.
    x_step_m: float = 0.1
    z_step_m: float = 0.015  #: unit of the torso's motion up and down from frame to frame, m
    step_cap: float = 2.0  #: largest cost of a motion
    #: unit of the torso's distance from its usual place along the line of sight, m.
    x_home_m: float = 0.08
    z_home_m: float = 0.06  #: unit of the torso's distance from the measured height, m
    # With less, somebody who squats is taken for somebody who stands nearer.
    #: unit of both with points of the legs, which show who squats or sits, m.
    located_z_m: float = 0.4
    home_cap: float = 4.0  #: largest cost of such a distance
    #: cost of a hand, forearm or elbow on the axis of trunk or head; 0 at the surface.
    penetration: float = 3.0
    unknown_nats: float = FLOOR_NATS  #: largest cost of the learned prior of an arm
