"""Every number of the README that an evaluation gave is that of the committed results."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from lab.evaluation.results import read_json
from lab.experiments.digest import paper_digest
from lab.tools.readme_figures import BEGIN, END, RESULTS, ROWS, _tracking, current, main, section

ROOT = Path(__file__).parents[3]


def readme() -> str:
    return (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_readme_is_up_to_date() -> None:
    """If not: python -m lab.tools.readme_figures."""
    assert current(ROOT) == readme()
    assert main(["--check", "--root", str(ROOT)]) == 0


def test_no_error_or_cost_stands_outside_the_marks() -> None:
    outside = readme().split(BEGIN)[0] + readme().split(END)[1]
    assert re.findall(r"\d[\d.]*\s*(?:cm|px)\b", outside) == []


def test_the_experiments_are_of_the_present_filter_simulation_and_initialization() -> None:
    """If not: make experiments."""
    for folder in (ROOT / RESULTS, ROOT / RESULTS / "person_a"):
        results = read_json(folder / "results.json")
        assert results["digest"] == paper_digest(), folder
        report = (folder / "report.md").read_text(encoding="utf-8")
        assert results["commit"] in report
        assert results["digest"] in report


def test_peers_have_as_many_ratings_as_the_paper_within_one_percent() -> None:
    for folder in (ROOT / RESULTS, ROOT / RESULTS / "person_a"):
        for name, by_motion in read_json(folder / "results.json")["methods"].items():
            for figures in by_motion.values():
                assert 594 <= figures["ratings"] <= 606, name


def session(name: str, points: str, aligned: float, cameras: tuple[str, ...]) -> dict[str, Any]:
    peer = {} if name.startswith("P0_") else {"aligned": 9.7}
    run = {"aligned": aligned, "absolute": 2 * aligned, "ms": 3.0}
    run |= {"frames": 100, "tracking": 50, "tracking_beyond_30": 1}
    return {"name": name, "points": points, "cameras": cameras, "mediapipe": peer, "runs": [run]}


def test_section_by_hand() -> None:
    films = [film for row in ROWS for film in row.films] + [("P0_2", ())]
    people = [
        session(name, points, number + more, cameras)
        for number, (name, cameras) in enumerate(films)
        for points, more in (("none", 10.0), ("mediapipe", 2.0))
    ]
    rendered = [
        {"mediapipe": {"aligned": 8.0}, "runs": [{"aligned": 4.0, "absolute": 5.0, "ms": 2.5}]},
        {"mediapipe": {"aligned": 6.0}, "runs": [{"aligned": 9.0, "absolute": 9.0, "ms": 2.5}]},
    ]
    text = section({"sessions": people}, {"sessions": rendered})
    cells = [re.findall(r"(?<=\| )[^|]*(?=\|)", line)[2:] for line in text.splitlines()[2:7]]
    assert [[cell.strip() for cell in row] for row in cells] == [
        ["12.5 cm", "4.5 cm", "7.7 cm", "9.0 cm"],
        ["", "3.0 cm", "9.7 cm", "6.0 cm"],
        ["", "4.0 cm", "9.7 cm", "8.0 cm"],
        ["", "5.5 cm", "", "11.0 cm"],
        ["6.5 cm", "", "7.0 cm", "7.0 cm"],
    ]
    words = " ".join(text.split())
    assert "call 50 % of the images of real people `tracking`, of which" in words
    assert "2.0 % have a joint beyond 30 cm" in words
    assert "2.5 ms on one core, 3.0 ms with points" in words
    never = {"runs": [{"frames": 9, "tracking": 0, "tracking_beyond_30": 0}]}
    assert _tracking([never]) == "none of the images of real people `tracking`"
