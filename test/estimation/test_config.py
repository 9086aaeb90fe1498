"""Settings of the tracker: Table I, the presets, and what is out of range."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, fields, replace
from typing import Any

import pytest

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation import tracker
from cardbox_tracker.estimation.config import (
    FILTERS,
    PRESETS,
    FilterConfig,
    TrackerConfig,
    default_preset,
    paper_preset,
)
from cardbox_tracker.estimation.filtering.whole_body_config import WholeBodyConfig


def test_the_paper_preset_is_table_one() -> None:
    config = paper_preset()
    assert (config.torso.particles, config.arm.particles) == (200, 200)
    assert (config.torso.survival_rate, config.arm.survival_rate) == (0.2, 0.4)
    assert (config.torso.rotation_noise_rad, config.arm.rotation_noise_rad) == (0.1, 0.25)
    assert (config.torso.translation_noise_m, config.arm.translation_noise_m) == (0.02, 0.0)
    assert (config.torso.sigma_gamma_px, config.arm.sigma_gamma_px) == (8000.0, 4000.0)
    assert config.strategy == "drs"
    # One cycle a frame whose best particle is the result, and nothing else.
    assert (config.cycles, config.average, config.terms) == (1, 1, ())
    assert not config.relocalize and not config.select_person


def test_only_the_default_preset_takes_the_whole_body_filter() -> None:
    default, paper = default_preset(), paper_preset()
    assert (paper.filter, default.filter) == ("hierarchical", "whole_body")
    assert set(FILTERS) == {"hierarchical", "whole_body"} == set(tracker.FILTERS)
    assert default.relocalize and default.select_person


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("effort", (0.2, 4.1, 0.0)),
        ("smoothing", (-0.1, 1.0)),
        ("smallest_person", (-0.1, 1.1)),
        ("largest_person", (0.9, 1001.0)),
    ],
)
def test_a_whole_body_value_out_of_range_is_named(name: str, values: tuple[float, ...]) -> None:
    for value in (*values, float("nan")):
        with pytest.raises(ValueError, match=f"^{name} is .*; expected .* to "):
            WholeBodyConfig(**{name: value})
        with pytest.raises(ValueError, match=rf"^whole_body\.{name} is .*; expected .* to "):
            default_preset().changed({"whole_body": {name: value}})


def test_presets_by_name() -> None:
    assert {name: make() for name, make in PRESETS.items()} == {
        "paper": paper_preset(),
        "default": default_preset(),
    }


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("particles", (1, 0, -200, 1_000_001)),
        ("survival_rate", (0.0, -0.1, 1.01, 40.0)),
        ("rotation_noise_rad", (-0.1, 3.3, 14.0)),
        ("translation_noise_m", (-0.01, 1.5)),
        ("sigma_gamma_px", (0.0, -4000.0, 1e10)),
    ],
)
def test_a_filter_value_out_of_range_is_named(name: str, values: tuple[float, ...]) -> None:
    for value in (*values, float("nan")):
        with pytest.raises(ValueError, match=f"^{name} is .*; expected .* to "):
            FilterConfig(**{name: value})


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("cycles", (0, -1, 101)),
        ("average", (0, -3, 201)),
        ("lost_iou", (-0.1, 1.1)),
        ("lost_frames", (0, -1)),
    ],
)
def test_a_tracker_value_out_of_range_is_named(name: str, values: tuple[float, ...]) -> None:
    for value in (*values, float("nan")):
        with pytest.raises(ValueError, match=f"^{name} is .*; expected .* to "):
            TrackerConfig(**{name: value})


def test_an_unknown_strategy_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"strategy .*'best'; .*drs, srs"):
        TrackerConfig(strategy="best")


@pytest.mark.parametrize(
    "values",
    [
        {"particles": 2},
        {"survival_rate": 1.0},
        {"survival_rate": 1e-9},
        {"rotation_noise_rad": 0.0, "translation_noise_m": 0.0},
    ],
)
def test_the_ends_of_the_ranges_are_allowed(values: dict[str, Any]) -> None:
    config = FilterConfig(**values)
    assert {name: getattr(config, name) for name in values} == values


def test_no_more_particles_are_averaged_than_the_smaller_filter_has() -> None:
    small = FilterConfig(particles=10)
    assert TrackerConfig(arm=small, average=10).average == 10
    with pytest.raises(ValueError, match="average is 11; expected 1 to 10"):
        TrackerConfig(arm=small, average=11)
    with pytest.raises(ValueError, match="average is 11; expected 1 to 10"):
        TrackerConfig(torso=small, average=11)


def test_the_number_of_particles_changes_in_all_filters_and_nothing_else() -> None:
    config = replace(paper_preset(), average=20)
    many = config.with_particles(1000)
    assert (many.torso.particles, many.arm.particles) == (1000, 1000)
    assert many.with_particles(200) == config
    few = config.with_particles(5)
    assert (few.torso.particles, few.arm.particles, few.average) == (5, 5, 5)
    assert replace(few.with_particles(200), average=config.average) == config


def test_settings_cannot_change_while_a_tracker_uses_them() -> None:
    for config in (paper_preset(), paper_preset().torso):
        for field in fields(config):
            with pytest.raises(FrozenInstanceError):
                setattr(config, field.name, getattr(config, field.name))


def test_a_misspelt_preset_is_refused_with_the_names() -> None:
    with pytest.raises(CardboxError, match=r"'defualt'.*mean 'default'.*paper, default"):
        PRESETS["defualt"]
    assert PRESETS.get("defualt") is None and "defualt" not in PRESETS
