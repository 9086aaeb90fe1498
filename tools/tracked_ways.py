"""Recorded sessions, tracked in several ways: what the package's networks learn from.

As it is; without images, or with one of several cameras after the other covered; with a body from
proportions, whom nobody measured; with depth images, where the session has them.
"""

from __future__ import annotations

from typing import NamedTuple
from zlib import crc32

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.proportions import (
    STATURE_LIMITS_M,
    STATURE_M,
    body_from_proportions,
)
from cardbox_tracker.estimation.config import TrackerConfig
from cardbox_tracker.evaluation.recorded.session import RecordedSession
from cardbox_tracker.evaluation.recorded.tracking import (
    WITH_DEPTH,
    InputSelection,
    Observe,
    track_session,
)

# One of so many sessions has no images, one has a person whose distance nobody tells, and one has
# a depth image of somebody who was not measured.
WITHOUT_IMAGES, WITHOUT_DISTANCE, WITHOUT_MEASURING = 3, 3, 4
# Deviations of what people say of stature and distance, as logarithms.
TOLD = 0.02, 0.05
# A camera is covered for the last seconds of each turn.
TURN_S, COVERED_S = 6.0, 2.5


class Way(NamedTuple):
    """How a session is tracked.

    Attributes:
        has_images: images beside silhouettes.
        covers: of several cameras one after the other is covered for a while.
        body: one that nobody measured; None: the one that is measured.
        has_depth: the depth images of the session.
    """

    has_images: bool = True
    covers: bool = False
    body: BodyModel | None = None
    has_depth: bool = False


def way_of(session: RecordedSession, seed: int) -> Way:
    """Return how to track a session: one of four ways, in turns of the seeds."""
    drawn = crc32(session.name.encode())
    if seed % 4 == 0:
        return Way()
    if seed % 4 == 1:
        # Who sends silhouettes alone shall have a correction, too.
        return Way(has_images=drawn % WITHOUT_IMAGES > 0, covers=True)
    if seed % 4 == 3:
        # Who has a depth camera often does without measuring.
        is_guessed = drawn % WITHOUT_MEASURING == 0
        return Way(body=_guessed(session, drawn, seed) if is_guessed else None, has_depth=True)
    return Way(body=_guessed(session, drawn, seed))


def _guessed(session: RecordedSession, drawn: int, seed: int) -> BodyModel:
    """Return a body from what people would say of themselves."""
    truth, rng = session.truth, np.random.default_rng((drawn, seed))
    told = np.exp(np.array(TOLD) * rng.standard_normal(2))
    stature_m = float(np.clip((truth.stature_m or STATURE_M) * told[0], *STATURE_LIMITS_M))
    distance_m = float(truth.distance_m * told[1]) if drawn % WITHOUT_DISTANCE > 0 else None
    pitch_rad = float(np.radians(truth.pitch_deg))
    return body_from_proportions(stature_m, distance_m, camera_pitch_rad=pitch_rad)


def covered(time_s: float) -> int | None:
    """Return which of two cameras is covered at a time since tracking began; None: none."""
    turn, part_s = divmod(time_s, TURN_S)
    return int(turn) % 2 if part_s > TURN_S - COVERED_S else None


def track(session: RecordedSession, config: TrackerConfig, seed: int, observe: Observe) -> None:
    """Track a session in the way of the seed."""
    way = way_of(session, seed)
    inputs = InputSelection(
        only=WITH_DEPTH if way.has_depth and session.truth.depth_topic else None,
        has_images=way.has_images,
        covered=covered if way.covers and len(session.truth.cameras) > 1 else None,
    )
    track_session(session, config, (seed,), inputs, observe, way.body)
