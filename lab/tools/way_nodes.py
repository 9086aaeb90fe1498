"""The nodes of :mod:`.ways`: a bag goes through them, and what they publish becomes results."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown
from std_msgs.msg import String

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.recordings.bag_reader import BagReader, stamp_ns_of
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.outputs import TOPICS, person_space
from cardbox_tracker.recordings.result_bag import result_writer
from cardbox_tracker.recordings.result_reader import Results, read_results
from cardbox_tracker.ros.messages.types import class_of
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.processes import Nodes, compile_kernels, isolate, running_nodes
from lab.tools.way_cases import Case

_START_S, _QUIET_S, _SHOWN = 180.0, 3.0, 400
# In the order of their publication.
_RECORDED = ("tracking_state", "joint_states", "joint_states_stddev", "keypoints")


def prepare() -> None:
    """Keep nodes of this tree from other graphs, compile for them, and stop them on the way out."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    os.environ.setdefault("PYTHONPATH", str(Path(__file__).parents[2]))
    isolate()
    compile_kernels()


class Recorder:
    """Writes what trackers publish to a bag that :func:`.read_results` takes.

    Attributes:
        node: subscribes.
    """

    def __init__(self, bag: BagWriter, spaces: Sequence[str]) -> None:
        """Subscribe to the results in the namespaces ``spaces``."""
        self._bag, self._came_s = bag, time.monotonic()
        self._stamps_ns = dict.fromkeys(spaces, 0)
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        self.node = rclpy.create_node("cardbox_ways", enable_rosout=False)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        for space in spaces:
            self._subscribe(space, "body_model", String, qos.LATCHED)
            for topic in _RECORDED:
                self._subscribe(space, topic, class_of(TOPICS[topic]), qos.REPLAY)

    def _subscribe(self, space: str, topic: str, kind: Any, profile: Any) -> None:
        name = f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"

        def record(raw: bytes) -> None:
            self._came_s = time.monotonic()
            message = deserialize_message(raw, kind)
            # A state has no stamp, and comes between the results of two images.
            at_ns = self._stamps_ns[space] + 1
            if hasattr(message, "header"):
                at_ns = self._stamps_ns[space] = stamp_ns_of(message)
            self._bag.write_raw(f"{space}/{topic}", name, raw, at_ns)

        self.node.create_subscription(kind, f"{space}/{topic}", record, profile, raw=True)

    def spin(self, duration_s: float) -> None:
        """Record for ``duration_s``."""
        end_s = time.monotonic() + duration_s
        while (left_s := end_s - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left_s)

    def spin_until_quiet(self) -> None:
        """Record until nothing has come for a while, because the nodes may lag behind."""
        self._came_s = time.monotonic()
        while time.monotonic() - self._came_s < _QUIET_S:
            self.spin(0.2)

    def close(self) -> None:
        """Leave ROS."""
        self._executor.shutdown()
        self.node.destroy_node()  # type: ignore[no-untyped-call]
        try_shutdown()


def live(
    case: Case,
    folder: Path,
    rate: float,
    further: Callable[[Nodes, Any, str], Sequence[str]] | None = None,
) -> Iterator[Results]:
    """Play the bag to the nodes at ``rate`` times its speed; yield the results by person.

    ``further`` starts more of the nodes, with the node that records and the namespace of the
    results, and returns the topics to wait for. Logs and results are written to ``folder``. Raises
    CardboxError if a node ends, or the bag does not, or there are no results.
    """
    # One camera has all nodes in its namespace, several have a tracker above theirs.
    space = f"/{case.cameras[0]}" if len(case.cameras) == 1 else ""
    spaces = [space + (person_space(one) if one else "") for one in case.numbers]
    with running_nodes(folder) as nodes, result_writer(folder / "live") as bag:
        awaited = [f"{one}/keypoints" for one in spaces]
        several = {"people": len(case.people)} if len(case.people) > 1 else {}
        for camera in case.cameras:
            words = ("--ros-args", "-r", f"__ns:=/{camera}", "-p", "image_transport:=compressed")
            looks = _parameters(rate_hz=0.0, publish_silhouette=case.empty is None, **several)
            nodes.start("detector", *words, *looks, called=f"detector_{camera}")
            awaited.append(f"/{camera}/detector/keypoints")
            if case.empty is not None:
                nodes.start("background", *words, called=f"background_{camera}")
        given = _parameters(**_given(case), **several)
        nodes.start("tracker", "--ros-args", "-r", f"__ns:={space or '/'}", *given)
        recorder = Recorder(bag, spaces)
        try:
            awaited += further(nodes, recorder.node, space) if further else ()
            _play(case, nodes, awaited, rate, recorder)
        finally:
            recorder.close()
    for number in case.numbers:
        yield read_results(folder / "live", number)


def _given(case: Case) -> dict[str, Any]:
    """Return the parameters of the tracker for what is given."""
    statures = [float(person.stature_m) for person in case.people]
    given: dict[str, Any] = {"keypoints": "detector/keypoints"}
    given["camera_pitch_deg"] = float(case.pitch_deg)
    given |= {"stature": statures[0]} if len(statures) == 1 else {"statures": statures}
    if len(case.cameras) > 1:
        given["cameras"] = list(case.cameras)
    if case.extrinsics is not None:
        given["extrinsics_file"] = case.extrinsics.resolve()
    return given


def _play(
    case: Case, nodes: Nodes, awaited: Sequence[str], rate: float, recorder: Recorder
) -> None:
    with BagReader(case.bag) as bag:
        played = [bag.image_topic(one) for one in case.cameras]
        played += [bag.camera_info_topic(one) for one in case.cameras]
        end_s = time.monotonic() + _START_S + 1.5 * bag.duration_s / rate
    words = (str(case.bag), "--rate", f"{rate:g}", "--topics", *played)
    nodes.start("play_bag", *words, "--ros-args", *_parameters(wait_for_topics=awaited))
    while nodes.is_running("play_bag"):
        recorder.spin(0.2)
        nodes.check()
        if time.monotonic() > end_s:
            raise CardboxError(f"the bag did not end: {nodes.text('tracker')[-_SHOWN:]}")
    recorder.spin_until_quiet()


def _parameters(**values: Any) -> list[str]:
    """Return values as ROS arguments; texts of lists have no quotes."""
    texts = {name: str(value).replace("'", "") for name, value in values.items()}
    return [word for name, text in texts.items() for word in ("-p", f"{name}:={text}")]
