"""Parameters come from one dataclass, are checked together, and change while the node runs."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_type_hints

import pytest
from rcl_interfaces.msg import ParameterType
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.settings import settings_of
from cardbox_tracker.measuring.config import InitializationConfig
from cardbox_tracker.ros.nodes.background_node import BackgroundParameters
from cardbox_tracker.ros.nodes.initializer_parameters import InitializerParameters
from cardbox_tracker.ros.nodes.play_bag_node import PlayBagParameters
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.ros.runtime.parameter_fields import (
    AT_START,
    NEXT_IMAGE,
    RESTARTS,
    NodeParameters,
    parameter,
)
from cardbox_tracker.ros.runtime.parameters import LiveParameters
from cardbox_tracker.search.config import PRESETS, TrackerConfig
from cardbox_tracker.segmentation.background_config import BackgroundConfig
from lab.tools import parameter_docs
from lab.tools.parameter_docs import NODES

ROOT = Path(__file__).resolve().parents[3]


@dataclass(frozen=True)
class Sample(NodeParameters):
    """Parameters of a test."""

    low: float = parameter(1.0, "lower end", unit="m", limits=(0.0, 10.0))
    high: float = parameter(2.0, "upper end", unit="m", limits=(0.0, 10.0))
    count: int = parameter(3, "a count", limits=(1, 5))
    kind: str = parameter("a", "a kind", choices=("a", "b"))
    fixed: bool = parameter(False, "only at the start", effect=AT_START)
    names: list[str] = parameter([], "some names")
    times: list[float] = parameter([], "some times")

    def check(self) -> None:
        """Check that ``low`` is at most ``high``."""
        if self.low > self.high:
            raise ValueError(f"low is {self.low:g}, above high {self.high:g}; lower it")


def set_values(node: Any, **values: Any) -> tuple[bool, str]:
    result = node.set_parameters_atomically([Parameter(k, value=v) for k, v in values.items()])
    return result.successful, result.reason


def test_a_name_that_is_no_parameter_is_said_with_the_nearest(
    make_node: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = ("lo:=1.5", "nothing_like_it:=1", "use_sim_time:=false")
    of_qos = "qos_overrides./image_raw.publisher.depth:=3"
    node = make_node(*(word for one in (*given, of_qos) for word in ("-p", one)))
    said: list[str] = []
    monkeypatch.setattr(node, "get_logger", lambda: SimpleNamespace(warning=said.append))
    assert LiveParameters(node, Sample).value == Sample()
    assert len(said) == 2
    assert all(name in said[0] for name in ("'lo'", "'tested'", "'low'"))
    assert "'nothing_like_it'" in said[1] and "did you mean" not in said[1]


def test_defaults_are_declared_with_description_unit_and_range(make_node: Callable) -> None:
    node = make_node()
    assert LiveParameters(node, Sample).value == Sample()
    low = node.describe_parameter("low")
    assert low.description == "lower end [m]"
    assert (low.floating_point_range[0].from_value, low.floating_point_range[0].to_value) == (0, 10)
    assert node.describe_parameter("count").integer_range[0].to_value == 5
    assert node.describe_parameter("fixed").read_only
    assert node.describe_parameter("names").type == ParameterType.PARAMETER_STRING_ARRAY
    assert node.describe_parameter("kind").additional_constraints == "one of: a | b"


def test_live_change_is_seen_and_announced(make_node: Callable) -> None:
    node = make_node()
    seen: list[Sample] = []
    live = LiveParameters(node, Sample, seen.append)
    assert set_values(node, low=1.5, names=["x", "y"]) == (True, "")
    assert live.value == Sample(low=1.5, names=["x", "y"])
    assert seen == [live.value]


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"low": 11.0}, "out of range"),
        ({"low": float("nan")}, "out of range"),
        ({"count": 6}, "out of range"),
        ({"low": "much"}, "Wrong parameter type"),
        ({"kind": "c"}, "kind is 'c'; expected one of a, b"),
        ({"fixed": True}, "read-only"),
        ({"low": 3.0}, "low is 3, above high 2; lower it"),
    ],
)
def test_wrong_value_is_refused_with_the_reason_and_the_old_one_stays(
    make_node: Callable, values: dict[str, Any], reason: str
) -> None:
    node = make_node()
    seen: list[Sample] = []
    live = LiveParameters(node, Sample, seen.append)
    accepted, text = set_values(node, **values)
    assert not accepted
    assert reason in text
    assert live.value == Sample()
    assert {name: node.get_parameter(name).value for name in ("low", "kind", "fixed")} == {
        "low": 1.0,
        "kind": "a",
        "fixed": False,
    }
    assert seen == []


def test_values_are_checked_together(make_node: Callable) -> None:
    node = make_node()
    live = LiveParameters(node, Sample)
    assert set_values(node, low=5.0, high=6.0)[0]
    assert (live.value.low, live.value.high) == (5.0, 6.0)


def test_values_of_the_start_are_taken(make_node: Callable) -> None:
    node = make_node("-p", "low:=0.5", "-p", "names:=[a, b]")
    assert LiveParameters(node, Sample).value == Sample(low=0.5, names=["a", "b"])


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("low:=-1.0", ("low is -1; expected 0 to 10. low is lower end",)),
        ("low:=3.0", ("low is 3", "lower it")),
        ("kind:=c", ("kind is 'c'", "a, b")),
        ("count:=many", ("count", "a count")),
        ("count:=2.0", ("count", "a count")),
    ],
)
def test_wrong_value_at_the_start_says_which_and_why(
    make_node: Callable, given: str, words: tuple[str, ...]
) -> None:
    node = make_node("-p", given)
    with pytest.raises(CardboxError) as caught:
        LiveParameters(node, Sample)
    for word in ("tested", *words):
        assert word in str(caught.value)


def test_a_whole_number_is_taken_for_a_float(make_node: Callable) -> None:
    node = make_node("-p", "low:=1", "-p", "times:=[4, 9]")
    live = LiveParameters(node, Sample)
    assert live.value == Sample(low=1.0, times=[4.0, 9.0])
    assert isinstance(live.value.low, float)
    assert set_values(node, low=2, times=[3])[0]
    assert live.value == Sample(low=2.0, times=[3.0])
    assert node.get_parameter("low").type_ == Parameter.Type.DOUBLE
    assert not set_values(node, low=True)[0]


def test_a_whole_number_is_taken_for_a_text_where_a_text_may_be_one(make_node: Callable) -> None:
    @dataclass(frozen=True)
    class Device(NodeParameters):
        """Parameters of a test."""

        device: str = parameter("/dev/video0", "a device")

    assert LiveParameters(make_node("-p", "device:=0"), Device).value.device == "0"


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"lo": 1.5}, ("'lo' is not a parameter of node 'tested'", "did you mean 'low'")),
        ({"nothing_like_it": 1}, ("'nothing_like_it'", "ros2 param list")),
    ],
)
def test_a_request_to_set_what_is_no_parameter_is_answered_with_the_name_and_the_nearest(
    make_node: Callable, values: dict[str, Any], words: tuple[str, ...]
) -> None:
    """'ros2 param set' sends this request; rclpy's own answer names nothing."""
    node = make_node()
    live = LiveParameters(node, Sample)
    client = AsyncParameterClient(node, "tested")
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    assert client.wait_for_services(10.0)
    answer = client.set_parameters_atomically([Parameter(k, value=v) for k, v in values.items()])
    executor.spin_until_future_complete(answer, 10.0)
    result = answer.result().result
    assert not result.successful
    assert all(word in result.reason for word in words), result.reason
    assert live.value == Sample()


@pytest.mark.parametrize(
    ("kind", "core"),
    [(BackgroundParameters, BackgroundConfig), (InitializerParameters, InitializationConfig)],
)
def test_a_setting_of_the_core_keeps_its_text_range_and_type(kind: Any, core: Any) -> None:
    types = get_type_hints(core)
    shared_names = settings_of(core).keys() & kind.specs().keys()
    assert len(shared_names) >= 4
    for name in shared_names:
        spec, setting = kind.specs()[name], settings_of(core)[name]
        assert (spec.description, spec.unit) == (setting.description, setting.unit)
        assert (spec.limits, spec.choices) == (setting.limits, setting.choices)
        assert kind.types()[name] is types[name]


def test_what_a_live_change_does_is_that_of_the_core() -> None:
    effects = {name: spec.effect for name, spec in TrackerParameters.specs().items()}
    assert effects["preset"] == RESTARTS
    assert effects["lost_iou"] == effects["lost_frames"] == NEXT_IMAGE


@pytest.mark.parametrize("kind", NODES.values(), ids=NODES.keys())
def test_every_parameter_has_a_description_and_a_default_in_its_range(
    kind: type[NodeParameters],
) -> None:
    for name, spec in kind.specs().items():
        assert spec.description and not spec.description.endswith(".")
        default = parameter_docs.default_of(kind, name)
        if spec.choices:
            assert default in spec.choices
        if spec.limits is not None:
            assert spec.limits[0] <= default <= spec.limits[1]


@pytest.mark.parametrize("node_name", NODES)
def test_every_node_can_declare_its_parameters(make_node: Callable, node_name: str) -> None:
    arguments = ("-p", "bag:=some") if node_name == "play_bag" else ()
    LiveParameters(make_node(*arguments, name=node_name), NODES[node_name])


@pytest.mark.parametrize("node_name", NODES)
def test_every_node_answers_with_the_values_of_all_its_parameters(
    make_node: Callable, node_name: str
) -> None:
    """One request for all names is how rqt and 'ros2 param dump' read a node."""
    arguments = ("-p", "bag:=some") if node_name == "play_bag" else ()
    node = make_node(*arguments, name=node_name)
    expected = LiveParameters(node, NODES[node_name]).value
    names = node.list_parameters([], 0).names
    client = AsyncParameterClient(node, node_name)
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    assert client.wait_for_services(10.0)
    answer = client.get_parameters(names)
    executor.spin_until_future_complete(answer, 10.0)
    values = [parameter_value_to_python(value) for value in answer.result().values]
    assert len(values) == len(names) > 0
    answered = dict(zip(names, values, strict=True))
    assert [name for name, value in answered.items() if value is None] == []
    for entry in fields(expected):
        value = answered[entry.name]
        assert value == getattr(expected, entry.name), entry.name


@pytest.mark.parametrize("given", [None, "names:=[]"])
def test_an_empty_list_keeps_its_type_and_properties(
    make_node: Callable, given: str | None
) -> None:
    @dataclass(frozen=True)
    class Listed(NodeParameters):
        """Parameters of a test."""

        names: list[str] = parameter([], "some names", effect=AT_START)
        times: list[float] = parameter([], "some times")

    node = make_node(*(() if given is None else ("-p", given)))
    live = LiveParameters(node, Listed)
    assert node.get_parameter("names").value == []
    described = node.describe_parameter("names")
    assert described.type == ParameterType.PARAMETER_STRING_ARRAY
    assert (described.description, described.read_only) == ("some names", True)
    assert not set_values(node, names=["a"])[0]
    assert set_values(node, times=[1.0, 2.0])[0]
    empty = Parameter("times", Parameter.Type.DOUBLE_ARRAY, [])
    assert node.set_parameters_atomically([empty]).successful
    assert live.value == Listed()


@pytest.mark.parametrize("name", parameter_docs.files())
def test_committed_files_are_the_generated_ones(name: str) -> None:
    path = ROOT / name
    assert path.exists(), f"{name} is missing: run python -m lab.tools.parameter_docs"
    assert path.read_text(encoding="utf-8") == parameter_docs.files()[name], (
        f"{name} is stale: run python -m lab.tools.parameter_docs"
    )


@pytest.mark.parametrize("node_name", NODES)
def test_ros_reads_the_generated_file_as_the_defaults(make_node: Callable, node_name: str) -> None:
    path = ROOT / "config" / f"{node_name}.yaml"
    extra = ("-p", "bag:=some") if node_name == "play_bag" else ()
    node = make_node("--params-file", str(path), *extra, name=node_name)
    expected = PlayBagParameters(bag="some") if extra else NODES[node_name]()
    assert LiveParameters(node, NODES[node_name]).value == expected


@pytest.mark.parametrize("node_name", NODES)
def test_one_file_has_the_parameters_of_all_nodes_in_any_namespace(
    make_node: Callable, node_name: str, tmp_path: Path
) -> None:
    changed = tmp_path / "nodes.yaml"
    text = (ROOT / "config" / "cardbox_nodes.yaml").read_text()
    changed.write_text(text.replace('model_file: ""', f'model_file: "{node_name}"'))
    extra = ("-p", "bag:=some") if node_name == "play_bag" else ()
    arguments = ("--params-file", str(changed), "-r", "__ns:=/left", *extra)
    value = LiveParameters(make_node(*arguments, name=node_name), NODES[node_name]).value
    if hasattr(value, "model_file"):
        assert value == NODES[node_name](model_file=node_name)  # type: ignore[call-arg]
    else:
        assert value == (PlayBagParameters(bag="some") if extra else NODES[node_name]())


def test_defaults_of_the_core_are_not_written_twice() -> None:
    assert InitializerParameters().config() == InitializationConfig()
    for preset, make in PRESETS.items():
        assert TrackerParameters(preset=preset).config() == make()


def test_every_background_setting_is_a_parameter() -> None:
    names = {entry.name for entry in fields(BackgroundParameters)}
    assert {entry.name for entry in fields(BackgroundConfig)} <= names


def test_tracker_settings_override_the_preset() -> None:
    config = TrackerParameters(preset="paper", lost_iou=0.3, lost_frames=9).config()
    assert config == replace(TrackerConfig(), lost_iou=0.3, lost_frames=9)


def test_a_parameter_without_effect_is_refused_live(make_node: Callable) -> None:
    node = make_node()
    live = LiveParameters(node, TrackerParameters)
    assert set_values(node, effort=0.5) == (True, "")
    assert live.value.config().whole_body.effort == 0.5
    accepted, reason = set_values(node, preset="paper")
    assert not accepted and "effort has no effect" in reason
    assert "back to 1, or give torso.particles" in reason
    assert set_values(node, preset="paper", effort=1.0) == (True, "")


def test_a_settings_file_gives_what_has_no_parameter(tmp_path: Path, make_node: Callable) -> None:
    path = tmp_path / "settings.yaml"
    path.write_text("lost_frames: 7\nwhole_body: {effort: 0.5, smoothing: 0.2}\n")
    config = TrackerParameters(settings_file=f"{path}", effort=2.0).config()
    assert (config.lost_frames, config.whole_body.effort) == (7, 2.0)
    assert config.whole_body.smoothing == 0.2
    path.write_text("lost_frame: 7\n")
    with pytest.raises(CardboxError, match=r"settings\.yaml.*lost_frame'.*'lost_frames'"):
        LiveParameters(make_node("-p", f"settings_file:={path}"), TrackerParameters)


@pytest.mark.parametrize("value", [1e-5, 0.1, 2.0, 0.00012])
def test_yaml_floats_stay_floats(value: float) -> None:
    import yaml

    assert yaml.safe_load(parameter_docs.yaml_value(value)) == pytest.approx(value)
    assert isinstance(yaml.safe_load(parameter_docs.yaml_value(value)), float)


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@pytest.mark.parametrize(("particles", "cycles", "fits"), [(20_000, 1, True), (20_000, 2, False)])
def test_what_would_make_the_tracker_deaf_is_refused(
    tmp_path: Path, particles: int, cycles: int, fits: bool
) -> None:
    path = tmp_path / "settings.yaml"
    path.write_text(f"torso: {{particles: {particles}}}\ncycles: {cycles}\n")
    words = "40000; .*20000.*cardbox track"
    with nullcontext() if fits else pytest.raises(ValueError, match=words):
        TrackerParameters(preset="paper", settings_file=f"{path}").check()
