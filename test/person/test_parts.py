"""Where the parts begin and end, by hand, and that whoever draws a body takes it from there."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.person.cardbox import cardbox_patches, part_patches
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts, parts_of_bodies
from cardbox_tracker.person.sizes import DEFAULT_SIZES, SIZE_LIMITS
from lab.experiments.volumetric import volumetric_faces

REST = np.zeros(12)
SEEDS = st.integers(0, 2**32 - 1)


def random_sizes(seed: int, *count: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(*SIZE_LIMITS.T, (*count, 18))


def test_the_default_person_by_hand() -> None:
    parts = body_parts(DEFAULT_SIZES)
    assert (parts.waist.bottom_m, parts.waist.top_m) == (0.0, 0.17)
    assert (parts.torso.bottom_m, parts.torso.top_m) == pytest.approx((0.17, 0.53))
    assert (parts.torso.bottom_width_m, parts.torso.top_width_m) == (0.30, 0.34)
    assert parts.torso.mean_width_m == pytest.approx(0.32)
    assert (parts.neck.bottom_m, parts.neck.top_m) == pytest.approx((0.53, 0.59))
    assert (parts.head.bottom_m, parts.head.middle_m) == pytest.approx((0.59, 0.71))
    assert (parts.head.top_m, parts.head.forward_m) == pytest.approx((0.83, 0.04))
    assert (parts.upper_arm.bottom_m, parts.upper_arm.top_m) == (-0.27, 0.0)
    assert (parts.forearm.bottom_m, parts.forearm.depth_m) == (-0.36, 0.085)
    assert (parts.shoulder_aside_m, parts.shoulder_height_m) == pytest.approx((0.18, 0.48))


@given(SEEDS)
def test_many_bodies_are_each_alone(seed: int) -> None:
    sizes = random_sizes(seed, 3)
    together = parts_of_bodies(sizes, 0.5)
    for i, one in enumerate(sizes):
        alone = body_parts(one, 0.5)
        assert together.shoulder_aside_m[i] == alone.shoulder_aside_m
        assert together.shoulder_height_m[i] == alone.shoulder_height_m
        for many, part in zip(together[:6], alone[:6], strict=True):
            assert tuple(length[i] for length in many) == tuple(part)
        for many_corners, corners in zip(part_patches(sizes), part_patches(one), strict=True):
            np.testing.assert_array_equal(many_corners[i], corners)


@given(SEEDS)
def test_cardbox_and_volumetric_model_span_the_same(seed: int) -> None:
    body = BodyModel.of(random_sizes(seed))
    patches = cardbox_patches(body, REST)
    corners = volumetric_faces(body, REST)
    for axis in range(3):
        assert patches[..., axis].min() == pytest.approx(corners[..., axis].min())
        assert patches[..., axis].max() == pytest.approx(corners[..., axis].max())


@given(SEEDS)
def test_joints_are_where_the_parts_end(seed: int) -> None:
    body = BodyModel.of(random_sizes(seed), distance_m=3.0, hip_height_m=0.0)
    parts, frames = body_parts(body.sizes), pose(body.rigid, REST)
    assert frames.neck[2] == pytest.approx(parts.torso.top_m)
    assert frames.head[0] + 3.0 == pytest.approx(parts.head.forward_m)
    assert frames.head[2] == pytest.approx(parts.head.middle_m)
    for arm, side in ((frames.left, 1.0), (frames.right, -1.0)):
        expected = (-3.0, side * parts.shoulder_aside_m, parts.shoulder_height_m)
        assert arm.shoulder == pytest.approx(np.array(expected))
        assert arm.elbow[2] - arm.shoulder[2] == pytest.approx(parts.upper_arm.bottom_m)
        assert arm.hand[2] - arm.elbow[2] == pytest.approx(parts.forearm.bottom_m)


def test_a_neck_is_a_part_of_the_heads_width() -> None:
    neck = body_parts(DEFAULT_SIZES, 0.6).neck
    # From the torso's top 53 cm to the chin 59 cm above the hips, 0.6 x 17 cm wide.
    assert tuple(neck) == pytest.approx((0.53, 0.06, 0.102, 0.102, 0.102, 0.02))
