"""Track recorded sessions in four ways, from which the package's networks learn.

A session is tracked as it is; without images or with its cameras covered in turn; with a body from
proportions instead of a measured one; or with its depth images, if it has any.
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

# One of three sessions is tracked without images, one of three without a given distance, and one of
# four with depth images has a body that was not measured.
WITHOUT_IMAGES, WITHOUT_DISTANCE, WITHOUT_MEASURING = 3, 3, 4
# Standard deviations of the logarithms of stature and distance as people state them.
TOLD = 0.02, 0.05
# One camera is covered in the last COVERED_S seconds of each turn.
TURN_S, COVERED_S = 6.0, 2.5


class Way(NamedTuple):
    """How a session is tracked.

    Attributes:
        has_images: whether the tracker gets images beside silhouettes.
        covers: whether several cameras are covered in turn.
        body: a body that was not measured; None: the measured one.
        has_depth: whether the tracker gets the depth images of the session.
    """

    has_images: bool = True
    covers: bool = False
    body: BodyModel | None = None
    has_depth: bool = False


def way_of(session: RecordedSession, seed: int) -> Way:
    """Return how to track a session; the seed modulo 4 chooses one of four ways."""
    drawn = crc32(session.name.encode())
    if seed % 4 == 0:
        return Way()
    if seed % 4 == 1:
        # The correction also has to serve users who send silhouettes alone.
        return Way(has_images=drawn % WITHOUT_IMAGES > 0, covers=True)
    if seed % 4 == 3:
        # Users of a depth camera often skip the measurement.
        is_guessed = drawn % WITHOUT_MEASURING == 0
        return Way(body=_guessed(session, drawn, seed) if is_guessed else None, has_depth=True)
    return Way(body=_guessed(session, drawn, seed))


def _guessed(session: RecordedSession, drawn: int, seed: int) -> BodyModel:
    """Return a body from stature and distance as people would state them."""
    truth, rng = session.truth, np.random.default_rng((drawn, seed))
    told = np.exp(np.array(TOLD) * rng.standard_normal(2))
    stature_m = float(np.clip((truth.stature_m or STATURE_M) * told[0], *STATURE_LIMITS_M))
    distance_m = float(truth.distance_m * told[1]) if drawn % WITHOUT_DISTANCE > 0 else None
    pitch_rad = float(np.radians(truth.pitch_deg))
    return body_from_proportions(stature_m, distance_m, camera_pitch_rad=pitch_rad)


def covered(time_s: float) -> int | None:
    """Return the number of the covered camera, of two, at a time since tracking began, or None."""
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
