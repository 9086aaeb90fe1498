"""'cardbox retarget': a table, a bag with the robot in it, and mistakes in words."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.result_bag import result_bag
from cardbox_tracker.recordings.result_table import result_table
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.tracking.estimate import LOST, TRACKING, Estimate
from cardbox_tracker.tracking.tracker import Tracker

CONFIG = Path(__file__).parents[2] / "config"
ROBOT, MAP = CONFIG / "example_arm.urdf", CONFIG / "example_joint_map.yaml"


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four images of stretched arms, of which the third has nobody."""
    path = tmp_path_factory.mktemp("results") / "results"
    tracker = Tracker(BodyModel.of(hip_height_m=-0.51), Camera(64, 48, 66.0, 66.0, 31.5, 23.5))
    grey, posture = np.zeros((48, 64), np.uint8), reference_posture("arms")
    seen = Estimate(TRACKING, posture, np.full(12, 0.1), np.zeros((6, 3)), 10, 0.9)
    with result_bag(path, "camera") as bag:
        for i, estimate in enumerate((seen, seen, Estimate(LOST), seen, seen)):
            bag(RecordedFrame(i * 10**8, i / 10, grey, grey), estimate, tracker)
    return path


def test_the_robot_follows_and_stands_still(
    results: Path, tmp_path: Path, cardbox: Callable
) -> None:
    table, bag = tmp_path / "arm.csv", tmp_path / "with_arm"
    done = cardbox(
        *("retarget", results, "--robot", ROBOT, "--map", MAP, "--max-speed", "0.5"),
        *("--soft-start-s", "0", "--max-acceleration", "20", "--max-jerk", "400"),
        *("--csv", table, "--bag", bag),
    )
    assert done.code == 0, done.err
    assert "following: 4 of 5 images" in done.out
    assert "holding: lost: 1 of 5 images" in done.out
    with table.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["status"] for row in rows[:26]] == (
        ["following"] * 10 + ["holding: lost"] * 5 + ["following"] * 11
    )
    assert np.diff([int(row["stamp_ns"]) for row in rows]).tolist() == [20_000_000] * 25
    # 0.5 rad/s from the second image on, which comes after 0.1 s; it arrives later.
    roll = np.array([float(row["shoulder_roll"]) for row in rows])
    assert roll[5] == 0.0 and (np.diff(roll) <= 0.0).all() and roll[-1] < -0.05
    assert np.abs(np.diff(roll)).max() <= 0.5 * 0.02 + 1e-6
    assert float(rows[9]["shoulder_roll_velocity"]) < -0.2
    with BagReader(bag) as read, BagReader(results) as before:
        kinds = read.topics
        assert kinds["/retarget/joint_trajectory"] == "trajectory_msgs/msg/JointTrajectory"
        assert read.count(["/retarget/joint_states"]) == 26
        assert read.count(["/retarget/joint_trajectory"]) == 5
        assert kinds.keys() - before.topics.keys() == {
            f"/retarget/{name}"
            for name in ("joint_states", "joint_trajectory", "robot_description", "status")
        }
        assert read.count(list(before.topics)) == before.count()


def test_a_table_is_read_and_its_joints_are_streamed(
    results: Path, tmp_path: Path, cardbox: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[dict] = []
    sender = SimpleNamespace(
        send=lambda one: sent.append(json.loads(one)), close=lambda: None, remarks=()
    )
    monkeypatch.setattr(
        "cardbox_tracker.applications.teleoperation.sending.ZmqSender", lambda _: sender
    )
    table, arm = tmp_path / "person.csv", tmp_path / "arm.csv"
    posture = reference_posture("arms")
    seen = Estimate(TRACKING, posture, np.full(12, 0.1), np.zeros((6, 3)), 10, 0.9)
    grey = np.zeros((48, 64), np.uint8)
    with result_table(table, has_points=True) as add:
        for i in range(3):
            add(RecordedFrame(i * 10**8, i / 10, grey, grey), seen)
    body = BodyModel.of(hip_height_m=-0.51)
    save_body_model(body, tmp_path / "person.body.yaml")
    options = ("--robot", ROBOT, "--csv", arm, "--stream", "tcp://127.0.0.1:5557")
    done = cardbox("retarget", table, *options)
    assert done.code == 0, done.err
    with arm.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    names = sent[0]["names"]
    assert [one["stamp_ns"] for one in sent] == [int(row["stamp_ns"]) for row in rows]
    assert sent[-1]["positions"] == [float(rows[-1][name]) for name in names]
    assert sent[0]["lower"] < sent[0]["upper"]
    done = cardbox("retarget", table, "--robot", ROBOT, "--bag", tmp_path / "out")
    assert done.code == 1 and "is a table" in done.err
    (tmp_path / "person.body.yaml").unlink()
    done = cardbox("retarget", table, "--robot", ROBOT)
    assert done.code == 1 and "keep OUT.body.yaml" in done.err


HEAD = """<robot name="head"><link name="neck"/><link name="face"/>
<joint name="head_yaw" type="revolute"><parent link="neck"/><child link="face"/>
<limit lower="-1" upper="1" velocity="0" effort="1"/></joint></robot>"""


def test_a_head_in_a_bag_is_followed_while_the_face_is_known(
    tmp_path: Path, cardbox: Callable
) -> None:
    """The face is seen in the first three of five images, turned by 0.3 rad."""
    results, robot, joint_map = (tmp_path / name for name in ("results", "head.urdf", "map.yaml"))
    robot.write_text(HEAD)
    joint_map.write_text("joints:\n  - {from: neck_yaw, to: head_yaw}\n")
    tracker = Tracker(BodyModel.of(hip_height_m=-0.51), Camera(64, 48, 66.0, 66.0, 31.5, 23.5))
    grey = np.zeros((48, 64), np.uint8)
    hidden = Estimate(TRACKING, np.zeros(12), np.full(12, 0.1), np.zeros((6, 3)), 10, 0.9)
    seen = replace(hidden, neck=np.array([0.3, 0.0]), neck_stddev=np.array([0.1, 0.1]))
    with result_bag(results, "camera") as bag:
        for i, estimate in enumerate((seen, seen, seen, hidden, hidden)):
            bag(RecordedFrame(i * 10**8, i / 10, grey, grey), estimate, tracker)
    table = tmp_path / "head.csv"
    done = cardbox(
        *("retarget", results, "--robot", robot, "--map", joint_map, "--max-speed", "2"),
        *("--soft-start-s", "0", "--max-acceleration", "1000", "--max-jerk", "1000000"),
        *("--csv", table),
    )
    assert done.code == 0, done.err
    with table.open(encoding="utf-8") as file:
        yaw = [float(row["head_yaw"]) for row in csv.DictReader(file)]
    # 0.2 rad from the second image on, the rest from the third, and no way back to 0.
    assert [yaw[10], yaw[15], yaw[-1]] == pytest.approx([0.2, 0.3, 0.3], abs=0.01)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--robot", "FOLDER/missing.urdf"), "missing.urdf: No such file or directory"),
        (("--robot", str(MAP)), "expected the URDF"),
        (("--map", str(ROBOT)), "config/example_joint_map.yaml"),
        (("--map", str(MAP), "--hand", "hand_link"), "either a joint map or hand, not both"),
        (("--map", str(MAP), "--lowest-m", "0"), "either a joint map or lowest_m, not both"),
        (("--max-speed", "100"), "--max-speed is 100; expected 0.01 to 20"),
        (("--map", str(MAP), "--side", "both"), "either a joint map or both sides"),
        (("--side", "none"), "--side: invalid choice: 'none'"),
    ],
)
def test_mistakes_of_retarget(
    results: Path, tmp_path: Path, words: tuple[str, ...], expected: str, cardbox: Callable
) -> None:
    given = [word.replace("FOLDER", str(tmp_path)) for word in words]
    rest = [] if "--robot" in words else ["--robot", ROBOT]
    rest += [] if "--map" in words else ["--map", MAP]
    done = cardbox("retarget", results, *rest, *given, "--csv", tmp_path / "arm.csv")
    done.assert_refused("retarget", expected)
    assert not (tmp_path / "arm.csv").exists()


def test_images_alone_are_no_results(files: Path, cardbox: Callable) -> None:
    done = cardbox("retarget", files / "session", "--robot", ROBOT, "--map", MAP)
    done.assert_refused("retarget", "has no results of the tracker", "cardbox track BAG")
