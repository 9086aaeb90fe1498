"""What the initializer publishes while it guides a person through the reference postures."""

from __future__ import annotations

import math

from sensor_msgs.msg import Image
from std_msgs.msg import Bool, String

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import REFERENCE_NAMES, reference_posture
from cardbox_tracker.drawing.guidance import draw_guidance
from cardbox_tracker.drawing.overlay import draw_message
from cardbox_tracker.estimation.initialization.guidance import Step
from cardbox_tracker.estimation.initialization.standing import at_height_of
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.nodes.node_parameters import InitializerParameters
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.vision.camera import Camera

_SCALE = 2


class GuideOutputs:
    """Tells a person what to do next: in words on ``~/status``, drawn on ``overlay``.

    ``~/guiding`` is true meanwhile: the tracker then leaves ``overlay`` to the guidance.
    """

    def __init__(self, node: CardboxNode) -> None:
        """Advertise the topics for ``node``."""
        self._step: Step | None = None
        self._status = node.advertise(String, "~/status", qos.LATCHED)
        self._guiding = node.advertise(Bool, "~/guiding", qos.LATCHED)
        self._overlay = node.advertise(Image, "overlay", qos.SENSOR_DATA)
        self._guiding.publish(Bool(data=False))

    def show(self, step: Step) -> None:
        """Show a step of the guidance."""
        if self._step is None:
            self._guiding.publish(Bool(data=True))
        self._step = step
        self._status.publish(String(data=step.text))

    def end(self, text: str) -> None:
        """End the guidance with a last line."""
        if self._step is not None:
            self._guiding.publish(Bool(data=False))
        self._step = None
        self._status.publish(String(data=text))

    def draw(self, message: Image, camera: Camera | None, settings: InitializerParameters) -> None:
        """Draw the present step over a silhouette, if there is one and somebody to see it."""
        step = self._step
        if step is None or camera is None or not self._overlay.get_subscription_count():
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
            image = draw_message(silhouette, step.text)
        self._overlay.publish(conversions.image_message(message.header, image, "bgr8"))
