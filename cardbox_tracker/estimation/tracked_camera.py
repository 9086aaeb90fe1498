"""One camera of a tracker: view of the body, selection of the person, terms of the cost."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import N_STATE
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.detection.image_points import ImagePoints
from cardbox_tracker.estimation.config import TrackerConfig
from cardbox_tracker.estimation.cost.silhouette import rows_above_hips
from cardbox_tracker.estimation.cost.terms import USUAL_INTERVAL_S, Frame, Image, Silhouette, Term
from cardbox_tracker.estimation.cost.view import OtherCamera, View
from cardbox_tracker.estimation.depth_agreement import DepthAgreement
from cardbox_tracker.estimation.observation import Observation
from cardbox_tracker.estimation.person_region import PersonRegion
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.given_arrays import depth_from, image_from, silhouette_from


class TrackedCamera:
    """The first camera, or a further one whose images are turned upright.

    Attributes:
        view: the body in the frame of a further camera; None for the first camera.
        terms: terms of its cost in addition to the silhouette.
        depth: check that its depth images show the view of its silhouettes.
    """

    def __init__(
        self,
        body: BodyModel,
        first: Camera,
        config: TrackerConfig,
        other: OtherCamera | None = None,
    ) -> None:
        """Prepare for ``body`` in front of ``first``, with the pitch of the body model.

        Call :meth:`reset` before the first frame.

        Args:
            body: the person.
            first: the first camera.
            config: settings of the tracker.
            other: this camera if it is a further one; None for the first camera.

        Raises:
            CameraError: the person is not in front of the camera.
        """
        self.view = None if other is None else View.of(body, first, other)
        raw = first if other is None else other.camera
        self._size = raw.height, raw.width
        self._name = "the first camera" if other is None else "a further camera"
        self._body = body if self.view is None else self.view.body
        self._camera = first if self.view is None else self.view.camera
        # The cost of a further camera limits the rows where the person is found.
        self._rows = rows_above_hips(body, first) if self.view is None else self._camera.height
        self.configure(config)
        self._region: PersonRegion | None = None
        self.depth = DepthAgreement()

    def configure(self, config: TrackerConfig) -> None:
        """Build the terms from other settings."""
        self.terms: list[Term] = [term.build(self._body, self._camera) for term in config.terms]

    def reset(self, config: TrackerConfig) -> None:
        """Forget the region of the person in the images."""
        self._region = PersonRegion(self._body, self._camera) if config.select_person else None

    def frame(
        self,
        observation: Observation | None,
        before: FloatArray | None,
        is_sure: bool,
        interval_s: float = USUAL_INTERVAL_S,
    ) -> Frame:
        """Return the frame of an observation: upright, with the person's part of the silhouette.

        Args:
            observation: data of the camera; without a silhouette, the frame is empty.
            before: state of the previous frame, (12,) or (14,), for the first camera; None at the
                start of tracking.
            is_sure: whether that state fitted.
            interval_s: time since the previous frame, s.

        Raises:
            ValueError: the size of an array is not the camera's, its type or values are impossible
                (:mod:`~cardbox_tracker.vision.given_arrays`), or the points are no ImagePoints.
        """
        observation = None if observation is None else self._checked(observation)
        posture, depth_m = before, None
        stamp_ns = None if observation is None else observation.stamp_ns
        if self.view is None:
            depth_m = None if observation is None else observation.depth_m
        elif before is not None:
            posture = self.view.states(before) if len(before) == N_STATE else None
        if observation is None or observation.silhouette is None:
            nothing = np.zeros((self._camera.height, self._camera.width), np.uint8)
            return Frame(nothing, self._rows, 0, None, posture, depth_m, interval_s, stamp_ns)
        points = observation.points
        silhouette, image = observation.silhouette, observation.image
        if self.view is not None:
            silhouette, image = _upright(self.view, silhouette, image)
            if points is not None:
                points = replace(points, px=self.view.upright_px(points.px))
        if self._region is not None:
            silhouette = self._region.select(silhouette, posture, is_sure, image)
        depth_m = self.depth.accepted(silhouette, depth_m)
        upper = np.ascontiguousarray(silhouette[: self._rows])
        foreground_px = cv2.countNonZero(upper)
        seen = silhouette, self._rows, foreground_px, image
        return Frame(*seen, posture, depth_m, interval_s, stamp_ns, points)

    def _checked(self, given: Observation) -> Observation:
        """Return an observation with arrays that compiled code can take."""
        points, depth_m = given.points, None
        if points is not None and not isinstance(points, ImagePoints):
            raise ValueError(
                f"points are of the type {type(points).__name__}; expected ImagePoints, such as "
                "ImagePoints.of(...), or None"
            )
        if self.view is None and given.depth_m is not None:
            depth_m = depth_from(given.depth_m, f"depth_m of {self._name}", self._size)
        silhouette, image = given.silhouette, given.image
        if silhouette is not None:
            silhouette = silhouette_from(silhouette, f"silhouette of {self._name}", self._size)
        if image is not None:
            image = image_from(image, f"image of {self._name}", self._size)
        return Observation(silhouette, image, depth_m, given.stamp_ns, points)


def _upright(
    view: View, silhouette: Silhouette, image: Image | None
) -> tuple[Silhouette, Image | None]:
    """Return silhouette and image turned upright; the image is only filled at the foreground."""
    silhouette = view.upright(silhouette, is_mask=True)
    if image is None:
        return silhouette, None
    return silhouette, view.upright(image, box=cv2.boundingRect(silhouette))
