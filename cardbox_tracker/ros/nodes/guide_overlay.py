"""The overlay while a person is guided through the reference postures."""

from __future__ import annotations

import math

from sensor_msgs.msg import Image

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import REFERENCE_NAMES, reference_posture
from cardbox_tracker.drawing.guidance import draw_guidance
from cardbox_tracker.drawing.overlay import draw_message
from cardbox_tracker.estimation.initialization.guidance import step_of
from cardbox_tracker.estimation.initialization.standing import at_height_of
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.nodes.node_parameters import InitializerParameters
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.vision.camera import Camera

_SCALE = 2


class GuideOverlay:
    """Publishes on ``overlay`` what to do next, as long as somebody watches.

    Meanwhile the tracker leaves that topic alone: it follows ``initializer/status`` too.

    Attributes:
        status: the latest line of ``initializer/status``.
    """

    def __init__(self, node: CardboxNode) -> None:
        """Advertise ``overlay`` for ``node``."""
        self.status = ""
        self._publisher = node.advertise(Image, "overlay", qos.SENSOR_DATA)

    def show(self, message: Image, camera: Camera | None, settings: InitializerParameters) -> None:
        """Draw the present step over a silhouette, if there is one and anybody to see it."""
        step = step_of(self.status)
        if step is None or camera is None or not self._publisher.get_subscription_count():
            return
        silhouette = conversions.silhouette_of(message)
        if silhouette.shape != (camera.height, camera.width):
            return
        body = BodyModel.of(
            distance_m=settings.person_distance_m,
            camera_pitch_rad=math.radians(settings.camera_pitch_deg),
            side_turn=settings.side_turn,
        )
        if step.name in REFERENCE_NAMES:
            image = draw_guidance(
                silhouette,
                at_height_of(silhouette, body, camera),
                camera.with_pitch(body.camera_pose.pitch_rad),
                reference_posture(step.name, settings.side_turn),
                step.words,
                step.left_s,
                _SCALE,
            )
        else:
            image = draw_message(silhouette, self.status)
        self._publisher.publish(conversions.image_message(message.header, image, "bgr8"))
