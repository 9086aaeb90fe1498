"""The model over what each of several cameras sees: one overlay below each namespace."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from sensor_msgs.msg import Image

from cardbox_tracker.body.posture import PLACE, POSTURE
from cardbox_tracker.drawing.overlay import draw_overlay
from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.outputs import place_of
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.nodes.camera_views import Views
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode


class CameraOverlays:
    """The overlays of several cameras; each is drawn only while somebody looks at it."""

    def __init__(self, node: CardboxNode, cameras: Sequence[str]) -> None:
        """Advertise ``overlay`` below each of the namespaces ``cameras``."""
        self._publishers = [
            node.advertise(Image, f"{camera.rstrip('/')}/overlay", qos.SENSOR_DATA)
            for camera in cameras
            if camera
        ]

    def publish(self, views: Views, estimate: Estimate, tracker: Tracker) -> None:
        """Draw the estimate over the images, or else the silhouettes, that it was made from."""
        for number, publisher in enumerate(self._publishers):
            header, silhouette = views.headers[number], views.silhouettes[number]
            if header is None or silhouette is None or not publisher.get_subscription_count():
                continue
            image = views.images[number]
            picture = silhouette if image is None else image
            drawn = _draw(number, picture, estimate, tracker)
            publisher.publish(conversions.image_message(header, drawn, "bgr8"))


def _draw(
    number: int, picture: conversions.ImageArray, estimate: Estimate, tracker: Tracker
) -> conversions.ImageArray:
    if number == 0:
        return draw_overlay(picture, tracker.body, tracker.camera, estimate)
    # A further camera is turned upright, as the tracker sees it.
    view = tracker.views[number - 1]
    if estimate.posture is not None and estimate.keypoints_m is not None:
        state = view.states(np.concatenate([estimate.posture, place_of(estimate)]))
        points_m = view.points(tracker.camera.optical_to_reference(estimate.keypoints_m))
        estimate = replace(
            estimate,
            posture=state[POSTURE],
            offset_m=state[PLACE],
            keypoints_m=view.camera.reference_to_optical(points_m),
        )
    return draw_overlay(view.upright(picture), view.body, view.camera, estimate)
