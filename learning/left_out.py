"""Train the correction without each source in turn, and measure it on that source.

python -m learning.left_out SAMPLES... [--sessions SAMPLES...] --output FILE.md [--epochs N]
                            [--jobs N]

Sources are families of bodies and groups of motions. ``--sessions`` has recorded sessions
(``learning.sessions``), none of which is trained with, so the package's network is measured on
them. The tool writes a Markdown table, and its rows to FILE.json.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cardbox_tracker.estimation.filtering.correction import DATA
from cardbox_tracker.estimation.filtering.networks import RecurrentNetwork, load_recurrent_network
from cardbox_tracker.files import atomic_path
from learning import correction
from learning.command_line import run
from learning.samples import Samples, grouped, load_all, split

SOURCES = (
    *("family=makehuman", "family=rocketbox"),
    *("source=cmu-0", "source=cmu-1", "source=cmu_text", "source=scripted"),
)
"""Sources that are left out in turn; ``cmu-0`` are the subjects 1 to 9."""

NETWORKS = 2
"""Number of networks for each source: enough to disagree."""

_TEXT = """# The correction on sources that it was not trained with

Mean errors of shoulders, elbows and hands, cm, over recordings, without and with the correction. In
the upper rows a network was trained without the source and measured on it. In the rows of sessions
(`real`: films of people, `kit`: rendered) the package's network was measured; no network was
trained with any session, but settings were compared on them. Inverse kinematics and the bound by
the silhouette are left out here; [sessions.md](sessions.md) and [real-people.md](real-people.md)
have the figures of the whole tracker. *Better*: recordings with a smaller aligned error. Made by
`python -m learning.left_out`, see [learning](../research/learning.md).

"""
_HEAD = (
    "| left out | people | recordings | absolute | aligned | median aligned | better |\n"
    "|---|---|---|---|---|---|---|"
)


class Row(NamedTuple):
    """Errors on a source, cm; each pair is without and with the correction."""

    left_out: str
    people: str
    recordings: int
    absolute: tuple[float, float]
    aligned: tuple[float, float]
    median: tuple[float, float]
    better_percent: float

    def __str__(self) -> str:
        """Return the row of the table."""
        pairs = ("{:.1f} / {:.1f}".format(*pair) for pair in self[3:6])
        cells = (
            self.left_out,
            self.people,
            self.recordings,
            *pairs,
            f"{self.better_percent:.0f} %",
        )
        return f"| {' | '.join(map(str, cells))} |"


def people_of(one: Samples) -> str:
    """Return how the person of a recording was tracked."""
    body = "measured" if one.origin.is_measured else "unmeasured"
    return f"{body}, points" if one.origin.has_points else body


def rows_of(name: str, network: RecurrentNetwork, samples: Iterable[Samples]) -> list[Row]:
    """Return a row for each way of tracking."""
    ways: dict[str, list[tuple[float, ...]]] = {}
    for one in samples:
        ways.setdefault(people_of(one), []).append(correction.check(network, one))
    rows = []
    for people, figures in sorted(ways.items()):
        each = np.array(figures)[:, [0, 3, 1, 4]]
        absolute, aligned = each.mean(axis=0).reshape(2, 2).tolist()
        median = np.median(each[:, 2:], axis=0).tolist()
        better = 100.0 * float((each[:, 3] < each[:, 2]).mean())
        pairs = tuple(absolute), tuple(aligned), tuple(median)
        rows.append(Row(name, people, len(each), *pairs, better))
    return rows


def report(
    samples: Sequence[Samples], sessions: Sequence[Samples], epochs: int, jobs: int = 1
) -> list[Row]:
    """Return the rows of all sources and sessions.

    Raises:
        CardboxError: a source has no samples, or all.
    """
    rows: list[Row] = []
    # All are divided first, because each training takes long.
    divided = [(source, *split(samples, source)) for source in SOURCES]
    for source, others, left_out in divided:
        network = correction.learn(others, epochs=epochs, jobs=jobs, count=NETWORKS)
        fresh = rows_of(source.partition("=")[2], network, left_out)
        print(*fresh, sep="\n", flush=True)
        rows += fresh
    if sessions:
        network = load_recurrent_network(DATA)
        for name, group in grouped(sessions).items():
            rows += rows_of(name, network, group)
    return rows


def main(args: list[str] | None = None) -> int:
    """Train, measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("samples", nargs="+", type=Path)
    parser.add_argument("--sessions", nargs="*", type=Path, default=[])
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--epochs", type=int, default=correction.EPOCHS)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args(args)
    samples, sessions = load_all(given.samples), load_all(given.sessions)
    rows = report(samples, sessions, given.epochs, given.jobs)
    table = "\n".join([_HEAD, *map(str, rows)])
    data = json.dumps([row._asdict() for row in rows], indent=1)
    for path, text in (
        (given.output, f"{_TEXT}{table}\n"),
        (given.output.with_suffix(".json"), f"{data}\n"),
    ):
        with atomic_path(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
        print(f"written: {path}")
    return 0


if __name__ == "__main__":
    sys.exit(run(main))
