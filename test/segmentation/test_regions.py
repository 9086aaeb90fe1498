"""Small regions: by hand, and as OpenCV's labels have them."""

from __future__ import annotations

from functools import partial

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cardbox_tracker.segmentation.regions import _recolour, clean_silhouette, find_regions
from cardbox_tracker.segmentation.window import window_of


def image(*rows: str) -> np.ndarray:
    """White where there is an ``x``."""
    return np.array([[255 * (letter == "x") for letter in row] for row in rows], np.uint8)


def recoloured(before: np.ndarray, colour: int, area_px: float) -> np.ndarray:
    after = before.copy()
    _recolour(after, colour, area_px)
    return after


def by_labels(before: np.ndarray, colour: int, area_px: float) -> np.ndarray:
    """The same with OpenCV's labels."""
    count, labels = cv2.connectedComponents((before == colour).astype(np.uint8), connectivity=4)
    after = before.copy()
    for label in range(1, count):
        region = labels == label
        if np.count_nonzero(region) < area_px:
            after[region] = 255 - colour
    return after


def test_specks_by_hand() -> None:
    before = image("x..xx", "..x..", "xx.x.", "xx...")
    np.testing.assert_array_equal(
        recoloured(before, 255, 2), image("...xx", ".....", "xx...", "xx...")
    )
    np.testing.assert_array_equal(
        recoloured(before, 255, 4.5), image(".....", ".....", ".....", ".....")
    )
    np.testing.assert_array_equal(recoloured(before, 255, 1), before)


def test_holes_by_hand() -> None:
    """What touches by a corner alone is apart; the outside is a region like any other."""
    before = image("xxxxx.", "x.xxx.", "xx..x.", "xxxxx.")
    np.testing.assert_array_equal(
        recoloured(before, 0, 2), image("xxxxx.", "xxxxx.", "xx..x.", "xxxxx.")
    )
    np.testing.assert_array_equal(
        recoloured(before, 0, 3), image("xxxxx.", "xxxxx.", "xxxxx.", "xxxxx.")
    )
    assert recoloured(before, 0, 5).all()


def test_arms_that_meet_below_are_one_region() -> None:
    before = image("x.x.x", "x.x.x", "xxxxx")
    np.testing.assert_array_equal(recoloured(before, 255, 11), before)
    assert not recoloured(before, 255, 12).any()


@pytest.mark.parametrize("width", [7, 8, 64, 65])
def test_one_colour_is_one_region(width: int) -> None:
    white = np.full((5, width), 255, np.uint8)
    np.testing.assert_array_equal(recoloured(white, 255, 5 * width), white)
    np.testing.assert_array_equal(recoloured(white, 0, 1e9), white)
    assert not recoloured(white, 255, 5 * width + 1).any()


@settings(max_examples=300, deadline=None)
@given(
    st.tuples(st.integers(1, 24), st.integers(1, 40)).flatmap(
        lambda shape: arrays(np.bool_, shape, fill=st.nothing())
    ),
    st.sampled_from([(1, 1), (2, 3), (8, 1), (1, 8)]),
    st.sampled_from([0, 255]),
    st.integers(0, 200),
)
def test_equal_to_labelling_every_pixel(
    cells: np.ndarray, scale: tuple[int, int], colour: int, area_px: int
) -> None:
    """Cells of several pixels have the long runs that real silhouettes have."""
    before = np.kron(cells, np.ones(scale)).astype(np.uint8) * np.uint8(255)
    np.testing.assert_array_equal(
        recoloured(before, colour, area_px), by_labels(before, colour, area_px)
    )


def painted(before: np.ndarray) -> np.ndarray:
    """Each region's number plus 1 where it is."""
    regions = find_regions(before)
    labels = np.zeros(before.shape, np.int32)
    for row, start, end, label in zip(*regions[:4], strict=True):
        labels[row, start:end] = label + 1
    return labels


def test_regions_by_hand() -> None:
    before = image("x..xx", "x.x.x", "xxx..", "....x")
    np.testing.assert_array_equal(
        painted(before), [[1, 0, 0, 2, 2], [1, 0, 1, 0, 2], [1, 1, 1, 0, 0], [0, 0, 0, 0, 3]]
    )
    assert find_regions(before).areas_px.tolist() == [6, 3, 1]


@pytest.mark.parametrize("other", [1, 128, 254])
def test_pixels_of_another_value_belong_to_no_region(other: int) -> None:
    before = image("x.ox..oo", "oo.x.xxx", "xxxxxxxo")
    expected = painted(before)
    before[0, 2] = before[0, 6] = before[1, 0] = before[2, 7] = other
    np.testing.assert_array_equal(painted(before), expected)
    after = recoloured(before, 255, 100)
    np.testing.assert_array_equal(after, np.where(before == other, other, 0))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (np.zeros((4, 8), np.int32), "int32; expected .* of uint8"),
        (np.zeros((4, 8), np.bool_), "bool"),
        (np.zeros((4, 8, 1), np.uint8), r"\(4, 8, 1\)"),
        (np.zeros(8, np.uint8), r"\(8,\)"),
    ],
)
def test_another_type_or_shape_is_refused(wrong: np.ndarray, words: str) -> None:
    for function in (find_regions, window_of, partial(clean_silhouette, min_area=0, max_hole=0)):
        with pytest.raises(ValueError, match=words):
            function(wrong)


@given(arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 20))))
@settings(max_examples=60, deadline=None)
def test_regions_are_those_of_opencv(pixels: np.ndarray) -> None:
    before = 255 * pixels.astype(np.uint8)
    before.setflags(write=False)
    count, labels = cv2.connectedComponents(before.copy(), connectivity=4)
    found = painted(before)
    pairs = set(zip(labels.ravel().tolist(), found.ravel().tolist(), strict=True))
    assert len(pairs) == count if (labels == 0).any() else len(pairs) == count - 1
    assert find_regions(before).areas_px.tolist() == np.bincount(found.ravel())[1:].tolist()
