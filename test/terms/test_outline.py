"""Residuals of the outline: distances by hand, derivatives, and what does not count."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_STATE, reference_posture
from cardbox_tracker.terms.body_outline import BODY_PATCHES, corners_of_body
from cardbox_tracker.terms.kernel_arguments import body_tuple
from cardbox_tracker.terms.outline import Outline, signed_distances
from cardbox_tracker.terms.outline_distances import SeenOutline
from cardbox_tracker.terms.outline_points import POINTS, find_outline
from cardbox_tracker.terms.term import Posed

CAMERA = Camera(320, 240, 300.0, 310.0, 159.5, 119.5, 0.15)
BODY = BodyModel.of(distance_m=2.3, hip_height_m=-0.45, camera_pitch_rad=0.15)
POSABLE = body_tuple(BODY, CAMERA)
STATE = np.append(reference_posture("arms"), [0.0, 0.0])
STATE[:4] = 0.02, 0.1, 0.2, 0.3


def in_a_linear_field(slope: tuple[float, float]) -> Outline:
    """Distances that grow evenly, where the interpolation is exact."""
    seen = Outline(np.full((240, 320), 255, np.uint8), CAMERA, (0.5, 2.3))
    v, u = np.indices((240, 320))
    field = slope[0] * (u - 160) + slope[1] * (v - 120)
    lens = np.array([CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy])
    seen._seen = lens, field.astype(np.float32), np.array([3.0, 316.0, 3.0, 200.0])
    return seen


@pytest.mark.parametrize("slope", [(0.06, 0.0), (0.0, 0.06), (0.03, -0.05)])
def test_residuals_and_jacobian_are_those_of_numerical_derivatives(
    slope: tuple[float, float],
) -> None:
    found = in_a_linear_field(slope).residuals(Posed(POSABLE, STATE[None]))
    assert found is not None
    edges, points = np.empty((POINTS, 2), np.int64), np.empty((POINTS, 2))
    within = np.array([3.0, 316.0, 3.0, 200.0])
    n = find_outline(corners_px(STATE), within, edges, points)
    assert n > 60
    (patch, corner), (share, length) = edges[:n].T, points[:n].T

    def distances(at: np.ndarray) -> np.ndarray:
        corners = corners_px(at)[..., :2]
        begin, end = corners[patch, corner], corners[patch, (corner + 1) % 4]
        return (begin + share[:, None] * (end - begin) - (160, 120)) @ slope

    now = distances(STATE)
    steps = 1e-5 * np.eye(N_STATE)
    jacobian = np.array([distances(STATE + d) - distances(STATE - d) for d in steps]) / 2e-5
    outlying = 1.0 + (now / 5.0) ** 2
    root = np.sqrt(0.01 * length) / outlying
    np.testing.assert_allclose(found.values[0, :n], root * now, atol=1e-5)
    assert not found.values[0, n:].any() and not found.jacobian[0, n:].any()
    expected = (root * jacobian).T
    # The outline of a round part differs from a rigid motion along itself.
    assert np.linalg.norm(found.jacobian[0, :n] - expected) < 0.05 * np.linalg.norm(expected)
    assert found.costs[0] == pytest.approx((0.01 * length * now**2 / outlying).sum(), rel=1e-4)


def corners_px(state: np.ndarray) -> np.ndarray:
    """Column, row and inverse depth of the corners of all patches, (13, 4, 3)."""
    corners_m = np.empty((BODY_PATCHES, 4, 3))
    corners_of_body(state, POSABLE, corners_m)
    return np.concatenate([CAMERA.project(corners_m), 1.0 / corners_m[..., 2:]], axis=2)


def test_a_residual_is_the_distance_with_its_weight() -> None:
    found = in_a_linear_field((0.06, 0.0)).residuals(Posed(POSABLE, STATE[None]))
    assert found is not None
    # With the weight w = information / (1 + r^2 / half^2)^2, w r^2 adds up to less than the cost.
    known = found.values[0] != 0.0
    squares = found.values[0, known] ** 2
    assert 0.5 * found.costs[0] < squares.sum() <= found.costs[0]
    assert found.costs[0] < 0.01 * 5.0**2 * 1000


def test_nobody_has_no_residuals() -> None:
    nobody = Outline(np.zeros((240, 320), np.uint8), CAMERA, (0.5, 2.3))
    assert nobody.is_empty
    assert nobody.residuals(Posed(POSABLE, STATE[None])) is None


def test_distances_are_signed_and_cover_what_is_seen() -> None:
    silhouette = np.zeros((60, 80), np.uint8)
    silhouette[20:40, 30:50] = 255
    left, top, field, within = signed_distances(silhouette, 60.0)
    assert field[30 - top, 40 - left] == pytest.approx(-10.0, abs=1.0)
    assert field[30 - top, 25 - left] == pytest.approx(5.0, abs=1.0)
    # 12 px around the foreground, less a border of 3 px.
    shift = np.array([left, left, top, top])
    np.testing.assert_array_equal(within + shift, [21, 58, 11, 49])
    assert signed_distances(silhouette, -100.0)[2].size == 0


def test_distances_of_camera_poses_are_of_every_fourth_pixel_around_the_person() -> None:
    camera = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
    silhouette = np.zeros((240, 320), np.uint8)
    silhouette[60:180, 100:200] = 255
    # Four rows above those of the hips, 144.5.
    seen = SeenOutline(silhouette, camera, np.array([0.0, 25.0 / 150.0, 2.0]))
    # 24 px at the sides and above.
    assert seen.distances.size == (24 + 100 + 24) // 4 * ((24 + 80) // 4)
    # A patch whose edges lie within the outer pixels paints them all: it is half a pixel smaller.
    corners = [(99.75, 59.75), (199.25, 59.75), (199.25, 179.25), (99.75, 179.25)]
    there = [((u - 159.5) / 150.0, (v - 119.5) / 150.0, 2.0) for u, v in corners]
    near = np.abs(seen.distances) < 8.0
    np.testing.assert_allclose((seen.drawn(np.array([there])) - seen.distances)[near], 0.5)
