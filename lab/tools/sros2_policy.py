"""Write ``config/sros2_policy*.xml``, the rights of each node, from the graph of running nodes.

``python -m lab.tools.sros2_policy`` starts the nodes of each layout in this process, asks the graph
for their topics and services, and allows these and nothing else. ``docs/security.md`` says how the
files are used.
"""

from __future__ import annotations

import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter

from cardbox_tracker.applications.simulation.session import session_camera
from cardbox_tracker.detectors.detector import PersonDetector
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.ros.nodes.background_node import BackgroundNode
from cardbox_tracker.ros.nodes.camera_node import CameraNode
from cardbox_tracker.ros.nodes.detector_node import DetectorNode
from cardbox_tracker.ros.nodes.initializer_node import InitializerNode
from cardbox_tracker.ros.nodes.play_bag_node import PlayBagNode
from cardbox_tracker.ros.nodes.retarget_node import RetargetNode
from cardbox_tracker.ros.nodes.rula_node import RulaNode
from cardbox_tracker.ros.nodes.stereo_depth_node import StereoDepthNode
from cardbox_tracker.ros.nodes.teleoperation_node import TeleoperationNode
from cardbox_tracker.ros.nodes.tracker_node import TrackerNode

_CONFIG = Path(__file__).resolve().parents[2] / "config"
# An operator of the tracker sets no parameters and publishes no topics.
OPERATOR = "operator"
_TRIGGER = "std_srvs/srv/Trigger"
_WAIT_S = 30.0
_COMMENT = """
  SROS 2 allows each node of cardbox_tracker these topics and services only; see docs/security.md.
  'python -m lab.tools.sros2_policy' writes this file from the graph of the running nodes.
"""


@dataclass(frozen=True)
class Layout:
    """Nodes that run together, as a launch file starts them.

    Attributes:
        file: name of its policy.
        cameras: namespaces of several cameras; empty: one, without a namespace.
        depth: whether they are a rectified pair with depth; other drivers publish their images.
    """

    file: str
    cameras: tuple[str, ...] = ()
    depth: bool = False

    @property
    def path(self) -> Path:
        """Path of its policy."""
        return _CONFIG / self.file

    @property
    def places(self) -> list[str]:
        """Namespaces of the cameras' own nodes, absolute."""
        return [f"/{name}" for name in self.cameras or ("",)]


LAYOUTS = (
    Layout("sros2_policy.xml"),
    Layout("sros2_policy_two_cameras.xml", ("cam0", "cam1")),
    Layout("sros2_policy_stereo.xml", ("left", "right"), depth=True),
)


@dataclass
class Access:
    """Names, relative to the namespace of the node unless they begin with a slash."""

    publish: set[str] = field(default_factory=set)
    subscribe: set[str] = field(default_factory=set)
    reply: set[str] = field(default_factory=set)
    request: set[str] = field(default_factory=set)
    triggers: set[str] = field(default_factory=set)


def access_of(observer: Any, name: str, place: str) -> Access:
    """Return topics and services of the node ``name`` in the namespace ``place``."""

    def names(query: Callable[..., Any]) -> dict[str, list[str]]:
        return dict(query(name, place))

    services = names(observer.get_service_names_and_types_by_node)
    triggers = {service for service, kinds in services.items() if _TRIGGER in kinds}
    return Access(
        *(
            _relative(found, place)
            for found in (
                names(observer.get_publisher_names_and_types_by_node),
                names(observer.get_subscriber_names_and_types_by_node),
                services,
                names(observer.get_client_names_and_types_by_node),
                triggers,
            )
        )
    )


# These names are the same in all namespaces.
_GLOBAL = ("/diagnostics", "/rosout", "/parameter_events", "/tf_static")
# With several cameras, these nodes read /tf_static if tf2_msgs is installed.
_OF_TRANSFORMS = ("tracker", "initializer")


def _relative(names: Any, place: str) -> set[str]:
    below = f"{place.rstrip('/')}/"
    return {name if name in _GLOBAL else name.removeprefix(below) for name in names}


def policy(nodes: dict[str, Access]) -> str:
    """Return the policy file: an enclave for each node, and one for an operator."""
    operator = Access(publish={"/rosout", "/parameter_events"}, subscribe={"/diagnostics"})
    for path, access in nodes.items():
        operator.request |= {f"{_place(path)}/{name}".lstrip("/") for name in access.triggers}
        if path in ("initializer", "tracker", "rula", "retarget", "teleoperation"):
            operator.subscribe |= access.publish - set(_GLOBAL)
    root = ElementTree.Element("policy", version="0.2.0")
    root.append(ElementTree.Comment(_COMMENT))
    enclaves = ElementTree.SubElement(root, "enclaves")
    for path, access in (*nodes.items(), (OPERATOR, operator)):
        enclave = ElementTree.SubElement(enclaves, "enclave", path=f"/cardbox/{path}")
        profiles = ElementTree.SubElement(enclave, "profiles")
        of = {"ns": _place(path) or "/", "node": path.rpartition("/")[2]}
        profile = ElementTree.SubElement(profiles, "profile", of)
        for kind, verb, allowed in (
            ("topic", "publish", access.publish),
            ("topic", "subscribe", access.subscribe),
            ("service", "reply", access.reply),
            ("service", "request", access.request),
        ):
            if allowed:
                part = ElementTree.SubElement(profile, f"{kind}s", {verb: "ALLOW"})
                for one in sorted(allowed):
                    ElementTree.SubElement(part, kind).text = one
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def _place(path: str) -> str:
    """Return the namespace of the node ``path``, such as cam0/background, or an empty text."""
    return f"/{path}".rpartition("/")[0]


@contextmanager
def running(
    folder: Path, layout: Layout, domain: int | None = None
) -> Iterator[tuple[Any, tuple[str, ...]]]:
    """Run the nodes of ``layout``; yield a node that observes them, and their paths."""
    video = folder / "video.avi"
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"MJPG"), 15.0, (64, 48))
    writer.write(np.zeros((48, 64, 3), np.uint8))
    writer.release()
    with BagWriter(folder / "bag") as bag:
        camera = session_camera()
        empty = np.zeros((camera.height, camera.width), np.uint8)
        for place in layout.places:
            bag.write_camera_info(f"{place}/camera_info".lstrip("/"), 1, "camera", camera)
            bag.write_image(f"{place}/image_raw".lstrip("/"), 1, "camera", empty, "mono8")
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain)
    several: dict[str, Any] = {"cameras": list(layout.cameras)} if layout.cameras else {}
    tracked = several | {"keypoints": "detector/keypoints"}
    network: Any = None  # no image comes, so the network files are not needed
    detector = partial(DetectorNode, PersonDetector(network))
    robot = {
        "robot_file": str(_CONFIG / "example_arm.urdf"),
        "joint_map_file": str(_CONFIG / "example_joint_map.yaml"),
    }
    kinds: list[tuple[Any, str, dict[str, Any]]] = [
        *((CameraNode, place, {"file": str(video)}) for place in layout.places if not layout.depth),
        (PlayBagNode, "/", {"bag": str(folder / "bag")}),
        *((BackgroundNode, place, {}) for place in layout.places),
        *((detector, place, {"publish_silhouette": True}) for place in layout.places),
        (InitializerNode, "/", several),
        (TrackerNode, "/", tracked | ({"depth": "depth"} if layout.depth else {})),
        *([(StereoDepthNode, "/", {})] if layout.depth or not layout.cameras else []),
        (RulaNode, "/", {}),
        (RetargetNode, "/", robot),
        (TeleoperationNode, "/", {}),
    ]
    make: Any = Parameter
    made = []
    try:
        for kind, place, values in kinds:
            overrides = [make(name, value=value) for name, value in values.items()]
            made.append(kind(context=context, namespace=place, parameter_overrides=overrides))
        observer = rclpy.create_node("observer", context=context, enable_rosout=False)
        made.append(observer)
        yield observer, tuple(node.get_fully_qualified_name().lstrip("/") for node in made[:-1])
    finally:
        for node in made:
            getattr(node, "close", lambda: None)()
            node.destroy_node()
        context.try_shutdown()


def read_graph(folder: Path, layout: Layout, domain: int | None = None) -> dict[str, Access]:
    """Return the access of each node, once another node discovers nothing more."""
    with running(folder, layout, domain) as (observer, paths):
        found: dict[str, Access] = {}
        settled_s = end_s = time.monotonic() + _WAIT_S
        while time.monotonic() < min(settled_s, end_s):
            try:
                now = {
                    path: access_of(observer, path.rpartition("/")[2], _place(path) or "/")
                    for path in paths
                }
            except rclpy.node.NodeNameNonExistentError:
                now = {}
            if now != found or not now:
                found, settled_s = now, time.monotonic() + 1.0
            time.sleep(0.1)
    for path in _OF_TRANSFORMS if layout.cameras else ():
        found[path].subscribe.add("/tf_static")
    return found


def main() -> int:
    """Write the files."""
    for layout in LAYOUTS:
        with tempfile.TemporaryDirectory() as folder:
            text = policy(read_graph(Path(folder), layout))
        layout.path.write_text(text, encoding="utf-8")
        print(f"written: {layout.path.relative_to(_CONFIG.parent)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
