"""One camera of a tracker: view of the body, selection of the person, terms of the cost."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.view import OtherCamera, View
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.terms.kernel_arguments import body_tuple
from cardbox_tracker.terms.silhouette import rows_above_hips
from cardbox_tracker.terms.term import USUAL_INTERVAL_S, Frame, Posed, Silhouette, Term
from cardbox_tracker.tracking.depth_agreement import DepthAgreement
from cardbox_tracker.tracking.observation import CHANNELS, Observation
from cardbox_tracker.tracking.person_masks import PersonDrawer
from cardbox_tracker.tracking.person_region import PersonRegion


class TrackedCamera:
    """The first camera, or a further one whose images are turned upright.

    Attributes:
        view: the body in the frame of a further camera; None for the first camera.
        posable: the body before this camera, as argument of the kernels.
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
        """Prepare for ``body`` before ``first``, with its pitch; ``other`` is a further camera.

        Call :meth:`reset` before the first frame. Raises CameraError if the person is not in front.
        """
        self.view = None if other is None else View.of(body, first, other)
        raw = first if other is None else other.camera
        self._size = raw.height, raw.width
        self._name = "the first camera" if other is None else "a further camera"
        self._body = body if self.view is None else self.view.body
        self._camera = first if self.view is None else self.view.camera
        # The cost of a further camera limits the rows where the person is found.
        self._rows = rows_above_hips(body, first) if self.view is None else self._camera.height
        self.posable = body_tuple(self._body, self._camera)
        self.configure(config)
        self._region: PersonRegion | None = None
        self._drawer: PersonDrawer | None = None
        self.depth = DepthAgreement()

    def configure(self, config: TrackerConfig) -> None:
        """Build the terms from other settings."""
        built = (settings.build(self._body, self._camera) for settings in config.terms)
        self.terms: list[Term] = [term for term in built if term is not None]

    def reset(self, config: TrackerConfig) -> None:
        """Forget the region of the person in the images."""
        self._region = PersonRegion(self._body, self._camera) if config.select_person else None

    def drawn(self, state: FloatArray) -> Silhouette:
        """Return the pixels (H, W), 0 or 255, of a state (14,) for the first camera, coarsely."""
        if self._drawer is None:
            self._drawer = PersonDrawer(self._body, self._camera)
        if self.view is not None:
            state = self.view.states(state)
        cells, side = self._drawer.masks(state, 0.0).core, self._drawer.cell_px
        pixels = np.repeat(np.repeat(cells, side, axis=0), side, axis=1)
        drawn: Silhouette = 255 * pixels[: self._camera.height, : self._camera.width]
        if self.view is not None and self.view.turn is not None:
            drawn = np.asarray(cv2.warpAffine(drawn, self.view.raw_px, self._size[::-1]), np.uint8)
        return drawn

    def frame(
        self,
        observation: Observation | None,
        before: FloatArray | None,
        is_sure: bool,
        interval_s: float = USUAL_INTERVAL_S,
    ) -> Frame:
        """Return the frame of an observation: upright, with the person's part of the silhouette.

        It is empty without a silhouette. ``before`` is the state (14,) of the previous frame for
        the first camera, None at first, and ``is_sure`` whether it fitted. Raises ValueError if
        data do not fit the camera, see :data:`~.observation.CHANNELS`.
        """
        if before is not None and self.view is not None:
            before = self.view.states(before)
        channels, camera = self._channels(observation), self._camera
        if "silhouette" not in channels:
            nothing = np.zeros((camera.height, camera.width), np.uint8)
            channels = {"silhouette": nothing}
        elif self._region is not None:
            channels["silhouette"] = self._region.select(
                channels["silhouette"], before, is_sure, channels.get("image")
            )
        silhouette = channels["silhouette"]
        if self.depth.accepted(silhouette, channels.get("depth_m")) is None:
            channels.pop("depth_m", None)
        return Frame(
            camera,
            channels,
            self._rows,
            cv2.countNonZero(np.ascontiguousarray(silhouette[: self._rows])),
            None if before is None else Posed(self.posable, before[None]),
            interval_s,
            None if observation is None else observation.stamp_ns,
        )

    def _channels(self, observation: Observation | None) -> dict[str, Any]:
        """Return the data of all channels, checked and turned upright."""
        channels = {}
        for name, given in ({} if observation is None else observation.channels).items():
            data = CHANNELS[name].checked(given, f"{name} of {self._name}", self._size)
            channels[name] = data if self.view is None else CHANNELS[name].upright(self.view, data)
        return channels
