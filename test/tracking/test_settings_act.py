"""Each setting of the tracker changes the result in the filter that runs, or is refused."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.body.cardbox import cardbox_patches
from cardbox_tracker.body.kinematics import keypoints_m
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import reference_posture
from cardbox_tracker.detection.image_points import ImagePoints
from cardbox_tracker.estimation.config import PRESETS, TrackerConfig
from cardbox_tracker.estimation.filtering.whole_body import WholeBodyFilter
from cardbox_tracker.estimation.filtering.whole_body_config import WholeBodyConfig
from cardbox_tracker.estimation.initialization.part_colors import learn_appearance
from cardbox_tracker.estimation.observation import Observation
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.settings import NoEffectError, Setting, nested, settings_below
from cardbox_tracker.simulation.motions import wave
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.rasterisation import render

CAMERA = Camera(160, 120, 165.0, 165.0, 79.5, 59.5)
BODY = BodyModel.of(distance_m=2.0)
SHIRT, SKIN, WALL = (150, 60, 30), (110, 150, 210), (128, 128, 128)
# Where another value than the usual one shows.
VALUES: dict[str, Any] = {
    "strategy": "srs",
    "filter": "whole_body",
    "whole_body.fresh_torsos": 0,
    "whole_body.smallest_person": 1.0,
    "whole_body.uncertain_from": 0.02,
    "whole_body.lost_from": 0.05,
}


def drawn(posture: np.ndarray, gain: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Image and silhouette of a person with bare forearms."""
    patches = cardbox_patches(BODY, posture)
    silhouette = render(patches, CAMERA)
    image = np.full((120, 160, 3), WALL, np.uint8)
    image[silhouette > 0] = SHIRT
    for k in (5, 6, 9, 10, 13, 14):  # head and forearms
        corners = CAMERA.project(CAMERA.reference_to_optical(patches[k]))
        cv2.fillConvexPoly(image, np.round(corners).astype(np.int32), SKIN)
    return np.clip(image * gain, 0, 255).astype(np.uint8), silhouette


@cache
def body() -> BodyModel:
    """A person whose colours are known."""
    images, silhouettes = {}, {}
    for name in ("front", "arms"):
        image, silhouettes[name] = drawn(reference_posture(name))
        images[name] = [image]
    return BODY.with_values(appearance=learn_appearance(images, silhouettes, BODY, CAMERA))


def detected(posture: np.ndarray) -> ImagePoints:
    """The points of shoulders, elbows and knuckles."""
    pixels = CAMERA.project(CAMERA.reference_to_optical(keypoints_m(BODY, posture)))
    names = [
        (f"{side}_{joint}",) if joint != "hand" else (f"{side}_index", f"{side}_little_finger")
        for side in ("left", "right")
        for joint in ("shoulder", "elbow", "hand")
    ]
    return ImagePoints.of(
        {name: (u, v, 0.9) for (u, v), same in zip(pixels, names, strict=True) for name in same}
    )


@cache
def scenes() -> tuple[tuple[np.ndarray, np.ndarray, ImagePoints | None], ...]:
    """A person who moves, a door that opens, noise, nobody, and the person elsewhere.

    In some of the images a detector has found the joints.
    """
    found = []
    for i in range(14):
        posture = wave(i / 8.0)
        posture[0:4] += 0.02 * i, 0.02 * i, 0.03 * i, 0.04 * i
        posture[8:12] += np.radians((2.0, 5.0, -6.0, 6.0)) * i
        points = detected(posture) if 4 <= i < 8 else None
        found.append((*drawn(posture, 1.0 - 0.02 * i), points))
    image, silhouette = drawn(wave(1.0))
    door = silhouette.copy()
    door[20:, :25] = 255
    found += [(image, door, None)] * 2
    stripes = np.zeros_like(silhouette)
    stripes[:, ::5] = 255
    found += [(image, stripes, None)] * 6 + [(*drawn(wave(1.0)), None)] * 2
    found.append((image, np.zeros_like(silhouette), None))
    elsewhere = reference_posture("front")
    elsewhere[0] = -0.35
    return (*found, *[(*drawn(elsewhere), None)] * 4)


def result_of(config: TrackerConfig) -> list[Any]:
    """What is estimated of the scenes, as bytes."""
    tracker = Tracker(body(), CAMERA, config, np.random.default_rng(0))
    found: list[Any] = []
    for image, silhouette, points in scenes():
        one = tracker.track(Observation(silhouette, image, points=points))
        values = (one.posture, one.posture_stddev, one.offset_m)
        found.append((one.state, *(None if a is None else a.tobytes() for a in values)))
    return found


@cache
def usual(preset: str) -> list[Any]:
    return result_of(PRESETS[preset]())


def another(name: str, value: Any, setting: Setting) -> Any:
    """Another value that is allowed."""
    if name in VALUES and VALUES[name] != value:
        return VALUES[name]
    if isinstance(value, bool):
        return not value
    if isinstance(value, str):
        return next(choice for choice in setting.choices if choice != value)
    low, high = setting.limits or (0, 0)
    if isinstance(value, int):
        return value - 1 if value > low and value > 2 else value + 1
    return low + 0.3 * (value - low) if value > low else min(high, value + 0.3)


COUNTS = (
    *("survivors", "alike", "torsos", "torso_explorers", "fresh_torsos", "best_torsos", "arms"),
    *("arm_mirrors", "arm_tips", "banked_arms", "best_arms", "arms_again", "paired_arms"),
    *("together", "average"),
)


@given(effort=st.floats(0.25, 4.0), data=st.data())
def test_any_effort_scales_any_settings_that_go_together(
    effort: float, data: st.DataObject
) -> None:
    usual = WholeBodyConfig()
    few = {name: data.draw(st.integers(1, getattr(usual, name)), name) for name in COUNTS[7:13]}
    config = replace(usual, **few, effort=effort)
    scaled = config.scaled()
    assert scaled.effort == 1.0
    for name in COUNTS:
        wanted = effort * getattr(config, name)
        assert abs(getattr(scaled, name) - wanted) < 1.0 or wanted < 1.0


def test_an_effort_of_one_changes_nothing() -> None:
    config = WholeBodyConfig()
    assert config.scaled() is config


def test_an_effort_beyond_what_is_possible_is_named() -> None:
    with pytest.raises(ValueError, match=r"effort is 4.*survivors is 4000"):
        WholeBodyConfig(survivors=1000, effort=4.0)


@pytest.mark.parametrize("effort", [0.25, 4.0])
def test_an_effort_takes_as_many_states_more(effort: float) -> None:
    counts = []
    for factor in (1.0, effort):
        config = PRESETS["default"]().changed({"whole_body": {"effort": factor}})
        tracker = Tracker(body(), CAMERA, config, np.random.default_rng(0))
        for image, silhouette, _ in scenes()[:3]:
            assert tracker.track(silhouette, image).posture is not None
        assert isinstance(tracker.filter, WholeBodyFilter)
        counts.append(len(tracker.filter.rated.states))
    assert counts[1] / counts[0] == pytest.approx(effort, rel=0.2)


CASES = [(preset, *case) for preset in PRESETS for case in settings_below(PRESETS[preset]())]


@pytest.mark.parametrize(
    ("preset", "name", "value", "setting"), CASES, ids=[f"{c[0]}-{c[1]}" for c in CASES]
)
def test_a_setting_acts_or_is_refused_with_the_one_that_does(
    preset: str, name: str, value: Any, setting: Setting
) -> None:
    config = PRESETS[preset]()
    given = nested({name: another(name, value, setting)})
    try:
        changed = config.changed(given)
    except NoEffectError as error:
        assert error.name == name
        cases = {case[0]: case for case in settings_below(config)}
        for instead in error.instead.replace(" and ", ", ").split(", "):
            assert config.changed(nested({instead: another(*cases[instead])})) != config
        return
    assert changed != config
    assert result_of(changed) != usual(preset)
