"""Track recorded sessions with several cameras through running nodes, beside ``cardbox track``.

python -m tools.live_cameras --sessions DIR... --output docs/two-cameras.md

``play_bag`` plays each session over DDS in its own time; a background node for each camera, the
tracker, and for a rectified pair ``stereo_depth`` follow. The body is measured from the recording,
the same for both, so that only the nodes make a difference.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.model_file import save_body_model
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation.config import default_preset
from cardbox_tracker.evaluation.recorded.session import RecordedSession, load_session
from cardbox_tracker.evaluation.recorded.tracking import WITH_DEPTH, track_session
from cardbox_tracker.files import atomic_path
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.cameras import STEREO
from cardbox_tracker.ros.runtime.processes import Nodes, isolate, running_nodes
from tools.readme_figures import replaced

FloatArray = NDArray[np.float64]

BEGIN, END = "<!-- figures of tools.live_cameras -->", "<!-- end of the figures -->"
_TIMEOUT_S = 60.0
# Silhouettes and postures of the last images are still on their way when the recording has ended.
_AFTER_S = 3.0


@dataclass(frozen=True)
class Live:
    """What the nodes made of one session.

    Attributes:
        keypoints_m: (6, 3) by the image's stamp, metres in the first camera's optical frame.
        behind_s: from the first camera's silhouette to the joint state, of images that had both.
    """

    keypoints_m: dict[int, FloatArray]
    behind_s: list[float]


def main(args: list[str] | None = None) -> None:
    """Play all sessions and write the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--sessions", type=Path, nargs="+", required=True, metavar="DIR")
    parser.add_argument("--output", type=Path, required=True, metavar="PAGE.md")
    options = parser.parse_args(args)
    isolate()
    lines = [
        "| session | input | live, cm | `cardbox track`, cm | images with a posture | 95 % within |"
    ]
    lines.append("|---|---|---|---|---|---|")
    for folder in options.sessions:
        session = load_session(folder)
        for depth in [None, STEREO] if session.truth.is_rectified else [None]:
            lines.append(row(session, depth))
            print(lines[-1], flush=True)
    page = options.output.read_text(encoding="utf-8")
    with atomic_path(options.output) as path:
        path.write_text(replaced(page, "\n".join(lines), BEGIN, END), encoding="utf-8")


def row(session: RecordedSession, depth: str | None) -> str:
    """Return the line of a session, with depth or without.

    Raises:
        CardboxError: it cannot be measured, or a node ended.
    """
    (run,) = track_session(session, default_preset(), (0,), WITH_DEPTH if depth else None)
    if run.body is None:
        raise CardboxError(f"{session.name}: {run.failure}")
    with tempfile.TemporaryDirectory() as folder:
        save_body_model(run.body, Path(folder) / "body.yaml")
        live = played(session, Path(folder) / "body.yaml", depth, Path(folder))
    stamps = session.stamps_ns.tolist()
    found = np.full(session.keypoints_m.shape, np.nan)
    for number, stamp in enumerate(stamps):
        if stamp in live.keypoints_m:
            found[number] = live.keypoints_m[stamp]
    seen = np.isfinite(found).all(axis=(1, 2))
    errors = [
        100 * float(np.nanmean(np.linalg.norm(points - session.keypoints_m, axis=2)))
        for points in (found, run.keypoints_m)
    ]
    behind_ms = 1e3 * float(np.percentile(live.behind_s, 95)) if live.behind_s else float("nan")
    return (
        f"| `{session.name}` | both{', depth' if depth else ''} "
        f"| {errors[0]:.1f} | {errors[1]:.1f} "
        f"| {np.count_nonzero(seen)} of {len(stamps)} | {behind_ms:.0f} ms |"
    )


def played(session: RecordedSession, body: Path, depth: str | None, logs: Path) -> Live:
    """Play a session to the nodes, and return what they published.

    Raises:
        CardboxError: a node ended, or they do not find each other.
    """
    depth_node = ["stereo_depth"] if depth else []
    with running_nodes(logs) as nodes, subscribed(session.truth.cameras[0]) as (live, ears):
        topics = _start(nodes, session, body, depth)
        _wait(nodes, ears, lambda: all(ears.node.count_subscribers(topic) for topic in topics))
        _wait(nodes, ears, lambda: ears.node.count_publishers("keypoints") == 1)
        spin_until(ears, time.monotonic() + 1.0)
        # Late enough that all are connected: the empty scene may be hardly longer than learning.
        nodes.start(
            "play_bag", str(session.bag), "--topics", *topics, "--ros-args", "-p", "delay_s:=3.0"
        )
        while nodes.is_running("play_bag"):
            spin_until(ears, time.monotonic() + 0.2)
        nodes.check()
        spin_until(ears, time.monotonic() + _AFTER_S)
        if not live.keypoints_m:
            words = "\n".join(nodes.text(name) for name in ("tracker", *depth_node))
            raise CardboxError(f"{session.name}: no posture has come:\n{words}")
        return live


def _start(nodes: Nodes, session: RecordedSession, body: Path, depth: str | None) -> list[str]:
    """Start the nodes that follow a recording; return the topics to play."""
    cameras = session.truth.cameras
    with BagReader(session.bag) as bag:
        known = set(bag.topics)
    image = (
        "image_raw/compressed" if f"/{cameras[0]}/image_raw/compressed" in known else "image_raw"
    )
    transport = ("-p", f"image_transport:={'raw' if image == 'image_raw' else 'compressed'}")
    for camera in cameras:
        space = ("--ros-args", "-r", f"__ns:=/{camera}")
        nodes.start("background", *space, *transport, called=f"background_{camera}")
    words = ["-p", f"cameras:=[{', '.join(cameras)}]", "-p", f"model_file:={body}"]
    if session.extrinsics is not None:
        words += ["-p", f"extrinsics_file:={session.extrinsics}"]
    if depth is not None:
        names = [
            f"{side}/{topic}" for side in ("left", "right") for topic in (image, "camera_info")
        ]
        pairs = [name.split("/", 1) for name in names]
        sides = dict(zip(("left", "right"), cameras[:2], strict=True))
        renamed = [f"{side}/{topic}:=/{sides[side]}/{topic}" for side, topic in pairs]
        nodes.start(
            "stereo_depth", "--ros-args", *transport, *(w for r in renamed for w in ("-r", r))
        )
        words += ["-p", "depth:=depth"]
    nodes.start("tracker", "--ros-args", *words)
    return [f"/{camera}/{topic}" for camera in cameras for topic in (image, "camera_info")]


@dataclass(frozen=True)
class Ears:
    """A node that listens."""

    node: Any
    executor: Any


@contextmanager
def subscribed(camera: str) -> Iterator[tuple[Live, Ears]]:
    """Context in which the postures of an image are noted, and when they came."""
    import rclpy
    from geometry_msgs.msg import PoseArray
    from rclpy.executors import SingleThreadedExecutor
    from sensor_msgs.msg import Image

    from cardbox_tracker.ros.messages.conversions import stamp_ns
    from cardbox_tracker.ros.runtime import qos

    live, cut_out_s = Live({}, []), dict[int, float]()

    def on_points(message: PoseArray) -> None:
        stamp = stamp_ns(message.header.stamp)
        points = [(pose.position.x, pose.position.y, pose.position.z) for pose in message.poses]
        live.keypoints_m[stamp] = np.array(points)
        if stamp in cut_out_s:
            live.behind_s.append(time.monotonic() - cut_out_s[stamp])

    def on_silhouette(message: Image) -> None:
        cut_out_s[stamp_ns(message.header.stamp)] = time.monotonic()

    rclpy.init()
    try:
        node: Any = rclpy.create_node("live_cameras")
        node.create_subscription(PoseArray, "keypoints", on_points, qos.REPLAY)
        node.create_subscription(Image, f"/{camera}/silhouette", on_silhouette, qos.REPLAY)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        yield live, Ears(node, executor)
        node.destroy_node()
    finally:
        rclpy.shutdown()


def spin_until(ears: Ears, end_s: float) -> None:
    """Take messages until that time of the monotonic clock."""
    while time.monotonic() < end_s:
        ears.executor.spin_once(timeout_sec=0.05)


def _wait(nodes: Nodes, ears: Ears, condition: Any) -> None:
    end_s = time.monotonic() + _TIMEOUT_S
    while not condition():
        nodes.check()
        if time.monotonic() > end_s:
            raise CardboxError(f"the nodes did not find each other within {_TIMEOUT_S:g} s")
        spin_until(ears, time.monotonic() + 0.1)


if __name__ == "__main__":
    main()
