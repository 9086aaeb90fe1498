"""Every number of the README that an evaluation gave is that of the committed results."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from cardbox_tracker.applications.evaluation.results import read_json
from lab.experiments.results import motions_in, recorded_results
from lab.tools.people_rows import people_rows
from lab.tools.readme_figures import (
    BEGIN,
    END,
    SESSIONS_BEGIN,
    SESSIONS_END,
    current,
    main,
    readme_section,
    sessions_section,
)

ROOT = Path(__file__).parents[3]
RESULTS = ROOT / "docs" / "evaluation"


def readme() -> str:
    return (ROOT / "README.md").read_text(encoding="utf-8")


def section() -> str:
    return readme().split(BEGIN)[1].split(END)[0]


def test_the_readme_is_up_to_date() -> None:
    """If not: python -m lab.tools.readme_figures."""
    assert current(ROOT) == readme()
    assert main(["--check", "--root", str(ROOT)]) == 0


def test_each_number_of_the_table_is_in_the_results() -> None:
    """The table read back, apart from the code that wrote it."""
    sources = {"": read_json(RESULTS / "results.json")} | recorded_results(RESULTS)
    rows = [line.strip("|").split("|") for line in section().splitlines() if " px |" in line]
    seen = []
    for name, *cells in rows:
        motion, _, session = name.strip().rstrip(")").partition(" (")
        figures = sources[session][motion]
        drs, srs = figures["drs"], figures["srs"]
        expected = [
            100 * drs["mpjpe_m"],
            100 * srs["mpjpe_m"],
            50 * (drs["error_m"]["left_hand"] + drs["error_m"]["right_hand"]),
            50 * (srs["error_m"]["left_hand"] + srs["error_m"]["right_hand"]),
        ]
        assert [float(cell.split()[0]) for cell in cells[:4]] == pytest.approx(expected, abs=0.051)
        costs = [drs["mean_cost_px"], srs["mean_cost_px"]]
        assert [float(cell.split()[0]) for cell in cells[4:]] == pytest.approx(costs, abs=0.51)
        seen.append((session, motion))
    assert seen == [(name, m) for name, results in sources.items() for m in motions_in(results)]


def test_no_error_or_cost_stands_outside_the_marks() -> None:
    outside = readme().split(BEGIN)[0] + readme().split(END)[1]
    outside = outside.split(SESSIONS_BEGIN)[0] + outside.split(SESSIONS_END)[1]
    assert re.findall(r"\d[\d.]*\s*(?:cm|px)\b", outside) == []


def hand_made() -> dict[str, Any]:
    strategy = {
        "mpjpe_m": 0.1234,
        "error_m": {"left_hand": 0.2, "right_hand": 0.3},
        "mean_cost_px": 987.6,
    }
    return {
        "runs": 7,
        "quick": True,
        "wave": {"drs": strategy, "srs": strategy},
        "commit": "0123456789abcdef",
    }


def test_section_by_hand() -> None:
    results = hand_made()
    text = readme_section(results, {"person": {"runs": 3, "reach": results["wave"]}})
    row = "12.3 cm | 12.3 cm | 25.0 cm | 25.0 cm | 988 px | 988 px |"
    assert f"| wave | {row}" in text
    assert f"| reach (person) | {row}" in text
    assert "7 runs (a quick run)" in text
    words = " ".join(text.split())
    assert words.endswith("Measured at commit 01234567.")
    assert "`person` are images of rendered, realistically shaped bodies, not films" in words
    assert "(3 runs)" in words


def test_sessions_by_hand() -> None:
    def session(name: str, aligned: float, peer: float) -> dict[str, Any]:
        run = {"absolute": 9.0, "aligned": aligned, "ms": 2.5}
        return {"name": name, "mediapipe": {"aligned": peer}, "runs": [run, run]}

    results = {"seeds": [0, 1], "sessions": [session("a", 4.0, 8.0), session("b", 9.0, 6.0)]}
    other = {"people": "real", "cameras": "two", "source": "elsewhere", "mediapipe": None}
    other |= {"left_out": "body"}
    real = other | {"aligned": [4.06, 6.7], "absolute": 7.3, "with_detector": 3.2}
    text = sessions_section(results, [real])
    *rest, last = [line for line in text.splitlines() if " cm " in line]
    assert (
        "(2 recordings) | one | recording; used in development | 6.5 cm |  | 7.0 cm | 9.0" in last
    )
    assert rest[0] == "| real | two | body | 4.1 to 6.7 cm | 3.2 cm |  | 7.3 cm |  | elsewhere |"
    words = " ".join(text.split())
    assert "on 1 of the 2 rendered recordings" in words
    assert "An image takes 2.5 ms" in words
    assert "2 seeds" in words


def test_rows_of_people_are_means_with_and_without_points() -> None:
    def session(name: str, points: str, aligned: float, cameras: list[str]) -> dict[str, Any]:
        peer = {} if name.startswith("P0_") else {"aligned": 9.7}
        run = {"aligned": aligned, "absolute": 2 * aligned}
        return {
            "name": name,
            "points": points,
            "cameras": cameras,
            "mediapipe": peer,
            "runs": [run],
        }

    films = [("P0_1", []), ("P0_2", []), ("real_balance", ["cam02", "cam01"])]
    sessions = [
        session(name, points, number + factor, cameras)
        for number, (name, cameras) in enumerate(films, 1)
        for points, factor in (("none", 10.0), ("mediapipe", 2.0))
    ]
    one, two = people_rows({"sessions": sessions}, {"P0_": 7.7})
    assert (one["aligned"], one["with_detector"], one["mediapipe"]) == (11.5, 3.5, 7.7)
    assert (one["absolute"], one["absolute_with_detector"]) == (23.0, 7.0)
    assert (two["cameras"], two["aligned"], two["with_detector"]) == ("two", 13.0, 5.0)
    # MediaPipe's figure is of one camera.
    assert two["mediapipe"] is None
