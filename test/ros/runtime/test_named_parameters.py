"""Parameters that name a node reach it in every namespace."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from cardbox_tracker.ros.runtime.node import CardboxNode, run

FILE = """tracker: # of the person

  ros__parameters:
    stature: 1.7
    nested: {deep: 2}
other:
  ros__parameters: {stature: 1.2}
/x/tracker:
  ros__parameters:
    seed: 3
"""


@pytest.mark.parametrize("namespace", [(), ("-r", "__ns:=/x"), ("-r", "__ns:=/x/y")])
@pytest.mark.parametrize("is_file", [False, True])
def test_the_name_of_a_node_holds_in_every_namespace(
    namespace: tuple[str, ...], is_file: bool, tmp_path: Path
) -> None:
    given: dict[str, Any] = {}

    def create() -> CardboxNode:
        node = CardboxNode("tracker", automatically_declare_parameters_from_overrides=True)
        names = ("stature", "seed", "nested.deep", "list")
        given.update((n, node.get_parameter(n).value) for n in names if node.has_parameter(n))
        node.destroy_node()
        return node

    rules = ["-p", "tracker:stature:=1.7", "--param", "tracker:nested.deep:=2", "-p", "seed:=3"]
    rules += ["-p", "other:stature:=1.2"]
    if is_file:
        (tmp_path / "given.yaml").write_text(FILE)
        rules = ["--params-file", str(tmp_path / "given.yaml")]
    rules += ["-p", "tracker:list:=['a: b', 'c']", "-p", "elsewhere:seed:=9"]
    assert run(create, ["tracker", "--ros-args", *namespace, *rules], lambda _: None) == 0
    seed = {} if is_file and namespace != ("-r", "__ns:=/x") else {"seed": 3}
    assert given == {"stature": 1.7, "nested.deep": 2, "list": ["a: b", "c"]} | seed


@pytest.mark.parametrize("rule", [("-p", "tracker:a"), ("--params-file", "missing.yaml"), ("-p",)])
def test_what_is_wrong_is_left_to_ros(rule: tuple[str, ...], capsys: Any) -> None:
    assert run(lambda: pytest.fail("not reached"), ["tracker", "--ros-args", *rule], print) == 2
    assert "cannot start" in capsys.readouterr().err
