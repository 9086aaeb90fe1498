"""The scores of a recording in words, as a plot, and as a page that needs no other file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cardbox_tracker.applications.drawing.page import png_of, render_page
from cardbox_tracker.applications.ergonomics.recording import (
    LONGEST_STEP,
    RulaRow,
    RulaSummary,
    ScoreShares,
    durations_of,
    score_shares,
    summarize,
    worst_rows,
)
from cardbox_tracker.applications.ergonomics.rula import (
    NOT_SEEN,
    RULA,
    ErgonomicConfig,
    Method,
    declared,
    expected,
)
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.recordings.track import GAP_S
from cardbox_tracker.tracking.estimate import UNCERTAIN

_ACTION_COLOURS = ("#d9ecd5", "#fdf1c4", "#fbd5ac", "#f2aaa0", "#d98c8c")
_UNCERTAIN_COLOUR, _NOTHING_COLOUR, _LINE_COLOUR = "#e69f00", "#9a9a9a", "#1b4f8a"
_LIGHTEST, _DARKEST = np.array([222, 235, 247]), np.array([8, 69, 148])
# A smaller share is left out in words, and has no room for its score in a bar.
_LEAST_SHARE, _LEAST_LABEL = 0.005, 0.06
_DPI = 120


def report_lines(
    summary: RulaSummary,
    shares: Sequence[ScoreShares],
    config: ErgonomicConfig,
    method: Method = RULA,
) -> Iterator[str]:
    """Yield the lines that a method's command prints; only declared inputs without a posture."""
    if summary.measured_s:
        yield (
            f"expected {method.name} score {summary.mean:.1f} "
            f"(of the mean postures {summary.of_mean:.1f}); "
            f"above {method.above} for {summary.above_s:.1f} of {summary.measured_s:.1f} s "
            f"({summary.above_s / summary.measured_s:.0%})"
        )
        for (low, high, meaning), time_s in zip(method.levels, summary.by_level_s, strict=True):
            yield f"  {_span(low, high):<{3 if method is RULA else 5}} {time_s:6.1f} s  {meaning}"
        if summary.uncertain_s:
            yield f"  of these, {summary.uncertain_s:.1f} s have a posture that may be wrong"
        yield "mean score of each part, and the share of the time at each score:"
        for one in shares:
            yield f"  {one.words:<16} {one.mean:.1f}  {one.source:<8}  {_share_words(one)}"
    inputs = declared(config, summary.always_measured)
    for title, is_default in ((NOT_SEEN, False), (f"{NOT_SEEN}, with the default value", True)):
        found = [one.words for one in inputs if one.is_default == is_default]
        if found:
            yield f"{title}: {', '.join(found)}"
    yield from _measured_words(summary)


@dataclass(frozen=True)
class PageContent:
    """Content of the page."""

    title: str  #: heading of the page
    facts: Mapping[str, str]  #: lines about recording, person and settings, by name
    config: ErgonomicConfig  #: settings of the score
    rows: Sequence[RulaRow]  #: one image each, in order
    #: JPEG of images by stamp; None if no images are wanted or given
    images: Mapping[int, bytes] | None = None
    are_heads_hidden: bool = True  #: whether heads in the images were made unrecognizable
    method: Method = RULA  #: of the scores


def write_page(content: PageContent, path: Path) -> None:
    """Write the page, one file of HTML without scripts (``page.html``), or raise CardboxError."""
    rows, config, method = content.rows, content.config, content.method
    summary = summarize(rows, method)
    shares, moments = score_shares(rows, config, method), worst_rows(rows)
    colours = _ACTION_COLOURS[: len(method.levels)]
    levels = zip(method.levels, colours, summary.by_level_s, strict=True)
    render_page(
        path,
        Path(__file__).with_name("page.html"),
        content=content,
        summary=summary,
        above=method.above,
        gap_s=GAP_S,
        levels=[(_span(low, high), what, *rest) for (low, high, what), *rest in levels],
        plot=score_plot(rows, moments, method) if summary.measured_s else b"",
        colours={"uncertain": _UNCERTAIN_COLOUR, "nothing": _NOTHING_COLOUR},
        shares=shares,
        inputs=declared(config, summary.always_measured),
        measured=[*_measured_words(summary)],
        moments=[(row, _moment_words(row, method)) for row in moments],
        bar=_bar,
        words=_share_words,
    )


def score_plot(
    rows: Sequence[RulaRow], moments: Sequence[RulaRow] = (), method: Method = RULA
) -> bytes:
    """Return the expected score over time, with its deviation and numbered moments, as PNG."""
    from matplotlib.figure import Figure

    time_s, durations_s = np.array([row.time_s for row in rows], float), durations_of(rows)
    scores = np.arange(1, method.highest + 1)
    nothing = np.full(method.highest, np.nan)
    chances = np.array([nothing if row.scores is None else row.scores.grand for row in rows])
    mean = chances @ scores
    deviation = np.sqrt(np.maximum(chances @ scores**2 - mean**2, 0.0))

    figure = Figure(figsize=(10.0, 3.2), dpi=_DPI, layout="constrained")
    axes = figure.subplots()
    for (low, high, _), colour in zip(method.levels, _ACTION_COLOURS, strict=False):
        axes.axhspan(low - 0.5, high + 0.5, color=colour, linewidth=0)
    # A line ends where no image follows for long.
    gaps = np.flatnonzero(np.diff(time_s) > LONGEST_STEP * durations_s[-1]) + 1
    x, y, dy = (np.insert(one, gaps, np.nan) for one in (time_s, mean, deviation))
    axes.fill_between(x, y - dy, y + dy, color=_LINE_COLOUR, alpha=0.25, linewidth=0)
    axes.plot(x, y, color=_LINE_COLOUR, linewidth=1.4)
    for colour, is_marked in (
        (_UNCERTAIN_COLOUR, [row.state == UNCERTAIN for row in rows]),
        (_NOTHING_COLOUR, [row.scores is None for row in rows]),
    ):
        spans = [*zip(time_s[is_marked], durations_s[is_marked], strict=True)]
        axes.broken_barh(spans, (0.5, 0.2), color=colour)
    for number, row in enumerate(moments, 1):
        at = (row.time_s, row.worst)
        axes.plot(*at, "o", color=_LINE_COLOUR)
        axes.annotate(str(number), at, (0, 5), textcoords="offset points", ha="center")
    limits_ = (0.5, method.highest + 0.5)
    axes.set(xlabel="time [s]", ylabel=f"{method.name} score", yticks=scores, ylim=limits_)
    axes.margins(x=0.01)
    return png_of(figure)


def _span(low: int, high: int) -> str:
    return str(low) if low == high else f"{low}-{high}"


def _share_words(shares: ScoreShares) -> str:
    found = [(score, share) for score, share in enumerate(shares.shares, 1)]
    return ", ".join(f"{score}: {share:.0%}" for score, share in found if share >= _LEAST_SHARE)


def _measured_words(summary: RulaSummary) -> Iterator[str]:
    for name, time_s in summary.measured_parts_s.items():
        words, (was, counts) = name.replace("_", " "), ("was", "counts")
        if name == "legs":
            was, counts = "were", "count"
        if name in summary.always_measured:
            yield f"the {words} {was} measured all the time"
        elif time_s:
            yield (
                f"the {words} {was} measured for {time_s:.1f} of {summary.measured_s:.1f} s, and "
                f"{counts} as declared for the rest"
            )


def _moment_words(row: RulaRow, method: Method) -> str:
    parts = {} if row.scores is None else row.scores.parts
    words = (f"{part.words} {expected(parts[part.name]):.1f}" for part in method.parts)
    doubt = ", but the posture may be wrong" if row.state == UNCERTAIN else ""
    return f"score {row.worst:.1f}{doubt} ({'; '.join(words)})"


def _bar(shares: FloatArray) -> Iterator[tuple[str, float, str, str]]:
    """Yield label, width in per cent, background and colour of each share (n,), dark for high."""
    for score, share in enumerate(shares.tolist(), 1):
        depth = (score - 1) / max(1, len(shares) - 1)
        rgb = np.round(_LIGHTEST + depth * (_DARKEST - _LIGHTEST)).astype(int)
        label = str(score) if share >= _LEAST_LABEL else ""
        yield (
            label,
            100 * share,
            "#{:02x}{:02x}{:02x}".format(*rgb),
            "#000" if depth <= 0.5 else "#fff",
        )
