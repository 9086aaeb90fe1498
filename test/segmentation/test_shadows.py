"""Soft shadows against dark clothes, by hand and as plain Python has it."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.segmentation import background
from cardbox_tracker.segmentation.background import SilhouetteExtractor
from cardbox_tracker.segmentation.background_config import BackgroundConfig
from cardbox_tracker.segmentation.empty_scene import BackgroundModel
from cardbox_tracker.segmentation.shadows import decide_shadows

H, W = 120, 160
LEVEL = 150.0


def shape(*boxes: tuple[int, int, int, int]) -> np.ndarray:
    made = np.zeros((H, W), np.float32)
    for top, bottom, left, right in boxes:
        made[top:bottom, left:right] = 1.0
    return made


PERSON = shape((30, 110, 60, 90))


def extractor(**settings: float) -> SilhouetteExtractor:
    mean = np.full((H, W), LEVEL, np.float32)
    return SilhouetteExtractor(
        BackgroundModel(mean, np.full_like(mean, 2)), BackgroundConfig(**settings)
    )


def image(person: float, shadow: float = 0.0, blur: float = 9.0) -> np.ndarray:
    """A person (a fraction of the wall's brightness) and the shadow behind, 16 px aside."""
    cast = cv2.GaussianBlur(np.roll(PERSON, 16, axis=1), (0, 0), blur)
    wall = LEVEL * (1 - shadow * cast)
    return np.where(PERSON > 0, LEVEL * person, wall).round().astype(np.uint8)


@pytest.mark.parametrize("strength", [0.2, 0.3])
def test_a_soft_shadow_disappears_and_the_person_stays(strength: float) -> None:
    picture = image(0.3, strength)
    before = extractor(soft_shadow=0.0)(picture)
    assert np.count_nonzero((before > 0) & (PERSON == 0)) > 700
    found = extractor()(picture)
    # The outline is 220 px long.
    assert np.count_nonzero((found > 0) != (PERSON > 0)) < 110


@pytest.mark.parametrize("cloth", [0.65, 0.75, 0.84])
def test_dark_clothes_in_the_colour_of_the_wall_stay(cloth: float) -> None:
    np.testing.assert_array_equal(
        extractor()(image(cloth)), extractor(soft_shadow=0.0)(image(cloth))
    )
    assert np.count_nonzero(extractor()(image(cloth))) > 0.98 * PERSON.sum()


def test_dark_clothes_in_noise_stay() -> None:
    rng = np.random.default_rng(2)
    picture = np.clip(image(0.75) + rng.normal(0, 3, (H, W)), 0, 255).astype(np.uint8)
    assert np.count_nonzero(extractor()(picture)) > 0.97 * PERSON.sum()


def test_what_is_darker_than_a_shadow_can_be_is_the_person(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Across the whole image from bright to half as bright, without any edge.
    picture = np.tile(np.linspace(LEVEL, LEVEL / 2, W), (H, 1)).round().astype(np.uint8)
    monkeypatch.setattr(background, "_FLICKER", 0.0)
    found = extractor(follow=False)(picture)
    assert not found[:, : int(0.75 * W)].any() and found[:, int(0.85 * W) :].all()
    monkeypatch.setattr(background, "_DARKEST_SHADOW", 0.6)
    assert not extractor(follow=False)(picture).any()


def plain(
    foreground: np.ndarray, relative: np.ndarray, colored: np.ndarray | None, limits: tuple
) -> np.ndarray:
    """The same in passes over whole images."""
    darkest, softest = limits
    by_color = np.zeros(foreground.shape, bool) if colored is None else colored > 0
    fixed = by_color | (foreground > 0)
    dark = (foreground > 0) & ~by_color & (relative < 0) & (relative > -darkest)
    square, cross = np.ones((5, 5), np.uint8), cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    size = foreground.shape
    varies = (cv2.dilate(relative, square) - cv2.erode(relative, square)).reshape(size)
    removed, reach = np.zeros(size, bool), ~fixed
    for steps, allowed in ((foreground.size, dark & (varies < softest)), (2, dark)):
        for _ in range(steps):
            near = cv2.dilate(reach.astype(np.uint8), cross).reshape(size) > 0
            added = near & allowed & ~removed
            if not added.any():
                break
            removed |= added
            reach = reach | added if steps > 2 else removed
        reach = removed
    return np.where(fixed & ~removed, 255, 0)


@settings(max_examples=80, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.tuples(st.integers(5, 40), st.integers(5, 40)),
    st.booleans(),
    st.sampled_from([0.5, 1.5, 4.0]),
)
def test_equal_to_passes_of_opencv(
    seed: int, size: tuple[int, int], has_color: bool, blur: float
) -> None:
    rng = np.random.default_rng(seed)
    noise = cv2.GaussianBlur(rng.normal(0, 1, size), (0, 0), blur).reshape(size)
    relative = (0.4 * noise / noise.std() - 0.2).astype(np.float32)
    foreground = np.where(np.abs(relative) > 0.1, 255, 0).astype(np.uint8)
    colored = np.where(rng.normal(-2, 1, size) >= 0, 255, 0).astype(np.uint8) if has_color else None
    limits = (0.4, 0.25)
    expected = plain(foreground, relative, colored, limits)
    per_level = np.full(size, 0.5, np.float32)
    decide_shadows(foreground, 2 * relative, per_level, colored, *limits)
    np.testing.assert_array_equal(foreground, expected)
