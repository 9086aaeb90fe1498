"""The node ``initializer`` measures a body from the silhouettes of three reference postures."""

from __future__ import annotations

import math
import threading
import time
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.task import Future
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger

from cardbox_tracker.applications.drawing.guidance import Guide
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import CardboxError, InitializationError
from cardbox_tracker.common.progress import told
from cardbox_tracker.measuring.guidance import Cancellation, Prompt, guide, measuring, spoken
from cardbox_tracker.measuring.scale import SCALE_REFERENCES
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import dumps_body_model
from cardbox_tracker.person.posture import REFERENCE_NAMES
from cardbox_tracker.person.urdf import urdf_from_body
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.messages.results import answer_text, measured_message, refused_message
from cardbox_tracker.ros.nodes.camera_poses import silhouettes_of
from cardbox_tracker.ros.nodes.initializer_parameters import InitializerParameters
from cardbox_tracker.ros.nodes.reference_capture import (
    DepthDistance,
    ReferenceCapture,
    SecondCamera,
    measured,
)
from cardbox_tracker.ros.nodes.saved_model import SavedModel
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.command_line import node_main
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.ros.runtime.parameters import LiveParameters

# Longest waits for a silhouette that a node advertises, and for a node that does.
_ANNOUNCED_S, _FIND_S, _STEP_S = 60.0, 10.0, 0.1


class InitializerNode(CardboxNode):
    """Captures reference silhouettes and measures the person in them."""

    def __init__(self, **options: Any) -> None:
        super().__init__("initializer", **options)
        self.parameters = LiveParameters(self, InitializerParameters)
        self._camera: Camera | None = None
        self._frame_id = ""
        self._body: BodyModel | None = None
        self._cancellation = Cancellation()

        self._model = self.advertise(String, "body_model", qos.LATCHED)
        self._description = self.advertise(String, "robot_description", qos.LATCHED)
        self._result = self.advertise(DiagnosticStatus, "~/result", qos.LATCHED)
        self._guide = GuideOutputs(self)
        settings = self.parameters.value
        topic = silhouettes_of(settings.cameras or [""])[0]
        self._topic = self.resolve(topic)
        self._references = ReferenceCapture(self._topic)
        self._distance: DepthDistance | SecondCamera | None = None
        if settings.depth:
            self._distance = DepthDistance(
                self, settings.depth, self._references, lambda: self._camera
            )
        elif len(settings.cameras) > 1:
            self._distance = SecondCamera(self, settings)
        self.subscribe(CameraInfo, f"{topic}/camera_info", self._on_info, qos.SILHOUETTE_INPUT)
        self.subscribe(Image, f"{topic}/image", self._references.add_image, qos.SILHOUETTE_INPUT)
        self.subscribe(Image, topic, self._on_silhouette, qos.SILHOUETTE_INPUT)
        for name in REFERENCE_NAMES:
            self.offer(f"~/capture_{name}", partial(self._capture, name))
        self.offer("~/cancel", self._cancellation.cancel)
        # The service answers after the measurement; meanwhile, a second call is refused at once.
        self.create_service(
            Trigger,
            "~/initialize",
            self._initialize,
            qos_profile=qos.SERVICE,
            callback_group=ReentrantCallbackGroup(),
        )
        self.diagnostics.extra = self._values
        self.diagnostics.source = f"silhouettes on {self._topic}"
        self.diagnostics.wait_for(
            f"silhouettes on {self._topic} (is the background node running, and has it learned?)"
        )
        self._saved = SavedModel(self.parameters.value.model_file)
        if self._saved.warning:
            self.diagnostics.warn(self._saved.warning)
        if self._saved.body is not None:
            self._publish(self._saved.body)
            self.get_logger().info(f"body model read from {self.parameters.value.model_file}")

    def _on_info(self, message: CameraInfo, _: int) -> None:
        self._camera = conversions.camera_of(message)

    def _on_silhouette(self, message: Image, sent_ns: int) -> None:
        if not self.diagnostics.input.add(conversions.stamp_ns(message.header.stamp)).is_usable:
            return
        self._references.add(message)
        seen = self._references.behind(message)
        self._guide.draw(message, seen, self._camera, self.parameters.value)
        self.diagnostics.working(sent_ns)
        if message.header.frame_id != self._frame_id:
            self._frame_id = message.header.frame_id
            if self._body is not None:
                self._describe(self._body)

    def _capture(self, name: str) -> str:
        given = self.parameters.value
        now_ns, is_wanted = self._references.latest_ns, name in SCALE_REFERENCES
        if self._distance and given.measure_distance and is_wanted and now_ns is not None:
            self._distance.capture(name, now_ns)
        return self._references.capture(name, self._camera, given.config())

    async def _initialize(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Measure in another thread, so that the node still handles silhouettes and captures."""
        if not self._cancellation.begin():
            response.message = "an initialization is already running; wait for its answer"
            return response
        done: Future = Future()

        def work() -> None:
            done.set_result(self.outcome("initialize", self._measure))
            if self.executor is not None:
                self.executor.wake()

        try:
            threading.Thread(target=work, name="initialize", daemon=True).start()
            response.success, response.message = await done
        finally:
            words = self._cancellation.end(response.success)
        if not response.success:
            self._result.publish(refused_message(response.message))
        self._guide.end(response.message, words)
        return response

    def _measure(self) -> str:
        settings, references = self.parameters.value, self._references
        distance = self._distance if settings.measure_distance else None
        self._await_silhouettes()
        references.check_running()
        if distance is not None:
            distance.check()
        before = dict(references.captured), dict(references.images)
        try:
            asked = settings.side_turn, settings.count_down_s, settings.attempts
            ways = self._guide.show, self._capture, self._cancellation.wait
            guide(references.missing, *asked, *ways)
            if (camera := self._camera) is None:
                raise InitializationError(
                    f"no CameraInfo was received yet on {self._topic}/camera_info; take the "
                    "silhouettes from the background node, which publishes it"
                )
            result = measured(references, distance, camera, settings.config(), self._progress)
        except CardboxError:
            # References captured by service are kept and can be replaced one by one.
            references.captured, references.images = before
            raise
        answer = answer_text(result)
        self._result.publish(measured_message(result, answer))
        self._publish(result.body)
        answer += self._saved.save(result.body)
        references.captured, references.images = {}, {}
        return answer

    def _await_silhouettes(self) -> None:
        """Wait for the first silhouette: the background node may still compile or learn."""
        if self._references.has_silhouettes:
            return
        begun_s = time.monotonic()
        with told(self._tell, f"waiting for the first silhouette on {self._topic}"):
            while not self._references.has_silhouettes:
                is_announced = self.count_publishers(self._topic) > 0
                if time.monotonic() - begun_s > (_ANNOUNCED_S if is_announced else _FIND_S):
                    return
                self._cancellation.wait(_STEP_S)

    def _tell(self, text: str) -> None:
        self.get_logger().info(text)
        self._guide.tell(text)

    def _progress(self, fraction: float) -> None:
        self._cancellation.wait(0.0)
        self._guide.show(measuring(fraction))

    def _publish(self, body: BodyModel) -> None:
        settings = self.parameters.value
        body = body.with_values(camera_roll_rad=math.radians(settings.camera_roll_deg))
        self._body = body
        self._model.publish(String(data=dumps_body_model(body)))
        self._describe(body)

    def _describe(self, body: BodyModel) -> None:
        settings = self.parameters.value
        frame_id = self._frame_id if settings.optical_frame_in_urdf else None
        urdf = urdf_from_body(
            body, frame_id or None, torso_place=settings.torso_place_in_urdf, hands=settings.hands
        )
        self._description.publish(String(data=urdf))

    def _values(self) -> dict[str, str]:
        return {
            "captured": ", ".join(self._references.captured) or "none",
            "body model": "published" if self._body is not None else "none yet",
            "initializing": str(self._cancellation.is_running),
        }

    def close(self) -> None:
        """Stop the guidance if it is running."""
        self._cancellation.stop()


class GuideOutputs:
    """Outputs of the guidance: drawings on ``overlay``, words on ``~/say``, more on ``~/status``.

    While ``~/guiding`` is true, the tracker does not publish ``overlay``.
    """

    def __init__(self, node: CardboxNode) -> None:
        self._prompt: Prompt | None = None
        self._guide: Guide | None = None
        self._status = node.advertise(String, "~/status", qos.LATCHED_LINES)
        self._say = node.advertise(String, "~/say", qos.RESULT)
        self._guiding = node.advertise(Bool, "~/guiding", qos.LATCHED)
        self._overlay = node.advertise(Image, "overlay", qos.SENSOR_DATA)
        self._guiding.publish(Bool(data=False))

    def show(self, prompt: Prompt) -> None:
        """Show a prompt, and say its words."""
        if self._prompt is None:
            self._guiding.publish(Bool(data=True))
        words = spoken(self._prompt, prompt)
        if words:
            self._say.publish(String(data=words))
        self._prompt = prompt
        self._status.publish(String(data=prompt.text))

    def tell(self, text: str) -> None:
        """Tell the operator a line before the guidance."""
        self._status.publish(String(data=text))

    def end(self, text: str, words: str) -> None:
        """End the guidance with a last line, and ``words`` to say."""
        if self._prompt is not None:
            self._say.publish(String(data=words))
            self._guiding.publish(Bool(data=False))
        self._prompt = None
        self._status.publish(String(data=text))

    def draw(
        self,
        message: Image,
        seen: Image | None,
        camera: Camera | None,
        settings: InitializerParameters,
    ) -> None:
        """Draw a prompt over ``seen``, the image of the silhouette ``message``, if it is wanted."""
        prompt = self._prompt
        if prompt is None or camera is None or not self._overlay.get_subscription_count():
            return
        silhouette = conversions.silhouette_of(message)
        if silhouette.shape != (camera.height, camera.width):
            return
        config = settings.config()
        if self._guide is None or (self._guide.camera, self._guide.config) != (camera, config):
            self._guide = Guide(camera, config)
        # An image of another size does not belong to the silhouette, which is drawn instead.
        fits = seen is not None and (seen.height, seen.width) == silhouette.shape
        image = conversions.image_of(seen) if fits else None
        picture = self._guide.draw(prompt, silhouette, image, settings.mirror)
        self._overlay.publish(conversions.image_message(message.header, picture, "bgr8"))


# The tracker, which gets the same silhouettes, has priority.
main = node_main("initializer", InitializerNode, InitializerParameters, nice=5)
