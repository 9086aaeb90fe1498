"""A camera beside the first one while tracking: its view, what of it is the person, its terms."""

from __future__ import annotations

import cv2
import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.config import TrackerConfig
from cardbox_tracker.estimation.cost.terms import Frame, Image, Silhouette, Term
from cardbox_tracker.estimation.cost.view import OtherCamera, View
from cardbox_tracker.estimation.person_region import PersonRegion
from cardbox_tracker.vision.camera import Camera


class FurtherCamera:
    """One further camera before one body.

    Attributes:
        view: how it sees the body.
        terms: the further terms of its cost.
    """

    def __init__(
        self, body: BodyModel, first: Camera, camera: OtherCamera, config: TrackerConfig
    ) -> None:
        """Prepare for ``body``, which stands before ``first``, pitched as it stands.

        Raises:
            CameraError: the person is not in front of the camera.
        """
        self._size = camera.camera.height, camera.camera.width
        self.view = View.of(body, first, camera)
        self.configure(config)
        self.reset(config)

    def configure(self, config: TrackerConfig) -> None:
        """Build the terms anew."""
        view = self.view
        self.terms: list[Term] = [term.build(view.body, view.camera) for term in config.terms]

    def reset(self, config: TrackerConfig) -> None:
        """Forget what in its images is the person."""
        view = self.view
        self._region = PersonRegion(view.body, view.camera) if config.select_person else None

    def frame(
        self,
        silhouette: Silhouette | None,
        image: Image | None,
        before: FloatArray | None,
        is_sure: bool,
    ) -> Frame:
        """Return what this camera sees, turned upright; nothing without a silhouette.

        Args:
            silhouette: (H, W), 0 or 255, of the camera's size.
            image: (H, W) grey or (H, W, 3) bgr of the same time.
            before: posture of the frame before, (12,) or (14,) of the first camera.
            is_sure: that it fitted.

        Raises:
            ValueError: silhouette or image has not the camera's size.
        """
        view = self.view
        if silhouette is None:
            return Frame(np.zeros((view.camera.height, view.camera.width), np.uint8), 0, 0)
        for what, given in (("silhouette", silhouette), ("image", image)):
            if given is not None and given.shape[:2] != self._size:
                raise ValueError(
                    f"{what} of a further camera is {given.shape[:2]}; expected {self._size}"
                )
        silhouette = view.upright(silhouette, is_mask=True)
        if image is not None:
            # What is not foreground is not asked for.
            image = view.upright(image, box=cv2.boundingRect(silhouette))
        posture = None if before is None or len(before) != 14 else view.states(before)
        if self._region is not None:
            silhouette = self._region.select(silhouette, posture, is_sure, image)
        foreground_px = int(np.count_nonzero(silhouette))
        return Frame(silhouette, view.camera.height, foreground_px, image, posture)
