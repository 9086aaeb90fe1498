"""The body of a person who was not measured, as the tracker finds it in the images."""

from __future__ import annotations

import math
from collections.abc import Callable

from std_msgs.msg import Float64, String

from cardbox_tracker.measuring.standing_camera import FOUND_STDDEV
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import dumps_body_model
from cardbox_tracker.person.urdf import urdf_from_body
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode


class FoundBody:
    """Publishes what was found, latched, until a measured body replaces it.

    Attributes:
        text: the body model that was published last; empty before.
    """

    def __init__(
        self,
        node: CardboxNode,
        settings: TrackerParameters,
        guess: BodyModel,
        use: Callable[[BodyModel], None],
    ) -> None:
        """Use ``guess`` now, and again with the camera's pitch when the detector finds it."""
        self.text = ""
        self._node, self._settings, self._guess, self._use = node, settings, guess, use
        self._is_measured = False
        self._model = node.advertise(String, "body_model", qos.LATCHED)
        self._description = node.advertise(String, "robot_description", qos.LATCHED)
        node.subscribe(Float64, "detector/camera_pitch", self._on_pitch, qos.LATCHED)
        stature = (
            f"a stature of {settings.stature:g} m"
            if settings.stature
            else "the mean stature of people, so sizes and distances may be wrong by a tenth"
        )
        node.get_logger().info(
            f"nobody is measured: the person in the image is tracked with {stature}"
        )
        use(guess)

    def _on_pitch(self, message: Float64, _: int) -> None:
        if not self._is_measured:
            # The message has no deviation; this is the largest one of a pitch that is found.
            tilt = {"camera_pitch_rad": message.data, "pitch_stddev_rad": FOUND_STDDEV}
            body = self._guess.with_values(**tilt)
            degrees = math.degrees(message.data)
            self._node.diagnostics.say("pitch", f"the detector found a pitch of {degrees:.0f} deg")
            self._use(body)

    def replace(self, text: str) -> None:
        """Latch the text of a measured body, too, so that late subscribers get one body."""
        self._is_measured, self.text = True, text
        self._model.publish(String(data=text))

    def publish(self, body: BodyModel, frame_id: str) -> None:
        """Publish a body that was fitted to the images of a camera's frame."""
        if self._is_measured:
            return
        self.text = dumps_body_model(body)
        self._model.publish(String(data=self.text))
        settings = self._settings
        frame = frame_id if settings.optical_frame_in_tf else ""
        urdf = urdf_from_body(body, frame or None, torso_place=settings.torso_place)
        self._description.publish(String(data=urdf))
