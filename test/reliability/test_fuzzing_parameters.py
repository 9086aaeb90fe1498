"""Whatever a parameter is set to, it is taken as documented or refused in words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

rclpy = pytest.importorskip("rclpy", reason="rclpy is not installed")

from rclpy.context import Context  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402

from cardbox_tracker.common.settings import check  # noqa: E402
from cardbox_tracker.ros.runtime.parameters import LiveParameters  # noqa: E402
from lab.tools.parameter_docs import NODES  # noqa: E402

PLAY_BAG = [Parameter("bag", value="bag")]
TEXTS = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=20)
NUMBERS = st.integers(-(2**63), 2**63 - 1) | st.integers(-5, 500)
VALUES = st.one_of(
    *(st.booleans(), NUMBERS, st.floats(), st.floats(0, 100), TEXTS),
    *(st.lists(st.booleans(), max_size=3), st.lists(NUMBERS, max_size=3)),
    *(st.lists(st.floats(), max_size=3), st.lists(TEXTS, max_size=3)),
)
NAMES = st.sampled_from([(node, name) for node, kind in NODES.items() for name in kind.specs()])


@pytest.fixture(scope="module")
def parameters(ros_domains: Iterator[int]) -> Iterator[dict[str, tuple[Any, Any]]]:
    """Each kind of parameters, declared on a node."""
    context = Context()
    rclpy.init(context=context, domain_id=next(ros_domains))
    nodes = {
        name: rclpy.create_node(
            name, context=context, enable_rosout=False, parameter_overrides=PLAY_BAG
        )
        for name in NODES
    }
    yield {name: (nodes[name], LiveParameters(nodes[name], kind)) for name, kind in NODES.items()}
    for node in nodes.values():
        node.destroy_node()
    context.try_shutdown()


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@given(st.lists(st.tuples(NAMES, VALUES), min_size=1, max_size=3))
def test_parameters(
    parameters: dict[str, tuple[Any, Any]], given: list[tuple[tuple[str, str], Any]]
) -> None:
    node, live = parameters[given[0][0][0]]
    new = [Parameter(name, value=value) for (of, name), value in given if of == node.get_name()]
    before = live.value
    result = node.set_parameters_atomically(new)
    assert result.successful or result.reason
    if not result.successful:
        assert live.value == before
    check(live.value)
    live.value.check()
