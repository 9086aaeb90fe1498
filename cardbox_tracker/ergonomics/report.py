"""The scores of a recording in words: times, part scores, and the inputs that were not seen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from cardbox_tracker.ergonomics.config import RulaConfig
from cardbox_tracker.ergonomics.distribution import ScoreDistribution, expected
from cardbox_tracker.ergonomics.parts import (
    DECLARED,
    DECLARED_PARTS,
    MEASURED,
    NECK,
    PARTS,
    Declared,
    declared,
)
from cardbox_tracker.ergonomics.recording import ABOVE, RulaSummary
from cardbox_tracker.ergonomics.shares import ScoreShares
from cardbox_tracker.ergonomics.tables import ACTION_LEVELS

NOT_SEEN = "declared, not seen"


def report_lines(
    summary: RulaSummary, shares: Sequence[ScoreShares], config: RulaConfig
) -> Iterator[str]:
    """Yield the lines that ``cardbox rula`` prints; only the declared inputs without a posture."""
    if summary.measured_s:
        yield (
            f"expected RULA score {summary.mean:.1f}; above {ABOVE} for {summary.above_s:.1f} of "
            f"{summary.measured_s:.1f} s ({summary.above_s / summary.measured_s:.0%})"
        )
        for (low, high, meaning), time_s in zip(ACTION_LEVELS, summary.by_level_s, strict=True):
            scores = str(low) if low == high else f"{low}-{high}"
            yield f"  {scores:<3} {time_s:6.1f} s  {meaning}"
        if summary.uncertain_s:
            yield f"  of these, {summary.uncertain_s:.1f} s have a posture that may be wrong"
        yield "mean score of each part, and the share of the time at each score:"
        for one in shares:
            yield f"  {one.words:<16} {one.mean:.1f}  {one.source:<8}  {share_words(one)}"
    inputs = unseen(config, summary)
    for title, is_default in ((NOT_SEEN, False), (f"{NOT_SEEN}, with the default value", True)):
        found = [one.words for one in inputs if one.is_default == is_default]
        if found:
            yield f"{title}: {', '.join(found)}"
    if summary.neck_measured_s:
        yield neck_words(summary)


def unseen(config: RulaConfig, summary: RulaSummary) -> list[Declared]:
    """Return the inputs that were declared, without a neck that was measured all the time."""
    is_neck_seen = summary.is_neck_always_measured
    return [one for one in declared(config) if one.name != NECK or not is_neck_seen]


def neck_words(summary: RulaSummary) -> str:
    """Return for how long the neck was measured, as words."""
    if summary.is_neck_always_measured:
        return "the neck was measured all the time"
    return (
        f"the neck was measured for {summary.neck_measured_s:.1f} of {summary.measured_s:.1f} s, "
        "and counts as declared for the rest"
    )


def share_words(shares: ScoreShares) -> str:
    """Return the shares of the scores that reach half a per cent, as words."""
    found = [(score, share) for score, share in enumerate(shares.shares, 1) if share >= 0.005]
    return ", ".join(f"{score}: {share:.0%}" for score, share in found)


def part_values(
    scores: ScoreDistribution, config: RulaConfig, is_neck_measured: bool
) -> dict[str, str]:
    """Return the part scores of one image in words, and the inputs that were not seen."""
    neck = f"{NECK} ({MEASURED if is_neck_measured else DECLARED})"
    values = {
        neck if part.name == NECK else part.words: f"{expected(scores.parts[part.name]):.2f}"
        for part in PARTS
    }
    for name in DECLARED_PARTS:
        values[f"{name.replace('_', ' ')} ({DECLARED})"] = str(getattr(config, name))
    inputs = [one for one in declared(config) if one.name != NECK or not is_neck_measured]
    return {**values, NOT_SEEN: ", ".join(map(str, inputs))}
