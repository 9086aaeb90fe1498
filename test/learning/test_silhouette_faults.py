"""Faults change silhouettes as their names say."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from learning.silhouette_faults import Degrader, Faults, draw_faults

# A person of 80 x 130 pixels.
PERSON = np.zeros((240, 320), bool)
PERSON[90:220, 120:200] = True


def degraded(faults: Faults, seed: int = 0, mask: np.ndarray = PERSON) -> np.ndarray:
    result = Degrader(faults, np.random.default_rng(seed))(mask)
    assert result is not None
    return result > 0


def test_without_faults_nothing_changes() -> None:
    degrade = Degrader(Faults(), np.random.default_rng(0))
    for _ in range(3):
        found = degrade(PERSON)
        assert found is not None and found.dtype == np.uint8
        np.testing.assert_array_equal(found, np.where(PERSON, 255, 0))


@pytest.mark.parametrize("growth", [-0.02, -0.01, 0.01, 0.02])
def test_the_outline_moves_by_its_growth(growth: float) -> None:
    found = degraded(Faults(growth=growth))
    both_sides_px = 2 * growth * 240
    assert found[150].sum() - 80 == pytest.approx(both_sides_px, abs=2)
    assert found[:, 160].sum() - 130 == pytest.approx(both_sides_px, abs=2)


def test_rounding_cuts_corners_and_keeps_edges() -> None:
    found = degraded(Faults(rounding=0.02))
    np.testing.assert_array_equal(found[150], PERSON[150])
    assert not found[90, 120] and not found[219, 199]


def test_a_ragged_outline_is_off_by_its_deviation() -> None:
    """The noise has a deviation slightly below 1, because it is interpolated."""
    off_px = []
    for seed in range(30):
        found = degraded(Faults(raggedness=0.01), seed)
        off_px += [first - 120 for first in found[100:210].argmax(axis=1)]
    assert np.mean(off_px) == pytest.approx(0.0, abs=0.5)
    assert 1.5 < np.std(off_px) < 2.9


def test_holes_only_remove_what_was_seen() -> None:
    found = degraded(Faults(holes=8.0, hole=0.03))
    assert (PERSON & ~found).any() and not (found & ~PERSON).any()


@pytest.mark.parametrize("holes", [0.3, 1.5])
def test_the_mean_number_of_holes(holes: float) -> None:
    """Small holes lie apart; a few overlap or lie at the edge."""
    counts = []
    for seed in range(40):
        degrade = Degrader(Faults(holes=holes), np.random.default_rng(seed))
        for _ in range(30):
            degrade(PERSON)
            counts.append(len(degrade._hole_places))
    assert np.mean(counts) == pytest.approx(holes, rel=0.25)


def test_specks_only_add_small_spots() -> None:
    found = degraded(Faults(specks=6.0))
    assert found[PERSON].all()
    assert 0 < (found & ~PERSON).sum() < 30 * 81


def test_a_shadow_and_a_chair_only_add() -> None:
    shadow, chair = degraded(Faults(shadow=0.1)), degraded(Faults(chair=0.3))
    for found in (shadow, chair):
        assert found[PERSON].all() and (found & ~PERSON).sum() > 50
    assert not (shadow & ~PERSON)[:120].any()
    assert not (chair & ~PERSON)[: 240 - 72].any()


def test_missing_silhouettes() -> None:
    rng = np.random.default_rng(0)
    assert Degrader(Faults(missing=1.0), rng)(PERSON) is None
    degrade = Degrader(Faults(missing=0.3), rng)
    assert np.mean([degrade(PERSON) is None for _ in range(300)]) == pytest.approx(0.3, abs=0.1)


def test_the_noise_changes_slowly() -> None:
    degrade = Degrader(Faults(raggedness=0.006), np.random.default_rng(1))
    first, *others = (degrade(PERSON) for _ in range(60))
    assert first is not None
    changed = [np.count_nonzero(one != first) for one in others]
    assert 0 < changed[0] < 0.5 * np.mean(changed[40:])


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_masks_are_binary_and_the_same_for_the_same_seed(seed: int, is_empty: bool) -> None:
    mask = np.zeros_like(PERSON) if is_empty else PERSON
    runs = []
    for _ in range(2):
        rng = np.random.default_rng(seed)
        degrade = Degrader(draw_faults(rng), rng)
        runs.append([degrade(mask) for _ in range(3)])
    for one, other in zip(*runs, strict=True):
        assert (one is None) == (other is None)
        if one is not None and other is not None:
            np.testing.assert_array_equal(one, other)
            assert one.shape == mask.shape and set(np.unique(one)) <= {0, 255}
