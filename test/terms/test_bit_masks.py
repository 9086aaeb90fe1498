"""Unions of patches drawn as bits: equal to the patches drawn one by one into an image."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import clip_near, fill_convex, snap
from cardbox_tracker.common.compiling import kernel
from cardbox_tracker.terms.bit_masks import cover_masks, new_masks, sum_masks
from cardbox_tracker.terms.bit_planes import Planes, fill_planes, new_planes
from cardbox_tracker.terms.kernel_arguments import Floats, Intrinsics, intrinsics_of
from cardbox_tracker.terms.rasterisation import draw, new_workspace

PATCHES = 6


@kernel
def sum_of(
    corners_m: Floats,
    camera: tuple[float, ...],
    size: tuple[int, int],
    planes: Planes,
    covered: Planes,
) -> tuple[int, int]:
    """Sum of (1 - 2 f) and area under the patches (6, 4, 3), which are removed in ``covered``."""
    rows, width = size
    work, masks = new_workspace(PATCHES, planes.shape[2]), new_masks(PATCHES, planes)
    for p in range(PATCHES):
        for c in range(4):
            for j in range(3):
                work.corners[j, c * PATCHES + p] = corners_m[p, c, j]
    has_cuts = draw(work, Intrinsics(*camera), rows, width)
    found = sum_masks(work, has_cuts, width, planes, masks)
    cover_masks(masks, planes, covered)
    return found


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
    silhouette = foreground.astype(np.uint8)
    planes, of_counts, rest = (new_planes(width, rows) for _ in range(3))
    for image, made in ((silhouette, planes), (counts.astype(np.uint8), of_counts)):
        fill_planes(image, np.zeros((1, 0), np.uint64), made)
    planes &= of_counts[1]

    drawn = np.zeros((rows, width), np.uint8)
    for patch_m in corners_m:
        fill_convex(drawn, snap(camera.project(clip_near(patch_m))))
    covered = drawn > 0
    expected = np.where(counts, 1 - 2 * foreground.astype(int), 0)[covered].sum(), covered.sum()
    size = rows, width
    assert sum_of(corners_m, intrinsics_of(camera), size, planes, rest) == expected
    # Under the union nothing is left, and beside it everything.
    assert sum_of(corners_m, intrinsics_of(camera), size, rest, planes)[0] == 0
    bits = np.unpackbits(np.ascontiguousarray(rest[:, :, :rows]).view(np.uint8), axis=2)
    everywhere = bits.sum(axis=(1, 2)).tolist()
    left = counts & ~covered
    assert everywhere == [left.sum(), (left & foreground).sum()]
