"""What a person is to do is drawn where they can follow it, and read from two metres away."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.applications.drawing.guidance import (
    FIT_BGR,
    MOOD_BGR,
    Asked,
    Guide,
    draw_guidance,
)
from cardbox_tracker.applications.drawing.overlay import TEXT_BGR
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.measuring.config import InitializationConfig
from cardbox_tracker.measuring.guidance import HOLD_STILL, Prompt, measuring, short_words
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import REFERENCE_NAMES, reference_posture

BODY = BodyModel()
CAMERA = Camera(320, 240, 330.0, 330.0, 159.5, 119.5)
EMPTY = np.zeros((240, 320), np.uint8)
BAND = 72


def coloured(image: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    return np.abs(image.astype(int) - colour).max(axis=2) < 30


def asked(name: str, fit: str = "far", side_turn: str = "left") -> Asked:
    return Asked(BODY, CAMERA, reference_posture(name, side_turn), fit)


@pytest.mark.parametrize("scale", [1, 2])
@pytest.mark.parametrize("name", REFERENCE_NAMES)
def test_outline_surrounds_the_wanted_posture(name: str, scale: int) -> None:
    image = draw_guidance(EMPTY, "", asked=asked(name), scale=scale)
    assert image.shape == ((240 + BAND) * scale, 320 * scale, 3)
    rows, columns = np.nonzero(coloured(image[BAND * scale :], FIT_BGR["far"]))
    view = CAMERA.scaled(320 * scale, 240 * scale)
    posture = reference_posture(name)
    pixels = view.project(view.reference_to_optical(pose(BODY.rigid, posture).keypoints_m))
    assert columns.min() < pixels[:, 0].min()
    assert columns.max() > pixels[:, 0].max()
    assert rows.min() < pixels[:, 1].min()


@pytest.mark.parametrize("name", REFERENCE_NAMES)
@pytest.mark.parametrize("number", [1, 60])
def test_nothing_is_written_over_the_person(name: str, number: int) -> None:
    outlined = asked(name, "fits")
    image = draw_guidance(EMPTY, short_words(name, "right"), "ask", number, outlined)
    without = draw_guidance(EMPTY, "", "ask", None, outlined)
    changed = np.any(image != without, axis=2)
    assert changed[:BAND].any() and changed[BAND:].any()
    for edge in (changed[:, 0], changed[:, -1], changed[0], changed[-1]):
        assert not edge.any(), "cut off"
    assert not np.any(changed[BAND:] & coloured(without, FIT_BGR["fits"])[BAND:])


@pytest.mark.parametrize(
    "words",
    [
        *(short_words(name, turn) for name in REFERENCE_NAMES for turn in ("left", "right")),
        *(HOLD_STILL, measuring(0.5).words, "Step into the picture", "Step back, please"),
    ],
)
def test_words_are_large_enough_for_two_metres(words: str) -> None:
    """Capitals of a thirtieth of the image or more: 9 mm where it is shown 27 cm high."""
    band = draw_guidance(EMPTY, words, scale=4)[: 4 * BAND]
    rows = coloured(band, TEXT_BGR).any(axis=1)
    heights = np.diff(np.flatnonzero(np.diff(np.concatenate([[False], rows, [False]]))))[::2]
    assert 1 <= len(heights) <= 2
    assert heights.min() >= 4 * 240 / 30


@pytest.mark.parametrize("mood", list(MOOD_BGR))
def test_the_band_says_how_it_went(mood: str) -> None:
    band = draw_guidance(EMPTY, "Good.", mood)[:BAND]
    assert coloured(band, MOOD_BGR[mood]).mean() > 0.5


def test_colour_and_tick_say_how_well_it_fits() -> None:
    shown = {fit: draw_guidance(EMPTY, "", asked=asked("front", fit)) for fit in FIT_BGR}
    for fit, image in shown.items():
        for other, colour in FIT_BGR.items():
            assert coloured(image, colour).any() == (fit == other)
    corner = slice(BAND, BAND + 60), slice(240, 320)
    assert [bool(shown[fit][corner].any()) for fit in FIT_BGR] == [False, False, True]


@pytest.mark.parametrize(("side_turn", "mirror"), [("left", False), ("right", True)])
def test_nose_and_arrow_point_to_where_the_face_turns(side_turn: str, mirror: bool) -> None:
    """Who turns to their own left looks to the right of the image; a mirror swaps that."""
    image = draw_guidance(EMPTY, "", asked=asked("side", "far", side_turn), mirror=mirror)[BAND:]
    arrow = coloured(image, TEXT_BGR)
    rows, columns = np.nonzero(arrow)
    assert columns[rows == rows.min()].mean() > 160 + 30, "its tip"
    outline = coloured(image, FIT_BGR["far"])
    head = outline[: rows.min() - 20].any(axis=0)
    nose = np.flatnonzero(head)
    assert nose.max() - 160 > 160 - nose.min() + 3
    front = draw_guidance(EMPTY, "", asked=asked("front"))
    assert not coloured(front, TEXT_BGR).any(), "no arrow where nobody turns"


def test_a_mirror_swaps_the_image_and_not_the_words() -> None:
    picture = EMPTY.copy()
    picture[:, :100] = 200
    plain, mirrored = (
        draw_guidance(picture, "Hold still", "ask", 3, mirror=mirror) for mirror in (False, True)
    )
    np.testing.assert_array_equal(plain[:BAND], mirrored[:BAND])
    bottom = slice(BAND + 120, None)
    np.testing.assert_array_equal(plain[bottom, ::-1], mirrored[bottom])
    number = slice(BAND, BAND + 80), slice(0, 60)
    assert coloured(mirrored[number], TEXT_BGR).any()


def test_the_number_can_be_left_out() -> None:
    images = [draw_guidance(EMPTY, "go", "ask", n) for n in (None, 3, 4)]
    assert np.any(images[0] != images[1])
    assert np.any(images[1] != images[2])


def person(name: str, aside_m: float) -> np.ndarray:
    posture = reference_posture(name)
    posture[0] = aside_m
    body = BodyModel.of(hip_height_m=-0.3)
    drawn = draw_guidance(EMPTY, "", asked=Asked(body, CAMERA, posture))[BAND:]
    seen = np.zeros((240, 320), np.uint8)
    seen[coloured(drawn, FIT_BGR["far"])] = 255
    rows, columns = np.nonzero(seen)
    for row in np.unique(rows):
        seen[row, columns[rows == row].min() : columns[rows == row].max() + 1] = 255
    return seen


def test_the_outline_stands_where_the_person_does() -> None:
    guide = Guide(CAMERA, InitializationConfig(2.0))
    middles = []
    for aside_m in (-0.3, 0.3):
        image = guide.draw(Prompt("front", "x"), person("front", aside_m), None, False)[304:]
        outline = sum(coloured(image, colour) for colour in FIT_BGR.values())
        middles.append(np.nonzero(outline)[1].mean() / 2)
    # 0.3 m at 2 m are 330 * 0.15 = 49.5 px.
    assert middles == pytest.approx([159.5 - 49.5, 159.5 + 49.5], abs=6)


def test_the_person_stands_out_of_the_image_and_without_one_of_black() -> None:
    guide = Guide(CAMERA, InitializationConfig(2.0))
    seen = person("front", 0.0)
    wall = np.full((240, 320, 3), (40, 80, 120), np.uint8)
    image = guide.draw(measuring(0.5), seen, wall, mirror=False)[144:]
    assert image[-1, 0].tolist() == [20, 40, 60]
    place = np.argwhere(seen)[np.count_nonzero(seen) // 2]
    assert image[tuple(2 * place)].tolist() == [40, 80, 120]
    assert np.all(wall == (40, 80, 120)), "the image itself stays as it is"
    assert not guide.draw(measuring(0.5), seen, None, mirror=False)[144:][-1, 0].any()
