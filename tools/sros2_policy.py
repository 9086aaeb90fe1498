"""Write ``config/sros2_policy.xml``: what each node may do, read from the graph of running nodes.

``python -m tools.sros2_policy`` starts each node in this process, asks the graph for its topics and
services, and allows these and nothing else. ``docs/security.md`` says how the file is used.
"""

from __future__ import annotations

import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter

from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.ros.nodes.background_node import BackgroundNode
from cardbox_tracker.ros.nodes.camera_node import CameraNode
from cardbox_tracker.ros.nodes.initializer_node import InitializerNode
from cardbox_tracker.ros.nodes.play_bag_node import PlayBagNode
from cardbox_tracker.ros.nodes.retarget_node import RetargetNode
from cardbox_tracker.ros.nodes.rula_node import RulaNode
from cardbox_tracker.ros.nodes.stereo_depth_node import StereoDepthNode
from cardbox_tracker.ros.nodes.tracker_node import TrackerNode
from cardbox_tracker.simulation.session import session_camera

_CONFIG = Path(__file__).resolve().parents[1] / "config"
PATH = _CONFIG / "sros2_policy.xml"
# What a person who operates the tracker needs: no parameters, no topics of ours to publish.
OPERATOR = "operator"
_TRIGGER = "std_srvs/srv/Trigger"
_WAIT_S = 30.0
_COMMENT = """
  What each node of cardbox_tracker may do with SROS 2, and nothing else; see docs/security.md.
  Written by 'python -m tools.sros2_policy' from the graph of the running nodes.
"""


@dataclass
class Access:
    """Names, relative to the namespace of the node unless they begin with a slash."""

    publish: set[str] = field(default_factory=set)
    subscribe: set[str] = field(default_factory=set)
    reply: set[str] = field(default_factory=set)
    request: set[str] = field(default_factory=set)
    triggers: set[str] = field(default_factory=set)


def access_of(observer: Any, name: str) -> Access:
    """Return what the graph says of the node ``name`` in the root namespace."""

    def names(query: Callable[..., Any]) -> dict[str, list[str]]:
        return dict(query(name, "/"))

    services = names(observer.get_service_names_and_types_by_node)
    return Access(
        _relative(names(observer.get_publisher_names_and_types_by_node)),
        _relative(names(observer.get_subscriber_names_and_types_by_node)),
        _relative(services),
        _relative(names(observer.get_client_names_and_types_by_node)),
        _relative({service for service, kinds in services.items() if _TRIGGER in kinds}),
    )


# These are the same for all nodes, whatever their namespace.
_GLOBAL = ("/diagnostics", "/rosout", "/parameter_events")


def _relative(names: Any) -> set[str]:
    return {name if name in _GLOBAL else name.removeprefix("/") for name in names}


def policy(nodes: dict[str, Access]) -> str:
    """Return the policy file: an enclave for each node, and one for an operator."""
    operator = Access(publish={"/rosout", "/parameter_events"}, subscribe={"/diagnostics"})
    for name, access in nodes.items():
        operator.request |= access.triggers
        if name in ("initializer", "tracker", "rula", "retarget"):
            operator.subscribe |= access.publish - set(_GLOBAL)
    root = ElementTree.Element("policy", version="0.2.0")
    root.append(ElementTree.Comment(_COMMENT))
    enclaves = ElementTree.SubElement(root, "enclaves")
    for name, access in (*nodes.items(), (OPERATOR, operator)):
        enclave = ElementTree.SubElement(enclaves, "enclave", path=f"/cardbox/{name}")
        profiles = ElementTree.SubElement(enclave, "profiles")
        profile = ElementTree.SubElement(profiles, "profile", ns="/", node=name)
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


@contextmanager
def running(folder: Path, domain: int | None = None) -> Iterator[tuple[Any, tuple[str, ...]]]:
    """Context of one node of each kind; gives a node that observes them, and their names."""
    video = folder / "video.avi"
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"MJPG"), 15.0, (64, 48))
    writer.write(np.zeros((48, 64, 3), np.uint8))
    writer.release()
    with BagWriter(folder / "bag") as bag:
        camera = session_camera()
        bag.write_camera_info("camera_info", 1, "camera", camera)
        empty = np.zeros((camera.height, camera.width), np.uint8)
        bag.write_image("image_raw", 1, "camera", empty, "mono8")
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain)
    kinds: dict[Any, dict[str, Any]] = {
        CameraNode: {"file": str(video)},
        PlayBagNode: {"bag": str(folder / "bag")},
        BackgroundNode: {},
        InitializerNode: {},
        TrackerNode: {},
        StereoDepthNode: {},
        RulaNode: {},
        RetargetNode: {
            "robot_file": str(_CONFIG / "example_arm.urdf"),
            "joint_map_file": str(_CONFIG / "example_joint_map.yaml"),
        },
    }
    make: Any = Parameter
    made = []
    try:
        for kind, values in kinds.items():
            overrides = [make(name, value=value) for name, value in values.items()]
            made.append(kind(context=context, parameter_overrides=overrides))
        observer = rclpy.create_node("observer", context=context, enable_rosout=False)
        made.append(observer)
        yield observer, tuple(node.get_name() for node in made[:-1])
    finally:
        for node in made:
            getattr(node, "close", lambda: None)()
            node.destroy_node()
        context.try_shutdown()


def read_graph(folder: Path, domain: int | None = None) -> dict[str, Access]:
    """Return what each node has, as another node sees it once nothing more comes."""
    with running(folder, domain) as (observer, names):
        found: dict[str, Access] = {}
        settled_s = end_s = time.monotonic() + _WAIT_S
        while time.monotonic() < min(settled_s, end_s):
            try:
                now = {name: access_of(observer, name) for name in names}
            except rclpy.node.NodeNameNonExistentError:
                now = {}
            if now != found or not now:
                found, settled_s = now, time.monotonic() + 1.0
            time.sleep(0.1)
        return found


def main() -> int:
    """Write the file."""
    with tempfile.TemporaryDirectory() as folder:
        PATH.write_text(policy(read_graph(Path(folder))), encoding="utf-8")
    print(f"written: {PATH.relative_to(PATH.parents[1])}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
