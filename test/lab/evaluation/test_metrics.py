"""Error measures, by hand-computed values and by what they must not depend on."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from cardbox_tracker.person.skeleton import rotation_x, rotation_y, rotation_z
from lab.evaluation.metrics import align, angle_errors_deg, distances_m


def pa_mpjpe_m(estimates_m: NDArray[np.float64], truth_m: NDArray[np.float64]) -> float:
    return float(distances_m(align(estimates_m, truth_m), truth_m).mean())


seeds = st.integers(0, 2**32 - 1)
angles = st.floats(-np.pi, np.pi)


def joints(seed: int) -> NDArray[np.float64]:
    return np.random.default_rng(seed).normal(0.0, 0.3, (6, 3))


def test_distances_and_mpjpe_by_hand() -> None:
    truth = np.zeros((2, 2, 3))
    estimates = np.array([[[3.0, 4.0, 0.0], [0.0, 0.0, 0.0]], [[0.0, 0.0, 1.0], [2.0, 3.0, 6.0]]])
    np.testing.assert_allclose(distances_m(estimates, truth), [[5.0, 0.0], [1.0, 7.0]])
    assert distances_m(estimates, truth).mean() == pytest.approx(13.0 / 4.0)


@given(seeds, angles, angles, angles, st.floats(0.1, 10.0))
def test_pa_mpjpe_is_blind_to_a_similarity_transform(
    seed: int, roll: float, pitch: float, yaw: float, scale: float
) -> None:
    truth = joints(seed)
    rotation = rotation_z(np.array(yaw)) @ rotation_y(np.array(pitch)) @ rotation_x(np.array(roll))
    moved = scale * truth @ rotation.T + [1.0, -2.0, 3.0]
    assert pa_mpjpe_m(moved, truth) < 1e-9
    noisy = truth + joints(seed + 1) / 10
    expected = pa_mpjpe_m(noisy, truth)
    assert pa_mpjpe_m(scale * noisy @ rotation.T + [1.0, 1.0, 1.0], truth) == pytest.approx(
        expected
    )


@given(seeds)
def test_alignment_never_makes_the_squared_error_larger(seed: int) -> None:
    truth, estimate = joints(seed), joints(seed + 1)
    before = np.sum((estimate - truth) ** 2)
    assert np.sum((align(estimate, truth) - truth) ** 2) <= before * (1 + 1e-9)


def test_a_mirror_image_is_not_aligned_away() -> None:
    truth = joints(3)
    assert pa_mpjpe_m(truth * (-1.0, 1.0, 1.0), truth) > 0.05


def test_alignment_by_hand_scales_about_the_middle() -> None:
    truth = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    np.testing.assert_allclose(align(2.0 * truth + 5.0, truth), truth, atol=1e-12)


def test_alignment_takes_each_image_for_itself() -> None:
    truth = np.stack([joints(1), joints(2)])
    estimates = np.stack([2.0 * truth[0], truth[1] + 1.0])
    assert pa_mpjpe_m(estimates, truth) < 1e-9


def test_joints_in_one_point_end_in_the_middle_of_the_truth() -> None:
    truth = joints(5)
    aligned = align(np.ones_like(truth), truth)
    np.testing.assert_allclose(aligned, np.broadcast_to(truth.mean(axis=0), (6, 3)))


def test_angles_are_compared_the_shorter_way_round() -> None:
    estimates = np.radians([170.0, -10.0, 360.0, 90.0])
    truth = np.radians([-170.0, 20.0, 0.0, 90.0])
    np.testing.assert_allclose(
        angle_errors_deg(estimates, truth), [20.0, 30.0, 0.0, 0.0], atol=1e-9
    )


@given(angles, angles)
def test_angle_errors_are_symmetric_and_at_most_half_a_turn(a: float, b: float) -> None:
    forth, back = (
        angle_errors_deg(np.array([a]), np.array([b])),
        angle_errors_deg(np.array([b]), np.array([a])),
    )
    np.testing.assert_allclose(forth, back, atol=1e-9)
    assert 0.0 <= forth[0] <= 180.0
