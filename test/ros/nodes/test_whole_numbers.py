"""A float parameter accepts an integer of a YAML file, such as ``threshold: 3``."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from cardbox_tracker.ros.runtime.parameters import LiveParameters
from lab.tools.parameter_docs import NODES

GIVEN = {"play_bag": {"bag": "bag"}, "tracker": {"people": 2}}


WITH_NUMBERS = [
    name
    for name, kind in NODES.items()
    if any(one in (float, list[float]) for one in kind.types().values())
]


def whole(default: float, limits: tuple[float, float] | None) -> int | None:
    """Return the integer of the range nearest to the default, or None."""
    lowest, highest = limits or (-1e9, 1e9)
    number = max(round(default), math.ceil(lowest))
    return number if number <= highest else None


@pytest.mark.parametrize("place", ["/**", "/**/{name}"])
@pytest.mark.parametrize("name", WITH_NUMBERS)
def test_whole_numbers_of_a_file_are_accepted(
    name: str, place: str, make_node: Callable[..., Any], tmp_path: Path
) -> None:
    kind = NODES[name]
    numbers: dict[str, Any] = {}
    for key, spec in kind.specs().items():
        if kind.types()[key] is float:
            number = whole(getattr(kind, key), spec.limits)
            if number is not None:
                numbers[key] = number
        elif kind.types()[key] == list[float]:
            numbers[key] = [2, 2]
    path = tmp_path / "numbers.yaml"
    section = {"ros__parameters": numbers | GIVEN.get(name, {})}
    path.write_text(yaml.safe_dump({place.format(name=name): section}))
    found = LiveParameters(make_node("--params-file", str(path), name=name), kind).value
    assert numbers
    for key, number in numbers.items():
        value = getattr(found, key)
        assert value == number, key
        assert all(type(one) is float for one in (value if isinstance(value, list) else [value]))
