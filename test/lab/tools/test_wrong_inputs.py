"""The table of wrong inputs, from estimates whose errors are known."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.tracking.estimate import TRACKING, UNCERTAIN, Estimate, Place
from lab.tools import wrong_inputs

TRUE_M = np.tile([0.0, 0.0, 2.0], (6, 1))


def estimate(state: str, hand_m: float, away_m: float, contradiction: str = "") -> Estimate:
    keypoints_m = TRUE_M + np.array([0.0, 0.0, away_m])
    keypoints_m[2, 0] += hand_m
    place = Place(np.full(3, 0.1), 0.05, "given stature", contradiction)
    return Estimate(state, keypoints_m=keypoints_m, place=place)


def test_shape_and_place_are_judged_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    stamps = [0, 500_000_000, 1_000_000_000, 1_500_000_000]
    found = [
        estimate(TRACKING, 0.0, 0.0),
        estimate(TRACKING, 0.4, 0.5),
        estimate(UNCERTAIN, 0.4, 0.5, "they differ"),
        estimate(UNCERTAIN, 0.0, 0.1, "they differ"),
    ]
    bodies: list[BodyModel] = []

    def track(_: Any, __: Any, seeds: Any, ___: Any, observe: Any, body: BodyModel) -> None:
        bodies.append(body)
        for stamp_ns, one in zip(stamps, found, strict=True):
            observe(seeds[0], stamp_ns, one, None)

    monkeypatch.setattr(wrong_inputs, "track_session", track)
    truth = SimpleNamespace(stature_m=1.7, distance_m=2.0, pitch_deg=3.0, cameras=("",))
    session = SimpleNamespace(
        name="clip", truth=truth, stamps_ns=np.array(stamps), keypoints_m=np.array([TRUE_M] * 4)
    )
    row = wrong_inputs.row_of(cast(Any, session), "pitch + 10 degrees", cast(Any, None))
    # Of two tracking images one has a wrong hand; of two tracked places one is half a metre off.
    assert row == "| clip | pitch + 10 degrees | 50 | 50 | 50 | 50 | 50 | 5 | 1.0 |"
    assert bodies[0].camera_pose.pitch_rad == pytest.approx(np.radians(13.0))
    wrong_inputs.row_of(cast(Any, session), "stature x 0.8", cast(Any, None))
    assert bodies[1].size("upper_arm_length") == pytest.approx(0.16 * 1.36, abs=1e-3)
    assert bodies[1].placement.distance_m == 2.0
