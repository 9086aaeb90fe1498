"""The learned prior: a mixture that integrates to one, likely and unlikely arms, both alike."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.common.compiling import kernel
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.terms import pose_prior
from cardbox_tracker.terms.pose_prior import FLOOR_NATS, load_gmm, nats_of, sample_bank


def slow_nats(vectors: np.ndarray) -> np.ndarray:
    """-log p of unit vectors (N, 6), straight from the definition of a row."""
    total = np.full(len(vectors), np.exp(-FLOOR_NATS))
    for row in load_gmm():
        whitening = np.zeros((6, 6))
        whitening[np.tril_indices(6)] = row[7:]
        squares = np.sum(((vectors - row[1:7]) @ whitening.T) ** 2, axis=1)
        total += np.exp(row[0] - squares / 2)
    return -np.log(total)


def directions(arms: np.ndarray) -> np.ndarray:
    """Unit vectors (N, 6) of left arms (N, 4)."""
    postures = np.zeros((len(arms), 12))
    postures[:, 4:8] = arms
    arm = pose(BodyModel().rigid, postures).left
    limbs = [arm.elbow - arm.shoulder, arm.hand - arm.elbow]
    return np.hstack([limb / np.linalg.norm(limb, axis=1, keepdims=True) for limb in limbs])


def test_python_cannot_call_what_has_no_wrapper() -> None:
    vectors, gaussians = directions(np.zeros((1, 4)))[0], np.ascontiguousarray(load_gmm().T)
    given = vectors, gaussians, 0.1, np.empty(gaussians.shape[1])
    assert np.isfinite(nats_of_one(*given)), "compiled code calls it"
    with pytest.raises(TypeError, match="nats_of is for compiled functions"):
        nats_of(*given)


@kernel
def nats_of_one(vectors: np.ndarray, gaussians: np.ndarray, rest: float, logs: np.ndarray) -> float:
    return nats_of(vectors, gaussians, rest, logs)


def nats(arms: np.ndarray, floor_nats: float = FLOOR_NATS) -> np.ndarray:
    gaussians = np.ascontiguousarray(load_gmm().T)
    rest, logs = np.exp(-floor_nats), np.empty(gaussians.shape[1])
    return np.array([nats_of_one(one, gaussians, rest, logs) for one in directions(arms)])


def test_the_kernel_is_the_definition() -> None:
    arms = np.random.default_rng(0).uniform(-1.5, 1.5, (50, 4))
    # The kernel leaves out Gaussians too far away to matter.
    np.testing.assert_allclose(nats(arms), slow_nats(directions(arms)), atol=1e-4)


def test_the_rows_are_those_of_a_normalized_mixture() -> None:
    gmm = load_gmm()
    assert gmm.shape == (16, 28)
    # Undo the normalization of each Gaussian: what is left are the shares, times one factor, the
    # offset, that makes the likeliest posture cost about nothing.
    diagonal = gmm[:, [7, 9, 12, 16, 21, 27]]
    shares = np.exp(gmm[:, 0] + 3 * np.log(2 * np.pi)) / diagonal.prod(axis=1)
    data = json.loads(Path(pose_prior.__file__).with_suffix(".json").read_text(encoding="utf-8"))
    np.testing.assert_allclose(shares * np.exp(data["offset"]), data["shares"], rtol=1e-9)
    assert sum(data["shares"]) == pytest.approx(1.0, abs=1e-4)
    assert slow_nats(gmm[:, 1:7]).min() == pytest.approx(0.0, abs=0.01)


def test_elbows_bend_forwards() -> None:
    for abduction, elbow in ((20, 40), (20, 80), (45, 30), (60, 60), (80, 60)):
        arms = np.radians([[abduction, 0.0, 0.0, elbow], [abduction, 0.0, 0.0, -elbow]])
        forward, backward = nats(arms)
        assert forward < backward - 1.0


def test_no_posture_is_impossible() -> None:
    costs = nats(np.random.default_rng(0).uniform(-np.pi, np.pi, (2000, 4)))
    assert costs.max() <= FLOOR_NATS + 1e-9
    assert costs.min() > -3.0
    assert nats(np.radians([[-90.0, -90.0, 0.0, 0.0]]), 3.0).max() <= 3.0


def test_reference_postures_are_likely() -> None:
    assert nats(np.radians([[20.0, 0, 0, 0], [80.0, 0, 0, 0]])).max() < 3.0


def test_samples_are_likely_unit_vectors() -> None:
    bank = sample_bank()
    assert bank.shape == (3000, 6)
    np.testing.assert_allclose(np.linalg.norm(bank.reshape(-1, 3), axis=1), 1.0)
    assert np.median(slow_nats(bank)) < 4.0
    np.testing.assert_array_equal(bank, sample_bank())


def test_the_mixture_is_shared_and_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        load_gmm()[0, 0] = 1.0
