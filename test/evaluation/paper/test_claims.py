"""Verdicts come from the numbers, and turn with them."""

from __future__ import annotations

from typing import Any

import numpy as np

from cardbox_tracker.body.kinematics import KEYPOINT_NAMES
from cardbox_tracker.body.posture import JOINT_NAMES
from cardbox_tracker.evaluation.paper.claims import Claim, claims
from cardbox_tracker.evaluation.paper.plots import ELBOW


def strategy(cost_px: float, error_m: float, std_rad: float) -> dict[str, Any]:
    errors = dict.fromkeys(KEYPOINT_NAMES, error_m) | {
        "left_hand": error_m + 0.01,
        "right_hand": error_m + 0.01,
    }
    return {
        "mean_cost_px": cost_px,
        "error_m": errors,
        "std_dof": dict.fromkeys(JOINT_NAMES, std_rad),
        "mpjpe_m": error_m,
        "stderr_mpjpe_m": 0.001,
        "axis_error_m": {"lateral": 0.0, "vertical": 0.0, "depth": error_m},
    }


def side(error_m: float, cost_px: float | None = None) -> dict[str, Any]:
    cost = {"mean_cost_px": cost_px or 1e4 * error_m, "stderr_cost_px": 10.0}
    return {"mean": {"mpjpe_m": error_m, "stderr_mpjpe_m": 0.001} | cost}


def all_true() -> tuple[dict[str, Any], dict[Any, Any], dict[str, Any]]:
    """Results in which every claim holds."""
    results: dict[str, Any] = {
        motion: {"drs": strategy(900.0, 0.1, 0.1), "srs": strategy(1500.0, 0.2, 0.2)}
        for motion in ("wave", "bow")
    }
    results["experiments"] = {
        "survival_rate": {"slow": {"0.01": side(0.2), "0.4": side(0.1), "1": side(0.3)}},
        "particles": {
            "drs": {"25": side(0.2), "200": side(0.1)},
            "srs": {"25": side(0.3), "200": side(0.2)},
        },
        "models": {
            "cardbox": {"planes": 15, **side(0.1)},
            "volumetric": {"planes": 42, **side(0.1)},
        },
    }
    curves = {
        (motion, name): {"cost_px": np.full(4, cost), f"mean_{ELBOW}": np.zeros(4)}
        for motion in ("wave", "bow")
        for name, cost in (("drs", 900.0), ("srs", 1500.0))
    }
    timing = {"particle_us": {"cardbox": 1.0, "volumetric": 2.0}, "frame_ms": 1.0}
    return results, curves, timing


def failing(results: Any, curves: Any, timing: Any) -> list[Claim]:
    return [claim for claim in claims(results, curves, timing) if not claim.holds]


def test_all_hold() -> None:
    assert failing(*all_true()) == []


def test_cost() -> None:
    results, curves, timing = all_true()
    results["bow"]["drs"]["mean_cost_px"] = 1501.0
    (claim,) = failing(results, curves, timing)
    assert "bow 1501 against 1500 px" in claim.evidence


def test_cost_of_a_single_image() -> None:
    results, curves, timing = all_true()
    curves["wave", "drs"]["cost_px"] = np.array([900.0, 900.0, 1600.0, 900.0])
    (claim,) = failing(results, curves, timing)
    assert "wave in 75.0 % of the images" in claim.evidence


def test_one_worse_elbow_is_named_and_does_not_count_over_the_whole_sequence() -> None:
    results, curves, timing = all_true()
    results["wave"]["drs"]["error_m"]["left_elbow"] = 0.21
    (claim,) = [c for c in failing(results, curves, timing) if "elbows and hands" in c.text]
    assert "on each motion by itself" in claim.text
    assert "wave left elbow (21.0 against 20.0)" in claim.evidence
    assert "wave 3 of 4; bow 4 of 4" in claim.evidence


def test_an_elbow_that_is_worse_on_average_counts_twice() -> None:
    results, curves, timing = all_true()
    results["wave"]["drs"]["error_m"]["left_elbow"] = 0.31
    found = [c for c in failing(results, curves, timing) if "elbows and hands" in c.text]
    assert len(found) == 2
    assert "3 of 4" in found[0].evidence


def test_shoulders_are_no_part_of_that_claim() -> None:
    results, curves, timing = all_true()
    results["wave"]["drs"]["error_m"]["left_shoulder"] = 0.9
    assert not any("elbows and hands better" in c.text for c in failing(results, curves, timing))


def test_one_larger_deviation_is_named() -> None:
    results, curves, timing = all_true()
    results["bow"]["drs"]["std_dof"]["torso_pitch"] = 0.2
    (claim,) = failing(results, curves, timing)
    assert "wave 12 of 12; bow 11 of 12" in claim.evidence
    assert "bow torso pitch (0.200 against 0.200)" in claim.evidence
    assert claim.why


def test_bowing_may_be_worse_by_chance_only() -> None:
    results, curves, timing = all_true()
    results["bow"]["drs"]["mpjpe_m"] = 0.102
    assert failing(results, curves, timing) == []
    results["bow"]["drs"]["mpjpe_m"] = 0.104
    (claim,) = failing(results, curves, timing)
    assert "wave 10.0 ± 0.1 cm; bow 10.4 ± 0.1 cm" in claim.evidence


def test_survival_rate_must_be_worse_at_both_ends_by_more_than_chance() -> None:
    results, curves, timing = all_true()
    results["experiments"]["survival_rate"]["slow"]["0.01"] = side(0.102, 2000.0)
    (claim,) = failing(results, curves, timing)
    assert "worse in 3D" in claim.text
    assert "least 10.0 cm at e = 0.4; 10.2 cm at 0.01, 30.0 cm at 1" in claim.evidence
    assert "slow motion, the best alone survives" in claim.evidence
    assert "all survives" not in claim.evidence
    results["experiments"]["survival_rate"]["slow"]["1"] = side(0.3, 900.0)
    found = failing(results, curves, timing)
    assert len(found) == 2
    assert "slow motion, all survives" in found[0].evidence


def test_a_number_of_particles_with_which_srs_is_better_is_named() -> None:
    results, curves, timing = all_true()
    results["experiments"]["particles"]["srs"]["200"] = side(0.05)
    (claim,) = failing(results, curves, timing)
    assert "Not so with 200" in claim.evidence


def test_drawing_and_real_time() -> None:
    results, curves, timing = all_true()
    timing = {"particle_us": {"cardbox": 2.0, "volumetric": 1.0}, "frame_ms": 80.0}
    assert len(failing(results, curves, timing)) == 2


def test_a_recorded_session_is_judged_by_what_it_has() -> None:
    results, curves, _ = all_true()
    del results["experiments"]
    session = {"wave": results["wave"]}
    assert failing(session, curves, {}) == []
    assert len(claims(session, curves, {})) == 6
