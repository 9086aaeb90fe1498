"""The tracker's topics."""

from __future__ import annotations

from typing import Any

from sensor_msgs.msg import Image
from std_msgs.msg import Bool

from cardbox_tracker.applications.drawing.overlay import draw_camera_overlay, draw_message
from cardbox_tracker.recordings.outputs import Output, OutputStream, outputs, person_space
from cardbox_tracker.ros.messages import conversions, results
from cardbox_tracker.ros.nodes.camera_inputs import ObservationSet
from cardbox_tracker.ros.nodes.rep155_outputs import Rep155Outputs, TrackedBodies
from cardbox_tracker.ros.nodes.tf_outputs import TfOutputs
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.tracker import Tracker


class TrackerOutputs:
    """The tracker's topics; each message is made only while the topic has a subscriber."""

    def __init__(
        self,
        node: CardboxNode,
        settings: TrackerParameters,
        person: int | None = None,
        bodies: TrackedBodies | None = None,
    ) -> None:
        """Advertise the topics for ``node``; ``settings`` decide about REP-155 and TF.

        Args:
            node: the tracker.
            settings: its parameters.
            person: number of one of several people; None if there is only one.
            bodies: publishes the list of people after REP-155; None without it.

        Raises:
            CardboxError: TF is requested, but its messages are not installed.
        """
        topics = outputs(settings.torso_place)
        space = "" if person is None else f"{person_space(person)[1:]}/"
        self._publishers = {
            output.topic: node.advertise(
                results.message_type(output.kind), space + output.topic, qos.RESULT
            )
            for output in topics
        }
        self._stream = OutputStream(topics)
        self._overlay = node.advertise(Image, f"{space}overlay", qos.SENSOR_DATA)
        self._camera_overlays = [
            node.advertise(Image, f"{camera.rstrip('/')}/overlay", qos.SENSOR_DATA)
            for camera in settings.cameras
            if person is None
        ]
        ending = "" if person is None else f"_{person}"
        self._human = None
        if bodies is not None:
            self._human = Rep155Outputs(node, settings, settings.rep155_id + ending, bodies)
        self._tf = None
        if settings.publish_tf:
            self._tf = TfOutputs(node, settings, None if person is None else f"person{ending}")
        self._guided = False
        node.subscribe(Bool, "initializer/guiding", self._on_guiding, qos.LATCHED)

    def _on_guiding(self, message: Bool, _: int) -> None:
        self._guided = message.data

    def publish(self, seen: ObservationSet, estimate: Estimate, tracker: Tracker) -> None:
        """Publish the outputs of an image; a lost posture is not repeated."""
        header = seen.header
        stamp_ns = conversions.stamp_ns(header.stamp)
        for output, value in self._stream.values(stamp_ns, estimate, tracker, self._is_wanted):
            self._publishers[output.topic].publish(results.message_of(header, value))
        if self._human is not None:
            self._human.publish(header, estimate, tracker)
        if self._tf is not None:
            self._tf.publish(header, estimate, tracker)
        if _wanted(self._overlay) and not self._guided:
            image = draw_camera_overlay(seen.picture(), 0, estimate, tracker)
            self._overlay.publish(conversions.image_message(header, image, "bgr8"))
        for number, publisher in enumerate(self._camera_overlays):
            own = seen.headers[number]
            if own is not None and _wanted(publisher):
                image = draw_camera_overlay(seen.picture(number), number, estimate, tracker)
                publisher.publish(conversions.image_message(own, image, "bgr8"))

    def _is_wanted(self, output: Output) -> bool:
        return _wanted(self._publishers[output.topic])

    def waiting(self, message: Image, seen: Image | None, text: str) -> None:
        """Publish on ``overlay`` the image, or the silhouette, with a text about missing inputs."""
        if not _wanted(self._overlay) or self._guided:
            return
        silhouette = conversions.silhouette_of(message)
        picture = conversions.image_behind(silhouette, seen)
        image = draw_message(silhouette if picture is None else picture, text)
        self._overlay.publish(conversions.image_message(message.header, image, "bgr8"))


def _wanted(publisher: Any) -> bool:
    return bool(publisher.get_subscription_count())
