"""Nodes print help, and refuse unknown arguments."""

from __future__ import annotations

import importlib

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from cardbox_tracker.ros.runtime.command_line import plain_command_line

NODES = ("background", "initializer", "tracker")


@pytest.mark.parametrize("name", NODES)
@pytest.mark.parametrize(("word", "code"), [("--help", 0), ("foo", 2), ("--particles=3", 2)])
def test_a_node_explains_or_refuses_what_it_was_given(
    name: str, word: str, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    module = importlib.import_module(f"cardbox_tracker.ros.nodes.{name}_node")
    with pytest.raises(SystemExit) as ended:
        module.main([word, "--ros-args", "-p", "seed:=1"])
    assert ended.value.code == code
    printed = capsys.readouterr()
    text = printed.err if code else printed.out
    assert f"usage: {name}" in text
    assert ("--ros-args -p" if code == 0 else word) in text


def test_arguments_of_ros_are_passed_on() -> None:
    given = ["--ros-args", "-p", "seed:=1"]
    assert plain_command_line("tracker", "It tracks.", given) == ["tracker", *given]
