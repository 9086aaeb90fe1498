"""The size vector: its order, its subsets, its defaults."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.common.errors import BodyModelError
from cardbox_tracker.person.model import CONSTANTS, BodyModel
from cardbox_tracker.person.sizes import (
    DEFAULT_SIZES,
    N_SIZES,
    SIZE_INDEX,
    SIZE_LIMITS,
    SIZE_NAMES,
    SUBSETS,
)


def test_there_are_18_sizes_with_names_of_their_own() -> None:
    assert N_SIZES == len(SIZE_NAMES) == len(set(SIZE_NAMES)) == 18
    assert [SIZE_NAMES[SIZE_INDEX[name]] for name in SIZE_NAMES] == list(SIZE_NAMES)


def test_each_subset_holds_what_its_view_shows() -> None:
    assert SIZE_NAMES[SUBSETS["O1"]] == (
        "torso_top_width",
        "torso_bottom_width",
        "torso_height",
        "waist_width",
        "waist_height",
        "head_width",
        "head_height",
        "neck_length",
    )
    assert SIZE_NAMES[SUBSETS["O2"]] == ("torso_depth", "waist_depth", "head_depth", "head_offset")
    assert SIZE_NAMES[SUBSETS["O3"]] == (
        "shoulder_breadth",
        "shoulder_drop",
        "upper_arm_length",
        "upper_arm_width",
        "forearm_length",
        "forearm_width",
    )


def test_the_defaults_lie_well_inside_the_limits() -> None:
    assert SIZE_LIMITS.shape == (18, 2)
    assert np.all(SIZE_LIMITS[:, 0] < DEFAULT_SIZES)
    assert np.all(SIZE_LIMITS[:, 1] > DEFAULT_SIZES)


def test_the_default_person_is_built_like_an_adult_of_172_cm() -> None:
    # From mid-hip to the crown: 17 + 36 + 6 + 24 cm.
    model = BodyModel()
    names = ("waist_height", "torso_height", "neck_length", "head_height")
    assert sum(model.size(name) for name in names) == pytest.approx(0.83)


@pytest.mark.parametrize("array", [DEFAULT_SIZES, SIZE_LIMITS, BodyModel().sizes])
def test_shared_arrays_cannot_be_changed(array: np.ndarray) -> None:
    with pytest.raises(ValueError, match="read-only"):
        array[0] = 1.0


def test_a_body_keeps_its_sizes_when_the_array_it_came_from_changes() -> None:
    sizes = DEFAULT_SIZES.copy()
    model = BodyModel.of(sizes=sizes)
    sizes[0] = 0.5
    assert model.size("torso_top_width") == 0.34


@pytest.mark.parametrize("name", SIZE_NAMES)
def test_every_size_is_checked_and_named(name: str) -> None:
    for bad in (float("nan"), float("inf"), -1.0, 3.0):
        sizes = DEFAULT_SIZES.copy()
        sizes[SIZE_INDEX[name]] = bad
        with pytest.raises(BodyModelError, match=f"^{name} is"):
            BodyModel.of(sizes=sizes)


@pytest.mark.parametrize("name", CONSTANTS)
def test_every_constant_is_checked_and_named(name: str) -> None:
    for bad in (float("nan"), -100.0, 100.0):
        with pytest.raises(BodyModelError, match=f"^{name} is"):
            BodyModel.of(**{name: bad})


@pytest.mark.parametrize("shape", [(17,), (18, 1), (0,)])
def test_a_size_vector_of_another_shape_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(BodyModelError, match=r"expected \(18,\)"):
        BodyModel.of(sizes=np.full(shape, 0.2))


def test_a_side_turn_is_left_or_right() -> None:
    with pytest.raises(BodyModelError, match="side_turn is 'back'"):
        BodyModel.of(side_turn="back")


def test_a_size_in_centimetres_or_millimetres_gets_a_hint() -> None:
    for value, hint in ((27.0, "centimetres"), (270.0, "millimetres")):
        sizes = DEFAULT_SIZES.copy()
        sizes[SIZE_INDEX["upper_arm_length"]] = value
        with pytest.raises(BodyModelError, match=hint):
            BodyModel.of(sizes=sizes)


def test_equality_and_hash_see_every_number() -> None:
    base = BodyModel()
    assert base == BodyModel()
    assert hash(base) == hash(BodyModel())
    changed = [BodyModel.of(side_turn="right")]
    changed += [BodyModel.of(**{name: base.constants[name] + 0.01}) for name in CONSTANTS]
    for i in range(N_SIZES):
        sizes = DEFAULT_SIZES.copy()
        sizes[i] += 0.001
        changed.append(BodyModel.of(sizes=sizes))
    assert base not in changed
    assert len({base, *changed}) == 1 + len(changed)
    assert base != "a body"


def test_a_body_is_printed_in_centimetres() -> None:
    lines = str(BodyModel()).splitlines()
    assert len(lines) == 18
    assert lines[0].split() == ["torso_top_width", "34.0", "cm"]


def test_values_change_their_own_part_alone() -> None:
    body = BodyModel.of(distance_m=2.5, camera_pitch_rad=0.1)
    moved = body.with_values(hip_height_m=-0.3, side_turn="right")
    assert moved.person is body.person
    assert moved.camera_pose == body.camera_pose
    assert (moved.placement.distance_m, moved.placement.hip_height_m) == (2.5, -0.3)
    assert moved.side_turn == "right"
    with pytest.raises(TypeError, match="stature"):
        body.with_values(stature=1.8)
