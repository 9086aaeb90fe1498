"""Reference silhouettes: what is refused, in which words, and where the person stands."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.measuring.references import (
    aligned_iou,
    average_silhouette,
    check_reference,
    check_references,
    lateral_m,
    rounded_down,
    rounded_up,
)
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import REFERENCE_NAMES, SIDE_TURNS, reference_posture

CAMERA = Camera(160, 120, 165.0, 165.0, 79.5, 59.5)
BODY = BodyModel.of(hip_height_m=-0.51)


def seen(name: str, torso_y_m: float = 0.0, side_turn: str = "left") -> np.ndarray:
    posture = reference_posture(name, side_turn)
    posture[0] = torso_y_m
    return render(cardbox_patches(BODY, posture), CAMERA)


def all_seen() -> dict[str, np.ndarray]:
    return {name: seen(name) for name in REFERENCE_NAMES}


def block(rows: slice, columns: slice) -> np.ndarray:
    silhouette = np.zeros((120, 160), np.uint8)
    silhouette[rows, columns] = 255
    return silhouette


@pytest.mark.parametrize("side_turn", SIDE_TURNS)
@pytest.mark.parametrize("torso_y_m", [-0.1, 0.0, 0.1])
def test_good_references_pass(side_turn: str, torso_y_m: float) -> None:
    check_references({name: seen(name, torso_y_m, side_turn) for name in REFERENCE_NAMES})


def test_what_has_two_digits_is_not_rounded() -> None:
    """In binary, 29 hundredths are less than that, and 7 are more."""
    assert (rounded_down(0.29), rounded_up(0.07)) == ("0.29", "0.07")


def test_the_average_is_the_majority() -> None:
    rows = ([0, 0, 0, 1], [0, 0, 1, 1], [0, 1, 1, 1])
    images = [np.array([row], np.uint8) * 255 for row in rows]
    average = average_silhouette(images)
    assert average.dtype == np.uint8
    assert average.tolist() == [[0, 0, 255, 255]]
    # A tie is background.
    assert average_silhouette(images[:2]).tolist() == [[0, 0, 0, 255]]


def test_no_silhouette_at_all_is_refused() -> None:
    with pytest.raises(InitializationError, match=r"no silhouette.*times"):
        average_silhouette([])


@pytest.mark.parametrize(
    ("name", "advice"),
    [
        ("front", "face the camera, arms 20 degrees away"),
        ("side", "turn by 90 degrees"),
        ("arms", "both arms stretched sideways"),
    ],
)
def test_nobody_in_the_image_is_refused(name: str, advice: str) -> None:
    # 2 % of 160 x 120 px are 384; these are 380, which is never told as 2.0 %.
    references = all_seen() | {name: block(slice(10, 20), slice(10, 48))}
    expected = rf"'{name}': nobody .*1\.9 % .*{advice}"
    with pytest.raises(InitializationError, match=expected):
        check_references(references)
    check_reference(name, block(slice(10, 26), slice(10, 34)))  # 384 px


def test_an_image_full_of_foreground_is_refused() -> None:
    with pytest.raises(
        InitializationError,
        match=r"'front': 81 % .*learn it again",
    ):
        check_reference("front", block(slice(6, 114), slice(8, 152)))


@pytest.mark.parametrize(
    ("border", "rows", "columns"),
    [
        ("left", slice(10, 80), slice(0, 40)),
        ("right", slice(10, 80), slice(120, 160)),
        ("upper", slice(0, 80), slice(60, 100)),
    ],
)
@pytest.mark.parametrize("name", REFERENCE_NAMES)
def test_a_person_cut_off_at_a_border_is_refused(
    name: str, border: str, rows: slice, columns: slice
) -> None:
    with pytest.raises(
        InitializationError,
        match=f"'{name}': .*cut off .*{border} border.*; step back",
    ):
        check_reference(name, block(rows, columns))


def test_legs_may_leave_the_image() -> None:
    check_reference("front", block(slice(10, 120), slice(60, 100)))


def test_an_arm_that_reaches_the_border_is_refused() -> None:
    with pytest.raises(InitializationError, match=r"'arms': .*cut off .*right"):
        check_references({name: seen(name, 0.35) for name in REFERENCE_NAMES})


def test_whoever_did_not_turn_is_told_so() -> None:
    references = all_seen() | {"side": seen("front", 0.1)}
    with pytest.raises(
        InitializationError,
        match=r"'front' and 'side' .*IoU .*0\.80.* turn;.*'side' again: turn by 90 degrees",
    ):
        check_references(references)


def test_whoever_did_not_raise_the_arms_is_told_so() -> None:
    with pytest.raises(
        InitializationError,
        match=r"'front' and 'arms' .*IoU .* raised; .*'arms' again: .*arms stretched sideways",
    ):
        check_references(all_seen() | {"arms": seen("front")})


def test_missing_references_are_named() -> None:
    references = all_seen()
    del references["front"], references["arms"]
    with pytest.raises(InitializationError, match=r"missing.* front, arms; capture"):
        check_references(references)


def test_references_of_several_cameras_are_refused() -> None:
    references = all_seen() | {"side": np.zeros((240, 320), np.uint8)}
    with pytest.raises(
        InitializationError,
        match=r"\(120, 160\), \(240, 320\).*one camera",
    ):
        check_references(references)


def test_an_unknown_reference_is_an_error_of_the_program() -> None:
    with pytest.raises(ValueError, match="'back'"):
        check_reference("back", seen("front"))


@pytest.mark.parametrize(
    ("columns", "expected"),
    [
        (slice(60, 100), 1.0),  # the same
        (slice(20, 60), 1.0),  # moved aside
        (slice(110, 150), 1.0),
        (slice(60, 80), 0.5),  # half as wide, in the middle of it
        (slice(30, 110), 0.5),  # twice as wide
    ],
)
def test_likeness_by_hand(columns: slice, expected: float) -> None:
    first, second = block(slice(20, 90), slice(60, 100)), block(slice(20, 90), columns)
    assert aligned_iou(first, second) == pytest.approx(expected)
    assert aligned_iou(second, first) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("columns", "expected_m"),
    [
        (slice(70, 91), 0.5 / 165 * 2),  # the middle column is 80, half a pixel right of 79.5
        (slice(10, 31), -59.5 / 165 * 2),
        (slice(140, 151), 65.5 / 165 * 2),
    ],
)
def test_lateral_place_by_hand(columns: slice, expected_m: float) -> None:
    assert lateral_m(block(slice(30, 90), columns), CAMERA, 2.0) == pytest.approx(expected_m)


def test_only_head_and_chest_say_where_the_person_stands() -> None:
    silhouette = block(slice(30, 90), slice(70, 91))
    silhouette[51:90, 70:150] = 255
    assert lateral_m(silhouette, CAMERA, 2.0) == pytest.approx(0.5 / 165 * 2)


@pytest.mark.parametrize("name", REFERENCE_NAMES)
@pytest.mark.parametrize("torso_y_m", [-0.2, 0.0, 0.15])
def test_lateral_place_of_a_person(name: str, torso_y_m: float) -> None:
    """Within two pixels of 1.2 cm; from the side the head lies 4 cm forward of the torso's axis."""
    found = lateral_m(seen(name, torso_y_m), CAMERA, BODY.placement.distance_m)
    assert found == pytest.approx(torso_y_m, abs=0.025 + (0.04 if name == "side" else 0.0))
