"""Errors with and without the learned correction: ``python -m tools.check_correction SESSION...``.

The tool tracks recorded sessions with ground truth in one of the ways of ``tools/tracked_ways.py``.
It prints absolute and aligned error, cm, and the error of the acceleration, m/s^2, of the filter's
keypoints and of the corrected ones.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from cardbox_tracker.estimation.filtering.correction import network_for
from cardbox_tracker.evaluation.recorded.session import load_session
from tools import networks
from tools.make_correction import check, samples_of


def figures_of(folder: Path, seed: int) -> tuple[float, ...]:
    """Return the errors of a session, without and with the correction."""
    cameras = len(load_session(folder).truth.cameras)
    return check(network_for(max(1, cameras)), samples_of(folder, seed))


def main(args: list[str] | None = None) -> None:
    """Print a line for each session."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    parser.add_argument("--seed", type=int, default=0, help="modulo 4: the way of tracking")
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args(args)
    with ProcessPoolExecutor(given.jobs) as pool:
        rows = list(pool.map(partial(figures_of, seed=given.seed), given.sessions))
    networks.show(given.sessions, rows)


if __name__ == "__main__":
    main()
