"""Each setting of the tracker changes the result in the filter that runs, or is refused."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.applications.simulation.motions import wave
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.common.settings import NoEffectError, Setting, nested, settings_below
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.measuring.part_colors import learn_appearance
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.search.config import PRESETS, TrackerConfig
from cardbox_tracker.search.whole_body import WholeBodyFilter
from cardbox_tracker.search.whole_body_config import (
    ONE_CAMERA,
    SEVERAL_CAMERAS,
    SearchProfile,
    WholeBodyConfig,
)
from cardbox_tracker.tracking.estimate import LOST
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.tracker import Tracker

CAMERA = Camera(160, 120, 165.0, 165.0, 79.5, 59.5)
BODY = BodyModel.of(distance_m=2.0)
SHIRT, SKIN, WALL = (150, 60, 30), (110, 150, 210), (128, 128, 128)
# Where another value than the usual one shows.
VALUES: dict[str, Any] = {
    "strategy": "srs",
    "filter": "whole_body",
    "whole_body.smallest_person": 1.0,
    "lost_iou": 0.99,
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
    pixels = CAMERA.project(CAMERA.reference_to_optical(pose(BODY.rigid, posture).keypoints_m))
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
    # Points count for a while; the last stripes come after that.
    found += [(image, stripes, None)] * 14 + [(*drawn(wave(1.0)), None)] * 2
    found.append((image, np.zeros_like(silhouette), None))
    elsewhere = reference_posture("front")
    elsewhere[0] = -0.35
    return (*found, *[(*drawn(elsewhere), None)] * 6)


def result_of(config: TrackerConfig, seed: int = 0) -> list[Any]:
    """What is estimated of the scenes, as bytes."""
    tracker = Tracker(body(), CAMERA, config, np.random.default_rng(seed))
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


@pytest.mark.parametrize("seed", range(8))
def test_noise_makes_nobody_else_of_the_person(seed: int) -> None:
    """A posture that follows noise does not show the person's colours."""
    assert all(state != LOST for state, *_ in result_of(PRESETS["default"](), seed)[-3:])


TOTALS = ("survivors", "torsos", "arms", "arms_again", "together", "average")
PARTS = (
    *("alike", "torso_explorers", "fresh_torsos", "best_torsos", "arm_mirrors", "arm_tips"),
    *("banked_arms", "best_arms", "paired_arms"),
)


@given(
    st.floats(0.25, 4.0),
    st.sampled_from((ONE_CAMERA, SEVERAL_CAMERAS)),
    st.sampled_from((1.0, 0.25)),
)
def test_any_effort_scales_all_numbers_of_states(
    effort: float, usual: SearchProfile, located: float
) -> None:
    """Twice, as in a frame whose points tell where joints are."""
    profile = usual.scaled(effort)
    for name in (*TOTALS, *PARTS):
        wanted = effort * getattr(usual, name)
        assert abs(getattr(profile, name) - wanted) < 1.0 or wanted < 6.0
    scaled = profile.scaled(located)
    rest = {
        field.name: getattr(usual, field.name)
        for field in fields(SearchProfile)
        if field.name not in (*TOTALS, *PARTS)
    }
    assert {name: getattr(scaled, name) for name in rest} == rest
    # Parts do not exceed their totals.
    assert 1 <= scaled.alike <= scaled.survivors
    assert scaled.fresh_torsos <= scaled.torso_explorers <= scaled.torsos
    assert scaled.best_torsos <= scaled.torsos
    assert scaled.arm_mirrors + scaled.arm_tips + scaled.banked_arms < scaled.arms
    assert min(scaled.best_arms, scaled.paired_arms) >= 1
    assert max(scaled.best_arms, scaled.paired_arms) <= scaled.arms + scaled.arms_again


def test_an_effort_of_one_changes_nothing() -> None:
    assert ONE_CAMERA.scaled(1.0) is ONE_CAMERA


def test_several_cameras_have_constants_of_their_own_unless_some_are_given() -> None:
    config = WholeBodyConfig()
    assert config.profile_for(1) is ONE_CAMERA
    assert config.profile_for(2) is config.profile_for(3) is SEVERAL_CAMERAS
    mine = replace(ONE_CAMERA, survivors=8)
    assert all(replace(config, profile=mine).profile_for(n) is mine for n in (1, 2))


def test_a_given_profile_is_that_of_the_search() -> None:
    preset = PRESETS["default"]()
    counts = []
    for profile in (ONE_CAMERA, replace(ONE_CAMERA, rounds=0)):
        config = replace(preset, whole_body=replace(preset.whole_body, profile=profile))
        tracker = Tracker(body(), CAMERA, config, np.random.default_rng(0))
        for image, silhouette, _ in scenes()[:3]:
            assert tracker.track(silhouette, image).posture is not None
        assert isinstance(tracker.filter, WholeBodyFilter)
        counts.append(len(tracker.filter.rated.states))
    # Two rounds of states that move all joints are left out.
    assert counts[0] - counts[1] == 2 * ONE_CAMERA.together


def test_the_whole_body_filter_has_four_settings() -> None:
    names = {name for name, *_ in settings_below(PRESETS["default"]())}
    assert {name for name in names if name.startswith("whole_body.")} == {
        f"whole_body.{name}"
        for name in ("effort", "smoothing", "smallest_person", "largest_person")
    }
    assert len(names) < 40


@pytest.mark.parametrize(
    ("name", "value"),
    [("survivors", 8), ("cost", {"weight": 0.5}), ("profile", 3), ("profile", {"arms": 9})],
)
def test_constants_of_the_search_are_no_settings(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=rf"'whole_body.{name}' is no setting; .*effort"):
        PRESETS["default"]().changed({"whole_body": {name: value}})


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
