"""The file of a scene: what is written is read again, and what is none is refused by name."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.measuring.scene import (
    FOUND,
    GIVEN,
    USUAL,
    Scene,
    SceneCamera,
    Value,
    dumps_scene,
    load_scene,
    save_scene,
)
from cardbox_tracker.person.model import body_from_proportions

CAMERA = SceneCamera(
    Value(math.radians(60.0), 0.02, USUAL),
    Value(math.radians(12.0), math.radians(2.0), FOUND, 'people: "all"'),
    Value(0.0, math.radians(1.0), GIVEN),
    Value(1.5, 0.1, FOUND),
)
SCENE = Scene(CAMERA, (body_from_proportions(1.75, 2.5), body_from_proportions(1.6)))


def test_a_scene_is_read_as_it_was_written(tmp_path: Path) -> None:
    save_scene(SCENE, tmp_path / "film.scene.yaml")
    found = load_scene(tmp_path / "film.scene.yaml")
    assert found.people == SCENE.people
    for one, other in zip(found.camera, CAMERA, strict=True):
        assert one is not None
        assert other is not None
        assert one[:2] == pytest.approx(other[:2], abs=1e-7)
        assert one[2:] == other[2:]


def test_words_have_deviation_unit_and_origin() -> None:
    assert list(SCENE.words()) == [
        "field of view across the image 60 +- 1.1 degrees (usual)",
        'downward pitch 12 +- 2 degrees (found: people: "all")',
        "clockwise roll 0 +- 1 degrees (given)",
        "height above the floor 1.5 +- 0.1 m (found)",
    ]
    assert SCENE.numbers()["height_m"] == {"mean": 1.5, "stddev": 0.1, "origin": "found"}


def test_a_camera_whose_floor_is_not_seen_has_no_height(tmp_path: Path) -> None:
    save_scene(Scene(CAMERA._replace(height_m=None)), tmp_path / "a.yaml")
    found = load_scene(tmp_path / "a.yaml")
    assert (found.camera.height_m, found.people) == (None, ())


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("cardbox_scene/1", "cardbox_scene/9", "format is 'cardbox_scene/9'"),
        ("pitch_deg", "tilt_deg", "lacks fov_deg, pitch_deg or roll_deg"),
        ("height_m: {", "width_m: {", "unknown key 'width_m'"),
        ("mean: 60.0", "mean: 6.0", "fov_deg is 6 .*expected 10 to 160"),
        ("mean: 60.0", "mean: wide", "fov_deg is no mapping"),
        ("stddev: 2.0", "stddev: -2.0", "deviation from 0 on"),
        ("stddev: 2.0", "stddev: .nan", "deviation from 0 on"),
        ("stddev: 2.0", "stddev: 1.0e+6", "deviation from 0 on, up to 178"),
        ("by: ", "by: 7 #", "pitch_deg"),
        ("\npeople:", "\npersons:", "expected a mapping of camera, format, people"),
        ("torso_height:", "torso_hight:", "person 1: unknown key 'sizes.torso_hight'"),
    ],
)
def test_a_file_that_is_no_scene_is_refused_by_name(
    tmp_path: Path, old: str, new: str, named: str
) -> None:
    text = dumps_scene(SCENE)
    assert old in text
    (tmp_path / "a.yaml").write_text(text.replace(old, new, 1))
    with pytest.raises(CardboxError, match=named):
        load_scene(tmp_path / "a.yaml")


def test_what_is_read_and_written_again_is_the_same(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    for _ in range(50):
        values = [Value(*rng.uniform(0.2, 0.5, 2)) for _ in range(4)]
        save_scene(Scene(SceneCamera(*values)), tmp_path / "a.yaml")
        found = load_scene(tmp_path / "a.yaml")
        assert dumps_scene(found) == (tmp_path / "a.yaml").read_text()
