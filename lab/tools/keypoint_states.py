"""Report how true the keypoints' states are: ``python -m lab.tools.keypoint_states``.

The command reads sessions.json and real-people.json, which ``cardbox evaluate --sessions`` writes
to docs/evaluation. It writes keypoint-states.md beside them, and docs/images/keypoint-states.png
with a reliability diagram for each kind of keypoint.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import write_file
from lab.evaluation.figures import KINDS, added
from lab.evaluation.results import read_json
from lab.pages import plot, table

_TEXT = """\
# States of the keypoints

A keypoint is wrong if it is off by more than 30 cm relative to the middle of the shoulders, so the
error of the person's distance does not count. The tracker gives each keypoint a probability of
being wrong and, from it, a [state](../conventions.md#states). The tables compare both with the
truth; [doubt](doubt.md) does so for sources that were left out of the fit.
`python -m lab.tools.keypoint_states` makes this page from the figures of
[sessions](sessions.md) and [real people](real-people.md).

![Reliability diagrams](../images/keypoint-states.png)

*How often keypoints are wrong (vertical) for which probability (horizontal); on the diagonal both
agree. Intervals with fewer than 50 keypoints are left out.*

## The state of the whole

`tracking` has no `uncertain` or `lost` hand. The last two columns are shares of all images: those
that are called `tracking` with a mean error beyond 30 cm, and with a wrong hand.

{whole}

## The states of keypoints

Share of the keypoints in each state, and in parentheses how many of these are wrong, %.

{states}
"""
_WHOLE_HEAD = (
    *(
        "recordings",
        "images",
        "`tracking`, %",
        "`tracking` with a mean error beyond 30 cm, % of all",
    ),
    "`tracking` with a wrong hand, % of all",
)
_STATES = ("tracked", "uncertain", "lost", "hidden")
_STATES_HEAD = ("recordings", "keypoint", *(f"`{state}`" for state in _STATES), "wrong in all")
_LEAST = 50


def groups_of(folder: Path) -> dict[str, list[Mapping[str, Any]]]:
    """Return the figures of runs by group of recordings.

    Raises:
        CardboxError: neither report has keypoint states.
    """
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for file, kind in (("sessions", "rendered"), ("real-people", "real people")):
        path = folder / f"{file}.json"
        if not path.is_file():
            continue
        for entry in read_json(path)["sessions"]:
            name = kind
            if len(entry.get("cameras", [])) > 1 and "alone" not in entry["name"]:
                name += ", several cameras"
            if entry.get("points", "none") != "none" or "points of" in entry["name"]:
                name += ", with detector"
            runs = [run for run in entry["runs"] if run.get("keypoint_states")]
            groups.setdefault(name, []).extend(runs)
    groups = {name: runs for name, runs in groups.items() if runs}
    if not groups:
        raise CardboxError(
            f"{folder} has no keypoint states; run cardbox evaluate --sessions with it as --output"
        )
    return groups


def whole(name: str, runs: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the row of a group in the table of whole states."""

    def total(key: str) -> int:
        return sum(int(run.get(key, 0)) for run in runs)

    images, far, hand = map(total, ("frames", "far_but_tracking", "hand_far_but_tracking"))
    tracking = sum(int(run["states"].get("tracking", 0)) for run in runs)
    shares = f"{100 * tracking / images:.0f}", *(f"{100 * n / images:.1f}" for n in (far, hand))
    return [name, str(images), *shares]


def rows(name: str, table: Mapping[str, Any]) -> Iterator[list[str]]:
    """Yield the rows of a group in the table of states: one for each kind of keypoint."""
    for kind in KINDS:
        states = table[kind]["states"]
        count, wrong = (sum(numbers) for numbers in zip(*states.values(), strict=True))
        cells = [
            f"{100 * number / count:.0f} ({100 * bad / number:.0f})" if number else "0"
            for number, bad in (states[state] for state in _STATES)
        ]
        yield [name, kind, *cells, f"{100 * wrong / count:.0f}"]


def draw(tables: Mapping[str, Mapping[str, Any]], path: Path) -> None:
    """Write a PNG with a reliability diagram for each kind of keypoint."""
    with plot(path, (1, 3), (11, 4.6), dpi=90, sharey=True) as grid:
        for axis, kind in zip(grid[0], KINDS, strict=True):
            axis.plot([0, 1], [0, 1], color="0.7", linewidth=1)
            for name, one in tables.items():
                count, said, wrong = np.array(one[kind]["bins"], float).T
                shown = count >= _LEAST
                said, wrong = (values[shown] / count[shown] for values in (said, wrong))
                axis.plot(said, wrong, "o-", markersize=4, label=name)
            axis.set(title=kind, xlabel="probability", xlim=(0, 1), ylim=(0, 1))
        first = grid[0, 0]
        first.set_ylabel("share of wrong ones")
        labels = first.get_legend_handles_labels()
        first.figure.legend(*labels, loc="outside lower center", ncols=4)


def main(args: list[str] | None = None) -> int:
    """Read, write the page and the picture."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--folder", type=Path, default=Path("docs/evaluation"))
    parser.add_argument("--image", type=Path, default=Path("docs/images/keypoint-states.png"))
    given = parser.parse_args(args)
    groups = groups_of(given.folder)
    tables = {
        name: added([run["keypoint_states"] for run in runs]) for name, runs in groups.items()
    }
    draw(tables, given.image)
    wholes = [whole(name, runs) for name, runs in groups.items() if "states" in runs[0]]
    every = (row for name, one in tables.items() for row in rows(name, one))
    text = _TEXT.format(whole=table(_WHOLE_HEAD, wholes), states=table(_STATES_HEAD, every))
    path = given.folder / "keypoint-states.md"
    write_file(path, text)
    print(f"written: {path} and {given.image}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
