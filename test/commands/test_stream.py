"""'cardbox stream': packets at even times between the images, and mistakes in words."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.applications.teleoperation.full_body import FullBody, at_rate
from cardbox_tracker.applications.teleoperation.sending import in_real_time
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.recordings.result_bag import result_bag
from cardbox_tracker.recordings.result_table import result_table
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.tracking.estimate import LOST, TRACKING, Estimate
from cardbox_tracker.tracking.tracker import Tracker

BODY = BodyModel.of(hip_height_m=-0.51)
GREY = np.zeros((48, 64), np.uint8)


def images() -> list[tuple[RecordedFrame, Estimate]]:
    """Five images a tenth of a second apart; the arms rise, the third one has nobody."""
    posture = np.zeros(12)
    seen = Estimate(TRACKING, posture, np.full(12, 0.1), np.zeros((6, 3)), 10, 0.9)
    raised = replace(seen, posture=np.where(np.arange(12) == 9, np.pi / 2, posture))
    return [
        (RecordedFrame(number * 10**8, number / 10, GREY, GREY), one)
        for number, one in enumerate((seen, raised, Estimate(LOST), seen, seen))
    ]


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "person.csv"
    with result_table(path, has_points=True) as add:
        for frame, estimate in images():
            add(frame, estimate)
    save_body_model(BODY, tmp_path / "person.body.yaml")
    return path


def lines(text: str) -> list[dict]:
    return [json.loads(line) for line in text.splitlines() if line.startswith("{")]


def test_a_table_becomes_lines_at_the_rate(table: Path, cardbox: Callable) -> None:
    done = cardbox("stream", table, "--to", "json", "--rate", "20", "--fast")
    assert done.code == 0, done.err
    found = lines(done.out)
    assert [one["stamp_ns"] for one in found] == [i * 50_000_000 for i in range(9)]
    assert [any(one["valid"]) for one in found] == [True] * 3 + [False] * 3 + [True] * 3
    hand = np.array([one["positions"][23] for one in found])
    # Half way between two images the hand is half way between its places.
    assert hand[1] == pytest.approx((hand[0] + hand[2]) / 2, abs=1e-4)
    assert hand[2][0] > 0.4 and hand[4] == pytest.approx(hand[2])
    assert "sent 9 packets of 9 times" in done.err


def test_a_bag_gives_the_same(table: Path, tmp_path: Path, cardbox: Callable) -> None:
    bag = tmp_path / "results"
    tracker = Tracker(BODY, Camera(64, 48, 66.0, 66.0, 31.5, 23.5))
    with result_bag(bag, "camera") as add:
        for frame, estimate in images():
            add(frame, estimate, tracker)
    of = [lines(cardbox("stream", one, "--to", "json", "--fast").out) for one in (table, bag)]
    assert [one["valid"] for one in of[0]] == [one["valid"] for one in of[1]]
    places = [np.array([one["positions"] for one in found]) for found in of]
    assert places[0] == pytest.approx(places[1], abs=1e-4) and len(places[0]) == 21


def test_a_file_is_written_at_once(table: Path, tmp_path: Path, cardbox: Callable) -> None:
    words = ("stream", table, "--to", "npz", "--rate", "20", "--output", tmp_path / "a.npz")
    done = cardbox(*words)
    assert done.code == 0, done.err
    assert np.load(tmp_path / "a.npz")["pose_body"].shape == (9, 63)
    cardbox(*words).assert_refused("stream", "exists; choose another name")
    cardbox(*words[:4]).assert_refused("stream", "--to npz needs --output")
    cardbox(*words, "--fast").assert_refused("stream", "neither --address nor --fast")
    json_words = (*words[:3], "json", "--output", tmp_path / "b")
    cardbox(*json_words).assert_refused("stream", "the others need none")


def test_without_the_person_it_is_told(table: Path, cardbox: Callable) -> None:
    table.with_name("person.body.yaml").unlink()
    done = cardbox("stream", table, "--to", "sonic", "--fast")
    assert done.code == 1
    assert "no posture of a known person: keep OUT.body.yaml" in done.err


def body(stamp_ns: int) -> FullBody:
    ones = np.tile([1.0, 0.0, 0.0, 0.0], (24, 1))
    return FullBody(stamp_ns, np.zeros((24, 3)), ones, 0.0, np.zeros((2, 3)), np.ones(24, bool))


def test_a_gap_is_invalid_and_a_jump_of_the_clock_is_short() -> None:
    found = list(at_rate([body(0), body(10**8), body(3600 * 10**9)], 10.0))
    assert [one.stamp_ns // 10**8 for one in found] == [*range(11), 36000]
    assert [bool(one.valid.any()) for one in found] == [True] + [False] * 10 + [True]


def test_the_clock_paces_the_packets() -> None:
    begun_s = time.monotonic()
    assert list(in_real_time(range(6), 50.0)) == [*range(6)]
    assert 0.1 <= time.monotonic() - begun_s < 0.5
