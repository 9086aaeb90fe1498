"""What the background node publishes of an image: silhouette, the image itself, and its camera."""

from __future__ import annotations

import numpy as np
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.messages.conversions import ImageArray
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.vision.camera import Camera


class SilhouetteOutput:
    """Publishes on ``silhouette`` and below it.

    Attributes:
        covered: share of the last image that is foreground.
    """

    def __init__(self, node: CardboxNode) -> None:
        """Advertise with ``node``."""
        self._silhouette = node.advertise_inside(Image, "silhouette", qos.SILHOUETTE)
        self._images = node.advertise_inside(Image, "silhouette/image", qos.SILHOUETTE)
        self._infos = node.advertise_inside(CameraInfo, "silhouette/camera_info", qos.SILHOUETTE)
        self.covered = 0.0

    def show(self, header: Header, image: ImageArray) -> None:
        """Publish the image, if somebody wants it: before its silhouette, which waits for it."""
        if self._images.get_subscription_count():
            self._images.publish(conversions.image_message(header, image))

    def send(
        self, header: Header, silhouette: ImageArray, camera: Camera, info: CameraInfo | None
    ) -> None:
        """Publish a silhouette (H, W), 0 or 255, of ``camera``, whose images have ``info``."""
        # The silhouette first, so that the tracker does not wait for a CameraInfo that rarely
        # changes.
        self._silhouette.publish(conversions.image_message(header, silhouette, "mono8"))
        self._infos.publish(conversions.camera_info_message(header, camera, info))
        self.covered = np.count_nonzero(silhouette) / silhouette.size
