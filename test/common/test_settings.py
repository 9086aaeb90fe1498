"""A setting is declared once, with its text, unit and range, and checked by that."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common import settings
from cardbox_tracker.common.settings import Setting, setting
from cardbox_tracker.measuring.config import InitializationConfig
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.search.config import FilterConfig, TrackerConfig
from cardbox_tracker.search.whole_body_config import WholeBodyConfig
from cardbox_tracker.segmentation.background_config import BackgroundConfig
from cardbox_tracker.segmentation.empty_scene import BackgroundModel
from cardbox_tracker.segmentation.silhouettes import SilhouetteExtractor
from cardbox_tracker.tracking.tracker import Tracker

CAMERA, PLANE = Camera(8, 6, 8.0, 8.0, 3.5, 2.5), np.ones((6, 8), np.float32)

CORE = (
    BackgroundConfig,
    InitializationConfig,
    FilterConfig,
    TrackerConfig,
    WholeBodyConfig,
)
PLAIN = {
    TrackerConfig: {"torso", "arm", "terms", "whole_body"},
    WholeBodyConfig: {"profile", "cost"},
}


@dataclass(frozen=True)
class Inner:
    depth: int = setting(1, "a depth", limits=(0, 5))


@dataclass(frozen=True)
class Sample:
    inner: Inner = Inner()
    ratio: float = setting(0.5, "a ratio", unit="m", limits=(0.0, 1.0), restarts=True)
    kind: str = setting("a", "a kind", choices=("a", "b"))
    limit: int | None = setting(3, "a limit", limits=(0, 10))


def test_settings_are_found_in_order_and_plain_fields_are_none() -> None:
    found = settings.settings_of(Sample)
    assert list(found) == ["ratio", "kind", "limit"]
    assert found["ratio"] == Setting("a ratio", "m", (0.0, 1.0), (), True)
    assert [one.range_text for one in found.values()] == ["0 to 1", "a | b", "0 to 10"]
    assert Setting("any").range_text == ""


@given(st.floats(allow_nan=True, allow_infinity=True))
def test_exactly_what_lies_in_the_range_is_allowed(value: float) -> None:
    sample = Sample(ratio=value)
    if 0.0 <= value <= 1.0:
        settings.check(sample)
    else:
        with pytest.raises(ValueError, match=r"ratio .*0 to 1"):
            settings.check(sample)


def test_choices_and_values_that_are_not_set() -> None:
    settings.check(Sample(limit=None))
    with pytest.raises(ValueError, match=r"kind .*'c'; .*a, b"):
        settings.check(Sample(kind="c"))


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, False),
        ({"kind": "b", "limit": None}, False),
        ({"ratio": 0.6}, True),
        ({"inner": Inner(2)}, True),
    ],
)
def test_only_what_must_restarts(changes: dict[str, Any], expected: bool) -> None:
    assert settings.restarts(Sample(), replace(Sample(), **changes)) is expected


@pytest.mark.parametrize("kind", CORE)
def test_the_core_declares_and_checks_all_its_settings(kind: Any) -> None:
    plain = PLAIN.get(kind, set())
    assert {f for f in kind.__dataclass_fields__ if f not in plain} == set(
        settings.settings_of(kind)
    )
    for name, one in settings.settings_of(kind).items():
        assert one.description and not one.description.endswith(".")
        default = getattr(kind, name)
        one.check(name, default)
        if isinstance(default, float):
            assert one.limits is not None, name
        if one.limits is not None:
            for wrong in (one.limits[0] - 1, one.limits[1] + 1):
                with pytest.raises(ValueError, match=name):
                    kind(**{name: type(default)(wrong)})


def test_a_value_out_of_range_is_refused_by_its_whole_name() -> None:
    with pytest.raises(ValueError, match=r"whole_body\.smoothing is 9; expected 0 to "):
        TrackerConfig().changed({"whole_body": {"smoothing": 9.0}})


def test_dotted_names_are_nested() -> None:
    values: dict[Any, int] = {"a.b.c": 1, "a.d": 2, "e": 3, 7: 4}
    assert settings.nested(values) == {"a": {"b": {"c": 1}, "d": 2}, "e": 3, "7": 4}


@pytest.mark.parametrize("wrong", [TrackerConfig, lambda: TrackerConfig(), "default", {}])
def test_what_is_no_settings_is_refused_by_its_name(wrong: Any) -> None:
    for make in (
        lambda: Tracker(BodyModel(), CAMERA, wrong),
        lambda: Tracker(BodyModel(), CAMERA, TrackerConfig(lost_iou=wrong)),
        lambda: TrackerConfig(whole_body=wrong),
        lambda: BackgroundConfig(threshold=wrong),
        lambda: SilhouetteExtractor(BackgroundModel(PLANE, PLANE), wrong),
    ):
        with pytest.raises(ValueError, match=r"(config|lost_iou|whole_body|threshold) is .*; exp"):
            make()
    with pytest.raises(ValueError, match=r"terms is .*; expected an instance of Sequence"):
        TrackerConfig(terms=lambda: ())  # type: ignore[arg-type]
    for body, camera in ((wrong, CAMERA), (BodyModel(), wrong)):
        with pytest.raises(ValueError, match=r"(body|camera) is .*; expected an instance of"):
            Tracker(body, camera)


@dataclass(frozen=True)
class Part(Sample, settings.Settings):
    pass


@dataclass(frozen=True)
class Outer:
    parts: tuple[Inner, ...] = (Inner(),)
    sample: Part = Part()
    flag: bool = setting(False, "a flag")


def test_settings_are_changed_by_name_however_deep() -> None:
    given = {"flag": True, "parts": {"Inner": {"depth": 2}}, "sample": {"ratio": 1, "kind": "b"}}
    found = settings.changed(Outer(), given)
    assert found == Outer((Inner(2),), Part(ratio=1.0, kind="b"), True)
    assert type(found.sample.ratio) is float
    assert settings.changed(Outer(), {}) == Outer()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"flags": True}, ["'flags'", "did you mean 'flag'", "parts, sample, flag"]),
        ({"sample": {"rate": 1.0}}, ["'sample.rate'", "ratio"]),
        ({"parts": {"Other": {}}}, ["'parts.Other'", "Inner"]),
        ({"sample": 3}, ["sample is 3", "names and values"]),
        ({"flag": 1}, ["flag is 1", "true or false"]),
        ({"sample": {"ratio": True}}, ["sample.ratio is True", "a number"]),
        ({"sample": {"ratio": "0.5"}}, ["sample.ratio is '0.5'", "a number"]),
        ({"sample": {"limit": 2.0}}, ["sample.limit is 2.0", "a whole number"]),
        ({7: True}, ["'7'", "flag"]),
    ],
)
def test_what_is_no_such_setting_is_refused_by_its_whole_name(
    given: dict[Any, Any], words: list[str]
) -> None:
    with pytest.raises(ValueError, match=re.escape(words[0])) as caught:
        settings.changed(Outer(), given)
    assert all(word in str(caught.value) for word in words)
