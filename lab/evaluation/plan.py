"""How recorded sessions are evaluated: settings, seeds, inputs, and the cameras of each run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import NamedTuple

from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.point_table import PointTable
from lab.evaluation.session import RecordedSession, load_session
from lab.evaluation.tracking import BACKGROUND, WITH_DEPTH

NO_POINTS = "none"
"""Name of the source of points that finds none."""


@dataclass(frozen=True)
class Plan:
    """Settings of an evaluation.

    Each session is tracked with every source of silhouettes and every source of points.

    Attributes:
        preset: a name of ``PRESETS``.
        seeds: random seeds of initialization and filters, one run for each.
        recovery: also count the recoveries from disturbances, in sessions with references.
        silhouettes: sources of the silhouettes, see :class:`InputSelection`.
        points: sources of points by name; None for no points.
    """

    preset: str = "default"
    seeds: tuple[int, ...] = (0, 1, 2)
    recovery: bool = False
    silhouettes: tuple[str | None, ...] = (None,)
    points: Mapping[str, Detector | PointTable | None] = field(
        default_factory=lambda: {NO_POINTS: None}
    )

    @property
    def words(self) -> str:
        """Options of the command that differ from the defaults, each with a space before it."""
        silhouettes = [name for name in self.silhouettes if name is not None]
        words = ["--silhouettes", *silhouettes] if silhouettes else []
        if list(self.points) != [NO_POINTS]:
            words += ["--detector", *self.points]
        return "".join(f" {word}" for word in words)


class Way(NamedTuple):
    """How one session is tracked.

    Attributes:
        folder: the session.
        cameras: namespaces of the cameras that track; empty for all.
        only: see :class:`InputSelection`; for sessions with references.
        silhouettes: see :class:`InputSelection`.
        points: name of the source of points.
    """

    folder: Path
    cameras: tuple[str, ...] = ()
    only: str | None = None
    silhouettes: str | None = None
    points: str = NO_POINTS


def ways_of(folder: Path, plan: Plan) -> list[Way]:
    """Return the ways in which a session is tracked.

    All cameras of the session track, and each alone. A rendered session with depth is tracked with
    depth, too. In sessions of real people the first camera also tracks with each other one, and
    several sources of silhouettes leave out the background of a session without an empty scene.

    Raises:
        CardboxError: the folder is not a session.
    """
    session = load_session(folder)
    if session.has_references:
        views = _with_references(session)
    else:
        views = [(cameras, None) for cameras in choices_of_cameras(session)]
    sources = plan.silhouettes
    if "empty" not in session.spans:
        sources = tuple(source for source in sources if source != BACKGROUND) or sources
    return [
        Way(folder, *view, silhouettes, points)
        for view, silhouettes, points in product(views, sources, plan.points)
    ]


def _with_references(session: RecordedSession) -> list[tuple[tuple[str, ...], str | None]]:
    truth = session.truth
    alone = truth.cameras if len(truth.cameras) > 1 else ()
    has_depth = session.is_rectified or truth.depth_topic is not None
    return [((), only) for only in (None, *alone, *([WITH_DEPTH] if has_depth else []))]


def choices_of_cameras(session: RecordedSession) -> list[tuple[str, ...]]:
    """Return all cameras of a session, the first with each other one, and each alone."""
    first, *others = session.truth.cameras or ("",)
    if not others:
        return [()]
    pairs = [(first, other) for other in others]
    return list(dict.fromkeys([(first, *others), *pairs, *((name,) for name in (first, *others))]))
