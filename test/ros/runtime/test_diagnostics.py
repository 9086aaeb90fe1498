"""Losses are detected by the stamps, and the status follows the state of the node."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from cardbox_tracker.camera.stamps import StampOrder, StreamStatistics
from cardbox_tracker.ros.runtime.diagnostics import ERROR, STATUS, WAITING, WORKING, NodeDiagnostics

PERIOD_NS = 66_666_667


def fed(frames: list[int]) -> StreamStatistics:
    statistics = StreamStatistics()
    for frame in frames:
        statistics.add(1_000_000_000 + frame * PERIOD_NS)
    return statistics


def test_nothing_lost_in_an_even_stream() -> None:
    statistics = fed(list(range(100)))
    assert (statistics.received, statistics.dropped, statistics.loss) == (100, 0, 0.0)
    assert statistics.period_ns == pytest.approx(PERIOD_NS)


def test_jitter_is_no_loss() -> None:
    statistics = StreamStatistics()
    for frame in range(100):
        statistics.add(frame * PERIOD_NS + (frame % 3) * 8_000_000)
    assert statistics.dropped == 0


def test_missing_stamps_are_counted() -> None:
    statistics = fed([frame for frame in range(100) if frame not in (40, 41, 60)])
    assert statistics.dropped == 3
    assert statistics.loss == pytest.approx(0.03, abs=0.005)


def test_heavy_loss_is_seen() -> None:
    kept = [0, 1, 9, 10, 21, 30, 31, 44, 45, 60, 61, 75]
    assert fed(kept).loss > 0.5


def test_a_burst_at_the_start_is_no_loss_for_ever() -> None:
    statistics = StreamStatistics()
    stamps = [number * 5_000_000 for number in range(8)]
    stamps += [stamps[-1] + number * PERIOD_NS for number in range(1, 401)]
    for stamp in stamps:
        statistics.add(1_000_000_000 + stamp)
    assert (statistics.dropped, statistics.loss) == (0, 0.0)


def test_a_pause_of_the_source_is_no_loss() -> None:
    statistics = fed([*range(20), *range(200, 220)])
    assert statistics.dropped == 0


def test_the_period_is_that_of_the_latest_stamps() -> None:
    frames = [*range(200), *range(201, 601, 2)]
    assert fed(frames).period_ns == pytest.approx(2 * PERIOD_NS)


def test_stamps_that_go_back_are_noticed() -> None:
    statistics = fed(list(range(40)))
    assert statistics.add(1_000_000_000) is StampOrder.RESTART
    assert statistics.out_of_order == 1
    assert statistics.add(1_000_000_000 + PERIOD_NS) is StampOrder.NEXT


def test_status_says_what_the_node_waits_for_and_what_is_wrong(make_node: Callable) -> None:
    diagnostics = NodeDiagnostics(make_node())
    diagnostics.wait_for("images on /image_raw")
    status = diagnostics.status()
    assert (status.level, status.message) == (
        DiagnosticStatus.WARN,
        "waiting for images on /image_raw",
    )
    diagnostics.problem("the image has encoding '16UC3'")
    assert diagnostics.status().level == DiagnosticStatus.ERROR
    diagnostics.working(sent_ns=1)
    status = diagnostics.status()
    assert (status.level, status.message) == (DiagnosticStatus.OK, "working")
    assert {value.key for value in status.values} >= {
        "rate in (Hz)",
        "rate out (Hz)",
        "latency p95 (ms)",
        "dropped (by stamps)",
    }


def test_programs_read_the_state_of_a_node_from_a_value(make_node: Callable) -> None:
    diagnostics = NodeDiagnostics(make_node())

    def state() -> str:
        return {v.key: v.value for v in diagnostics.status().values}[STATUS]

    diagnostics.wait_for("images")
    assert state() == WAITING
    diagnostics.problem("no such encoding")
    assert state() == ERROR
    diagnostics.working()
    assert state() == WORKING
    diagnostics.warn("incompatible QoS")
    assert state() == WORKING, "a warning does not keep it from working"


def test_a_warning_stays_until_the_end(make_node: Callable) -> None:
    diagnostics = NodeDiagnostics(make_node())
    diagnostics.warn("incompatible QoS on /silhouette")
    diagnostics.working()
    status = diagnostics.status()
    assert status.level == DiagnosticStatus.WARN
    assert "incompatible QoS on /silhouette" in [value.value for value in status.values]


def test_a_result_that_takes_longer_than_a_period_is_late(make_node: Callable) -> None:
    diagnostics = NodeDiagnostics(make_node())
    for frame in range(10):
        diagnostics.input.add(1_000_000_000 + frame * PERIOD_NS)
    diagnostics.working(sent_ns=time.time_ns() - 60 * PERIOD_NS)
    diagnostics.working(sent_ns=time.time_ns() + 60 * PERIOD_NS)
    values = {value.key: value.value for value in diagnostics.status().values}
    assert (values["late"], values["published"], values["received"]) == ("1", "2", "10")


class Logged:
    """Replaces a node's logger and records its lines."""

    def __init__(self, node: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        self.lines: list[str] = []
        monkeypatch.setattr(node, "get_logger", lambda: self)
        self.info = self.warning = self.error = self.lines.append


def clocked(
    node: Any, monkeypatch: pytest.MonkeyPatch
) -> tuple[NodeDiagnostics, Logged, list[float]]:
    """Return diagnostics, the log of ``node``, and a settable time in seconds."""
    diagnostics = NodeDiagnostics(node)
    logged = Logged(node, monkeypatch)
    now = [time.monotonic()]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    diagnostics.source = "images on /image_raw"
    return diagnostics, logged, now


@pytest.mark.promise("Whatever the stamps, each image has one place in the order")
def test_a_node_whose_input_has_ceased_says_so_once_and_when_it_is_back(
    make_node: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    diagnostics, logged, now = clocked(make_node(), monkeypatch)

    def second() -> tuple[str, str]:
        now[0] += 1.0
        diagnostics.publish()
        status = diagnostics.status()
        return status.message, {v.key: v.value for v in status.values}[STATUS]

    for _ in range(10):
        second()
    assert not logged.lines, "before the first image it waits, and that is said elsewhere"
    for frame in range(30):
        diagnostics.input.add(1_000_000_000 + frame * PERIOD_NS)
        diagnostics.working()
    assert second() == second() == ("working", WORKING)
    silent = [second() for _ in range(20)]
    assert silent[-1][1] == WAITING and silent[-1][0].startswith(
        "waiting for images on /image_raw, which have ceased"
    )
    assert [line[:36] for line in logged.lines] == ["images on /image_raw have ceased: is"]
    diagnostics.input.add(10**12)
    diagnostics.working()
    assert second() == ("working", WORKING)
    assert logged.lines[1:] == ["images on /image_raw arrive again"]


def test_the_pause_of_a_recording_is_no_fault(
    make_node: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = make_node()
    diagnostics, logged, now = clocked(node, monkeypatch)
    warned: list[str] = []
    logged.warning = warned.append
    topics: list[tuple[str, list[str]]] = [("/eye/play_bag/status", ["std_msgs/msg/String"])]
    monkeypatch.setattr(node, "get_topic_names_and_types", lambda: topics)
    diagnostics.input.add(1)
    for _ in range(6):
        now[0] += 1.0
        diagnostics.publish()
    assert logged.lines[0].startswith(
        "images on /image_raw have ceased: play_bag plays a recording"
    )
    assert len(logged.lines) == 1 and not warned
    assert diagnostics.status().level == DiagnosticStatus.WARN
    topics.clear()
    diagnostics.publish()
    assert diagnostics.status().level == DiagnosticStatus.ERROR


def test_a_slow_camera_is_not_silent(make_node: Callable, monkeypatch: pytest.MonkeyPatch) -> None:
    diagnostics = NodeDiagnostics(make_node())
    diagnostics.source = "images"
    now = [time.monotonic()]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    for frame in range(10):
        diagnostics.input.add(1 + frame * 1_500_000_000)
    diagnostics.publish()
    now[0] += 7.0
    diagnostics.publish()
    assert diagnostics.status().level == DiagnosticStatus.OK
    now[0] += 1.0
    diagnostics.publish()
    assert "have ceased" in diagnostics.status().message


def test_what_only_the_diagnostics_said_is_logged_once(
    make_node: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = make_node()
    diagnostics = NodeDiagnostics(node)
    logged = Logged(node, monkeypatch)
    loss = [11]
    diagnostics.advice = lambda: {"loss": f"{loss[0]} % are lost", "": "logged by the node"}
    for loss[0] in range(11, 30):
        status = diagnostics.status()
    assert logged.lines == ["11 % are lost"]
    assert status.message == "logged by the node"
    assert "29 % are lost" in [value.value for value in status.values]


def test_what_others_wrote_is_bounded_and_has_no_escape_codes(
    make_node: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = make_node()
    diagnostics = NodeDiagnostics(node)
    logged = Logged(node, monkeypatch)
    foreign = "\x1b[2J" + "x" * 1_000_000
    diagnostics.advice = lambda: {"frame": foreign}
    diagnostics.warn(foreign)
    diagnostics.say("said", foreign)
    diagnostics.problem(foreign)
    texts = [*logged.lines, *(value.value for value in diagnostics.status().values)]
    assert sum(len(text) > 1000 for text in texts) >= 5
    assert all(len(text) < 3000 and "\x1b" not in text for text in texts)


def test_good_images_between_do_not_open_the_log(
    make_node: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = make_node()
    diagnostics = NodeDiagnostics(node)
    logged = Logged(node, monkeypatch)
    for number in range(200):
        diagnostics.problem(f"encoding '{number}'", "EncodingError in image_raw")
        diagnostics.working()
    assert len(logged.lines) == 3


@pytest.mark.parametrize(
    ("periods", "remedy", "said"), [(0.5, "do X", False), (3.0, "do X", True), (3.0, "", False)]
)
def test_a_node_that_needs_longer_than_a_period_says_what_to_do(
    make_node: Callable, periods: float, remedy: str, said: bool
) -> None:
    diagnostics = NodeDiagnostics(make_node())
    diagnostics.remedy = remedy
    for frame in range(40):
        diagnostics.input.add(1_000_000_000 + frame * PERIOD_NS)
        diagnostics.working(sent_ns=time.time_ns() - int(periods * PERIOD_NS))
    assert diagnostics.status().message.endswith("left out; do X" if said else "working")
    assert diagnostics.is_slow is (periods > 1)


def test_images_that_come_in_bursts_are_neither_lost_nor_slow(
    make_node: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    diagnostics, logged, now = clocked(make_node(), monkeypatch)
    diagnostics.remedy = "do X"
    for frame in range(120):
        now[0] += 1.0 if frame % 15 == 0 else 0.001
        diagnostics.arrived(1_000_000_000 + frame * PERIOD_NS)
        diagnostics.working(sent_ns=time.time_ns() - 5 * PERIOD_NS)
        diagnostics.status()
    assert "arrive in bursts" in diagnostics.status().message
    assert [line[:27] for line in logged.lines] == ["the images arrive in bursts"]


def test_three_seconds_without_an_image_are_told(
    make_node: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once a second, whenever that is, the node looks whether anything has come."""
    diagnostics, logged, now = clocked(make_node(), monkeypatch)
    diagnostics.input.add(1_000_000_000)
    diagnostics.publish()
    now[0] += 0.9
    for _ in range(2):
        now[0] += 1.0
        diagnostics.publish()
    assert "have ceased" in logged.lines[0]
