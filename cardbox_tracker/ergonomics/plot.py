"""Plots the scores of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np

from cardbox_tracker.ergonomics.recording import ABOVE, RulaRow
from cardbox_tracker.ergonomics.tables import HIGHEST
from cardbox_tracker.files import atomic_path

_DPI = 80


def plot_scores(rows: Sequence[RulaRow], path: Path) -> None:
    """Write a PNG with the probability of each score, the expected score and the limit ``ABOVE``.

    Raises:
        CardboxError: the file cannot be written.
    """
    matplotlib.use("Agg")
    from matplotlib import pyplot

    nothing = np.full(HIGHEST, np.nan)
    chances = np.array([nothing if row.scores is None else row.scores.grand for row in rows])
    time_s = (np.array([row.stamp_ns for row in rows], np.int64) - rows[0].stamp_ns) / 1e9
    scores = np.arange(1, HIGHEST + 1)
    figure, axis = pyplot.subplots(figsize=(10, 3.6), dpi=_DPI, layout="constrained")
    try:
        shown = axis.pcolormesh(
            time_s,
            scores,
            np.atleast_2d(chances.T),
            cmap="Blues",
            vmin=0,
            vmax=1,
            shading="nearest",
        )
        axis.plot(time_s, chances @ scores, color="tab:orange", label="expected score")
        axis.axhline(ABOVE + 0.5, color="tab:red", linewidth=1, label=f"above {ABOVE}")
        axis.set(xlabel="time [s]", ylabel="RULA score", yticks=scores, ylim=(0.5, HIGHEST + 0.5))
        axis.legend(loc="upper right")
        figure.colorbar(shown, label="chance")
        with atomic_path(path) as temporary:
            figure.savefig(temporary, format="png", metadata={"Software": None})
    finally:
        pyplot.close(figure)
