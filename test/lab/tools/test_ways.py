"""Film, bag and live side by side: what is compared, and what the page says of it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES, LEG_NAMES
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.recordings.result_table import POINT_COLUMNS
from cardbox_tracker.recordings.silhouettes import TimeSpan
from lab.tools.way_cases import Case, Person, cases_of
from lab.tools.ways import FURTHER, figures, of_people, page, parts_of

TRUE_M = np.random.default_rng(0).normal(size=(6, 3)) + np.array([0.0, 0.0, 3.0])


def results(points_m: Mapping[int, FloatArray], legs: Sequence[float], state: str) -> Results:
    columns = np.array([one.ravel() for one in points_m.values()])
    numbers = dict(zip(POINT_COLUMNS, columns.T, strict=True))
    numbers |= dict.fromkeys(LEG_NAMES, np.array(legs))
    stamps = np.array(list(points_m), np.int64)
    states = (state,) * len(stamps)
    return Results(Path(), stamps, stamps / 1e9, states, numbers, {}, (None,) * len(stamps))


def test_figures_by_hand() -> None:
    # The place is 10 cm off, and one hand of six joints is 6 cm off in one of two images.
    away = TRUE_M + np.array([0.0, 0.0, 0.1])
    hand = TRUE_M.copy()
    hand[2, 0] += 0.06
    found = results({1: away, 2: hand, 9: TRUE_M}, [0.0, np.nan, 0.0], "tracking")
    truth = {1: TRUE_M, 2: TRUE_M, 3: TRUE_M, 4: TRUE_M}
    shown = figures(found, truth)
    assert shown["shape_cm"] == pytest.approx(0.5)
    assert shown["place_cm"] == pytest.approx(5.5)
    assert (shown["tracking"], shown["legs"], shown["images"]) == (0.5, 0.25, 2)


def test_without_an_estimate_errors_are_unknown_and_shares_0() -> None:
    shown = figures(results({9: TRUE_M}, [0.0], "tracking"), {1: TRUE_M})
    assert np.isnan([shown["shape_cm"], shown["place_cm"]]).all()
    assert (shown["tracking"], shown["legs"], shown["images"]) == (0.0, 0.0, 0)


@pytest.mark.parametrize("exchanged", [False, True])
def test_people_with_each_others_numbers_are_told(exchanged: bool) -> None:
    aside = TRUE_M + np.array([1.0, 0.0, 0.0])
    people = [Person("left", 1.4, {1: TRUE_M}), Person("right", 1.7, {1: aside})]
    runs = [results({1: points_m}, [0.0], "tracking") for points_m in (TRUE_M, aside)]
    rows = of_people(people, runs[::-1] if exchanged else runs)
    assert [row["person"] for row in rows] == ["left", "right"]
    assert [row["exchanged"] for row in rows] == [exchanged] * 2
    assert rows[0]["place_cm"] == rows[1]["place_cm"] == pytest.approx(0.0)


def case(**changes: object) -> Case:
    person = Person("", 1.7, {})
    given = (Path("bag"), ("cam0",), None, 5.0, 30.0, TimeSpan(0.2, 3.8), 4.0, (person,))
    values = Case("name", *given).__dict__
    return Case(**{**values, **changes})


def test_slow_replay_leaves_each_person_of_each_camera_its_time() -> None:
    two = (Person("", 1.7, {}), Person("", 1.5, {}))
    assert case().slowly(0.3) == pytest.approx(0.3)
    assert case(fps=6.0).slowly(0.3) == pytest.approx(0.3)
    assert case(fps=60.0, cameras=("a", "b"), people=two).slowly(0.3) == pytest.approx(0.0375)


def test_what_is_given() -> None:
    words = " ".join(case().given)
    assert "--stature 1.7 --camera-pitch-deg 5 " in words
    assert "--background 0.2:3.8 --start 4 " in words
    two = (Person("", 1.4, {}), Person("", 1.72, {}))
    words = " ".join(case(people=two, empty=None).given)
    assert "--stature 1.4,1.72 " in words
    assert "--people 2 --silhouettes detector " in words
    assert "--start" not in words
    assert case().numbers == [None]
    assert case(people=two).numbers == [1, 2]


def test_cases_of_a_session_of_two_people(tmp_path: Path) -> None:
    names, frames = ["cam0", "cam1"], [{"stamp_ns": 7}, {"stamp_ns": 8}]

    def person(name: str, x_m: float) -> dict[str, object]:
        joints = {one: [x_m, 0.0, 3.0] for one in KEYPOINT_NAMES[:-1]}
        there = {"mask_px": 9000, "joints_m": joints, "covered": []}
        return {
            "name": name,
            "height": 1.6,
            "frames": [{"cameras": dict.fromkeys(names, there)}, {}],
        }

    truth = {
        "fps": 15.0,
        "camera": {"pitch_down_deg": 3.0},
        "cameras": [{"name": name} for name in names],
        "segments": [{"name": "empty", "start_s": 0.0, "end_s": 2.0}],
        "people": [person("right", 0.5), person("left", -0.5)],
        "frames": frames,
    }
    (tmp_path / "ground_truth.json").write_text(json.dumps(truth))
    (tmp_path / "extrinsics.yaml").touch()
    one, both = cases_of(tmp_path)
    assert (one.cameras, one.extrinsics) == (("cam0",), None)
    assert (both.cameras, both.extrinsics) == (("cam0", "cam1"), tmp_path / "extrinsics.yaml")
    assert (one.empty, one.start_s) == (TimeSpan(0.0, 1.8), 2.0)
    assert [person.name for person in one.people] == ["left", "right"]
    (joints_m,) = one.people[0].joints_m.values()
    assert list(one.people[0].joints_m) == [7]
    assert joints_m[0].tolist() == [-0.5, 0.0, 3.0]
    assert np.isnan(joints_m[-1]).all()


def row(shape_cm: float, **more: object) -> dict[str, object]:
    values = {"person": "", "exchanged": False, "place_cm": 2.0 * shape_cm, "images": 3}
    return {**values, "tracking": 0.5, "legs": 1.0, "shape_cm": shape_cm, **more}


def test_the_page_has_a_row_for_each_recording_and_says_what_failed() -> None:
    found = {
        "one": {"film": [row(1.0)], "bag": [row(2.0)], "slow": [row(3.0)]},
        "other": {"film": [row(3.0)], "bag": [row(4.0)], "slow": "no tracker"},
        "two cameras": {"bag": [row(5.0, person="he"), row(6.0, person="she", exchanged=True)]},
    }
    lines = page(found, f"{FURTHER}\n\nmore\n").splitlines()
    assert "| recording | film | bag | live, slowly |" in lines
    cells = "1.0 / 2.0, 50%, 100% | 2.0 / 4.0, 50%, 100% | 3.0 / 6.0, 50%, 100% |"
    assert f"| one | {cells}" in lines
    assert f"| mean of 1 | {cells}" in lines
    assert "| other | 3.0 / 6.0, 50%, 100% | 4.0 / 8.0, 50%, 100% | failed |" in lines
    assert "- other, live, slowly: no tracker" in lines
    assert "| two cameras, she |  | 6.0 / 12.0, 50%, 100%, exchanged |  |" in lines
    assert lines[-3:] == [FURTHER, "", "more"]


def test_the_last_part_of_a_page_stays(tmp_path: Path) -> None:
    path = tmp_path / "page.md"
    assert parts_of(path) == ("", "")
    path.write_text(f"table\n\n{FURTHER}\n\nmore\n")
    assert parts_of(path) == ("table\n\n", f"{FURTHER}\n\nmore\n")
