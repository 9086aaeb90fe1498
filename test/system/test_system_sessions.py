"""Synthetic and recorded sessions, played to live nodes and compared with the ground truth."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseArray
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import String

from cardbox_tracker.applications.simulation.session import synthesize_session
from cardbox_tracker.ros.messages.conversions import stamp_ns
from cardbox_tracker.ros.messages.results import mean_iou_of
from cardbox_tracker.ros.runtime import qos

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
KEYPOINTS = tuple(
    f"{side}_{joint}" for side in ("left", "right") for joint in ("shoulder", "elbow", "hand")
)
MEAN_ERROR_M = 0.15


# The synthetic one is for computers without the recorded ones.
@pytest.mark.slow
@pytest.mark.parametrize("name", ["person_a" if (DATA / "person_a").is_dir() else "synthetic"])
def test_session_is_measured_and_tracked_to_its_end(
    own_graph: Any, deep: Callable[[str, str], tuple[str, ...]], name: str, tmp_path: Path
) -> None:
    graph = own_graph
    if name == "synthetic":
        bag, transport = tmp_path / "bag", "raw"
        truth = synthesize_session(bag, motion="wave")
    else:
        bag, transport = DATA / name / "bag", "compressed"
        truth = json.loads((DATA / name / "ground_truth.json").read_text())
    topic = "/camera/image_raw" + ("/compressed" if transport == "compressed" else "")
    spans = {
        segment["name"]: (segment["start_s"], segment["end_s"]) for segment in truth["segments"]
    }
    eye = f"/{name}"
    remap = ("--ros-args", "-r", f"__ns:={eye}")
    camera = (
        *("-r", f"{topic.removeprefix('/camera/')}:={topic}"),
        *("-r", "camera_info:=/camera/camera_info"),
        *deep(topic, "subscription"),
        *deep(f"{eye}/silhouette", "publisher"),
    )
    queue = deep(f"{eye}/silhouette", "subscription")
    graph.start("background", *remap, *camera, image_transport=transport)
    graph.start(
        "initializer",
        *remap,
        person_distance_m=truth["person"]["distance_m"],
        camera_pitch_deg=float(truth["camera"].get("pitch_down_deg", 0.0)),
        side_turn=truth["side_posture_turns_to"],
    )
    graph.start("tracker", *remap, *queue)
    states = graph.collect(JointState, f"{eye}/joint_states", qos.REPLAY)
    keypoints = graph.collect(PoseArray, f"{eye}/keypoints", qos.REPLAY)
    silhouettes = graph.collect(Image, f"{eye}/silhouette", qos.REPLAY)
    statuses = graph.collect(String, f"{eye}/play_bag/status", qos.LATCHED)
    fits = graph.collect(DiagnosticStatus, f"{eye}/initializer/result", qos.LATCHED)
    graph.wait(
        lambda: (
            graph.node.count_subscribers(topic) == 1
            and graph.node.count_subscribers("/camera/camera_info") == 1
            and graph.node.count_subscribers(f"{eye}/silhouette") == 3
            and graph.node.count_publishers(f"{eye}/keypoints") == 1
        ),
        "the nodes",
    )
    pauses = {reference: np.mean(spans[reference]) for reference in ("front", "side", "arms")}
    stops = [f"{at_s:.3f}" for at_s in pauses.values()]
    played = deep(topic, "publisher")
    player = graph.start(
        *("play_bag", str(bag), "--rate", "6", "--pause-at", *stops), *remap, *played
    )
    stamps = [frame["stamp_ns"] for frame in truth["frames"]]

    def is_cut_out(before_s: float) -> bool:
        last_ns = max(at for at in stamps if at - stamps[0] < before_s * 1e9 - 1e8)
        return bool(silhouettes) and stamp_ns(silhouettes[-1].header.stamp) >= last_ns

    for reference, stop in zip(pauses, stops, strict=True):
        graph.wait(lambda: statuses and statuses[-1].data == f"paused at {stop} s", reference)  # noqa: B023
        graph.wait(lambda: is_cut_out(pauses[reference]), "all silhouettes before the pause")  # noqa: B023
        graph.spin(0.3)
        response = graph.call(f"{eye}/initializer/capture_{reference}")
        assert response.success, response.message
        if reference == "arms":
            response = graph.call(f"{eye}/initializer/initialize", timeout_s=90)
            assert response.success, response.message
            graph.wait(lambda: fits, "the fit")
            iou = mean_iou_of(fits[-1])
            assert iou >= 0.80, response.message
            graph.diagnosis(f"{name}/tracker", "")
        assert graph.call(f"{eye}/play_bag/resume").success
    graph.wait(lambda: player.poll() is not None, "the end of the bag")
    frames = [f for f in truth["frames"] if "joints_m" in f]
    last_ns = frames[-1]["stamp_ns"]
    graph.wait(
        lambda: states[-1:] and stamp_ns(states[-1].header.stamp) >= last_ns, "the last joint state"
    )
    graph.spin(0.5)
    images = [f["stamp_ns"] for f in frames if f["stamp_ns"] >= stamp_ns(states[0].header.stamp)]
    assert [stamp_ns(state.header.stamp) for state in states] == images
    where = {frame["stamp_ns"]: frame["joints_m"] for frame in frames}
    errors = [
        np.linalg.norm(np.array([(p.position.x, p.position.y, p.position.z)]) - where[at][joint])
        for message in keypoints
        if (at := stamp_ns(message.header.stamp)) in where
        for joint, p in zip(KEYPOINTS, message.poses, strict=True)
    ]
    print(f"{name}: IoU {iou:.2f}, {len(states)} images, mean error {np.mean(errors):.3f} m")
    assert np.mean(errors) < MEAN_ERROR_M
