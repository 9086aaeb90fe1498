"""One camera of a tracker: its view of the body, the person in its images, its terms."""

from __future__ import annotations

import cv2
import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import N_JOINTS
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.config import TrackerConfig
from cardbox_tracker.estimation.cost.silhouette import rows_above_hips
from cardbox_tracker.estimation.cost.terms import USUAL_INTERVAL_S, Frame, Image, Silhouette, Term
from cardbox_tracker.estimation.cost.view import OtherCamera, View
from cardbox_tracker.estimation.observation import Observation
from cardbox_tracker.estimation.person_region import PersonRegion
from cardbox_tracker.vision.camera import Camera


class TrackedCamera:
    """The first camera, or a further one whose images are turned upright.

    Attributes:
        view: how a further camera sees the body; None of the first camera.
        terms: the further terms of its cost.
    """

    def __init__(
        self,
        body: BodyModel,
        first: Camera,
        config: TrackerConfig,
        other: OtherCamera | None = None,
    ) -> None:
        """Prepare for ``body``, which stands before ``first``, pitched as it stands.

        Call :meth:`reset` before the first frame.

        Args:
            body: the person.
            first: the first camera.
            config: settings of the tracker.
            other: the further camera that this one is; None: it is the first one.

        Raises:
            CameraError: the person is not in front of the camera.
        """
        self.view = None if other is None else View.of(body, first, other)
        raw = first if other is None else other.camera
        self._size = raw.height, raw.width
        self._name = "the first camera" if other is None else "a further camera"
        self._body = body if self.view is None else self.view.body
        self._camera = first if self.view is None else self.view.camera
        # Rows of a further camera are cut by its own cost, where the person is found.
        self._rows = rows_above_hips(body, first) if self.view is None else self._camera.height
        self.configure(config)
        self._region: PersonRegion | None = None

    def configure(self, config: TrackerConfig) -> None:
        """Build the terms anew."""
        self.terms: list[Term] = [term.build(self._body, self._camera) for term in config.terms]

    def reset(self, config: TrackerConfig) -> None:
        """Forget which part of the images is the person."""
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
            observation: what the camera saw; without a silhouette, the frame shows nobody.
            before: state of the frame before, (12,) or (14,) of the first camera; None where
                tracking starts.
            is_sure: whether that state fitted.
            interval_s: since the frame before, s.

        Raises:
            ValueError: the silhouette or the image has not the camera's size.
        """
        posture, depth_m = before, None
        stamp_ns = None if observation is None else observation.stamp_ns
        if self.view is None:
            depth_m = None if observation is None else observation.depth_m
        elif before is not None:
            posture = self.view.states(before) if len(before) == N_JOINTS + 2 else None
        if observation is None or observation.silhouette is None:
            nothing = np.zeros((self._camera.height, self._camera.width), np.uint8)
            return Frame(nothing, self._rows, 0, None, posture, depth_m, interval_s, stamp_ns)
        self._check(observation)
        silhouette, image = observation.silhouette, observation.image
        if self.view is not None:
            silhouette, image = _upright(self.view, silhouette, image)
        if self._region is not None:
            silhouette = self._region.select(silhouette, posture, is_sure, image)
        upper = np.ascontiguousarray(silhouette[: self._rows])
        foreground_px = cv2.countNonZero(upper)
        seen = silhouette, self._rows, foreground_px, image
        return Frame(*seen, posture, depth_m, interval_s, stamp_ns)

    def _check(self, observation: Observation) -> None:
        for name, pixels, most in (
            ("silhouette", observation.silhouette, 2),
            ("image", observation.image, 3),
        ):
            if pixels is not None and (pixels.shape[:2] != self._size or pixels.ndim > most):
                raise ValueError(
                    f"{name} has shape {pixels.shape}; the camera's is {self._size}, of "
                    f"{self._name}"
                )


def _upright(
    view: View, silhouette: Silhouette, image: Image | None
) -> tuple[Silhouette, Image | None]:
    """Return silhouette and image turned upright; the image only where there is foreground."""
    silhouette = view.upright(silhouette, is_mask=True)
    if image is None:
        return silhouette, None
    return silhouette, view.upright(image, box=cv2.boundingRect(silhouette))
