"""Film, bag and nodes on the same images, side by side (``docs/evaluation/ways.md``).

    python -m lab.tools.ways SESSION... --output docs/evaluation/ways.md [--rate 0.3] [--full-speed]

A session has ``bag/`` and a ``ground_truth.json`` of one person or of several. Its first camera is
tracked alone, then its first two together. The package that is measured is the one that PYTHONPATH
names, or else this checkout. Figures are kept in a JSON file beside the page, so that a further
call only measures what is missing or failed; remove the file to measure all anew.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import permutations
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import write_file
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import LEG_NAMES
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.result_reader import Results, read_results
from cardbox_tracker.recordings.result_table import POINT_COLUMNS
from cardbox_tracker.recordings.truth import beside_shoulders
from cardbox_tracker.tracking.estimate import TRACKING
from lab.tools.way_cases import Case, Person, cases_of
from lab.tools.way_nodes import live, prepare

WAYS = {"film": "film", "bag": "bag", "slow": "live, slowly", "live": "live"}
"""Headings of the columns of the page by the name of the way."""
FURTHER = "## Two cameras"
"""Begin of the part of the page that :mod:`.triangulated` writes."""
_HEADER = """# Film, bag and live

`python -m lab.tools.ways SESSION... --full-speed` makes this table. The same images go through
`cardbox track` as a film (a folder of PNG files with the calibration of the bag) and as a bag, and
through the nodes `detector`, `tracker` and, where the session has an empty scene, `background`:
slowly, so that no image is left out for want of time, and at full speed. Stature, pitch and empty
scene are given, of two cameras also their poses. Without an empty scene the silhouettes are the
detector's. A film has one camera.

Each cell has the error of the shape and of the place, cm, then the share of the images with a 3D
reference that are `tracking`, and of those that have legs. *Shape*: mean error of shoulders, elbows
and hands, both skeletons shifted to the middle of their shoulders; *place*: not shifted.
Both are of the images that have an estimate, whose number is in `ways.json`. Live figures change
from run to run. The clips of real_balance and real_two_people last 1.7 s (60 Hz): at full speed
they are nearly over when the first body is fitted; nan: no image had an estimate. *Exchanged*:
the people have other numbers than their statures were given by. The last row is the mean of the
rows above in which all ways have figures."""
_SHOWN = "shape_cm", "place_cm", "tracking", "legs"
_LONGEST_S = 1800.0


def figures(results: Results, joints_m: Mapping[int, FloatArray]) -> dict[str, float]:
    """Return shape and place, cm, shares of ``tracking`` and of legs, and the number of images.

    Shape and place are nan without an image that has both an estimate and a reference; shares are
    of all images with a reference.
    """
    rows = {stamp: row for row, stamp in enumerate(results.stamp_ns.tolist())}
    seen = [(rows[stamp], true_m) for stamp, true_m in joints_m.items() if stamp in rows]
    points_m = results.of(POINT_COLUMNS).reshape(-1, 6, 3)
    has_legs = np.isfinite(results.of(LEG_NAMES).sum(axis=1))
    off_m = np.array([points_m[row] - true_m for row, true_m in seen]).reshape(-1, 6, 3)
    shape_cm, place_cm = shape_and_place_cm(off_m)
    return {
        "shape_cm": shape_cm,
        "place_cm": place_cm,
        "tracking": sum(results.state[row] == TRACKING for row, _ in seen) / len(joints_m),
        "legs": sum(bool(has_legs[row]) for row, _ in seen) / len(joints_m),
        "images": int(np.isfinite(off_m).any(axis=(1, 2)).sum()),
    }


def shape_and_place_cm(off_m: FloatArray) -> tuple[float, float]:
    """Return the mean lengths of errors (n, 6, 3), m, beside the shoulders' middle and not shifted.

    Errors that are nan do not count; without any others the result is nan.
    """
    lengths = (np.linalg.norm(one, axis=2) for one in (beside_shoulders(off_m), off_m))
    known = [one[np.isfinite(one)] for one in lengths]
    shape_cm, place_cm = (100.0 * float(one.mean()) if one.size else np.nan for one in known)
    return shape_cm, place_cm


def of_film(case: Case, folder: Path) -> Iterator[Results]:
    """Track the first camera's images as a folder of PNG files; yield the results by person."""
    stamps, camera, film = [], case.cameras[0], folder / "film"
    film.mkdir()
    with BagReader(case.bag) as bag:
        for number, image in enumerate(bag.images(bag.image_topic(camera))):
            cv2.imwrite(str(film / f"{number:06d}.png"), image.as_sent)
            stamps.append(image.stamp_ns)
        lens = bag.calibration(camera)
    values = {"width": lens.width, "height": lens.height, "k": lens.k.ravel().tolist()}
    values |= {"d": lens.distortion.tolist(), "distortion_model": lens.distortion_model}
    write_file(folder / "calibration.json", json.dumps(values))
    words = "--calibration", str(folder / "calibration.json"), "--fps", f"{case.fps:g}"
    for results in _tracked(case, film, words, folder / "film.csv"):
        numbers = np.rint(results.stamp_ns * case.fps / 1e9).astype(int)
        yield replace(results, stamp_ns=np.array(stamps)[numbers])


def of_bag(case: Case, folder: Path) -> Iterator[Results]:
    """Track the bag; yield the results by person."""
    words = ["--cameras", *case.cameras]
    if case.extrinsics is not None:
        words += ["--extrinsics", str(case.extrinsics)]
    return _tracked(case, case.bag, words, folder / "bag.csv")


def _tracked(case: Case, path: Path, words: Sequence[str], table: Path) -> Iterator[Results]:
    command = [sys.executable, "-P", "-m", "cardbox_tracker.start", "cardbox", "track", str(path)]
    command += [*words, *case.given, "--csv", str(table)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=_LONGEST_S)
    if done.returncode:
        raise CardboxError(done.stderr.strip()[-800:])
    for number in case.numbers:
        yield read_results(table, number)


def of_people(people: Sequence[Person], found: Sequence[Results]) -> list[dict[str, Any]]:
    """Return the figures of each person, with the numbers that give the least errors of the place.

    ``exchanged`` says whether these are not the numbers by which the statures were given.
    """
    ways = [
        [
            {"person": person.name, "exchanged": run is not own} | figures(run, person.joints_m)
            for person, own, run in zip(people, found, order, strict=True)
        ]
        for order in permutations(found)
    ]
    return min(ways, key=lambda one: sum(np.nan_to_num(row["place_cm"], nan=1e3) for row in one))


def measured(case: Case, way: str, rate: float) -> Any:
    """Return the figures of each person by one way, or the text of the error."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        speed = 1.0 if way == "live" else case.slowly(rate)
        try:
            runs = {"film": of_film, "bag": of_bag}
            found = runs[way](case, folder) if way in runs else live(case, folder, speed)
            return of_people(case.people, list(found))
        except (CardboxError, subprocess.TimeoutExpired) as error:
            return " ".join(str(error).split())


def page(found: Mapping[str, Mapping[str, Any]], further: str = "") -> str:
    """Return the page for figures by recording and way; ``further`` is what follows the table."""
    ways = [way for way in WAYS if any(way in one for one in found.values())]
    heads = "".join(f" {WAYS[way]} |" for way in ways)
    lines = [_HEADER, "", f"| recording |{heads}", "|---|" + "---|" * len(ways)]
    complete, failed = [], []
    for name, by_way in found.items():
        good = {way: one for way, one in by_way.items() if not isinstance(one, str)}
        failed += [f"- {name}, {WAYS[w]}: {t}" for w, t in by_way.items() if isinstance(t, str)]
        for number in range(max(map(len, good.values()), default=1)):
            row = {way: one[number] for way, one in good.items()}
            person = next((one["person"] for one in row.values()), "")
            shown = [_cell(row.get(way)) if way in by_way else "" for way in ways]
            cells = "".join(f" {one} |" for one in shown)
            lines.append(f"| {f'{name}, {person}' if person else name} |{cells}")
            if len(row) == len(ways) and all(one["images"] for one in row.values()):
                complete.append(row)
    if complete:
        means = [
            {name: np.mean([row[way][name] for row in complete]) for name in _SHOWN}
            | {"exchanged": False}
            for way in ways
        ]
        lines.append(f"| mean of {len(complete)} |{''.join(f' {_cell(one)} |' for one in means)}")
    lines += ["", "Failed:", "", *failed] if failed else []
    return "\n".join([*lines, *(["", further.rstrip()] if further else [])]) + "\n"


def _cell(one: Mapping[str, Any] | None) -> str:
    if one is None:
        return "failed"
    shape, place, tracking, legs = (float(one[name]) for name in _SHOWN)
    told = ", exchanged" if one["exchanged"] else ""
    return f"{shape:.1f} / {place:.1f}, {tracking:.0%}, {legs:.0%}{told}"


def main() -> None:
    """Measure what is missing, and write the page after each way."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("sessions", type=Path, nargs="+")
    parser.add_argument("--output", type=Path, required=True, help="the page")
    parser.add_argument("--rate", type=float, default=0.3, help="speed of slow replay")
    parser.add_argument("--full-speed", action="store_true", help="also live at full speed")
    options = parser.parse_args()
    prepare()
    kept = options.output.with_suffix(".json")
    found: dict[str, dict[str, Any]] = json.loads(kept.read_text()) if kept.is_file() else {}
    for case in (one for folder in options.sessions for one in cases_of(folder)):
        by_way = found.setdefault(case.name, {})
        for way in WAYS:
            skips = way == "live" and not options.full_speed
            skips |= way == "film" and len(case.cameras) > 1
            if skips or isinstance(by_way.get(way), list):
                continue
            by_way[way] = measured(case, way, options.rate)
            print(case.name, way, by_way[way], flush=True)
            write_file(kept, json.dumps(found, indent=1) + "\n")
            write_file(options.output, page(found, parts_of(options.output)[1]))


def parts_of(path: Path) -> tuple[str, str]:
    """Return what precedes ``FURTHER`` in a page, and the rest; "" for what there is not."""
    before, begin, rest = (path.read_text() if path.is_file() else "").partition(FURTHER)
    return before, begin + rest


if __name__ == "__main__":
    main()
