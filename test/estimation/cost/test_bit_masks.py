"""Unions of patches drawn as bits: equal to the patches drawn one by one into an image."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cardbox_tracker.compiling import kernel
from cardbox_tracker.estimation.cost.bit_masks import (
    Words,
    fill_planes,
    new_masks,
    new_planes,
    sum_masks,
)
from cardbox_tracker.estimation.cost.kernel_arguments import Floats, Intrinsics, intrinsics_of
from cardbox_tracker.estimation.cost.rasterisation import draw, new_workspace
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.rasterisation import clip_near, fill_convex, snap

PATCHES = 6


@kernel
def sum_of(
    corners_m: Floats, camera: tuple[float, ...], planes: Words, size: tuple[int, int]
) -> tuple[int, int]:
    """Sum of (1 - 2 f) and area under the patches (6, 4, 3) in an image of rows and width."""
    rows, width = size
    work, masks = new_workspace(PATCHES, planes.shape[2]), new_masks(PATCHES, planes)
    for p in range(PATCHES):
        for c in range(4):
            for j in range(3):
                work.corners[j, c * PATCHES + p] = corners_m[p, c, j]
    has_cuts = draw(work, Intrinsics(*camera), rows, width)
    return sum_masks(work, has_cuts, width, planes, masks)


def row_sums_of(foreground: NDArray[np.bool_], counts: NDArray[np.bool_]) -> NDArray[np.int16]:
    """The running sums by their definition, where pixels that do not count change nothing."""
    sums = np.zeros((foreground.shape[0], foreground.shape[1] + 1), np.int16)
    sums[:, 1:] = np.cumsum(np.where(counts, 1 - 2 * foreground.astype(int), 0), axis=1)
    return sums


def test_planes_by_hand() -> None:
    """A word has 31 pixels, the lowest bit is the left one, and pixels that do not count are 0."""
    foreground, counts = np.zeros((2, 40), bool), np.ones((2, 40), bool)
    foreground[0, [0, 2, 30, 31]] = True
    counts[1, 33:] = False
    planes = new_planes(40, 2)
    fill_planes(row_sums_of(foreground, counts), planes)
    assert planes.shape == (2, 2, 16)
    assert planes[0, :, :2].tolist() == [[2**31 - 1, 2**31 - 1], [2**9 - 1, 0b11]]
    assert planes[1, :, :2].tolist() == [[2**30 + 0b101, 0], [1, 0]]


@pytest.mark.parametrize(("width", "rows"), [(1, 1), (31, 16), (32, 17), (93, 40)])
@pytest.mark.parametrize("nearest_m", [0.3, -0.5], ids=["in front", "partly behind"])
@settings(max_examples=60)
@given(seed=st.integers(0, 10**6))
def test_union_is_that_of_the_drawn_patches(
    width: int, rows: int, nearest_m: float, seed: int
) -> None:
    """Pixels under several patches count once, also beyond the image and behind the camera."""
    rng = np.random.default_rng(seed)
    camera = Camera(width, rows, 50.0, 50.0, width / 2, rows / 2)
    middles = rng.uniform([-1.0, -0.6, nearest_m], [1.0, 0.6, 2.0], (PATCHES, 1, 3))
    half_m = rng.uniform(0.01, 0.6, (PATCHES, 1, 2, 1)) * rng.normal(size=(PATCHES, 1, 2, 3))
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])[None, :, :, None]
    corners_m = middles + (signs * half_m).sum(axis=2)
    foreground, counts = rng.random((2, rows, width)) < 0.7
    planes = new_planes(width, rows)
    fill_planes(row_sums_of(foreground & counts, counts), planes)

    drawn = np.zeros((rows, width), np.uint8)
    for patch_m in corners_m:
        fill_convex(drawn, snap(camera.project(clip_near(patch_m))))
    covered = drawn > 0
    expected = np.where(counts, 1 - 2 * foreground.astype(int), 0)[covered].sum(), covered.sum()
    assert sum_of(corners_m, intrinsics_of(camera), planes, (rows, width)) == expected
