"""The benchmark of the nodes runs with separate processes and with one process."""

from __future__ import annotations

from pathlib import Path

import pytest

from lab.benchmarks import nodes as benchmark_nodes


def test_the_nodes_are_measured(monkeypatch: pytest.MonkeyPatch, ros_domain: int) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    monkeypatch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", "")
    # The nodes run from the source tree, whose kernels the tests have compiled.
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).resolve().parents[2]))
    monkeypatch.setattr(benchmark_nodes, "_START_S", 120.0)
    monkeypatch.setattr(benchmark_nodes, "RATES_HZ", (15,))
    monkeypatch.setattr(benchmark_nodes, "STREAMS", benchmark_nodes.STREAMS[:1])
    # The detector's network files may not be installed; without them it is not measured.
    monkeypatch.setattr(benchmark_nodes, "_has_detector", lambda: False)
    done: list[float] = []
    measured = benchmark_nodes.measure_nodes(2.0, done.append)
    assert measured is not None and measured["with_detector"] is None
    assert done == pytest.approx([1 / 3, 2 / 3, 1.0])
    (robot,) = measured["with_robot"]["streams"].values()
    assert 0 < robot["command_p50_ms"] <= robot["command_p95_ms"]
    for processes, part in (
        (benchmark_nodes.SEPARATE, measured),
        (benchmark_nodes.TOGETHER, measured["single_process"]),
    ):
        assert set(part["ready_s"]) == set(part["rss_mb"]) == set(processes)
        stream = part["streams"]["mono8 320x240 at 15 Hz"]
        assert 0 < stream["received"] <= stream["sent"] == 30
        assert 0 < stream["received_p50_ms"] <= stream["p50_ms"] <= stream["p95_ms"]
        assert set(stream["cpu_percent"]) == set(processes)
        assert stream["cpu_percent_sum"] == pytest.approx(sum(stream["cpu_percent"].values()))
