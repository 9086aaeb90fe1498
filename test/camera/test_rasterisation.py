"""Which pixels a patch covers: counts by hand, neighbours, and what is behind the camera."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import (
    CROSSING_BITS,
    NEAR_PLANE_M,
    clip_near,
    fill_convex,
    in_front,
    render,
    snap,
)
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture

H, W = 24, 32
CAMERA = Camera(W, H, 20.0, 20.0, 15.5, 11.5)
GRID = st.integers(-6 * 256, 38 * 256).map(lambda i: i / 256)
POINT = st.tuples(GRID, GRID)


def filled(*corners: tuple[float, float]) -> np.ndarray:
    mask = np.zeros((H, W), np.uint8)
    fill_convex(mask, np.array(corners, dtype=float))
    return mask


def rectangle(left: float, top: float, right: float, bottom: float) -> np.ndarray:
    return filled((left, top), (right, top), (right, bottom), (left, bottom))


def wall(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> np.ndarray:
    """A patch (4, 3) of the optical frame whose depth grows with x."""
    return np.array(
        [(x[0], y[0], z[0]), (x[1], y[0], z[1]), (x[1], y[1], z[1]), (x[0], y[1], z[0])]
    )


@pytest.mark.parametrize(
    ("corners", "columns", "rows"),
    [
        # Left and top edges on pixel centres count, right and bottom ones do not.
        ((2, 3, 6, 8), range(2, 6), range(3, 8)),
        ((1.5, 2.5, 5.5, 7.5), range(2, 6), range(3, 8)),
        ((2.01, 3.01, 6.01, 8.01), range(3, 7), range(4, 9)),
        ((-4, -4, 3, 2), range(3), range(2)),
        ((29.5, 20.5, 90, 90), range(30, 32), range(21, 24)),
        ((-50, -50, 90, 90), range(W), range(H)),
    ],
)
def test_rectangles_by_hand(
    corners: tuple[float, float, float, float], columns: range, rows: range
) -> None:
    expected = np.zeros((H, W), np.uint8)
    expected[rows.start : rows.stop, columns.start : columns.stop] = 255
    np.testing.assert_array_equal(rectangle(*corners), expected)


@pytest.mark.parametrize(
    "corners",
    [(2.2, 3, 2.8, 8), (2, 3.2, 8, 3.8), (2, 3, 2, 9), (40, 3, 50, 9), (-9, -9, -1, -1)],
)
def test_what_holds_no_pixel_centre_draws_nothing(corners: tuple[float, ...]) -> None:
    assert not rectangle(*corners).any()


def test_a_triangle_by_hand() -> None:
    # Row v of the triangle (0, 0), (4, 0), (0, 4) covers the columns 0 <= u < 4 - v.
    mask = filled((0, 0), (4, 0), (0, 4))
    assert (mask // 255).sum(axis=1)[:5].tolist() == [4, 3, 2, 1, 0]
    assert np.count_nonzero(mask) == 10


def test_filling_adds_to_what_is_there_and_needs_three_corners() -> None:
    mask = rectangle(0, 0, 4, 4)
    fill_convex(mask, np.array([(8.0, 8.0), (10, 8), (10, 10), (8, 10)]))
    assert np.count_nonzero(mask) == 16 + 4
    fill_convex(mask, np.array([(0.0, 0.0), (20, 20)]))
    fill_convex(mask, np.zeros((0, 2)))
    assert np.count_nonzero(mask) == 20


@given(st.lists(POINT, min_size=3, max_size=3))
def test_the_order_of_the_corners_does_not_matter(corners: list[tuple[float, float]]) -> None:
    expected = filled(*corners)
    np.testing.assert_array_equal(filled(*corners[::-1]), expected)
    np.testing.assert_array_equal(filled(*corners[1:], corners[0]), expected)


@given(st.lists(POINT, min_size=3, max_size=3))
@example([(0.0, 0.0), (362 / 256, -129 / 256), (1057 / 256, 4027 / 256)])
def test_a_triangle_covers_the_centres_inside(corners: list[tuple[float, float]]) -> None:
    """Against half-planes; centres as near to an edge as crossings are inexact may be either."""
    (ax, ay), (bx, by), (cx, cy) = corners
    v, u = np.mgrid[:H, :W]
    sides = np.stack(
        [
            (bx - ax) * (v - ay) - (by - ay) * (u - ax),
            (cx - bx) * (v - by) - (cy - by) * (u - bx),
            (ax - cx) * (v - cy) - (ay - cy) * (u - cx),
        ]
    )
    # First crossing and step are rounded to whole 2^-16 px, so row v is off by half of (1 + v).
    inexact_px = 0.5 * (1 + v) / 2**CROSSING_BITS
    near = np.abs([by - ay, cy - by, ay - cy])[:, None, None] * inexact_px + 1e-9
    inside = np.all(sides > near, axis=0) | np.all(sides < -near, axis=0)
    outside = np.any(sides > near, axis=0) & np.any(sides < -near, axis=0)
    mask = filled(*corners) == 255
    assert mask[inside].all()
    assert not mask[outside].any()


@given(
    st.tuples(st.floats(4, 28), st.floats(4, 20)),
    st.floats(0, np.pi),
    st.floats(0.4, np.pi - 0.4),
    st.tuples(*[st.floats(2, 20)] * 4),
)
def test_neighbours_neither_overlap_nor_leave_a_gap(
    crossing: tuple[float, float],
    direction_rad: float,
    between_rad: float,
    lengths: tuple[float, float, float, float],
) -> None:
    """A convex quadrilateral is the disjoint union of its halves, whichever way it is cut."""
    # Diagonals that cross each other make the quadrilateral convex.
    angles = direction_rad + np.array([0, between_rad, np.pi, np.pi + between_rad])
    rays = np.array(lengths)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    a, b, c, d = map(tuple, snap(np.array(crossing) + rays))
    whole = filled(a, b, c, d)
    for first, second in (
        (filled(a, b, c), filled(a, c, d)),
        (filled(a, b, d), filled(b, c, d)),
    ):
        assert not np.any(first & second)
        np.testing.assert_array_equal(first | second, whole)


@given(POINT, POINT, POINT, POINT)
def test_triangles_on_either_side_of_an_edge_share_no_pixel(
    a: tuple[float, float],
    b: tuple[float, float],
    c: tuple[float, float],
    d: tuple[float, float],
) -> None:
    def side(p: tuple[float, float]) -> float:
        return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])

    assume(side(c) * side(d) < 0)
    assert not np.any(filled(a, b, c) & filled(a, b, d))


def test_an_edge_through_a_pixel_centre_gives_it_to_one_side() -> None:
    # At row 2 the edge is at column 3 exactly; from its lower end it would come out as 3 + 4e-16.
    a, b = (4.5703125, 0.6640625), (-0.140625, 4.671875)
    left, right = filled(a, b, (-3.0, 0.0)), filled(b, a, (9.0, 6.0))
    assert left[2, 2] == 255
    assert right[2, 4] == 255
    assert (left[2, 3] == 255) != (right[2, 3] == 255)


def test_snapping_by_hand() -> None:
    got = snap(np.array([0.0, 1 / 256, 0.4 / 256, 0.5 / 256, -0.4 / 256, -0.6 / 256, 7.3]))
    expected = np.array([0, 1, 0, 1, 0, -1, 1869]) / 256
    np.testing.assert_array_equal(got, expected)


@given(st.floats(-1e4, 1e4))
def test_snapping_moves_by_half_a_step_at_most_and_once(pixel: float) -> None:
    snapped = snap(np.array(pixel))
    assert abs(snapped - pixel) <= 1 / 512
    assert snap(snapped) == snapped


def test_what_is_before_the_near_plane_stays_whole() -> None:
    quad = wall((-1, 1), (-1, 1), (2, 3))
    np.testing.assert_array_equal(clip_near(quad), quad)


def test_what_is_behind_the_camera_is_gone() -> None:
    assert clip_near(wall((-1, 1), (-1, 1), (-2, -1))).shape == (0, 3)
    assert clip_near(wall((-1, 1), (-1, 1), (0.0, 0.099))).shape == (0, 3)


def test_what_is_half_behind_is_cut_at_the_near_plane() -> None:
    # Depth runs from -0.9 to 1.1 over x = -1 .. 1: it is 0.1 in the middle.
    cut = clip_near(wall((-1, 1), (-1, 1), (-0.9, 1.1)))
    expected = {(0.0, -1.0, 0.1), (1.0, -1.0, 1.1), (1.0, 1.0, 1.1), (0.0, 1.0, 0.1)}
    assert {tuple(corner) for corner in cut.round(9).tolist()} == expected


def test_one_corner_behind_makes_five() -> None:
    quad = np.array([(-1, -1, 0.0), (1, -1, 1.0), (1, 1, 2.0), (-1, 1, 1.0)])
    cut = clip_near(quad)
    assert cut.shape == (5, 3)
    assert np.count_nonzero(cut[:, 2] == NEAR_PLANE_M) == 2


def test_a_point_on_the_near_plane_is_in_front() -> None:
    depths = [NEAR_PLANE_M, np.nextafter(NEAR_PLANE_M, 0), np.nextafter(NEAR_PLANE_M, 1), 0, -1]
    points = np.array([(0.2, 0.3, z) for z in depths])
    assert in_front(points).tolist() == [True, False, True, False, False]
    assert in_front(points[0])
    on = wall((-1, 1), (-1, 1), (NEAR_PLANE_M, NEAR_PLANE_M))
    np.testing.assert_array_equal(clip_near(on), on)


@given(st.lists(st.tuples(*[st.floats(-3, 3)] * 3), min_size=4, max_size=4))
def test_nothing_nearer_than_the_near_plane_is_left(corners: list[tuple[float, ...]]) -> None:
    cut = clip_near(np.array(corners))
    assert np.all(in_front(cut))


def test_a_patch_before_the_camera_by_hand() -> None:
    # 1 m wide, 0.5 m high at 2 m: 10 x 5 px around (15.5, 11.5); at half pixels, 10.5 .. 20.5.
    patch = np.array(
        [(-2, y, z) for y, z in ((-0.5, 0.25), (0.5, 0.25), (0.5, -0.25), (-0.5, -0.25))]
    )
    mask = render(patch[None], CAMERA)
    rows, columns = np.nonzero(mask)
    assert (columns.min(), columns.max(), rows.min(), rows.max()) == (11, 20, 9, 13)
    assert np.count_nonzero(mask) == 50
    above = render(patch[None], CAMERA, height=11)
    np.testing.assert_array_equal(above, mask[:11])


def test_a_patch_behind_the_camera_draws_nothing() -> None:
    patch = np.array(
        [(2, y, z) for y, z in ((-0.5, 0.25), (0.5, 0.25), (0.5, -0.25), (-0.5, -0.25))]
    )
    assert not render(patch[None], CAMERA).any()


def test_a_patch_half_behind_draws_only_its_part_in_front() -> None:
    # A floor 1 m below, from 4 m ahead to 4 m behind: below row 11.5 + 20 / 4, none above.
    floor = np.array([(-4, -9, -1), (-4, 9, -1), (4, 9, -1), (4, -9, -1)], dtype=float)
    mask = render(floor[None], CAMERA)
    assert not mask[:17].any()
    assert np.all(mask[17:] == 255)


def test_several_patches_are_drawn_together() -> None:
    patches = cardbox_patches(BodyModel.of(distance_m=3.0), reference_posture("front"))
    together = render(patches, CAMERA)
    alone = [render(patch[None], CAMERA) for patch in patches]
    np.testing.assert_array_equal(together, np.bitwise_or.reduce(alone))
    assert together.any()
