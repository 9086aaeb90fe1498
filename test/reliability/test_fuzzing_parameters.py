"""Whatever a parameter or a message has, it is taken as documented or refused in words."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

rclpy = pytest.importorskip("rclpy", reason="rclpy is not installed")

from rclpy.context import Context  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402

from cardbox_tracker.common.settings import check  # noqa: E402
from cardbox_tracker.ros.messages.keypoints import CONVERSIONS, POINT_CLOUD  # noqa: E402
from cardbox_tracker.ros.runtime.parameters import LiveParameters  # noqa: E402
from lab.tools.parameter_docs import NODES  # noqa: E402
from lab.tools.reliability import refusals  # noqa: E402

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


UINT32 = st.integers(0, 40) | st.integers(0, 2**32 - 1)
COLUMNS = "u", "v", "score", "landmark", "person", "x", "y", "z"


@st.composite
def clouds(draw: st.DrawFn) -> SimpleNamespace:
    """Return points as the detector sends them, of which a few things are others."""
    fields = [
        SimpleNamespace(name=name, datatype=7 if at not in (3, 4) else 6, offset=4 * at)
        for at, name in enumerate(COLUMNS)
    ]
    count = draw(st.integers(0, 40))
    data = draw(st.binary(min_size=32 * count, max_size=32 * count))
    cloud = SimpleNamespace(
        width=count,
        height=1,
        point_step=32,
        row_step=32 * count,
        data=data,
        fields=fields,
        is_bigendian=False,
    )
    for one in draw(st.lists(st.sampled_from([cloud, cloud, *fields]), max_size=3)):
        name = draw(st.sampled_from(sorted(vars(one))))
        before = getattr(one, name)
        if isinstance(before, int):
            setattr(one, name, draw(UINT32))
        elif not isinstance(before, str):
            setattr(one, name, before[: draw(st.integers(0, 9))])
    return cloud


POINT = st.builds(
    SimpleNamespace,
    **dict.fromkeys("xyzc", st.floats() | st.floats(-1.0, 70.0)),
    score=st.floats() | st.floats(0.0, 1.0),
    id=st.integers(0, 19),
)


@st.composite
def lists_of_points(draw: st.DrawFn) -> SimpleNamespace:
    """Return a message with the fields of all types with lists of points."""
    some = st.integers(0, 44) | st.sampled_from([17, 18, 21])
    points = [draw(POINT) for _ in range(draw(some))]
    keypoints = [SimpleNamespace(point=p, score=p.score, id=p.id) for p in points]
    people = [SimpleNamespace(class_name="person", keypoints=SimpleNamespace(data=keypoints))]
    polygon = SimpleNamespace(points=points)
    return SimpleNamespace(polygon=polygon, skeleton=points, detections=people)


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@given(clouds(), lists_of_points())
def test_any_message_of_points(cloud: SimpleNamespace, points: SimpleNamespace) -> None:
    for kind, convert in CONVERSIONS.items():
        with refusals():
            convert(cloud if kind == POINT_CLOUD else points, (64, 48))
