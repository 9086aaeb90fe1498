from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from learning.bodies.colours import Palette, painted
from learning.bodies.outfit import Outfit, along_limbs, shirt_of, wearing
from learning.bodies.rigged import INDEX, RiggedBody

PALETTE = Palette((1, 1, 1), (2, 2, 2), (3, 3, 3), (4, 4, 4), (5, 5, 5))


def first(name: str) -> int:
    """The first vertex of the triangle at a joint."""
    return 3 * INDEX[name]


def test_limbs_are_measured_from_joint_to_joint(stick: RiggedBody) -> None:
    down = along_limbs(stick, "upper_arm", "forearm", "hand")
    names = ("left_upper_arm", "right_forearm", "left_hand", "chest")
    assert [down[first(name)] for name in names] == pytest.approx([0, 1, 2, -1], abs=1e-6)


def test_the_shirt_covers_what_its_sleeves_reach(stick: RiggedBody) -> None:
    def cover(sleeve: float) -> np.ndarray:
        return shirt_of(stick, Outfit(sleeve=sleeve))

    elbow, hand = first("left_forearm"), first("left_hand")
    assert cover(0.5)[elbow] == 0
    assert cover(1.5)[elbow] == pytest.approx(0.7)
    assert cover(1.9)[hand] == 0
    assert cover(1.9)[first("chest")] == pytest.approx(1)
    assert cover(1.9)[first("left_shin")] == 0


def test_loose_cloth_stands_off_and_leaves_skin_alone(stick: RiggedBody) -> None:
    loose = wearing(stick, Outfit(loose_m=0.04), np.random.default_rng(1))
    off = np.linalg.norm(loose.vertices - stick.vertices, axis=1)
    assert 0.4 * 0.04 <= off[first("chest")] <= 0.04
    assert off[first("left_hand")] == off[first("head")] == off[first("left_foot")] == 0


def test_a_skirt_hangs_from_the_waist_to_the_knees(stick: RiggedBody) -> None:
    dressed = wearing(stick, Outfit(skirt_m=0.1), np.random.default_rng(1))
    added = dressed.vertices[len(stick.vertices) :]
    assert (added[:, 2].min(), added[:, 2].max()) == pytest.approx((0.35, 0.9), abs=1e-5)
    left = added[:, 1] > 0.05
    weights = dressed.weights[len(stick.vertices) :]
    assert (weights[left, INDEX["left_thigh"]] >= weights[left, INDEX["right_thigh"]]).all()
    corners = dressed.vertices[dressed.faces[len(stick.faces) :]]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("fi,fi->f", outward[:, :2], corners.mean(axis=1)[:, :2]) > 0).all()


def test_the_tail_of_a_shirt_has_the_colour_of_the_shirt(stick: RiggedBody) -> None:
    outfit = Outfit(loose_m=0.03, tail_m=0.15)
    dressed = wearing(stick, outfit, np.random.default_rng(1))
    added = dressed.vertices[len(stick.vertices) :]
    assert (added[:, 2].min(), added[:, 2].max()) == pytest.approx((0.65, 0.95), abs=1e-5)
    colours = painted(dressed, outfit, PALETTE, len(stick.vertices)).colours
    assert (colours[len(stick.vertices) :] == 3).all()


def test_colours_follow_the_clothes(stick: RiggedBody) -> None:
    outfit = Outfit(sleeve=0.5, trouser=1.9, hem_m=-0.1)
    body = painted(stick, outfit, PALETTE, len(stick.vertices))
    named = {
        "left_hand": 1,
        "left_forearm": 1,
        "head": 1,
        "neck": 1,
        "chest": 3,
        "left_collar": 3,
        "right_upper_arm": 3,
        "hips": 3,
        "left_shin": 4,
        "right_foot": 5,
    }
    for name, colour in named.items():
        assert body.colours[first(name)].tolist() == [colour] * 3, name
    short = painted(stick, replace(outfit, sleeve=1.5, hem_m=0.1), PALETTE, len(stick.vertices))
    assert short.colours[first("left_forearm"), 0] == 3
    assert short.colours[first("hips"), 0] == 4
