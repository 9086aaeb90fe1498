"""The range of images of 16 bits."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.camera.encodings import Levels, SentImage, decode_as_sent, decode_compressed

GREY = np.random.default_rng(1).integers(0, 256, (120, 160), dtype=np.uint8)


@pytest.mark.parametrize("is_bigendian", [False, True])
@pytest.mark.parametrize("encoding", ["mono16", "16UC1"])
@pytest.mark.parametrize("bits", range(8, 17))
def test_images_of_any_number_of_bits_give_the_brightness_of_eight(
    bits: int, encoding: str, is_bigendian: bool
) -> None:
    words = GREY.astype(np.uint16) << (bits - 8)
    data = words.astype(">u2" if is_bigendian else "<u2").tobytes()
    np.testing.assert_array_equal(
        decode_as_sent(SentImage(data, 120, 160, 320, encoding, is_bigendian)), GREY
    )
    ok, png = cv2.imencode(".png", words)
    assert ok
    np.testing.assert_array_equal(decode_compressed(png), GREY)


@given(low=st.integers(17_000, 60_000), span=st.integers(256, 1_200), seed=st.integers(0, 1_000))
def test_a_narrow_range_of_temperatures_keeps_60_levels(low: int, span: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    image = rng.integers(low, low + span, (96, 128)).astype(np.uint16)
    scaled = Levels()(image)
    assert len(np.unique(scaled)) >= 60
    order = np.argsort(image, axis=None)
    assert np.all(np.diff(scaled.ravel()[order].astype(int)) >= 0)


@pytest.mark.parametrize("bits", range(8, 17))
def test_who_stands_before_a_plain_wall_keeps_the_brightness(bits: int) -> None:
    """The scale is that of the camera, not of the wall."""
    levels, shift = Levels(), bits - 8
    wall = np.random.default_rng(0).integers(167, 186, (120, 160)).astype(np.uint16)
    np.testing.assert_array_equal(levels(wall << shift), wall)
    person = wall.copy()
    person[30:, 60:90] = GREY[30:, 60:90]
    np.testing.assert_array_equal(levels(person << shift), person)


def test_all_images_have_one_scale_until_most_of_one_lies_outside() -> None:
    levels = Levels()
    dark = (GREY.astype(np.uint16) << 2) // 2
    levels(dark)
    person = dark.copy()
    person[:60, :40] = 4000
    scaled = levels(person)
    assert levels.changes == 1
    np.testing.assert_array_equal(scaled[60:], (dark >> 1)[60:])
    assert np.all(scaled[:60, :40] == 255)
    levels(np.full((120, 160), 12_000, np.uint16))
    assert levels.changes == 2


def test_a_faulty_pixel_does_not_set_the_scale() -> None:
    image = GREY.astype(np.uint16) << 2
    image[0, 0] = 65535
    assert np.array_equal(Levels()(image)[1:], GREY[1:])


def test_the_scale_is_told_unless_all_bits_are_used() -> None:
    levels = Levels()
    levels(GREY.astype(np.uint16) << 2)
    assert "0 to 1023 are scaled to 0 to 255" in levels.text
    levels(GREY.astype(np.uint16) << 8)
    assert levels.text == ""
