"""A recording that is played forwards and backwards to robots that follow live."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.camera.camera import level_to_optical
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES, rotation_z
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.result_reader import Results
from lab.tools import retarget_live
from lab.tools.way_cases import Case, Person

S = 10**9


def case(bag: Path, person: Person) -> Case:
    return Case("made up", bag, ("camera",), None, 20.0, 10.0, None, 1.0, (person,))


def test_motions_go_forwards_and_backwards_with_rising_stamps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(retarget_live, "_LENGTH_S", 0.7)
    stamps = [S, S + S // 2, *(2 * S + number * S // 10 for number in range(3))]
    with BagWriter(tmp_path / "bag") as bag:
        for number, stamp_ns in enumerate(stamps):
            info = {"height": number, "d": np.zeros(5)}
            kind = "sensor_msgs/msg/CameraInfo"
            bag.write_stamped("/camera/camera_info", kind, stamp_ns, "camera", **info)
            pixels = np.full((2, 2), number, np.uint8)
            bag.write_image("/camera/image_raw", stamp_ns, "camera", pixels, "mono8")
    given = case(tmp_path / "bag", Person("", 1.75, {}))
    played, recorded = retarget_live.repeated(given, tmp_path / "played")
    # What precedes the motions is not played.
    order = [2, 3, 4, 3, 2, 3, 4]
    assert list(recorded) == [2 * S + number * S // 10 for number in range(7)]
    assert list(recorded.values()) == [stamps[number] for number in order]
    with BagReader(played.bag) as bag:
        found = [(one.time_ns, bag.deserialize(one)) for one in bag.messages()]
    assert [(at_ns, one.height) for at_ns, one in found if hasattr(one, "d")] == list(
        zip(recorded, order, strict=True)
    )
    for at_ns, one in found:
        assert at_ns == one.header.stamp.sec * S + one.header.stamp.nanosec


def test_the_true_hand_is_seen_from_the_tracked_torso() -> None:
    points = np.zeros((6, 3))
    ahead = np.array([1.0, 0.0, 0.0]) @ rotation_z(np.array(0.5)).T
    hand = KEYPOINT_NAMES.index("right_hand")
    points[hand] = 0.7 * ahead @ level_to_optical(np.radians(20.0)).T
    turned = {"torso_roll": 0.0, "torso_pitch": 0.0, "torso_yaw": 0.5}
    numbers = {name: np.full(2, value) for name, value in turned.items()}
    stamps = np.array([S, 2 * S])
    results = Results(Path(), stamps, stamps / S, ("tracking",) * 2, numbers, {}, (None,) * 2)
    given = case(Path(), Person("", 1.75, {7: points}))
    found = retarget_live.true_directions(given, results, {S: 7, 2 * S: 8})
    np.testing.assert_allclose(found, [[1.0, 0.0, 0.0], [np.nan] * 3], atol=1e-9)
