"""Scores of a recording: a row for each image, the time at each score, the worst moments."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from cardbox_tracker.applications.drawing.overlay import (
    draw_overlay,
    with_hidden_faces,
    with_hidden_head,
)
from cardbox_tracker.applications.ergonomics.rula import (
    DECLARED,
    MEASURED,
    MIXED,
    POSTURE_ROWS,
    RULA,
    SAMPLES,
    ErgonomicConfig,
    Method,
    RulaConfig,
    ScoreDistribution,
    expected,
    sampled_scores,
)
from cardbox_tracker.common.files import write_table
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import STATE_NAMES
from cardbox_tracker.recordings.result_reader import KeptResults, Results
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.recordings.track import worst_moments
from cardbox_tracker.search.particles import normal_postures
from cardbox_tracker.tracking.estimate import UNCERTAIN, Estimate
from cardbox_tracker.tracking.tracker import Tracker


def header_of(method: Method) -> tuple[str, ...]:
    """Return the columns of :func:`write_csv`."""
    return (
        *("stamp_ns", "state", "score", "likeliest", f"chance_above_{method.above}"),
        *(f"chance_{score}" for score in range(1, method.highest + 1)),
        *("left_score", "right_score"),
        *(part.name for part in method.parts),
        "neck_from",
        "mean_posture_score",
        *(f"{name}_from" for name in method.measurable if name != "neck"),
    )


MEAN_POSTURE = "mean_posture"
"""Name of the grand score of the mean posture among the shares."""

LONGEST_STEP = 3.0
"""An image counts until the next one, for at most this multiple of the usual interval."""
# Images that are kept. Each worst moment excludes the images within GAP_S, so this suffices for up
# to 39 images a second; about 40 MB.
_MOST_IMAGES = 1200

# A separate random stream leaves the tracker's random numbers unchanged.
_STREAM = 0x52756C61
_WIDTH_PX, _QUALITY = 640, 80
_MOST_MOMENTS = 6


@dataclass(frozen=True)
class RulaRow:
    """One image."""

    stamp_ns: int  #: stamp of the image
    state: str  #: of the tracker
    scores: ScoreDistribution | None  #: its scores; None without a posture
    time_s: float  #: seconds from the recording's start
    #: which of the method's ``measurable`` parts are measured; others are declared
    measured: frozenset[str] = frozenset()

    @property
    def worst(self) -> float:
        """Expected score; 0 without a posture."""
        return 0.0 if self.scores is None else self.scores.mean


class MomentImages:
    """The images of the highest scores, with the model drawn over them."""

    def __init__(self, is_head_hidden: bool = True) -> None:
        """Start without images; ``is_head_hidden`` makes the heads unrecognizable."""
        self.is_head_hidden = is_head_hidden
        # The lowest score comes first, and of equal scores the latest image.
        self._kept: list[tuple[float, int, bytes]] = []

    def add(self, row: RulaRow, frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        """Keep the image of ``row`` if its score is among the highest."""
        rank = row.worst, -row.stamp_ns
        if not row.worst or (len(self._kept) == _MOST_IMAGES and rank < self._kept[0][:2]):
            return
        picture, camera, body = frame.image, tracker.camera, tracker.body
        if self.is_head_hidden:
            picture = with_hidden_faces(picture, camera, frame.everyone)
            picture = with_hidden_head(picture, body, camera, estimate)
        scale = max(1, round(_WIDTH_PX / picture.shape[1]))
        canvas = draw_overlay(picture, body, camera, estimate, scale)
        _, jpeg = cv2.imencode(".jpg", canvas, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
        heapq.heappush(self._kept, (*rank, jpeg.tobytes()))
        if len(self._kept) > _MOST_IMAGES:
            heapq.heappop(self._kept)

    def by_stamp(self) -> dict[int, bytes]:
        """Return the images as JPEG by their stamps."""
        return {-negative_ns: jpeg for _, negative_ns, jpeg in self._kept}


Score = Callable[[Results], list[RulaRow]]
"""Scores the images of results by a method."""


def score_rula(results: Results, config: RulaConfig, seed: int) -> list[RulaRow]:
    """Return the scores of each image, for samples of its posture; CardboxError without a body."""
    results.check_body()
    rng = np.random.default_rng([seed, _STREAM])
    states = np.stack([results.of(STATE_NAMES), results.deviations_of(STATE_NAMES)], axis=1)
    times = results.stamp_ns.tolist(), results.upright_state, results.time_s.tolist()
    rows = []
    for stamp_ns, state, time_s, body, joints in zip(*times, results.bodies, states, strict=True):
        scores, measured = None, frozenset[str]()
        posture, stddev = joints[:, POSTURE_ROWS]
        if body is not None and np.isfinite(posture + stddev).all():
            drawn = normal_postures(posture, stddev, SAMPLES, rng)
            scores, measured = sampled_scores(body, joints, drawn, config, rng)
        rows.append(RulaRow(stamp_ns, state, scores, time_s, measured))
    return rows


class ScoreObserver:
    """Observer of :func:`~.recordings.track.track_recording` that scores one person."""

    def __init__(self, path: Path, score: Score, images: MomentImages | None = None) -> None:
        """Take the recording, and where images are kept if they are wanted."""
        self._score, self._images = score, images
        self._empty = partial(KeptResults, path, has_points=True, has_hands=True)
        self._kept = self._empty()

    def __call__(self, frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        """Take one image; it is kept if its score, without what others show, is high."""
        self._kept(frame, estimate, tracker)
        if self._images is not None and estimate.posture is not None:
            alone = self._empty()
            alone(frame, estimate, tracker)
            for row in self._rows(alone):
                self._images.add(row, frame, estimate, tracker)

    @property
    def rows(self) -> list[RulaRow]:
        """The scores of all images, as those of their table."""
        return self._rows(self._kept)

    def _rows(self, kept: KeptResults) -> list[RulaRow]:
        return [row for results in kept.results().values() for row in self._score(results)]


def worst_rows(rows: Sequence[RulaRow]) -> list[RulaRow]:
    """Return the images with the highest expected scores, the worst one first."""
    scored = ((row.worst, row.stamp_ns, row) for row in rows if row.worst)
    return worst_moments(scored, _MOST_MOMENTS)


@dataclass(frozen=True)
class RulaSummary:
    """Expected times, s."""

    measured_s: float  #: time with a posture
    above_s: float  #: time with a score above ``above`` of the method
    by_level_s: tuple[float, ...]  #: time at each action level
    mean: float  #: expected score over the measured time; nan without any
    of_mean: float  #: mean score of the mean postures over the same time
    uncertain_s: float  #: part of the measured time whose postures may be wrong
    #: part of the measured time in which each measurable part was measured
    measured_parts_s: Mapping[str, float]

    @property
    def always_measured(self) -> frozenset[str]:
        """Parts that are declared in no image with a posture."""
        parts = self.measured_parts_s.items()
        return frozenset(name for name, time_s in parts if 0 < self.measured_s <= time_s + 1e-9)


def summarize(rows: Sequence[RulaRow], method: Method = RULA) -> RulaSummary:
    """Return the expected time spent at each score."""
    time_s = _time_at(rows, "grand", method.highest)
    total_s = float(time_s.sum())
    of_mean_s = _time_at(rows, MEAN_POSTURE, method.highest)
    scored_s = durations_of(rows) * [row.scores is not None for row in rows]
    return RulaSummary(
        total_s,
        float(time_s[method.above :].sum()),
        tuple(float(time_s[low - 1 : high].sum()) for low, high, _ in method.levels),
        expected(time_s / total_s) if total_s else float("nan"),
        expected(of_mean_s / total_s) if total_s else float("nan"),
        float(scored_s @ np.array([row.state == UNCERTAIN for row in rows], float)),
        {
            name: float(scored_s @ np.array([name in row.measured for row in rows], float))
            for name in method.measurable
        },
    )


class ScoreShares(NamedTuple):
    """Expected time at each score of a part."""

    name: str  #: of the part, as in the tables
    words: str  #: the same for people
    source: str  #: ``MEASURED``, ``DECLARED`` or ``MIXED``
    time_s: FloatArray  #: time (n,) at the scores 1 to n, s

    @property
    def shares(self) -> FloatArray:
        """Shares (n,) of the measured time; nan without any."""
        total_s = float(self.time_s.sum())
        return self.time_s / total_s if total_s else np.full(len(self.time_s), np.nan)

    @property
    def mean(self) -> float:
        """Expected score; nan without any measured time."""
        return expected(self.shares)


def score_shares(
    rows: Sequence[RulaRow], config: ErgonomicConfig, method: Method = RULA
) -> tuple[ScoreShares, ...]:
    """Return the time at each score: the grand score, measured parts and tables, declared parts."""
    grand_s = _time_at(rows, "grand", method.highest)
    of_mean_s = _time_at(rows, MEAN_POSTURE, method.highest)
    shares = [
        ScoreShares("grand", "grand score", MIXED, grand_s),
        ScoreShares(MEAN_POSTURE, "of mean posture", MIXED, of_mean_s),
    ]
    scored = [row for row in rows if row.scores is not None]
    sources = {}
    for name in method.measurable:
        known = {name in row.measured for row in scored}
        sources[name] = MIXED if len(known) > 1 else (DECLARED, MEASURED)[known == {True}]
    for name, words, highest in method.parts:
        source = sources.get(name, MIXED if "table" in name else MEASURED)
        time_s = _time_at(rows, name, highest)
        shares.append(ScoreShares(name, words, source, time_s))
    for name, highest in method.declared_parts.items():
        time_s = np.eye(highest)[getattr(config, name) - 1] * grand_s.sum()
        shares.append(ScoreShares(name, name.replace("_", " "), DECLARED, time_s))
    return tuple(shares)


def durations_of(rows: Sequence[RulaRow]) -> FloatArray:
    """Return the time (n,) that each image stands for, s."""
    steps_s = np.diff([row.stamp_ns for row in rows]) / 1e9
    usual_s = float(np.median(steps_s)) if len(steps_s) else 0.0
    return np.append(np.clip(steps_s, 0.0, LONGEST_STEP * usual_s), usual_s)[: len(rows)]


def _time_at(rows: Sequence[RulaRow], part: str, highest: int) -> FloatArray:
    """Return the expected time (highest,) at each score of a part, or of a grand score, s."""
    found = np.zeros((len(rows), highest))
    for chances, row in zip(found, rows, strict=True):
        if row.scores is not None and part == MEAN_POSTURE:
            chances[row.scores.of_mean - 1] = 1.0
        elif row.scores is not None:
            chances[:] = row.scores.grand if part == "grand" else row.scores.parts[part]
    return np.asarray(durations_of(rows) @ found)


def write_csv(rows: Sequence[RulaRow], path: Path, method: Method = RULA) -> None:
    """Write the columns of :func:`header_of`, unknown values empty, or raise CardboxError."""
    header = header_of(method)
    write_table(path, header, (_fields(row, method) for row in rows))


def _fields(row: RulaRow, method: Method) -> list[str]:
    stamp, scores = str(row.stamp_ns), row.scores
    if scores is None:
        return [stamp, row.state, *[""] * (len(header_of(method)) - 2)]
    of_parts = [scores.left, scores.right, *(scores.parts[part.name] for part in method.parts)]
    values = (scores.chance_above(method.above), *scores.grand.tolist(), *map(expected, of_parts))
    neck, *others = (MEASURED if name in row.measured else DECLARED for name in method.measurable)
    return [
        *(stamp, row.state, f"{scores.mean:.3f}", str(scores.likeliest)),
        *(f"{value:.3f}" for value in values),
        *(neck, str(scores.of_mean), *others),
    ]
