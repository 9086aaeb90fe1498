"""Nodes print help, and refuse unknown arguments."""

from __future__ import annotations

import importlib

import pytest

from cardbox_tracker.ros.runtime import command_line
from cardbox_tracker.ros.runtime.command_line import entries
from lab.tools.parameter_docs import NODES as PARAMETERS

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


def help_of(name: str, capsys: pytest.CaptureFixture[str]) -> str:
    module = importlib.import_module(f"cardbox_tracker.ros.nodes.{name}_node")
    with pytest.raises(SystemExit) as ended:
        module.main(["--help"])
    assert ended.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("name", PARAMETERS)
def test_the_help_has_every_parameter_topic_and_service(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    text = help_of(name, capsys)
    words = " ".join(text.split())
    kind = PARAMETERS[name]
    for parameter, spec in kind.specs().items():
        (line,) = (line for line in text.splitlines() if line.startswith(f"  {parameter} ("))
        assert spec.unit in line and spec.range_text in line
        assert " ".join(spec.description.split()) in words
    assert entries(name)
    for entry in entries(name):
        assert f" {entry.name} ({entry.type}" in text
    assert "](" not in text and max(map(len, text.splitlines())) <= 200


def test_the_help_of_the_tracker_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    text = help_of("tracker", capsys)
    assert "  lost_iou (float = 0.4; 0 to 1; live: next image)\n      least IoU of" in text
    assert "  in  silhouette (sensor_msgs/Image; reliable, 1)\n      of the background node" in text
    assert "  out joint_states_stddev (sensor_msgs/JointState; reliable, 10)\n" in text
    assert "  tracker/reset (std_srvs/Trigger)\n      start again from" in text


def test_arguments_of_ros_are_passed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    given, ran = ["--ros-args", "-p", "seed:=1"], []
    module = importlib.import_module("cardbox_tracker.ros.nodes.tracker_node")
    monkeypatch.setattr(command_line, "run_node", lambda _, words: ran.append(words) or 0)
    assert module.main(given) == 0
    assert ran == [["tracker", *given]]
