"""Frames, and the contract of a term of the cost.

A tracker's cost is a sum of terms, each in pixels of the image: silhouette, colours, depth, points,
or your own (``docs/extending.md``). Data flows through four types:

    settings.build(person, camera) -> Term           once, for each camera of the tracker
    term.observe(frame) -> TermObservation           once for each image of that camera
    observation.rate(posed) -> px (N,)               many times, for states before that camera
    observation.residuals(states) -> Residuals       for the refiner, if the term has any

Everything that a term gets belongs to *its* camera: the frame's channels are turned upright, and
the states of ``posed`` are in that camera's level frame. So a term neither knows nor needs the
number of cameras. An observation never changes, so several searches may share it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.least_squares import Residuals
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.person.kinematics import keypoints_of_states
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import LEFT_ARM, RIGHT_ARM
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.kernel_arguments import BodyTuple, Drawn

Silhouette = NDArray[np.uint8]
Image = NDArray[np.uint8]
DepthImage = NDArray[np.float32]

USUAL_INTERVAL_S = 1.0 / 15.0
"""Interval between frames without stamps, s."""

ARMS = {"left": LEFT_ARM, "right": RIGHT_ARM}
"""Slice of each arm's joints in a posture."""

WHOLE: Drawn = (True, True, True)
TRUNK: Drawn = (True, False, False)
ARM: tuple[Drawn, Drawn] = (False, True, False), (False, False, True)
"""Which of trunk, left arm and right arm count; ``ARM[0]`` is the left arm."""

TorsoCosts = Callable[[FloatArray], FloatArray]
"""Takes torsos d1..d4, (N, 4), rad and metres; returns costs (N,), px."""

ArmCosts = Callable[[str, FloatArray], FloatArray]
"""Takes ``left`` or ``right`` and that arm's joints, (N, 4), rad; returns costs (N,), px."""


class Posed:
    """States of one person before one camera, and the parts of the body that are rated.

    A search first rates trunks, then arms beside one trunk, then whole bodies. Joints of parts that
    do not count are nan, so that a term may add up what it knows.

    Attributes:
        body: fields of :class:`~.kernel_arguments.Body`: the person placed before this camera, and
            the camera.
        states: d1..d12, ``torso_x`` and ``torso_z``, (N, 14), rad and metres, in the level frame of
            this camera.
        parts: whether trunk, left arm and right arm count.
        lifted: state (14,) whose arms raise the shoulders of trunks that are rated without arms.
    """

    def __init__(
        self,
        body: BodyTuple,
        states: FloatArray,
        parts: Drawn = WHOLE,
        lifted: FloatArray | None = None,
    ) -> None:
        """Pose a body; joints are computed when a term first asks for them."""
        self.body, self.states, self.parts, self.lifted = body, states, parts, lifted

    def __len__(self) -> int:
        """Return the number of states."""
        return len(self.states)

    @property
    def arms_of(self) -> FloatArray:
        """States (N, 14) or (1, 14) whose arms raise the shoulders."""
        return self.states if self.lifted is None else self.lifted[None]

    @cached_property
    def keypoints_m(self) -> FloatArray:
        """Joints ordered as ``KEYPOINT_NAMES``, (N, 6, 3), metres in the camera's optical frame."""
        points = np.empty((len(self.states), 6, 3))
        parts, _, girdle, place, lens = self.body
        bones = parts, girdle, place, lens[4:]
        keypoints_of_states(self.states, self.arms_of, self.parts, bones, points)
        return points

    @cached_property
    def keypoints_px(self) -> FloatArray:
        """The same joints in the image, column and row, (N, 6, 2), px."""
        fx, fy, cx, cy = self.body[4][:4]
        ahead_m = np.maximum(self.keypoints_m[..., 2:], 1e-3)
        pixels: FloatArray = self.keypoints_m[..., :2] / ahead_m * (fx, fy) + (cx, cy)
        return pixels


@dataclass(frozen=True, eq=False)
class Frame:
    """The data of one camera at one time."""

    camera: Camera  #: the working camera, upright
    #: data by the names of :data:`~cardbox_tracker.tracking.observation.CHANNELS`, turned upright;
    #: ``frame[name]`` is None without data. There is always a silhouette, (H, W), 0 or 255, of the
    #: camera's size; do not write to it.
    channels: Mapping[str, Any]
    rows: int  #: number of rows of the silhouette that count, from the top to the hips
    foreground_px: int  #: foreground pixels in those rows
    #: the posture of the previous frame before this camera; None at the start of tracking.
    before: Posed | None = None
    interval_s: float = USUAL_INTERVAL_S  #: time since the previous frame, s
    stamp_ns: int | None = None  #: time of the frame, ns; None if it is unknown
    lean_rad: float = 0.0  #: lean of the trunk that the person's legs let expect

    def __getitem__(self, channel: str) -> Any:
        """Return the data of a channel; None without data."""
        return self.channels.get(channel)

    @property
    def silhouette(self) -> Silhouette:
        """The person's silhouette, (H, W), 0 or 255."""
        silhouette: Silhouette = self.channels["silhouette"]
        return silhouette

    @property
    def image(self) -> Image | None:
        """(H, W) grey or (H, W, 3) bgr, undistorted; None without one."""
        found: Image | None = self["image"]
        return found

    @property
    def depth_m(self) -> DepthImage | None:
        """(H, W), metres along the optical axis; unknown depths are 0; None without one."""
        found: DepthImage | None = self["depth_m"]
        return found

    @property
    def points(self) -> ImagePoints | None:
        """The person's joints in the image, from a detector; None without one."""
        found: ImagePoints | None = self["points"]
        return found

    def changed(self, **values: Any) -> Frame:
        """Return the frame with other attributes."""
        return replace(self, **values)


class TermObservation:
    """The evidence of one term in one frame. A term overrides what it knows.

    Attributes:
        locates: whether the residuals tell where joints are. Then states that fit them are
            proposed, and the search needs fewer others.
        shows_back: whether the person faces the other way than in the last states; at the start of
            tracking, away from the camera.
        shows_legs: whether the person's legs are in the image.
    """

    locates = False
    shows_legs = False
    shows_back = False

    def rate(self, posed: Posed) -> FloatArray:
        """Return the costs (N,) of the parts that count, px."""
        return np.zeros(len(posed))

    def residuals(self, posed: Posed) -> Residuals | None:
        """Return residuals of whole bodies for the refiner; None without any."""
        return None

    def evidence(self, posed: Posed) -> Mapping[str, FloatArray]:
        """Return what tells that a result, one state, may be wrong: by name, of keypoints (6,).

        The doubt (:mod:`.doubt`) has its coefficients.
        """
        return MappingProxyType({})


class Term(Protocol):
    """One summand of the cost of a posture, for one person before one camera."""

    def observe(self, frame: Frame) -> TermObservation | None:
        """Return the observation of ``frame``; None if the frame has nothing for this term."""


class TermSettings(Protocol):
    """The settings of a term, an element of ``TrackerConfig.terms``."""

    def build(self, person: BodyModel, camera: Camera) -> Term | None:
        """Return the term for a person before an upright working camera, or None.

        It is None if the term can say nothing. With several cameras it is called once for each;
        ``person`` is then placed before ``camera``.
        """
