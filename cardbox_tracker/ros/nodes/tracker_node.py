"""The node ``tracker``: silhouettes and a body model in, joint states out."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import String

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.model_file import load_body_model, loads_body_model
from cardbox_tracker.errors import CameraError
from cardbox_tracker.estimation.cost.view import OtherCamera
from cardbox_tracker.estimation.precompile import compile_all
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.files import user_path
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.nodes.camera_views import Seen
from cardbox_tracker.ros.nodes.image_pairing import ImagePairing
from cardbox_tracker.ros.nodes.several_cameras import SeveralCameras
from cardbox_tracker.ros.nodes.tracker_outputs import TrackerOutputs
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.ros.nodes.tracker_report import TrackerReport
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.command_line import plain_command_line
from cardbox_tracker.ros.runtime.node import CardboxNode, run_node
from cardbox_tracker.ros.runtime.parameters import LiveParameters
from cardbox_tracker.settings import restarts
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.stamps import StampOrder

_DOES = "Follow the measured person: silhouettes in, joint states out."


class TrackerNode(CardboxNode):
    """Follows one measured person from silhouette to silhouette."""

    def __init__(self, **options: Any) -> None:
        """Subscribe to silhouettes and wait for a body model."""
        super().__init__("tracker", **options)
        self.parameters = LiveParameters(self, TrackerParameters, self._changed)
        # Compiled before the first image arrives, unless it is in the cache.
        self.get_logger().info("preparing (the very first start compiles for half a minute)")
        compile_all()
        self._body: BodyModel | None = None
        self._camera: Camera | None = None
        self._tracker: Tracker | None = None
        self._others: Sequence[OtherCamera] = ()
        self._several: SeveralCameras | None = None

        self._outputs = TrackerOutputs(self, self.parameters.value)
        self._model_topic = self.resolve("body_model")
        self.subscribe(String, "body_model", self._on_model, qos.LATCHED)
        self._pairing: ImagePairing | SeveralCameras
        settings = self.parameters.value
        if settings.cameras or settings.depth:
            several = SeveralCameras(self, settings, self._on_cameras, self._on_views)
            self._pairing = self._several = several
            self._silhouette_topic, self._info_topic = several.source, several.missing
        else:
            info = "silhouette/camera_info"
            self._silhouette_topic, self._info_topic = map(self.resolve, ("silhouette", info))
            self.subscribe(CameraInfo, info, self._on_info, qos.SILHOUETTE_INPUT)
            self._pairing = pairing = ImagePairing(self._on_silhouette)
            if settings.use_image:
                image = "silhouette/image"
                self.subscribe(Image, image, pairing.add_image, qos.SILHOUETTE_INPUT)
            self.subscribe(Image, "silhouette", pairing.add_silhouette, qos.SILHOUETTE_INPUT)
        self.offer("~/reset", self._reset)
        self.diagnostics.source = f"silhouettes on {self._silhouette_topic}"
        self._report = TrackerReport(self, self._several)
        if self.parameters.value.model_file:
            self._use(load_body_model(user_path(self.parameters.value.model_file)))
        self._wait()

    def _wait(self) -> None:
        if self._body is None:
            self.diagnostics.wait_for(
                f"a body model on {self._model_topic} (call initializer/initialize, or give "
                "model_file)"
            )
        elif self._camera is None:
            info_topic = self._info_topic if self._several is None else self._several.missing
            self.diagnostics.wait_for(
                f"silhouettes on {self._silhouette_topic} and their CameraInfo on "
                f"{info_topic} (is the background node running, and has it learned?)"
            )

    def _changed(self, settings: TrackerParameters) -> None:
        if self._tracker is None:
            return
        config = settings.config()
        if restarts(self._tracker.config, config):
            self._build("other settings of the particles")
        else:
            self._tracker.configure(config)

    def _on_model(self, message: String, _: int) -> None:
        body = loads_body_model(message.data, source=self._model_topic)
        if body != self._body:
            self._use(body)

    def _use(self, body: BodyModel) -> None:
        self._body = body
        self._pairing.waits = body.appearance is not None or bool(body.unknown)
        if body.doubt:
            self.get_logger().warning(body.doubt)
        self._build("new body model")
        self._wait()

    def _on_info(self, message: CameraInfo, _: int) -> None:
        camera = conversions.camera_of(message)
        if camera != self._camera:
            self._camera = camera
            self._build("new camera")

    def _on_cameras(self, first: Camera | None, others: Sequence[OtherCamera]) -> None:
        self._camera, self._others = first, others
        self._tracker = None
        self._build("new cameras")

    def _build(self, reason: str) -> None:
        """Set the tracker up for the body, the camera and the parameters of now.

        The same seed and images then give the same results, also after a reset.
        """
        if self._body is None or self._camera is None:
            return
        settings = self.parameters.value
        rng = np.random.default_rng(settings.seed)
        self._tracker = Tracker(
            self._body, self._camera, settings.config(), rng, others=self._others
        )
        self._report.start(self._body)
        self.diagnostics.say(reason, f"{reason}: tracking starts from the front reference posture")

    def _reset(self) -> str:
        if self._tracker is None:
            missing = self._model_topic if self._body is None else self._info_topic
            raise CameraError(
                f"nothing to reset: the tracker has not started, it waits for {missing}"
            )
        self._build("reset")
        return "tracking starts again from the front reference posture"

    def _is_next(self, message: Image) -> bool:
        """Return whether a silhouette can be used; one of a time before starts tracking anew."""
        self._now_ns = conversions.stamp_ns(message.header.stamp)
        step = self.diagnostics.input.add(self._now_ns)
        if step is StampOrder.RESTART:
            self._build("an image is older than the one before (a bag that loops?)")
        return step.is_usable

    def _on_silhouette(self, message: Image, seen: Image | None, sent_ns: int) -> None:
        if not self._is_next(message):
            return
        if self._tracker is None or self._body is None or self._camera is None:
            self._wait()
            self._outputs.waiting(message, seen, "no body model yet: call initializer/initialize")
            return
        height, width = (silhouette := conversions.silhouette_of(message)).shape
        if (width, height) != (self._camera.width, self._camera.height):
            raise CameraError(
                f"the silhouette is {width}x{height} but {self._info_topic} describes "
                f"{self._camera.width}x{self._camera.height}; expected the same size"
            )
        image = conversions.image_behind(silhouette, seen)
        estimate = self._tracker.track(silhouette, image, self._now_ns)
        picture = silhouette if image is None else image
        self._outputs.publish(message.header, estimate, picture, self._tracker)
        self._report.add(estimate, self._tracker.body)
        self.diagnostics.working(sent_ns)

    def _on_views(self, lead: Image, seen: Sequence[Seen | None]) -> None:
        assert self._several is not None
        if not self._is_next(lead):
            return
        if self._tracker is None:
            self._several.check()
            self._wait()
            self._outputs.waiting(lead, None, "no body model yet: call initializer/initialize")
            return
        views = self._several.views(seen)
        estimate = self._tracker.track_views(*views.seen, self._now_ns)
        self._outputs.publish(views.header, estimate, views.picture, self._tracker)
        self._report.add(estimate, self._tracker.body)
        self._several.done(views, estimate, self._tracker)
        self.diagnostics.working(views.sent_ns)


def main(args: list[str] | None = None) -> int:
    """Run the node; the exit code is 0 unless it could not start."""
    return run_node(TrackerNode, plain_command_line("tracker", _DOES, args))


if __name__ == "__main__":
    sys.exit(main())
