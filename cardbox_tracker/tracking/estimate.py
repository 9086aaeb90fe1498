"""The result of tracking for one time.

States: ``tracking``; ``uncertain`` (the posture may be wrong); ``lost`` (no result has fitted for
several frames, or there is more foreground than a person can have); ``no_person`` (too few
foreground pixels for a person). Only ``tracking`` and ``uncertain`` have a posture, and ``filled``,
a gap with the posture between the images around it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import roll_turn
from cardbox_tracker.person.model import FOUND_STDDEV, BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import (
    POSTURE_GROUPS,
    STATE,
    Group,
    KeypointState,
    limits_of,
    rows_of,
)
from cardbox_tracker.search.doubt import doubted

OPEN, CLOSED = 0.75, 0.25
"""A hand is open above the first value of ``Hand.open``, and closed below the second."""
TRACKING, UNCERTAIN, LOST, NO_PERSON = "tracking", "uncertain", "lost", "no_person"
FILLED = "filled"
CONTRADICTED = "the cameras contradict each other"
"""Reason of a doubt."""

KEPT_S = 0.5
"""Time for which a head, a hand or legs that are not found keep their result, s."""
LARGEST_RMS = 2.5
"""Root of the mean square of residuals, in deviations, above which points are no face or legs."""
PLACE_UNCERTAIN_FROM = 0.1
"""Probability of a place that is wrong above which it is uncertain."""


@dataclass(frozen=True)
class Place:
    """What is known of the place of the middle of the hips."""

    stddev_m: FloatArray  #: standard deviations of distance, ``torso_y`` and height, (3,), metres
    chance: float  #: probability that the distance is wrong by more than 30 cm
    rests_on: str  #: what scale and distance rest on
    contradiction: str = ""  #: what contradicts it; empty if nothing does

    @property
    def state(self) -> KeypointState:
        """``tracked`` or ``uncertain``."""
        is_uncertain = bool(self.contradiction) or self.chance > PLACE_UNCERTAIN_FROM
        return KeypointState.UNCERTAIN if is_uncertain else KeypointState.TRACKED


class Hand(NamedTuple):
    """A hand, from its own points (:mod:`.hands`)."""

    #: 1 if all fingers are open, 0 if all are closed, about 0.5 if some are: the chance that it is
    #: open, plus half of the chance that it is neither. None if the hand is too small.
    open: float | None
    palm: FloatArray  #: normal out of the palm, unit vector (3,) in the optical frame
    #: flexion and deviation of the wrist and rotation of the forearm, (3,), rad; the rotation of a
    #: straight arm is nan.
    wrist: FloatArray
    wrist_stddev: FloatArray  #: their standard deviations, (3,), rad; nan where the rotation is
    turn: float = 0.0  #: turn of the hand about the forearm's frame, rad (:mod:`.skeleton`)
    turn_stddev: float = 0.0  #: its standard deviation, rad

    @property
    def joints(self) -> FloatArray:
        """Turn, flexion and deviation, (3,), rad, as joints within their limits."""
        lowest, highest = limits_of(Group.HAND, side="left").T
        return np.asarray(np.clip([self.turn, *self.wrist[:2]], lowest, highest))

    @property
    def joints_stddev(self) -> FloatArray:
        """Standard deviations of ``joints``, (3,), rad."""
        return np.array([self.turn_stddev, *self.wrist_stddev[:2]])


class Legs(NamedTuple):
    """Both legs (:mod:`.legs`)."""

    angles: FloatArray  #: ``LEG_NAMES``, (8,), rad
    angles_stddev: FloatArray  #: their standard deviations, (8,), rad
    points_m: FloatArray  #: ``LEG_KEYPOINT_NAMES``, (6, 3), metres in the optical frame
    #: standard deviation of each point relative to the middle of the hips, (6,), m: the root of the
    #: sum of the variances along all axes.
    points_stddev_m: FloatArray
    #: state of each point: ``hidden`` where the detector does not see it.
    states: tuple[KeypointState, ...]

    def hidden(self) -> Legs:
        """Return the legs of an image that does not show them."""
        return self._replace(states=(KeypointState.HIDDEN,) * len(self.states))


@dataclass(frozen=True)
class Estimate:
    """State of tracking and posture of the person at one time."""

    #: ``tracking``, ``uncertain``, ``filled``, ``lost`` or ``no_person``; with the last two, all
    #: other attributes are None. It is about the shape: the posture in the camera's frame beside
    #: the place.
    state: str
    posture: FloatArray | None = None  #: d1..d12, (12,), rad and metres
    #: standard deviation of each joint, (12,), rad and metres: the weighted spread of the particles
    posture_stddev: FloatArray | None = None
    #: shoulder, elbow, hand of the left, then the right arm, (6, 3), metres in the optical frame
    keypoints_m: FloatArray | None = None
    cost_px: int | None = None  #: cost of the posture (equation (2)), px
    iou: float | None = None  #: intersection over union of model and silhouette, above the hips
    #: ``torso_x`` and ``torso_z``, (2,), metres: displacement of the hips from the body model's
    #: placement, towards the camera and up; None if the filter keeps it constant
    offset_m: FloatArray | None = None
    offset_stddev_m: FloatArray | None = None  #: standard deviations of ``offset_m``, (2,), metres
    #: ``neck_yaw`` and ``neck_pitch``, (2,), rad, relative to the torso; None without points of the
    #: face
    neck: FloatArray | None = None
    #: standard deviations of ``neck``, (2,), rad, those of the torso included
    neck_stddev: FloatArray | None = None
    #: state of each keypoint, (6,): ``tracked``; ``uncertain`` (it may be off by more than 30 cm);
    #: ``lost`` (it rather is); ``hidden`` (behind the trunk or outside of the images). ``tracking``
    #: has no ``uncertain`` or ``lost`` hand. None if the filter has none.
    keypoint_states: tuple[KeypointState, ...] | None = None
    #: probability of each keypoint to be off by more than 30 cm relative to the middle of the
    #: shoulders, (6,), or None
    keypoint_chances: FloatArray | None = None
    #: what these probabilities follow from, by name, one value for each keypoint, (6,)
    evidence: Mapping[str, FloatArray] | None = None
    #: rise of the left and right shoulder with the arms, (2,), metres; None without a posture
    clavicles_m: FloatArray | None = None
    #: standard deviations of ``clavicles_m``, (2,), metres
    clavicles_stddev_m: FloatArray | None = None
    #: how surely distance, scale and height are known, and by what; None if the filter keeps them
    #: constant. All states above are about the shape alone.
    place: Place | None = None
    #: standard deviation of the camera's pitch, rad, on which leans and angles with the floor rest
    pitch_stddev_rad: float | None = None
    reason: str = ""  #: why the state is ``uncertain``
    person: int | None = None  #: number of the person, 1, 2, ...; None if only one is tracked
    #: probability that it is the person who had this number before: 1 unless they were away; None
    #: if only one is tracked
    person_chance: float | None = None
    #: the left and the right hand, None for one that is not known; None unless hands are looked at
    hands: tuple[Hand | None, Hand | None] | None = None
    legs: Legs | None = None  #: None without a posture, and as long as no points have shown them
    #: frequency of which smoothing over time has left half; None if it is not smoothed
    smoothed_hz: float | None = None
    #: velocity, its deviation, acceleration and its deviation, (4, n), of each joint of
    #: ``STATE_NAMES``, then of the coordinates of keypoints, in rad, m and s; None unless smoothing
    #: was asked for them, and nan where they are unknown
    rates: FloatArray | None = None

    def contradicted(self) -> Estimate:
        """Return the estimate as one of cameras that contradict each other."""
        place = self.place and replace(self.place, contradiction=CONTRADICTED)
        if self.state != TRACKING:
            return replace(self, place=place)
        states = self.keypoint_states and doubted(self.keypoint_states)
        doubt = replace(self, state=UNCERTAIN, reason=CONTRADICTED, keypoint_states=states)
        return replace(doubt, place=place)

    @property
    def vertical_state(self) -> KeypointState | None:
        """``tracked`` or ``uncertain``: how surely leans are known; None without a posture."""
        if self.pitch_stddev_rad is None:
            return None
        is_found = self.pitch_stddev_rad <= FOUND_STDDEV
        return KeypointState.TRACKED if is_found else KeypointState.UNCERTAIN

    @property
    def upright_state(self) -> str:
        """``state``, which is ``uncertain`` where the vertical is: that of leans."""
        is_sure = self.vertical_state in (None, KeypointState.TRACKED)
        return self.state if is_sure or self.state != TRACKING else UNCERTAIN

    def as_camera_stands(self, roll_rad: float) -> Estimate:
        """Return the estimate in the frame of the rolled camera, not of images turned upright."""
        if not roll_rad or self.keypoints_m is None:
            return self
        turn = roll_turn(roll_rad)
        hands, legs = self.hands, self.legs
        if hands is not None:
            left, right = (one and one._replace(palm=one.palm @ turn) for one in hands)
            hands = left, right
        if legs is not None:
            legs = legs._replace(points_m=legs.points_m @ turn)
        rates = self.rates
        if rates is not None:
            joints, points = np.split(rates, [len(STATE)], axis=1)
            points = points.reshape(len(rates), -1, 3)
            stddev = np.sqrt(points[1::2] ** 2 @ turn**2)
            points = np.stack([points[0] @ turn, stddev[0], points[2] @ turn, stddev[1]])
            rates = np.hstack([joints, points.reshape(len(rates), -1)])
        keypoints_m = self.keypoints_m @ turn
        return replace(self, keypoints_m=keypoints_m, hands=hands, legs=legs, rates=rates)

    @cached_property
    def joints(self) -> FloatArray:
        """Values and deviations of ``STATE_NAMES``, (2, n), rad and m; nan where they are unknown.

        A place that the filter keeps constant is 0, as are shoulders that do not rise.
        """
        found, still = np.full((2, len(STATE)), np.nan), rows_of(Group.PLACE, Group.CLAVICLE)

        def put(rows: NDArray[np.intp], *pair: FloatArray | float | None) -> None:
            for row, values in zip(found, pair, strict=True):
                if values is not None:
                    row[rows] = values

        put(still, *(None if one is None else 0.0 for one in (self.posture, self.posture_stddev)))
        put(rows_of(*POSTURE_GROUPS), self.posture, self.posture_stddev)
        put(rows_of(Group.PLACE), self.offset_m, self.offset_stddev_m)
        put(rows_of(Group.NECK), self.neck, self.neck_stddev)
        put(rows_of(Group.CLAVICLE), self.clavicles_m, self.clavicles_stddev_m)
        for side, hand in zip(("left", "right"), self.hands or (), strict=False):
            if hand is not None:
                put(rows_of(Group.HAND, side=side), hand.joints, hand.joints_stddev)
        if self.legs is not None:
            put(rows_of(Group.LEG), self.legs.angles, self.legs.angles_stddev)
        return found

    @property
    def placed_posture(self) -> FloatArray:
        """Posture and place of the hips, (14,), or the posture (12,) alone if that is constant."""
        assert self.posture is not None
        if self.offset_m is None:
            return self.posture
        return np.concatenate([self.posture, self.offset_m])

    def placed(self, body: BodyModel) -> BodyModel:
        """Return ``body`` at the place of this estimate."""
        if self.offset_m is None:
            return body
        x_m, z_m = self.offset_m.tolist()
        place = body.placement
        return body.with_values(
            distance_m=place.distance_m - x_m, hip_height_m=place.hip_height_m + z_m
        )
