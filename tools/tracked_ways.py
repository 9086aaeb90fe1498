"""Recorded sessions, tracked in several ways: what the learned correction learns from.

As it is; without images, or with one of several cameras after the other covered; with a body from
proportions, whom nobody measured.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.proportions import (
    STATURE_LIMITS_M,
    STATURE_M,
    body_from_proportions,
)
from cardbox_tracker.estimation.config import PRESETS, TrackerConfig
from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.estimation.filtering.whole_body import WholeBodyFilter
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.evaluation.recorded.session import RecordedSession, load_session
from cardbox_tracker.evaluation.recorded.tracking import track_session

FloatArray = NDArray[np.float64]

Observe = Callable[[int, int, Estimate, Tracker], None]
"""Is told of every estimate: seed, stamp in ns, estimate and tracker."""

LENGTH = 120
"""Images of a sequence that is learned at once."""

# One of so many sessions has no images, and one has a person whose distance nobody tells.
WITHOUT_IMAGES, WITHOUT_DISTANCE = 3, 3
# Deviations of what people say of stature and distance, as logarithms.
TOLD = 0.02, 0.05
# A camera is covered for the last seconds of each turn.
TURN_S, COVERED_S = 6.0, 2.5


class Samples(NamedTuple):
    """Images of a session, one after the other.

    Attributes:
        features: what the network sees, (n, 2, F).
        found_m: keypoints without the correction, (n, 6, 3), metres in the optical frame.
        true_m: true ones, nan where they are not scored.
        stamps_ns: (n,).
    """

    features: FloatArray
    found_m: FloatArray
    true_m: FloatArray
    stamps_ns: NDArray[np.int64]


class Way(NamedTuple):
    """How a session is tracked.

    Attributes:
        has_images: images beside silhouettes.
        covers: of several cameras one after the other is covered for a while.
        body: one that nobody measured; None: the one that is measured.
    """

    has_images: bool = True
    covers: bool = False
    body: BodyModel | None = None


def way_of(folder: Path, seed: int) -> Way:
    """Return how to track a session: one of three ways, in turns of the seeds."""
    drawn = crc32(folder.name.encode())
    if seed % 3 == 0:
        return Way()
    if seed % 3 == 1:
        # Who sends silhouettes alone shall have a correction, too.
        return Way(has_images=drawn % WITHOUT_IMAGES > 0, covers=True)
    session = json.loads((folder / "ground_truth.json").read_text(encoding="utf-8"))
    person, rng = session["person"], np.random.default_rng((drawn, seed))
    told = np.exp(np.array(TOLD) * rng.standard_normal(2))
    stature_m = float(np.clip(person.get("height", STATURE_M) * told[0], *STATURE_LIMITS_M))
    distance_m = float(person["distance_m"] * told[1])
    pitch_rad = float(np.radians(session["camera"]["pitch_down_deg"]))
    is_known = drawn % WITHOUT_DISTANCE > 0
    given = distance_m if is_known else None
    return Way(body=body_from_proportions(stature_m, given, camera_pitch_rad=pitch_rad))


def covered(time_s: float) -> int | None:
    """Return which of two cameras is covered at a time since tracking began; None: none."""
    turn, part_s = divmod(time_s, TURN_S)
    return int(turn) % 2 if part_s > TURN_S - COVERED_S else None


def track(session: RecordedSession, config: TrackerConfig, seed: int, observe: Observe) -> None:
    """Track a session in the way of the seed."""
    way = way_of(session.bag.parent, seed)
    track_session(
        session,
        config,
        (seed,),
        observe=observe,
        has_images=way.has_images,
        body=way.body,
        covered=covered if way.covers and len(session.truth.cameras) > 1 else None,
    )


def samples_of(folder: Path, seed: int) -> Samples:
    """Track a session; see :class:`Samples`."""
    session = load_session(folder)
    wanted = dict(zip(session.stamps_ns.tolist(), session.keypoints_m, strict=True))
    unknown = np.full((6, 3), np.nan)
    rows: list[tuple[FloatArray, FloatArray, FloatArray, int]] = []

    seen: list[FloatArray] = []

    def keep(_: int, stamp_ns: int, __: Estimate, tracker: Tracker) -> None:
        assert isinstance(tracker.filter, WholeBodyFilter)
        correction = tracker.filter.refine.correction
        assert correction is not None
        # Of a lost person it sees something, too, and remembers it; of nobody it sees nothing.
        if seen and seen[-1] is correction.features:
            return
        seen[:] = [correction.features]
        if not correction.features.size:
            return
        true_m = wanted.get(stamp_ns, unknown)
        rows.append((correction.features, correction.found_m, true_m, stamp_ns))

    track(session, PRESETS["default"](), seed, keep)
    if len(rows) < LENGTH:
        raise SystemExit(f"{folder}: nobody was tracked for long; leave the session out")
    features, found_m, true_m, stamps_ns = (np.array(c) for c in zip(*rows, strict=True))
    return Samples(features, found_m, true_m, stamps_ns)
