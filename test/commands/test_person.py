"""--person: one of several people from the first image to the last, also over a film's cuts."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import cardbox_tracker
from cardbox_tracker.applications.drawing.video import video_file
from cardbox_tracker.commands.track import TrackArguments, run
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.recordings.result_reader import read_results

RED, BLUE, GREEN = (40, 40, 220), (220, 60, 40), (40, 200, 60)
SHAPE, HZ = (240, 320), 10.0
GIVEN = {"fov_deg": 60, "stature_m": 1.75, "camera_pitch_deg": 0, "effort": 0.3}
# Joints beside the middle of the trunk, px: a trunk of 60 px is 2.5 m away.
BESIDE = {"shoulder": (20, -30), "elbow": (27, 0), "wrist": (29, 26), "hip": (12, 30)}
Person = tuple[float, tuple[int, int, int]]


class ByColour:
    """Finds people whose clothes have one colour, unless half of them is hidden."""

    def detect(self, image: np.ndarray) -> Sequence[Mapping[str, Any]]:
        return [one for colour in (RED, BLUE, GREEN) if (one := self._found(image, colour))]

    def _found(self, image: np.ndarray, colour: tuple[int, int, int]) -> dict[str, Any] | None:
        mask = (np.abs(image.astype(int) - colour) < 60).all(axis=2)
        if mask.sum() < 1300:
            return None
        columns = np.nonzero(mask)[1]
        middle = (columns.min() + columns.max()) / 2
        points: dict[str, Any] = {"nose": (middle, 68, 0.9), "mask": mask}
        for name, (aside, down) in BESIDE.items():
            points |= {f"left_{name}": (middle + aside, 120 + down, 0.9)}
            points |= {f"right_{name}": (middle - aside, 120 + down, 0.9)}
        return points


def film(path: Path, *shots: Sequence[Sequence[Person]]) -> Path:
    """Write a film of people at columns in colours; the last ones stand in front."""
    with video_file(path, HZ) as add:
        for number, shot in enumerate(shots):
            noise = np.random.default_rng(number).integers(90, 170, (12, 16), np.uint8)
            room = cv2.resize(noise, SHAPE[::-1], interpolation=cv2.INTER_NEAREST)
            for people in shot:
                image = np.repeat(room[..., None], 3, axis=2)
                for column, colour in people:
                    middle = round(column), 120
                    cv2.rectangle(
                        image, *((middle[0] + x, y) for x, y in ((-8, 58), (8, 80))), colour, -1
                    )
                    cv2.rectangle(
                        image, *((middle[0] + x, y) for x, y in ((-20, 88), (20, 150))), colour, -1
                    )
                    cv2.rectangle(
                        image, *((middle[0] + x, y) for x, y in ((-12, 150), (12, 230))), colour, -1
                    )
                add(image)
    return path


def columns(recording: Path, person: str, **more: Any) -> list[float]:
    """Return the column of the shoulders in each image, px; nan without a posture."""
    given = {"detector": ByColour(), "person": person, **GIVEN, **more}
    found = cardbox_tracker.track(recording, **given).numbers
    x, z = ((found[f"left_shoulder_{axis}"] + found[f"right_shoulder_{axis}"]) / 2 for axis in "xz")
    return list(160.0 + 160.0 / np.tan(np.radians(30.0)) * x / z)


@pytest.fixture(scope="module")
def crossing(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, np.ndarray, np.ndarray]:
    """A film of one who stands at the left, and one who comes in from the right, passes, leaves."""
    blue = np.full(50, 120.0)
    red = np.concatenate([np.full(8, np.nan), np.linspace(280.0, 30.0, 36), np.full(6, np.nan)])
    people = [
        [(b, BLUE), *([(r, RED)] if np.isfinite(r) else [])] for b, r in zip(blue, red, strict=True)
    ]
    return film(tmp_path_factory.mktemp("crossing") / "film.mp4", people), blue, red


@pytest.mark.parametrize("person", ["right", "left@3.5"])
def test_the_person_is_the_same_in_all_images(
    person: str, crossing: tuple[Path, np.ndarray, np.ndarray]
) -> None:
    recording, blue, red = crossing
    found = np.array(columns(recording, person))
    # At 3.5 s, who came in at the right is at the left.
    own, other = red, blue
    has_posture = np.isfinite(found)
    assert np.mean(has_posture[np.isfinite(own)]) > 0.75
    assert not has_posture[np.isnan(own)][:8].any()
    apart = np.abs(own - other)[has_posture] > 60.0
    np.testing.assert_allclose(found[has_posture][apart], own[has_posture][apart], atol=30.0)


def test_each_shot_is_tracked_anew_and_has_the_person_if_the_clothes_are_there(
    tmp_path: Path,
) -> None:
    shots = [
        [[(90.0, RED), (220.0, BLUE)]] * 12,
        [[(100.0, BLUE), (210.0, RED)]] * 8,
        [[(90.0, GREEN)]] * 8,
    ]
    recording, told = film(tmp_path / "film.mp4", *shots), tmp_path / "a.json"
    found = columns(recording, "left", json=told, csv=tmp_path / "a.csv")
    np.testing.assert_allclose(found[:12], 90.0, atol=15.0)
    np.testing.assert_allclose(found[12:20], 210.0, atol=15.0)
    assert np.isnan(found[20:]).all()
    account = json.loads(told.read_text())
    assert any("the film is cut at 1.2, 2.0 s" in one for one in account["remarks"])
    assert "person: the left one, of 2 at 0.4 s" in account["assumed"]


def test_each_shot_is_a_film_of_its_own(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shots = [[[(90.0, RED)]] * 12, [[]], [[(210.0, BLUE)]] * 8]
    recording, table = film(tmp_path / "film.mp4", *shots), tmp_path / "a.csv"
    more = {"detector": ByColour(), "csv": table, "plot": tmp_path / "a.png", **GIVEN}
    run(TrackArguments(recording, shots=True, **more))
    told = capsys.readouterr()
    assert "shot 3 of 3: 1.30 to 2.00 s" in told.out
    assert "shot 2 is left out: " in told.err and "cut" not in told.err
    first, last = read_results(table), read_results(tmp_path / "a.shot_3.csv")
    assert [len(one.state) for one in (first, last)] == [12, 8]
    assert last.time_s[0] == pytest.approx(1.3)
    assert (tmp_path / "a.shot_3.scene.yaml").is_file() and (tmp_path / "a.shot_3.png").is_file()
    alone = cardbox_tracker.track(
        recording, start_s=1.3, end_s=2.0, **{**more, "csv": None, "plot": None}
    )
    x_m = [one.numbers["left_shoulder_x"] for one in (last, alone)]
    np.testing.assert_allclose(*x_m, atol=1e-6)
    with pytest.raises(CardboxError, match="give start_s and end_s of one"):
        cardbox_tracker.track(recording, shots=True, **GIVEN)
