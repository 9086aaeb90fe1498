"""The 15 patches: corners by hand, and what holds in every posture."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cardbox_tracker.person.cardbox import (
    LEFT_ARM_PATCHES,
    PATCH_NAMES,
    RIGHT_ARM_PATCHES,
    TORSO_PATCHES,
    cardbox_patches,
)
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_JOINTS

BODY = BodyModel()
REST = np.zeros(N_JOINTS)
ANY_POSTURE = arrays(np.float64, N_JOINTS, elements=st.floats(-3.1, 3.1))


def patch(name: str, posture: np.ndarray = REST) -> np.ndarray:
    return cardbox_patches(BODY, posture)[PATCH_NAMES.index(name)]


def edges_m(corners: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.roll(corners, -1, axis=-2) - corners, axis=-1)


def extent_m(corners: np.ndarray) -> list[float]:
    return np.ptp(corners, axis=0).tolist()


def test_there_are_15_patches_in_three_groups() -> None:
    assert cardbox_patches(BODY, REST).shape == (15, 4, 3)
    assert len(set(PATCH_NAMES)) == 15
    assert all(n.startswith(("torso", "waist", "head")) for n in PATCH_NAMES[TORSO_PATCHES])
    assert all(n.startswith("left_") for n in PATCH_NAMES[LEFT_ARM_PATCHES])
    assert all(n.startswith("right_") for n in PATCH_NAMES[RIGHT_ARM_PATCHES])
    groups = (TORSO_PATCHES, LEFT_ARM_PATCHES, RIGHT_ARM_PATCHES)
    assert [i for group in groups for i in range(15)[group]] == list(range(15))


def test_the_heads_corners_by_hand() -> None:
    # Hips at (-2, 0, -0.5); chin 17 + 36 + 6 = 59 cm above them, crown 83 cm; 4 cm forward.
    expected = {(-1.96, -0.085, 0.09), (-1.96, 0.085, 0.09), (-1.96, 0.085, 0.33)}
    expected.add((-1.96, -0.085, 0.33))
    assert {tuple(corner) for corner in patch("head_frontal").round(9).tolist()} == expected
    expected = {(-2.06, 0.0, 0.09), (-1.86, 0.0, 0.09), (-1.86, 0.0, 0.33), (-2.06, 0.0, 0.33)}
    assert {tuple(corner) for corner in patch("head_sagittal").round(9).tolist()} == expected


def test_the_torso_is_a_trapezoid() -> None:
    corners = patch("torso_frontal")
    bottom, top = corners[corners[:, 2] < -0.1], corners[corners[:, 2] > -0.1]
    np.testing.assert_allclose(np.sort(bottom[:, 1]), (-0.15, 0.15), atol=1e-12)
    np.testing.assert_allclose(np.sort(top[:, 1]), (-0.17, 0.17), atol=1e-12)
    np.testing.assert_allclose(bottom[:, 2], -0.33)
    np.testing.assert_allclose(top[:, 2], 0.03, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "extent"),
    [
        ("torso_sagittal", (0.22, 0, 0.36)),
        ("torso_top", (0.22, 0.34, 0)),
        ("waist_frontal", (0, 0.33, 0.17)),
        ("waist_sagittal", (0.22, 0, 0.17)),
        ("head_frontal", (0, 0.17, 0.24)),
        ("head_sagittal", (0.20, 0, 0.24)),
        ("left_upper_arm_frontal", (0, 0.10, 0.27)),
        ("left_upper_arm_sagittal", (0.10, 0, 0.27)),
        ("right_forearm_frontal", (0, 0.085, 0.36)),
        ("right_forearm_sagittal", (0.085, 0, 0.36)),
    ],
)
def test_each_patch_spans_its_sizes(name: str, extent: tuple[float, ...]) -> None:
    np.testing.assert_allclose(extent_m(patch(name)), extent, atol=1e-12)


def test_the_parts_of_the_trunk_and_of_an_arm_join() -> None:
    def heights(name: str) -> tuple[float, float]:
        return patch(name)[:, 2].min(), patch(name)[:, 2].max()

    assert heights("waist_frontal") == pytest.approx((-0.5, -0.33))
    assert heights("torso_frontal")[0] == pytest.approx(-0.33)
    assert heights("torso_top") == pytest.approx((0.03, 0.03))
    assert heights("left_upper_arm_frontal") == pytest.approx((-0.29, -0.02))
    assert heights("left_forearm_frontal") == pytest.approx((-0.65, -0.29))


def test_a_raised_arm_takes_its_patches_along() -> None:
    raised = REST.copy()
    raised[4] = np.pi / 2
    forearm = patch("left_forearm_frontal", raised)
    assert np.sort(forearm[:, 1]) == pytest.approx([0.45, 0.45, 0.81, 0.81])
    np.testing.assert_array_equal(
        patch("right_forearm_frontal", raised), patch("right_forearm_frontal")
    )


@given(ANY_POSTURE)
def test_every_patch_stays_plane_and_keeps_its_edges(posture: np.ndarray) -> None:
    patches = cardbox_patches(BODY, posture)
    sides = patches[:, 1:] - patches[:, :1]
    # numpy's determinant divides by zero where an angle is nearly the least number.
    volumes = np.sum(np.cross(sides[:, 0], sides[:, 1]) * sides[:, 2], axis=-1)
    np.testing.assert_allclose(volumes, 0, atol=1e-12)
    np.testing.assert_allclose(edges_m(patches), edges_m(cardbox_patches(BODY, REST)), atol=1e-12)


@given(ANY_POSTURE)
def test_corners_go_around_every_patch(posture: np.ndarray) -> None:
    # A quadrilateral whose corners are in order is convex: all its turns have one direction.
    for corners in cardbox_patches(BODY, posture):
        edges = np.roll(corners, -1, axis=0) - corners
        turns = np.cross(edges, np.roll(edges, -1, axis=0))
        assert np.all(turns @ turns[0] > 0)


@given(ANY_POSTURE)
def test_the_two_patches_of_a_part_are_perpendicular(posture: np.ndarray) -> None:
    patches = cardbox_patches(BODY, posture)
    edges = np.roll(patches, -1, axis=1) - patches
    normals = np.cross(edges[:, 0], edges[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    for i, name in enumerate(PATCH_NAMES):
        if name.endswith("_frontal"):
            assert PATCH_NAMES[i + 1].endswith("_sagittal")
            assert normals[i] @ normals[i + 1] == pytest.approx(0, abs=1e-12)


@given(arrays(np.float64, (2, 2, N_JOINTS), elements=st.floats(-3.1, 3.1)))
def test_many_postures_at_once_are_each_alone(postures: np.ndarray) -> None:
    together = cardbox_patches(BODY, postures)
    assert together.shape == (2, 2, 15, 4, 3)
    for index in np.ndindex(2, 2):
        alone = cardbox_patches(BODY, postures[index])
        np.testing.assert_allclose(together[index], alone, atol=1e-12)
