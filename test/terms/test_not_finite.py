"""Numbers that are not finite, and images of one row, lead to no place outside of an array."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.compiling import kernel
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.terms.compiled import CompiledSilhouette
from cardbox_tracker.terms.outline import signed_distances
from cardbox_tracker.terms.outline_points import distance_at

CAMERA = Camera(48, 32, 50.0, 50.0, 23.5, 15.5)
# Metres in the optical frame; the lower half of the patch is in the image.
CORNERS_M = np.array([(-0.2, -0.3, 1.0), (0.2, -0.3, 1.0), (0.2, 0.2, 1.0), (-0.2, 0.2, 1.0)])


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("changed", [(0,), (0, 1), (1, 2), (0, 1, 2, 3)])
def test_nan_is_far_to_the_left_or_above(axis: int, changed: tuple[int, ...]) -> None:
    silhouette = np.full((CAMERA.height, CAMERA.width), 255, np.uint8)
    seen = CompiledSilhouette(BodyModel(), CAMERA).look(silhouette)
    costs = []
    for value in (-1e9, np.nan):
        corners_m = CORNERS_M.copy()
        corners_m[list(changed), axis] = value
        costs.append(seen.polygons(corners_m[None, None]).tolist())
    assert costs[0] == costs[1]


def test_a_point_that_is_nan_has_a_distance_of_the_field() -> None:
    field = np.arange(6, dtype=np.float32).reshape(2, 3)
    distance = kernel(lambda field, x, y: distance_at(field, x, y))
    assert distance(field, 1.0, 0.5) == 2.5
    assert distance(field, np.nan, 0.0) == 0.0
    assert distance(field, 1.0, np.nan) == 1.0
    assert distance(field, np.nan, np.nan) == 0.0


@pytest.mark.parametrize("rows", [0, 1, 2, 3])
def test_a_field_of_distances_has_two_rows_or_nothing(rows: int) -> None:
    """Between pixels of a single row, the row below would be read."""
    silhouette = np.full((40, 30), 255, np.uint8)
    _, _, field, _ = signed_distances(silhouette, rows - 12.0)
    assert len(field) == (rows if rows > 1 else 0)
