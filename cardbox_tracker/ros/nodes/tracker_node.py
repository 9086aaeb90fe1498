"""The node ``tracker`` publishes joint states from silhouettes and a body model."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from std_msgs.msg import String

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.exposure import exposure_problem
from cardbox_tracker.camera.stamps import StampOrder
from cardbox_tracker.camera.view import OtherCamera
from cardbox_tracker.common.errors import CameraError
from cardbox_tracker.common.files import user_path
from cardbox_tracker.common.progress import told
from cardbox_tracker.common.settings import restarts
from cardbox_tracker.detectors.hand_network import HandNetwork
from cardbox_tracker.detectors.model_files import installed_hands
from cardbox_tracker.measuring.scene_watch import SceneWatch
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import dumps_body_model, load_body_model, loads_body_model
from cardbox_tracker.person.skeleton import PLACE_NAMES, STATE_NAMES
from cardbox_tracker.person.urdf import urdf_from_body
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.nodes.camera_inputs import CameraInputs, ObservationSet, Received
from cardbox_tracker.ros.nodes.tracker_outputs import TrackedBodies, TrackerOutputs
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.command_line import node_main
from cardbox_tracker.ros.runtime.diagnostics import every_second
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.ros.runtime.parameters import LiveParameters
from cardbox_tracker.tracking.estimate import LOST, NO_PERSON, UNCERTAIN, Estimate
from cardbox_tracker.tracking.precompile import compile_all
from cardbox_tracker.tracking.session import Session, trackers_as_seen
from cardbox_tracker.tracking.smoother import Smoother, Smoothing
from cardbox_tracker.tracking.tracker import Tracker

Seen = tuple[ObservationSet, Sequence[Tracker]]
"""The inputs of a time, and the trackers with the bodies that they then had."""

_REASONS = {
    NO_PERSON: "nobody is in the image",
    LOST: (
        "the person was lost (the model does not fit the silhouette); call tracker/reset when they "
        "stand in the front reference posture, or initialize again if it is another person"
    ),
    UNCERTAIN: (
        "the posture may be wrong ({why}); look at the overlay, and let a robot wait until "
        "tracking_state is tracking again"
    ),
}


class TrackingReport:
    """Collects the estimates of a tracker, and describes its state in words and numbers."""

    def __init__(self) -> None:
        self._body: BodyModel | None = None
        self._state = self._reason = ""
        self._counts: dict[str, int] = {}
        self._estimate: Estimate | None = None

    def start(self, body: BodyModel) -> None:
        """Begin again with ``body``."""
        self._state = self._reason = ""
        self._body = body

    def add(self, estimate: Estimate, body: BodyModel, exposure: str = "") -> dict[str, str]:
        """Add the estimate of an image, the ``body`` to which it belongs, and a fault of the light.

        Returns:
            Texts about changes, by kind.
        """
        news = {}
        if body is not self._body:
            self._body = body
            news["body"] = f"fitted to the person in the image:\n{body}"
        self._estimate = estimate
        self._counts[estimate.state] = self._counts.get(estimate.state, 0) + 1
        before, self._state = self._state, estimate.state
        reason = self._reason = exposure or _REASONS.get(estimate.state, "").format(
            why=estimate.reason or "several postures fit the silhouette, or none fits it well"
        )
        if estimate.state == before:
            return news
        if estimate.state == UNCERTAIN:
            news["state"] = f"tracking, but {reason}"
        elif before != UNCERTAIN or reason:
            # The state may change between tracking and uncertain with each image.
            news["state"] = f"not tracking: {reason}" if reason else "tracking"
        return news

    @property
    def is_absent(self) -> bool:
        """Whether nobody was in the last image."""
        return self._state == NO_PERSON

    def warnings(self) -> dict[str, str]:
        """Return texts about present problems, by kind."""
        reason = self._reason
        if not reason:
            return {}
        return {"": reason if self._state == UNCERTAIN else f"no joint states: {reason}"}

    def values(self, cameras: Mapping[str, str]) -> dict[str, str]:
        """Return the state, the number of images with each state, and values of the last posture.

        ``cameras`` are further values, which precede those of the posture.
        """
        values = {"state": self._state or "not started"}
        values |= {f"images {state}": str(count) for state, count in self._counts.items()}
        values |= cameras
        estimate = self._estimate
        if estimate is None or estimate.posture is None:
            return values
        if estimate.cost_px is not None and estimate.iou is not None:
            values |= {"cost (px)": str(estimate.cost_px), "iou": f"{estimate.iou:.4f}"}
        if estimate.posture_stddev is not None:
            angles = estimate.posture_stddev[1:]
            values["largest deviation (deg)"] = f"{math.degrees(float(angles.max())):.1f}"
        joints = dict(zip(STATE_NAMES, estimate.joints[0].tolist(), strict=True))
        return values | {f"{name} (m)": f"{joints[name]:.3f}" for name in PLACE_NAMES}


class OwnBody:
    """Publishes the body of model_file or of the images, latched, until a measured one replaces it.

    Attributes:
        text: the body model that was published last; empty before.
    """

    def __init__(self, node: CardboxNode, settings: TrackerParameters) -> None:
        self.text = ""
        self._settings = settings
        self._is_measured = False
        self._body: BodyModel | None = None
        self._model = node.advertise(String, "body_model", qos.LATCHED)
        self._description = node.advertise(String, "robot_description", qos.LATCHED)
        if settings.model_file:
            return
        given = settings.statures or [settings.stature]
        stature = (
            f"a stature of {' and '.join(f'{one:g}' for one in given)} m"
            if given[0]
            else "the mean stature of people, so sizes and distances may be wrong by a tenth"
        )
        node.get_logger().info(
            f"nobody is measured: the person in the image is tracked with {stature}"
        )

    def replace(self, text: str) -> None:
        """Latch the text of a measured body, too, so that late subscribers get one body."""
        self._is_measured, self.text = True, text
        self._model.publish(String(data=text))

    def publish(self, body: BodyModel, frame_id: str) -> None:
        """Publish a new body before the images of a camera's frame, unless it is a first guess."""
        if self._is_measured or body is self._body or body.unknown:
            return
        self._body = body
        self.text = dumps_body_model(body)
        self._model.publish(String(data=self.text))
        settings = self._settings
        frame = frame_id if settings.optical_frame_in_tf else ""
        urdf = urdf_from_body(
            body, frame or None, torso_place=settings.torso_place, hands=settings.hands
        )
        self._description.publish(String(data=urdf))


_SAME_ROLL_RAD = math.radians(0.1)
_PREPARING = "preparing (the very first start compiles for one to two minutes)"


class TrackerNode(CardboxNode):
    """Tracks people with one or several cameras."""

    def __init__(self, **options: Any) -> None:
        super().__init__("tracker", **options)
        self.parameters = LiveParameters(self, TrackerParameters, self._changed)
        # Calls that come while the code is compiled are answered afterwards.
        self.offer("~/reset", self._reset)
        settings = self.parameters.value
        self._look = HandNetwork(installed_hands()) if settings.hands else None
        self._beside = ThreadPoolExecutor(1)
        self._prepared: set[str] = set()
        self._prepare(settings)
        self._bodies: Sequence[BodyModel] = ()
        self._camera: Camera | None = None
        self._others: Sequence[OtherCamera] = ()
        self._session: Session | None = None
        self._smoother = self._new_smoother()
        self._is_silent = True
        if settings.lag:
            every_second(self, self._publish_last)
        self._as_seen: list[Tracker] = []
        self._scene: SceneWatch | None = None
        numbers = [None, *range(1, settings.people + 1)][settings.people > 0 :]
        self._reports = [TrackingReport() for _ in numbers]
        bodies = TrackedBodies(self, len(numbers)) if settings.rep155_id else None
        self._outputs = [TrackerOutputs(self, settings, person, bodies) for person in numbers]
        for number in range(1, settings.people + 1):
            self.offer(f"~/person_{number}/reset", partial(self._reset_person, number))
        self._model_topic = self.resolve("body_model")
        self.subscribe(String, "body_model", self._on_model, qos.LATCHED)
        self._inputs = CameraInputs(self, settings, self._on_cameras, self._on_input)
        self._names = [name.strip("/") for name in settings.cameras or [""]]
        self.diagnostics.source = f"silhouettes on {self._inputs.source}"
        self.diagnostics.extra = self._values
        self.diagnostics.remedy = (
            "lower the effort, take a smaller working resolution, or fewer images a second"
        )
        self._own: OwnBody | None = None
        file = settings.model_file
        known = [load_body_model(user_path(file))] if file else settings.guesses
        if known:
            self._own = OwnBody(self, settings)
            self._use(known)
        self._wait()

    def _prepare(self, settings: TrackerParameters) -> None:
        """Get the code that the settings need before an image needs it."""
        if settings.preset in self._prepared:
            return
        with told(self.get_logger().info, _PREPARING):
            compile_all(
                [settings.preset],
                several_cameras=len(settings.cameras) > 1,
                points=bool(settings.keypoints),
            )
        self._prepared.add(settings.preset)

    def _on_model(self, message: String, _: int) -> None:
        if self._own is not None and message.data == self._own.text:
            return
        body = self._rolled(loads_body_model(message.data, source=self._model_topic))
        if self._bodies != [body]:
            self._use([body])
        if self._own is not None:
            self._own.replace(message.data)

    def _rolled(self, body: BodyModel) -> BodyModel:
        """Return the body before this camera, as it stands."""
        roll_rad = math.radians(self.parameters.value.camera_roll_deg)
        found_rad = body.camera_pose.roll_rad
        if found_rad and abs(found_rad - roll_rad) > _SAME_ROLL_RAD:
            self.get_logger().warning(
                f"the body model is of a camera with a roll of {math.degrees(found_rad):.1f} "
                f"degrees, but camera_roll_deg is {math.degrees(roll_rad):.1f}, which is used"
            )
        return body.with_values(camera_roll_rad=roll_rad)

    def _use(self, bodies: Sequence[BodyModel]) -> None:
        self._bodies = [self._rolled(body) for body in bodies]
        needs_images = any(body.appearance is not None or body.unknown for body in self._bodies)
        self._inputs.wait_for_images(needs_images or bool(self._look))
        for body in self._bodies:
            if body.doubt:
                self.get_logger().warning(body.doubt)
        self._build("new body model")
        self._wait()

    def _on_cameras(self, first: Camera | None, others: Sequence[OtherCamera]) -> None:
        """Use the cameras when all are known or one has changed."""
        if not (others or self._others) and first == self._camera:
            return
        self._camera, self._others = first, others
        self._session = None
        self._build("new cameras" if others else "new camera")

    def _changed(self, settings: TrackerParameters) -> None:
        self._prepare(settings)
        if self._session is None:
            return
        config = settings.config()
        if restarts(self._session.config, config):
            self._build("other settings of the particles")
        else:
            self._session.configure(config)

    def _build(self, reason: str) -> None:
        """Set up a tracker for the current body, cameras and parameters.

        The same seed and images give the same results, also after a reset.
        """
        if not self._bodies or self._camera is None:
            return
        # What was seen before is published before what starts now.
        self._publish(self._smoother.finish())
        self._smoother, self._as_seen = self._new_smoother(), []
        settings = self.parameters.value
        rng = np.random.default_rng(settings.seed)
        people = settings.people or None
        # A fit takes as long as several images.
        self._scene = None
        if settings.keypoints and any(body.unknown for body in self._bodies):
            is_level = settings.camera_roll_deg != 0.0
            statures_m = [one or None for one in settings.statures or [settings.stature]]
            given_scene = statures_m, settings.pitch, self._beside, is_level
            self._scene = SceneWatch(self._camera, *given_scene)
        given = settings.config(), rng, self._others, people, self._look, self._beside
        self._session = Session(self._bodies, self._camera, *given, scene=self._scene)
        for report, tracker in zip(self._reports, self._session.trackers, strict=True):
            report.start(tracker.body)
        self.diagnostics.say(reason, f"{reason}: tracking starts from the front reference posture")

    def _reset(self) -> str:
        if self._session is None:
            missing = self._inputs.missing if self._bodies else self._model_topic
            raise CameraError(
                f"nothing to reset: the tracker has not started, it waits for {missing}"
            )
        self._build("reset")
        return "tracking starts again from the front reference posture"

    def _reset_person(self, number: int) -> str:
        if self._session is None:
            return self._reset()
        self._session.reset(number)
        return f"person {number} is sought again"

    def _wait(self) -> None:
        if not self._bodies:
            self.diagnostics.wait_for(
                f"a body model on {self._model_topic} (call initializer/initialize, or give "
                "model_file or stature)"
            )
        elif self._camera is None:
            self.diagnostics.wait_for(
                f"silhouettes on {self._inputs.source} and their CameraInfo on "
                f"{self._inputs.missing} (is the background node running, and has it learned?)"
            )

    def _on_input(self, lead: Received, received: Sequence[Received | None]) -> None:
        """Track the messages of one time; ``lead`` has the stamp that represents them."""
        step = self.diagnostics.arrived(conversions.stamp_ns(lead.message.header.stamp))
        if step is StampOrder.RESTART:
            self._build("an image is older than the one before (a bag that loops?)")
        if not step.is_usable:
            return
        if self._session is None:
            self._inputs.check()
            self._wait()
            text = "no body model yet: call initializer/initialize"
            self._outputs[0].waiting(lead.message, lead.image, text)
            return
        self._is_silent = False
        seen = self._inputs.observed(received)
        estimates, trackers = self._session.track(seen.observations), self._session.trackers
        if self.parameters.value.lag:
            trackers = self._as_seen = trackers_as_seen(self._as_seen, trackers)
        bodies = (tracker.body for tracker in trackers)
        stamp_ns = conversions.stamp_ns(seen.header.stamp)
        self._publish(self._smoother.add((seen, trackers), stamp_ns, estimates, bodies))
        if self._scene is not None and self._scene.news:
            self.diagnostics.say("scene", self._scene.news)
        self._session.check_cameras()
        self.diagnostics.advice = self._warnings
        self.diagnostics.working(seen.sent_ns)

    def _new_smoother(self) -> Smoother[Seen]:
        return Smoother(Smoothing(self.parameters.value.lag, every_s=0.0))

    def _publish_last(self) -> None:
        """Publish what waits for later images if none has come for a second."""
        if self._is_silent:
            self._publish(self._smoother.finish())
        self._is_silent = True

    def _publish(self, finished: Iterable[tuple[Seen, Sequence[Estimate]]]) -> None:
        """Publish the results of images."""
        for (seen, trackers), estimates in finished:
            for outputs, report, estimate, tracker in zip(
                self._outputs, self._reports, estimates, trackers, strict=True
            ):
                image, exposure = seen.observations[0].image, ""
                if image is not None and estimate.posture is None:
                    exposure = exposure_problem(image)
                news, named = report.add(estimate, tracker.body, exposure), _named(estimate.person)
                for kind, text in news.items():
                    self.diagnostics.say(named + kind, named + text)
                # Joint states of a new version of the body follow the version.
                if self._own is not None and tracker is trackers[0]:
                    self._own.publish(tracker.body, seen.header.frame_id)
                outputs.publish(seen, estimate, tracker)
            self.diagnostics.made("joint states", conversions.stamp_ns(seen.header.stamp))

    def _warnings(self) -> dict[str, str]:
        remarks = [] if self._session is None else self._session.remarks(self._names)
        images = {f"images {number}": text for number, text in enumerate(remarks)}
        told = self._inputs.warnings()
        # Of several people some may be absent; nobody at all is a reason for no joint states.
        shown = [one for one in self._named_reports() if not one[1].is_absent]
        for name, report in shown or [("", self._reports[0])]:
            told |= {name + kind: name + text for kind, text in report.warnings().items()}
        return told | images

    def _values(self) -> dict[str, str]:
        first = None if self._session is None else self._session.trackers[0]
        ious, used = list[float | None](), dict[str, str]()
        if first is not None:
            ious = first.filter.ious()
            used = {f"{name} used": f"{n} of {first.images}" for name, n in first.used.items()}
        agreement = None if self._session is None else self._session.agreement
        turned = {} if agreement is None else agreement.values(self._names[1:])
        common = self._inputs.values(ious) | turned | used
        values: dict[str, str] = {}
        if self.parameters.value.people:
            absent = [str(k) for k, report in enumerate(self._reports, 1) if report.is_absent]
            values["absent people"] = ", ".join(absent) or "none"
        for name, report in self._named_reports():
            values |= {name + key: text for key, text in report.values(common).items()}
            common = {}
        return values

    def _named_reports(self) -> Iterator[tuple[str, TrackingReport]]:
        for number, report in enumerate(self._reports, 1):
            yield _named(number if self.parameters.value.people else None), report


def _named(person: int | None) -> str:
    """Return the beginning of texts about one of several people."""
    return "" if person is None else f"person {person} "


main = node_main("tracker", TrackerNode, TrackerParameters)
