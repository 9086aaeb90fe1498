"""One camera of a tracker: view of the body, selection of the person, check of depth, terms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.view import OtherCamera, View
from cardbox_tracker.common.health import Verdict
from cardbox_tracker.detectors.figure import Figure, figure_of_points
from cardbox_tracker.detectors.identity import Identity, colours_in
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.terms.joint_points import projected
from cardbox_tracker.terms.joint_points_kernels import ELBOW, HIPS, POINTS_OF_ARM, SHOULDER, WRIST
from cardbox_tracker.terms.kernel_arguments import body_tuple
from cardbox_tracker.terms.silhouette import rows_above_hips
from cardbox_tracker.terms.term import (
    USUAL_INTERVAL_S,
    DepthImage,
    Frame,
    Image,
    Posed,
    Silhouette,
    Term,
)
from cardbox_tracker.tracking.observation import CHANNELS, Observation
from cardbox_tracker.tracking.person_masks import PersonDrawer
from cardbox_tracker.tracking.person_region import PersonRegion

# Pixels between a point of the outline and each pixel of its pair, as a share of the image's width.
_AWAY = 0.02
# Least jump, m, and share of the depth by which a sensor's noise may exceed it.
_JUMP_M, _JUMP_SHARE = 0.06, 0.02
# Fewest pairs of an image that count, and largest number that are compared.
_LEAST_PAIRS, _MOST_PAIRS = 20, 120
# Images between samples.
_EVERY = 3
# Points of a figure by their rows in :func:`projected`.
_PROJECTED = {
    f"{side}_{name}": first + row
    for side, first in (("left", 0), ("right", POINTS_OF_ARM))
    for name, row in (("shoulder", SHOULDER), ("elbow", ELBOW), ("wrist", WRIST))
} | {"left_hip": HIPS, "right_hip": HIPS}


def surplus_of_jumps(silhouette: Silhouette, depth_m: DepthImage) -> float | None:
    """Return how much oftener the depth grows than shrinks across the outline, -1 to 1, or None.

    The value is a share of the pairs with a known depth, of which there must be some. A pixel
    without one counts as far away, because depth images may show the person alone. The silhouette
    is (H, W), 0 or 255; the depth (H, W), metres.
    """
    inner, outer = _pairs(silhouette)
    here, there = (
        np.where(np.isfinite(one) & (one > 0.0), one, np.inf)
        for one in (depth_m[at[:, 1], at[:, 0]] for at in (inner, outer))
    )
    nearer = np.minimum(here, there)
    if np.count_nonzero(nearer < np.inf) < _LEAST_PAIRS:
        return None
    jump_m = np.maximum(_JUMP_M, _JUMP_SHARE * nearer)
    grows, shrinks = there > here + jump_m, here > there + jump_m
    return float((grows.sum() - shrinks.sum()) / np.count_nonzero(nearer < np.inf))


def _pairs(silhouette: Silhouette) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return columns and rows of the inner and outer pixels, (N, 2) each, of one outline."""
    contours, _ = cv2.findContours(silhouette, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return np.zeros((0, 2), np.int64), np.zeros((0, 2), np.int64)
    outline = max(contours, key=len)[:, 0, :].astype(np.float64)
    height, width = silhouette.shape
    away = max(2.0, _AWAY * width)
    reach = max(2, round(away))
    # OpenCV walks down the left side of a region and up its right side.
    along = np.roll(outline, -reach, axis=0) - np.roll(outline, reach, axis=0)
    length = np.hypot(along[:, 0], along[:, 1])
    outward = np.column_stack([-along[:, 1], along[:, 0]]) / np.maximum(length, 1e-9)[:, None]
    some = slice(None, None, max(1, len(outline) // _MOST_PAIRS))
    inner = np.rint(outline[some] - away * outward[some]).astype(np.int64)
    outer = np.rint(outline[some] + away * outward[some]).astype(np.int64)
    last = np.array([width - 1, height - 1])
    is_inside = ((inner >= 0) & (inner <= last) & (outer >= 0) & (outer <= last)).all(axis=1)
    inner, outer = inner[is_inside], outer[is_inside]
    # At corners and thin parts a pair may not lie on both sides.
    is_across = (silhouette[inner[:, 1], inner[:, 0]] > 0) & (
        silhouette[outer[:, 1], outer[:, 0]] == 0
    )
    return inner[is_across], outer[is_across]


class DepthAgreement(Verdict):
    """Says over about a second whether depth images show the view of the silhouettes.

    Those of another camera may have the same size. In the same view, the depth grows outwards at
    the outline of a person; elsewhere it shrinks as often (``docs/research.md#several-cameras``).
    """

    def __init__(self) -> None:
        """Trust the depth until images contradict it."""
        super().__init__("other view")
        self._frames = 0

    def accepted(self, silhouette: Silhouette, depth_m: DepthImage | None) -> DepthImage | None:
        """Return the depth image (H, W), metres; None if it belongs to another view."""
        if depth_m is None:
            return None
        self._frames += 1
        if self._frames % _EVERY == 0:
            surplus = surplus_of_jumps(silhouette, depth_m)
            if surplus is not None:
                self.see(100.0 * surplus)
        return None if self.holds else depth_m


class TrackedCamera:
    """The first camera, or a further one whose images are turned upright.

    Attributes:
        view: the body in the frame of a further camera; None for the first camera.
        posable: the body before this camera, as argument of the kernels.
        terms: terms of its cost in addition to the silhouette.
        depth: check that its depth images show the view of its silhouettes.
        identity: who is followed in its images.
        given: names of the channels that had data so far.
        column: middle of all foreground of a further camera, px; None if it touches a side.
        picture: returns the last image at its full resolution; None without one.
    """

    def __init__(
        self,
        body: BodyModel,
        first: Camera,
        config: TrackerConfig,
        other: OtherCamera | None = None,
    ) -> None:
        """Prepare for ``body`` before ``first``, with its pitch; ``other`` is a further camera.

        Raises CameraError if the person is not in front.
        """
        self._other = other
        raw = first if other is None else other.camera
        self._size = raw.height, raw.width
        self._name = "the first camera" if other is None else "a further camera"
        self.identity, self.given, self._sees_other = Identity(), set[str](), False
        self.picture: Callable[[], Image] | None = None
        self.column: float | None = None
        self.use(body, first, config)

    def use(self, body: BodyModel, first: Camera, config: TrackerConfig) -> None:
        """Go on with another version of the body, as at the start; the person is the same."""
        self.view = None if self._other is None else View.of(body, first, self._other)
        self._body = body if self.view is None else self.view.body
        self._camera = first if self.view is None else self.view.camera
        # The cost of a further camera limits the rows where the person is found.
        self._rows = rows_above_hips(body, first) if self.view is None else self._camera.height
        self.posable = body_tuple(self._body, self._camera)
        self.configure(config)
        self._select(config)
        self._drawer: PersonDrawer | None = None
        self.depth = DepthAgreement()

    def configure(self, config: TrackerConfig) -> None:
        """Build the terms from other settings."""
        built = (settings.build(self._body, self._camera) for settings in config.terms)
        self.terms: list[Term] = [term for term in built if term is not None]

    def reset(self, config: TrackerConfig) -> None:
        """Forget the person, and their region in the images."""
        self.identity.forget()
        self._sees_other = False
        self._select(config)

    def _select(self, config: TrackerConfig) -> None:
        self._region = PersonRegion(self._body, self._camera) if config.select_person else None

    def _here(self, state: FloatArray) -> FloatArray:
        """Return a state (14,) for the first camera as one for this camera."""
        return state if self.view is None else self.view.states(state)

    def drawn(self, state: FloatArray) -> Silhouette:
        """Return the pixels (H, W), 0 or 255, of a state (14,) for the first camera, coarsely."""
        if self._drawer is None:
            self._drawer = PersonDrawer(self._body, self._camera)
        cells, side = self._drawer.masks(self._here(state), 0.0).core, self._drawer.cell_px
        pixels = np.repeat(np.repeat(cells, side, axis=0), side, axis=1)
        drawn: Silhouette = 255 * pixels[: self._camera.height, : self._camera.width]
        if self.view is not None and self.view.turn is not None:
            drawn = np.asarray(cv2.warpAffine(drawn, self.view.raw_px, self._size[::-1]), np.uint8)
        return drawn

    def figure(self, state: FloatArray) -> Figure:
        """Return the figure, in the image as it comes, of a state (14,) for the first camera."""
        px = projected(Posed(self.posable, self._here(state)[None]))[:, :2]
        if self.view is not None:
            px = px @ self.view.raw_px[:, :2].T + self.view.raw_px[:, 2]
        return Figure({name: px[row] for name, row in _PROJECTED.items()})

    def frame(
        self,
        observation: Observation | None,
        before: FloatArray | None,
        is_sure: bool,
        interval_s: float = USUAL_INTERVAL_S,
        now_ns: int = 0,
    ) -> Frame:
        """Return the frame of an observation: upright, with the person's silhouette and points.

        It is empty without a silhouette. ``before`` is the state (14,) of the previous frame for
        the first camera, None at first, and ``is_sure`` whether it fitted. ``now_ns`` is the time
        of points without a stamp. Raises ValueError if data do not fit the camera, see
        :data:`~.observation.CHANNELS`.
        """
        before = None if before is None else self._here(before)
        self.picture = None if observation is None else observation.picture
        channels, camera = self._channels(observation), self._camera
        self.given |= channels.keys()
        self.column = None
        if "silhouette" not in channels:
            nothing = np.zeros((camera.height, camera.width), np.uint8)
            channels = {"silhouette": nothing}
        elif self._region is not None:
            self.column = None if self.view is None else middle(channels["silhouette"])
            channels["silhouette"] = self._region.select(
                channels["silhouette"], before, is_sure, channels.get("image")
            )
        silhouette, points = channels["silhouette"], channels.get("points")
        if self.depth.accepted(silhouette, channels.get("depth_m")) is None:
            channels.pop("depth_m", None)
        self._sees_other = False
        if points is not None and not points.is_empty:
            figure = figure_of_points(points)
            # The silhouette lacks whoever is far from the last posture.
            colours = colours_in(channels.get("image"), figure.trunk(silhouette.shape))
            seen_ns = now_ns if points.stamp_ns is None else points.stamp_ns
            if not self.identity.is_same(figure, colours, seen_ns):
                self._sees_other = True
                del channels["points"]
        posed = None if before is None else Posed(self.posable, before[None])
        stamp_ns = None if observation is None else observation.stamp_ns
        return self.counted(Frame(camera, channels, 0, 0, posed, interval_s, stamp_ns))

    def counted(self, frame: Frame) -> Frame:
        """Return a frame with the rows above the hips of the body, and the foreground in them."""
        upper = np.ascontiguousarray(frame.silhouette[: self._rows])
        return frame.changed(rows=self._rows, foreground_px=cv2.countNonZero(upper))

    def shows_other(
        self, frame: Frame, state: FloatArray | None, now_ns: int, is_sure: bool
    ) -> bool:
        """Return whether the person in the first camera's last frame is somebody else.

        That is so if its points were those of somebody else and there is no ``state`` (14,). A
        state without points must be where the person can be, with their colours, which are those
        of states that are sure.
        """
        if self.identity.is_new or state is None:
            return self._sees_other
        if frame.points is not None and not frame.points.is_empty:
            return False
        figure, silhouette = self.figure(state), frame.silhouette
        trunk = figure.trunk(silhouette.shape)
        is_seen, colours = (trunk & silhouette).any(), colours_in(frame.image, trunk)
        return not is_seen or not self.identity.is_same(figure, colours, now_ns, is_sure)

    def _channels(self, observation: Observation | None) -> dict[str, Any]:
        """Return the data of all channels, checked and turned upright."""
        channels = {}
        for name, given in ({} if observation is None else observation.channels).items():
            data = CHANNELS[name].checked(given, f"{name} of {self._name}", self._size)
            channels[name] = data if self.view is None else CHANNELS[name].upright(self.view, data)
        return channels


def middle(silhouette: Silhouette) -> float | None:
    """Return the mean column of the foreground (H, W), px; None without, or at a side."""
    # A third of the time of numpy's count.
    columns = cv2.reduce(silhouette, 0, cv2.REDUCE_SUM, dtype=cv2.CV_32S).ravel().astype(np.int64)
    if not columns.any() or columns[0] or columns[-1]:
        return None
    return float(columns @ np.arange(len(columns)) / columns.sum())
