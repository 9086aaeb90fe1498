"""Each row of ``watches.csv`` holds beyond its limit, and ends at the value to return to.

The values on both sides of a limit stand here as numbers, so twice or half of a limit fails.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from std_msgs.msg import Header

from cardbox_tracker.camera import zoom
from cardbox_tracker.camera.calibration_watch import CalibrationWatch
from cardbox_tracker.camera.camera import Calibration, Camera
from cardbox_tracker.camera.exposure import exposure_problem
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.stamps import ArrivalWatch, RecordedStamps, StampOrder, StreamStatistics
from cardbox_tracker.camera.view import OtherCamera, View
from cardbox_tracker.common.health import WATCHES, Verdict
from cardbox_tracker.detectors.figure import Figure
from cardbox_tracker.detectors.identity import Identity
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.measuring.motion_lag import MotionLag
from cardbox_tracker.measuring.silhouette_tangents import PoseDirection, _explained
from cardbox_tracker.person.model import PROPORTIONS, BodyModel
from cardbox_tracker.ros.messages.conversions import camera_info_message
from cardbox_tracker.ros.nodes import camera_inputs, input_stream, keypoint_inputs
from cardbox_tracker.ros.nodes.background_node import BackgroundNode
from cardbox_tracker.ros.nodes.camera_inputs import CameraInputs
from cardbox_tracker.ros.nodes.keypoint_inputs import CameraKeypoints, KeypointTopic, Taken
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.ros.runtime.diagnostics import NodeDiagnostics
from cardbox_tracker.ros.runtime.publishers import SinglePublisher
from cardbox_tracker.segmentation.learning import StillLearning
from cardbox_tracker.segmentation.scene_motion import SceneMotion
from cardbox_tracker.terms.term import Frame
from cardbox_tracker.tracking.camera_agreement import CameraAgreement
from cardbox_tracker.tracking.camera_faults import CameraFaults
from cardbox_tracker.tracking.facing import Facing
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.place import PlaceWatch
from cardbox_tracker.tracking.tracked_camera import DepthAgreement, surplus_of_jumps

S, PERIOD_NS = 1_000_000_000, 66_666_667
CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
# The same camera, half a metre to the right.
BESIDE = Extrinsics(np.eye(3), np.array([-0.5, 0.0, 0.0]))
Told = Iterator[bool]


def person(top: int = 60, shape: tuple[int, int] = (240, 320)) -> np.ndarray:
    mask = np.zeros(shape, np.uint8)
    mask[top : top + 100, 140:180] = 255
    return mask


def frozen(measures: Sequence[float]) -> Told:
    """The silhouette of 4000 px before the other camera changes by a share."""
    faults, still = CameraFaults(2), Observation(person())
    for share in (0.0, 0.0, *measures):
        moved = person()
        moved[200, : round(share * 4000) - 320 * (share > 0.08)] = 255
        moved[201, : 320 * (share > 0.08)] = 255
        yield faults.without([Observation(moved), still])[1] is None


def frozen_for_long(measures: Sequence[float]) -> Told:
    """The other silhouette changes by 2 %, which counts after so many repetitions."""
    for count in measures:
        faults, still, moved = CameraFaults(2), Observation(person()), person()
        faults.without([Observation(moved), still])
        moved[200, :80] = 255
        for _ in range(round(count)):
            seen = faults.without([Observation(moved), still])
        yield seen[1] is None


def full(measures: Sequence[float]) -> Told:
    faults = CameraFaults(2)
    for share in measures:
        mask = np.zeros((240, 320), np.uint8)
        mask[: round(240 * share)] = 255
        yield faults.without([Observation(person()), Observation(mask)])[1] is None


def moved(measures: Sequence[float]) -> Told:
    """The background of the other camera lies aside by whole pixels, also where people went."""
    room = np.kron(np.random.default_rng(0).integers(0, 255, (48, 64), np.uint8), np.ones((5, 5)))
    faults, number = CameraFaults(2), 0
    for percent in (0.0, *measures):
        shown = np.roll(room.astype(np.uint8), round(3.2 * percent), axis=1)
        for _ in range(40):
            number += 1
            pair = Observation(person(), room.astype(np.uint8)), Observation(person(), shown)
            told = faults.without(pair, number * PERIOD_NS)[1] is None
        if percent:
            yield told


def turned(measures: Sequence[float]) -> Told:
    faults = CameraFaults(2)
    for alike in measures:
        yield [faults.is_turned(1, alike) for _ in range(15)][-1]


def contradicted(measures: Sequence[float]) -> Told:
    """Both tops have the same height; the other silhouette is lower by an angle."""
    direction, top = PoseDirection(CAMERA, CAMERA, BESIDE, 0.0), 119
    for degrees in measures:
        lower = round(300.0 * np.tan(np.radians(degrees)))
        for _ in range(15 * 6):
            direction.see(person(top), person(top + lower))
        assert direction.height.value == pytest.approx(degrees, abs=0.15)
        yield direction.fault is not None


def supposed(name: str) -> Callable[[Sequence[float]], Told]:
    def told(measures: Sequence[float]) -> Told:
        verdict, unexplained = (Verdict(name, _explained) for _ in range(2))
        for degrees in measures:
            assert not [unexplained.see(degrees, 0.45 * degrees) for _ in range(15)][-1]
            yield [verdict.see(degrees, 0.35 * degrees) for _ in range(15)][-1]

    return told


def joints(measures: Sequence[float]) -> Told:
    """A detector finds the joints on one row, and lower by an angle in the other image."""
    direction, nobody = PoseDirection(CAMERA, CAMERA, BESIDE, 0.0), np.zeros((240, 320), np.uint8)
    for degrees in measures:
        px = np.column_stack([np.linspace(150, 170, 17), np.full(17, CAMERA.cy)])
        lower = px + np.array([0.0, 300.0 * np.tan(np.radians(degrees))])
        pair = ImagePoints(px, np.ones(17)), ImagePoints(lower, np.ones(17))
        for _ in range(15):
            direction.see(nobody, nobody, pair)
        yield direction.joints.holds


def compared(source: str, pose: Extrinsics = BESIDE) -> CameraAgreement:
    body = BodyModel.of(source=source) if source else BodyModel()
    view = View.of(body, CAMERA, OtherCamera(CAMERA, pose))
    return CameraAgreement(body, CAMERA, [view])


def extrinsics(measures: Sequence[float], part: str = "turned", source: str = "") -> Told:
    agreement = compared(source)
    for degrees in measures:
        for _ in range(15 if part == "unit" else 3):
            getattr(agreement._others[0], part).see(-degrees if part == "rolled" else degrees)
        yield agreement.remarks(["cam1"]) != []


def height(measures: Sequence[float]) -> Told:
    agreement = compared(PROPORTIONS)
    for degrees in measures:
        lower = round(300.0 * np.tan(np.radians(degrees)))
        pair = [{"silhouette": person(119)}, {"silhouette": person(119 + lower)}]
        for _ in range(15 * 6):
            agreement.look([Frame(CAMERA, channels, 240, 1) for channels in pair])
        yield agreement.remarks(["cam1"]) != []


def aside(measures: Sequence[float]) -> Told:
    """A camera 10 cm to the right shows the person aside of where a farther one would be."""
    agreement = compared(PROPORTIONS, Extrinsics(np.eye(3), np.array([-0.1, 0.0, 0.0])))
    farthest = 0.1 / (1.15 * BodyModel().placement.distance_m)
    for degrees in measures:
        # The person is at the left of the image.
        there = np.tan(np.arctan(-0.2 - farthest) + np.radians(degrees))
        pair = [{"silhouette": np.roll(person(), round(300.0 * at), 1)} for at in (-0.2, there)]
        frames = [Frame(CAMERA, channels, 240, 1) for channels in pair]
        for _ in range(15):
            agreement.see(np.zeros(14), frames)
            agreement.look(frames)
        yield agreement.are_contradicted == [True]


def late(measures: Sequence[float]) -> Told:
    """Eight joints move at random, at 20 Hz, and in the other images by so much later."""
    lag, noise = MotionLag(), np.random.default_rng(0)
    moves = np.cumsum(noise.normal(0.0, 0.1, (300 * len(measures), 8)), axis=0)
    for number, late_s in enumerate(measures):
        for i in range(300 * number + 20, 300 * (number + 1)):
            there = moves[i - round(20 * late_s)] + noise.normal(0.0, 0.05, 8)
            lag.add(i * S // 20, moves[i], there)
        yield "later" in lag.remark("cam1")


def other_motion(measures: Sequence[float]) -> Told:
    """Eight joints swing at 2 Hz; in the other images so much of that, and the rest at 6 Hz."""
    lag = MotionLag()
    for number, share in enumerate(measures):
        for i in range(300 * number, 300 * (number + 1)):
            here, rest = (np.sin(hertz * np.pi * i / 10 + np.arange(9)) for hertz in (2, 6))
            lag.add(i * S // 20, here, share * here + np.sqrt(1.0 - share**2) * rest)
        yield lag.concordance.holds


def other_view(measures: Sequence[float]) -> Told:
    """A wall is behind the lower part of the person, who is 2 m away; else there is no jump."""
    depths, mask = DepthAgreement(), np.zeros((120, 160), np.uint8)
    mask[20:, 60:100] = 255
    for percent in measures:
        depth_m = np.full(mask.shape, 2.0, np.float32)
        # Pairs are at 40 px of the top and 100 px of each side.
        depth_m[120 - round(1.2 * percent) :] = 3.0
        depth_m[mask > 0] = 2.0
        assert surplus_of_jumps(mask, depth_m) == pytest.approx(percent / 100.0, abs=0.03)
        yield [depths.accepted(mask, depth_m) is None for _ in range(45)][-1]


def distance(measures: Sequence[float]) -> Told:
    """The points are 0.067 of the distance apart for each standard deviation."""
    watch, count = PlaceWatch(BodyModel(), CAMERA), 5
    for deviations in measures:
        factor = np.exp(deviations * np.hypot(np.hypot(0.045, 0.05), 0.005))
        for _ in range(count):
            told = watch._compared.see(2.0 * factor, 2.0)
        count *= 3
        yield told


def back(measures: Sequence[float]) -> Told:
    facing = Facing(BodyModel())
    facing._known_s, facing._usual = 2.0, 0.2
    for share in measures:
        for _ in range(20):
            facing._elapsed_s = 1.0
            facing._add(0.2 + share, is_frontal=False)
        yield facing.shows_back


def other_person(measures: Sequence[float]) -> Told:
    own, other, identity = np.array([1.0, 0.0]), np.array([0.0, 1.0]), Identity()
    sides = ("left", 20.0), ("right", -20.0)
    figure = Figure(
        {f"{s}_{n}": np.array([u, v]) for s, u in sides for n, v in (("shoulder", 0), ("hip", 90))}
    )
    now_ns = 0
    for count in measures:
        for colours in [own] * 6 + [other] * round(count):
            now_ns += PERIOD_NS
            assert identity.is_same(figure, colours, now_ns)
        yield identity.is_doubtful


def of_stamps(order: StampOrder) -> Callable[[Sequence[float]], Told]:
    """Return the case of 120 images of which a number have stamps in an order."""

    def told(measures: Sequence[float]) -> Told:
        for number in measures:
            statistics, count = StreamStatistics(), round(number)
            at_ns = [S + n * PERIOD_NS for n in range(120)]
            if order is StampOrder.RESTART:
                bounds = np.array_split(at_ns, count + 1)
                at_ns = [int(n - part[0]) + S for part in bounds for n in part]
            elif order is StampOrder.FOREIGN:
                at_ns[1 : 2 * (count + 1) * (count > 0) : 2] = [9 * S] * (count + (count > 0))
            for n in range(60, 60 + count):
                at_ns[n] = {
                    StampOrder.UNSTAMPED: 0,
                    StampOrder.REPEATED: at_ns[59],
                    StampOrder.LATE: at_ns[59] - PERIOD_NS // 2,
                }.get(order, at_ns[n])
            for stamp_ns in at_ns:
                statistics.add(stamp_ns)
            assert statistics.counts[order] == count
            yield bool(statistics.remarks())

    return told


def bursts(measures: Sequence[float]) -> Told:
    """Three images with the stamps of their arrival come each second."""
    for count in measures:
        watch = ArrivalWatch()
        for second in range(round(count) + 1):
            for n in range(3):
                at_s = 100.0 + second + 0.001 * n
                watch.add(round(1e9 * at_s), StampOrder.NEXT, at_s, 0)
        yield bool(watch.remarks())


def ahead(measures: Sequence[float]) -> Told:
    watch = ArrivalWatch()
    for ahead_s in measures:
        watch.add(round(1e9 * (100.0 + ahead_s)), StampOrder.NEXT, 100.0, 100 * S)
        yield bool(watch.remarks())


class Cameras:
    """Two cameras without a node, whose messages come at a settable time."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.now_s = 1000.0
        patch.setattr(input_stream.time, "monotonic", lambda: self.now_s)
        patch.setattr(camera_inputs.CameraPoses, "__init__", lambda *_: None)
        node = SimpleNamespace(resolve=lambda name: f"/{name}", subscribe=lambda *_: None)
        settings = TrackerParameters(cameras=["left", "right"])
        given = node, settings, lambda *_: None, lambda *_: None
        self.inputs = CameraInputs(*given)  # type: ignore[arg-type]

    def show(self, number: int, stamp_s: float) -> None:
        at_ns = round(1e9 * stamp_s)
        stamp = SimpleNamespace(sec=at_ns // S, nanosec=at_ns % S)
        message = SimpleNamespace(header=SimpleNamespace(stamp=stamp))
        self.inputs._add(number, message, None, 1)  # type: ignore[arg-type]

    @property
    def is_told(self) -> bool:
        return bool(self.inputs.warnings())


def clock(measures: Sequence[float], patch: pytest.MonkeyPatch) -> Told:
    cameras = Cameras(patch)
    for apart_s in measures:
        for _ in range(61):
            cameras.now_s += 0.05
            cameras.show(0, cameras.now_s)
            cameras.show(1, cameras.now_s + apart_s)
        yield cameras.is_told


def stuck(measures: Sequence[float], patch: pytest.MonkeyPatch) -> Told:
    for count in measures:
        cameras = Cameras(patch)
        cameras.show(1, 100.0)
        for _ in range(round(count)):
            cameras.show(1, 100.0)
        cameras.show(0, 100.0)
        yield cameras.is_told


def silence(measures: Sequence[float], patch: pytest.MonkeyPatch) -> Told:
    cameras = Cameras(patch)
    for waited_s in measures:
        cameras.show(1, cameras.now_s)
        cameras.now_s += waited_s
        cameras.show(0, cameras.now_s)
        yield cameras.is_told


def diagnostics(patch: pytest.MonkeyPatch) -> NodeDiagnostics:
    patch.setattr("cardbox_tracker.ros.runtime.diagnostics.every_second", lambda *_: None)
    node: Any = SimpleNamespace(
        create_publisher=lambda *_, **__: None,
        get_topic_names_and_types=list,
        get_logger=lambda: SimpleNamespace(info=print, warning=print),
    )
    return NodeDiagnostics(node)


def ceased(measures: Sequence[float], patch: pytest.MonkeyPatch) -> Told:
    now = [1000.0]
    patch.setattr(time, "monotonic", lambda: now[0])
    made = diagnostics(patch)
    made.source = "images on /image_raw"
    for waited_s in measures:
        made.input.add(round(1e9 * now[0]))
        made._look_for_silence()
        now[0] += waited_s
        made._look_for_silence()
        yield bool(made._silence)


def slow(measures: Sequence[float], patch: pytest.MonkeyPatch) -> Told:
    made = diagnostics(patch)
    for frame in range(40):
        made.input.add(S + frame * S)
    patch.setattr(time, "time_ns", lambda: 1000 * S)
    for periods in measures:
        for _ in range(120):
            made.working(sent_ns=1000 * S - round(periods * S))
        yield made.is_slow


def advised(patch: pytest.MonkeyPatch, loss: float = 0.0, **given: Any) -> bool:
    """Return whether the background node advises something on large images."""
    values = {"covered": 0.0, "drift": 0.0, "within_m": 0.0} | given
    node: Any = SimpleNamespace(
        parameters=SimpleNamespace(
            value=SimpleNamespace(follow=False, clean_up=True, within_m=values["within_m"])
        ),
        camera_images=SimpleNamespace(remarks=dict, image_bytes=10**6, topic="/image_raw"),
        diagnostics=SimpleNamespace(
            is_slow=False,
            arrivals=SimpleNamespace(has_burst=False),
            input=SimpleNamespace(loss=loss),
        ),
        _outputs=SimpleNamespace(covered=values["covered"]),
        _drift=lambda: -values["drift"],
    )
    return bool(BackgroundNode._advice(node))


def loss(measures: Sequence[float], patch: pytest.MonkeyPatch) -> Told:
    return (advised(patch, loss=percent / 100.0) for percent in measures)


def drift(measures: Sequence[float], patch: pytest.MonkeyPatch) -> Told:
    return (advised(patch, drift=levels) for levels in measures)


def near(measures: Sequence[float], patch: pytest.MonkeyPatch) -> Told:
    for share in measures:
        found = {advised(patch, covered=share, within_m=within_m) for within_m in (0.0, 2.0)}
        assert len(found) == 1
        yield found.pop()


def exposure(measures: Sequence[float]) -> Told:
    return (exposure_problem(np.full((120, 160), level, np.uint8)) != "" for level in measures)


def keypoints(patch: pytest.MonkeyPatch, kind: Any, *given: Any) -> Any:
    """Return an input of points without a node."""
    patch.setattr(keypoint_inputs, "every_second", lambda *_: None)
    node = SimpleNamespace(
        resolve=lambda name: f"/{name}",
        subscribe=lambda *_, **__: None,
        subscribe_info=lambda *_: None,
        get_publishers_info_by_topic=lambda _: [],
    )
    return kind(node, *given, lambda: None)


def no_points(measures: Sequence[float], patch: pytest.MonkeyPatch) -> Told:
    now = [1000.0]
    patch.setattr(time, "monotonic", lambda: now[0])
    topic = keypoints(patch, KeypointTopic, "keypoints", "points")
    for waited_s in measures:
        topic.stream.arrived(S)
        now[0] += waited_s
        yield bool(topic.warnings())


def other_time(measures: Sequence[float], patch: pytest.MonkeyPatch) -> Told:
    for count in measures:
        topic = keypoints(patch, KeypointTopic, "keypoints", "points")
        for n in range(round(count)):
            topic._kept.append(Taken((1 + n) * S, "", []))
            assert topic.take((2 + n) * S, "") is None
        yield bool(topic.warnings())


def beside(measures: Sequence[float], patch: pytest.MonkeyPatch) -> Told:
    people = [ImagePoints.of({"nose": (10.0, 10.0, 0.9), "left_shoulder": (20.0, 30.0, 0.9)})]
    patch.setattr(CameraKeypoints, "_placed", lambda *_: people)
    for count in measures:
        source = keypoints(patch, CameraKeypoints, TrackerParameters(keypoints="points"), "")
        for _ in range(round(count)):
            assert source.points(None, None, person()) is None
        yield bool(source.warnings())


def other_calibration(measures: Sequence[float]) -> Told:
    """A CameraInfo of another focal length is followed when it came so often."""
    for count in measures:
        watch = CalibrationWatch("/camera_info", "/image_raw")
        watch.see(camera_info_message(Header(), CAMERA))
        other = camera_info_message(Header(), replace(CAMERA, fx=400.0, fy=400.0))
        yield [watch.see(other) for _ in range(round(count))][-1]


def wrong_calibration(measures: Sequence[float], patch: pytest.MonkeyPatch) -> Told:
    for better in measures:
        patch.setattr(zoom, "_scaled_less_same", lambda *_, by=-better: by)
        witness = zoom.ZoomWitness()
        witness.look(person())
        witness.mark()
        witness.look(person())
        calibration = Calibration.of_fov(320, 240, 60.0)
        yield witness.contradicts(calibration, calibration)


def clock_set(measures: Sequence[float]) -> Told:
    """Stamps of an image that the recorder took a tenth of a second after the one before."""
    for jump_s in measures:
        stamps = RecordedStamps()
        for at_ns in (10 * S, 10 * S + PERIOD_NS):
            stamps.add(at_ns, at_ns)
        stamps.add(10 * S + 2 * PERIOD_NS + round(jump_s * S), 10 * S + 2 * PERIOD_NS)
        yield any("was set. Times" in remark for remark in stamps.remarks())


def stamps_ahead(measures: Sequence[float]) -> Told:
    """The same, up to the remark on stamps that are believed."""
    for jump_s in measures:
        stamps = RecordedStamps()
        for at_ns, recorded_ns in ((10 * S, 10 * S), (10 * S + round(jump_s * S), 10 * S + 1)):
            stamps.add(at_ns, recorded_ns)
        yield any("late by as much" in remark for remark in stamps.remarks())


def single(publishers: dict[str, int]) -> SinglePublisher:
    """Return the watch of a node beside so many publishers of images by topic."""
    node: Any = SimpleNamespace(
        get_publishers_info_by_topic=lambda topic: [
            SimpleNamespace(node_namespace="/", node_name=f"driver_{n}")
            for n in range(publishers.get(topic, 0))
        ],
        get_topic_names_and_types=lambda: [(topic, ["Image"]) for topic in publishers],
        get_namespace=lambda: "/",
        get_name=lambda: "tracker",
    )
    return SinglePublisher(node, ("/image_raw",))


def publishers(measures: Sequence[float]) -> Told:
    return (bool(single({"/image_raw": round(count)}).remarks()) for count in measures)


def no_publisher(measures: Sequence[float], others: int = 1) -> Told:
    """So many checks, while so many nodes publish images on another topic."""
    for count in measures:
        watch = single({"/image_raw": 0, "/image": others})
        yield [bool(watch.remarks()) for _ in range(round(count))][-1]


def motion(measures: Sequence[float], patch: pytest.MonkeyPatch) -> Told:
    for share in measures:
        patch.setattr(SceneMotion, "add", lambda *_, found=share: found)
        learning = StillLearning(30)
        learning.add(person())
        yield learning.count == 0


class Case(NamedTuple):
    """A row's name, values within and beyond its limit, and how it ends if the limits differ."""

    name: str
    within: float
    beyond: float
    feed: Callable[..., Told]
    lasting: float | None = None  #: a value at which the watch goes on
    ending: float | None = None  #: and at which it ends


def of_extrinsics(part: str, source: str = "") -> Callable[[Sequence[float]], Told]:
    return lambda measures: extrinsics(measures, part, source)


CASES = [
    Case("frozen", 0.07, 0.1, frozen),
    Case("frozen for long", 14, 15, frozen_for_long),
    Case("full", 0.75, 0.85, full),
    Case("moved", 0.93, 1.25, moved),
    Case("turned", 0.72, 0.68, turned, lasting=0.73, ending=0.77),
    Case("inverted", 0.25, 0.35, supposed("inverted")),
    Case("mirrored", 0.15, 0.25, supposed("mirrored"), lasting=0.06, ending=0.04),
    Case("upside down", 0.25, 0.35, supposed("upside down"), lasting=0.06, ending=0.04),
    Case("contradicted", 2.2, 2.8, contradicted),
    Case("extrinsics", 0.8, 0.9, of_extrinsics("turned")),
    Case("extrinsics unmeasured", 5.5, 6.5, of_extrinsics("turned", PROPORTIONS)),
    Case("height", 0.8, 1.3, height),
    Case("joints", 1.6, 1.7, joints),
    Case("unit", 0.25, 0.35, of_extrinsics("unit"), lasting=0.2, ending=0.1),
    Case("aside", 0.4, 0.8, aside, ending=0.2),
    Case("late", 0.1, 0.2, late),
    Case("other motion", 0.53, 0.47, other_motion, lasting=0.56, ending=0.64),
    Case("rolled", 1.9, 2.1, of_extrinsics("rolled")),
    Case("other view", 29, 20, other_view, lasting=30, ending=40),
    Case("distance", 1.85, 2.05, distance, lasting=1.1, ending=0.9),
    Case("back", 0.2, 0.3, back, lasting=0.2, ending=0.1),
    Case("other person", 2, 3, other_person),
    Case("stamps that are zero", 0, 1, of_stamps(StampOrder.UNSTAMPED)),
    Case("stamps that repeat", 13, 14, of_stamps(StampOrder.REPEATED)),
    Case("stamps of two clocks", 0, 1, of_stamps(StampOrder.FOREIGN)),
    Case("stamps that are late", 13, 14, of_stamps(StampOrder.LATE)),
    Case("stamps that go back", 2, 3, of_stamps(StampOrder.RESTART)),
    Case("bursts", 2, 3, bursts),
    Case("stamps ahead", 0.9, 1.1, ahead),
    Case("clock", 0.09, 0.11, clock),
    Case("stuck", 10, 11, stuck),
    Case("silence", 1.9, 2.1, silence),
    Case("ceased", 1.9, 2.1, ceased),
    Case("no points", 2.9, 3.1, no_points),
    Case("other time", 4, 5, other_time),
    Case("beside", 10, 11, beside),
    Case("slow", 0.9, 1.1, slow),
    Case("loss", 9, 11, loss),
    Case("dark", 25, 20, exposure),
    Case("white", 240, 250, exposure),
    Case("drift", 11, 13, drift),
    Case("near", 0.55, 0.65, near),
    Case("other calibration", 29, 30, other_calibration),
    Case("wrong calibration", 0.09, 0.11, wrong_calibration),
    Case("clock set", 9.8, 10.2, clock_set),
    Case("stamps ahead of the recorder", 1.9, 2.1, stamps_ahead),
    Case("publishers", 1, 2, publishers),
    Case("no publisher", 5, 6, no_publisher),
    Case("no camera", 150, 151, lambda measures: no_publisher(measures, 0)),
    Case("motion", 0.005, 0.007, motion),
]


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_a_watch_holds_beyond_its_limit_until_its_end(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    more = [monkeypatch] if "patch" in case.feed.__code__.co_varnames[:2] else []
    limit = WATCHES[case.name].limit
    assert limit == 0 or all(0.5 < one / limit <= 2.0 for one in (case.within, case.beyond))
    lasting = case.beyond if case.lasting is None else case.lasting
    ending = case.within if case.ending is None else case.ending
    assert not list(case.feed([case.within], *more))[-1]
    assert list(case.feed([case.beyond, lasting, ending], *more))[-3:] == [True, True, False]


def test_each_row_has_a_case() -> None:
    assert [case.name for case in CASES] == list(WATCHES)
