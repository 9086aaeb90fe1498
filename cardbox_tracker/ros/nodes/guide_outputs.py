"""What the initializer publishes while it guides a person through the reference postures."""

from __future__ import annotations

import sys

from sensor_msgs.msg import Image
from std_msgs.msg import Bool, String

from cardbox_tracker.drawing.guide import Guide
from cardbox_tracker.estimation.initialization.guidance import ASK, Prompt, spoken
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.nodes.node_parameters import InitializerParameters
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.vision.camera import Camera


class GuideOutputs:
    """Tells a person what to do next: drawn on ``overlay``, in words to say aloud on ``~/say``.

    Whoever runs the program gets more of it on ``~/status``. ``~/guiding`` is true meanwhile: the
    tracker then leaves ``overlay`` to the guidance.
    """

    def __init__(self, node: CardboxNode) -> None:
        """Advertise the topics for ``node``."""
        self._prompt: Prompt | None = None
        self._guide: Guide | None = None
        self._status = node.advertise(String, "~/status", qos.LATCHED)
        self._say = node.advertise(String, "~/say", qos.RESULT)
        self._guiding = node.advertise(Bool, "~/guiding", qos.LATCHED)
        self._overlay = node.advertise(Image, "overlay", qos.SENSOR_DATA)
        self._guiding.publish(Bool(data=False))

    def show(self, prompt: Prompt, bell: bool = False) -> None:
        """Show a prompt; with ``bell``, ring the terminal bell at a success or failure."""
        if self._prompt is None:
            self._guiding.publish(Bool(data=True))
        words = spoken(self._prompt, prompt)
        if words:
            self._say.publish(String(data=words))
            if bell and prompt.mood != ASK:
                # With the end of a line, at which 'ros2 launch' hands on what a node writes.
                print("\a", file=sys.stderr, flush=True)
        self._prompt = prompt
        self._status.publish(String(data=prompt.text))

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
        """Draw the present prompt over an image, if there is one and somebody to see it.

        ``message`` is the silhouette, and ``seen`` what it is cut out of, if that came in time.
        """
        prompt = self._prompt
        if prompt is None or camera is None or not self._overlay.get_subscription_count():
            return
        silhouette = conversions.silhouette_of(message)
        if silhouette.shape != (camera.height, camera.width):
            return
        config = settings.config()
        if self._guide is None or (self._guide.camera, self._guide.config) != (camera, config):
            self._guide = Guide(camera, config)
        # Of another size it is another's: then the silhouette has to do.
        fits = seen is not None and (seen.height, seen.width) == silhouette.shape
        image = conversions.image_of(seen) if fits else None
        picture = self._guide.draw(prompt, silhouette, image, settings.mirror)
        self._overlay.publish(conversions.image_message(message.header, picture, "bgr8"))
