"""The volumetric model of the comparison: seven boxes over the same sizes as the cardbox."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cardbox_tracker.person.cardbox import PATCH_NAMES, cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_JOINTS
from lab.experiments.volumetric import (
    LEFT_ARM_FACES,
    N_FACES,
    PART_NAMES,
    RIGHT_ARM_FACES,
    TRUNK_FACES,
    volumetric_faces,
)

BODY = BodyModel()
REST = np.zeros(N_JOINTS)
ANY_POSTURE = arrays(np.float64, N_JOINTS, elements=st.floats(-3.1, 3.1))


def faces_of(part: str, posture: np.ndarray = REST) -> np.ndarray:
    first = 6 * PART_NAMES.index(part)
    return volumetric_faces(BODY, posture)[first : first + 6]


def test_there_are_42_faces_in_three_groups() -> None:
    assert N_FACES == 42
    assert volumetric_faces(BODY, REST).shape == (42, 4, 3)
    groups = (TRUNK_FACES, LEFT_ARM_FACES, RIGHT_ARM_FACES)
    assert [i for group in groups for i in range(42)[group]] == list(range(42))
    owners = [name for name in PART_NAMES for _ in range(6)]
    assert {name.split("_")[0] for name in owners[LEFT_ARM_FACES]} == {"left"}
    assert {name.split("_")[0] for name in owners[RIGHT_ARM_FACES]} == {"right"}


@pytest.mark.parametrize(
    ("part", "low", "high"),
    [
        ("torso", (-2.11, -0.17, -0.33), (-1.89, 0.17, 0.03)),
        ("waist", (-2.11, -0.165, -0.50), (-1.89, 0.165, -0.33)),
        ("head", (-2.06, -0.085, 0.09), (-1.86, 0.085, 0.33)),
        ("left_upper_arm", (-2.05, 0.13, -0.29), (-1.95, 0.23, -0.02)),
        ("left_forearm", (-2.0425, 0.1375, -0.65), (-1.9575, 0.2225, -0.29)),
        ("right_upper_arm", (-2.05, -0.23, -0.29), (-1.95, -0.13, -0.02)),
        ("right_forearm", (-2.0425, -0.2225, -0.65), (-1.9575, -0.1375, -0.29)),
    ],
)
def test_each_box_spans_its_sizes(part: str, low: tuple[float], high: tuple[float]) -> None:
    corners = faces_of(part).reshape(-1, 3)
    np.testing.assert_allclose(corners.min(axis=0), low, atol=1e-12)
    np.testing.assert_allclose(corners.max(axis=0), high, atol=1e-12)


def test_the_torsos_bottom_has_its_own_width() -> None:
    corners = faces_of("torso").reshape(-1, 3)
    bottom = corners[corners[:, 2] < -0.3]
    assert np.abs(bottom[:, 1]).max() == pytest.approx(0.15)


@pytest.mark.parametrize("part", PART_NAMES)
def test_the_faces_of_a_part_close_it(part: str) -> None:
    # In a closed surface of quads every corner is in three faces and every edge in two.
    faces = faces_of(part).round(9)
    corners, counts = np.unique(faces.reshape(-1, 3), axis=0, return_counts=True)
    assert len(corners) == 8
    assert set(counts.tolist()) == {3}
    edges: dict[frozenset[tuple[float, ...]], int] = {}
    for face in faces:
        for a, b in zip(face, np.roll(face, -1, axis=0), strict=True):
            edge = frozenset((tuple(a.tolist()), tuple(b.tolist())))
            edges[edge] = edges.get(edge, 0) + 1
    assert len(edges) == 12
    assert set(edges.values()) == {2}


@given(ANY_POSTURE)
def test_every_face_stays_plane(posture: np.ndarray) -> None:
    faces = volumetric_faces(BODY, posture)
    np.testing.assert_allclose(np.linalg.det(faces[:, 1:] - faces[:, :1]), 0, atol=1e-12)


@given(ANY_POSTURE)
def test_the_box_of_a_part_is_centred_on_its_patches(posture: np.ndarray) -> None:
    patches = cardbox_patches(BODY, posture)
    for part in PART_NAMES:
        frontal = patches[PATCH_NAMES.index(f"{part}_frontal")]
        np.testing.assert_allclose(
            faces_of(part, posture).mean(axis=(0, 1)), frontal.mean(axis=0), atol=1e-12
        )


@given(arrays(np.float64, (2, 2, N_JOINTS), elements=st.floats(-3.1, 3.1)))
def test_many_postures_at_once_are_each_alone(postures: np.ndarray) -> None:
    together = volumetric_faces(BODY, postures)
    assert together.shape == (2, 2, 42, 4, 3)
    for index in np.ndindex(2, 2):
        alone = volumetric_faces(BODY, postures[index])
        np.testing.assert_allclose(together[index], alone, atol=1e-12)
