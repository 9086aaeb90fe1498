"""The topics of silhouettes, which the nodes ``background`` and ``detector`` share."""

from __future__ import annotations

import numpy as np
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.messages.conversions import ImageArray
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode


class SilhouetteOutputs:
    """Publishes silhouettes with the image behind each and the camera of both.

    Attributes:
        covered: fraction of the last silhouette that is foreground.
    """

    def __init__(self, node: CardboxNode) -> None:
        """Advertise the topics for ``node``."""
        self.covered = 0.0
        self._node = node
        self._silhouettes = node.advertise_inside(Image, "silhouette", qos.SILHOUETTE)
        self._images = node.advertise_inside(Image, "silhouette/image", qos.SILHOUETTE)
        self._infos = node.advertise_inside(CameraInfo, "silhouette/camera_info", qos.SILHOUETTE)

    def send_image(self, header: Header, image: ImageArray) -> None:
        """Publish an image (H, W) or (H, W, 3) before its silhouette; the tracker pairs both."""
        if self._images.get_subscription_count():
            self._images.publish(conversions.image_message(header, image))

    def send(
        self, header: Header, silhouette: ImageArray, camera: Camera, info: CameraInfo | None
    ) -> None:
        """Publish a silhouette (H, W), 0 or 255, and then its calibration."""
        self._silhouettes.publish(conversions.image_message(header, silhouette, "mono8"))
        self._infos.publish(conversions.camera_info_message(header, camera, info))
        self.covered = np.count_nonzero(silhouette) / silhouette.size
