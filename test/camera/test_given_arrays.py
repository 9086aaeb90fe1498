"""Masks, images and depth images as people have them, by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cardbox_tracker.camera.given_arrays import depth_from, image_from, silhouette_from

PERSON = np.array([[0, 0, 1, 0], [0, 1, 1, 1], [0, 1, 1, 0]], np.uint8)
SILHOUETTE = 255 * PERSON
GREY = np.array([[0, 127, 128, 3], [90, 255, 200, 129], [0, 254, 128, 127]], np.uint8)


def read_only(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array


@pytest.mark.parametrize(
    "given",
    [
        PERSON > 0,
        PERSON,
        SILHOUETTE,
        GREY,
        *(PERSON.astype(kind) for kind in "bBhHiIlLefdg"),
        *(GREY.astype(kind) for kind in "BhHiIlLefdg"),
        SILHOUETTE[..., None],
        SILHOUETTE.astype(">i4"),
        read_only(SILHOUETTE.copy()),
        np.repeat(np.repeat(PERSON, 2, 0), 3, 1)[::2, ::3],
        np.ascontiguousarray(SILHOUETTE[::-1, ::-1])[::-1, ::-1],
        np.asfortranarray(PERSON > 0),
        np.where(PERSON, 0.5, 0.49),
        np.where(PERSON, 0.97, 0.03).astype(np.float32),
        SILHOUETTE.tolist(),
    ],
)
def test_every_mask_is_the_same_silhouette(given: Any) -> None:
    silhouette = silhouette_from(given, size=(3, 4))
    np.testing.assert_array_equal(silhouette, SILHOUETTE)
    assert silhouette.dtype == np.uint8
    assert silhouette.flags.c_contiguous and silhouette.flags.writeable
    assert silhouette is not given


@pytest.mark.parametrize("kind", [np.bool_, np.uint8, np.int32, np.float32])
def test_an_empty_mask_shows_nobody(kind: type) -> None:
    assert not silhouette_from(np.zeros((3, 4), kind)).any()


def test_a_mask_of_low_levels_shows_nobody() -> None:
    """Levels of 2 to 127 are the noise of a compressed mask."""
    assert not silhouette_from(np.full((3, 4), 127, np.uint8)).any()
    assert not silhouette_from(np.full((3, 4), 0.4)).any()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (np.where(PERSON, np.nan, 0), "values that are nan; expected bool, 0 and 1"),
        (np.where(PERSON, np.inf, 0), "from 0 to inf"),
        (-PERSON.astype(int), "from -1 to 0; expected"),
        (257 * SILHOUETTE.astype(np.uint16), "to 65535; expected"),
        (SILHOUETTE.T, r"shape \(4, 3\); the camera's is \(3, 4\): resize it"),
        (SILHOUETTE[None], r"shape \(1, 3, 4\); expected \(3, 4\)"),
        (np.zeros((3, 4, 3), np.uint8), r"expected \(3, 4\): give one"),
        (np.zeros((0, 4)), r"expected \(3, 4\)"),
        (np.float32(1), r"shape \(\); expected"),
        (PERSON.astype(object), "of object; expected an array of numbers"),
        (PERSON.astype(complex), "of complex128; expected"),
        (PERSON.astype(str), "expected an array of numbers"),
        ([[1], [1, 0]], "no array of numbers"),
        (None, "type NoneType, of object"),
        ("mask.png", "type str, of "),
    ],
)
def test_what_is_no_mask_is_refused_in_words(given: Any, words: str) -> None:
    with pytest.raises(ValueError, match=f"^the mask .*{words}"):
        silhouette_from(given, "the mask", (3, 4))


IMAGE = np.arange(36, dtype=np.uint8).reshape(3, 4, 3) * 7


@pytest.mark.parametrize(
    "given",
    [
        IMAGE,
        read_only(IMAGE.copy()),
        np.asfortranarray(IMAGE),
        IMAGE[..., ::-1].copy()[..., ::-1],
        *(IMAGE.astype(kind) for kind in "hHiIlLefd"),
        IMAGE / 255,
        (IMAGE / 255).astype(np.float32),
        IMAGE + 0.4,
    ],
)
@pytest.mark.parametrize("channel", [slice(None), 0, slice(0, 1)])
def test_every_image_has_the_same_levels(given: np.ndarray, channel: Any) -> None:
    image = image_from(given[..., channel], size=(3, 4))
    np.testing.assert_array_equal(image, IMAGE[..., 0 if channel == slice(0, 1) else channel])
    assert image.dtype == np.uint8 and image.flags.c_contiguous


def test_an_image_of_bytes_is_not_copied() -> None:
    assert image_from(IMAGE) is IMAGE


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (np.zeros((3, 4, 4), np.uint8), r"leave out its fourth channel, as image\[\.\.\., :3\]"),
        (np.zeros((3, 3, 4), np.uint8), "leave out"),
        (np.zeros((3, 4, 2), np.uint8), "convert it to grey or to bgr"),
        (np.zeros((0, 4), np.uint8), "expected"),
        (IMAGE[:2], r"shape \(2, 4, 3\); the camera's is \(3, 4\)"),
        (IMAGE > 9, "bool; .* this is a mask"),
        (IMAGE.astype(np.uint16) * 257, "to 62965; .* .16 bits: divide by 257"),
        (IMAGE - 100.0, "from -100 to 145; expected levels"),
        (np.full((3, 4), np.nan), "values that are nan"),
        (IMAGE.astype(object), "expected an array of numbers"),
    ],
)
def test_what_is_no_image_is_refused_in_words(given: Any, words: str) -> None:
    with pytest.raises(ValueError, match=f"^image .*{words}"):
        image_from(given, size=(3, 4))


def test_unknown_depths_are_zero() -> None:
    given = np.array([[np.nan, np.inf, -np.inf, -1.0], [0.0, 2.5, 99.0, 1e300]])
    for array in (given, given[..., None], np.asfortranarray(given)):
        depth_m = depth_from(array, size=(2, 4))
        np.testing.assert_array_equal(depth_m, [[0, 0, 0, 0], [0, 2.5, 99, 0]])
        assert depth_m.dtype == np.float32 and depth_m.flags.c_contiguous
    assert not depth_from(np.full((2, 4), np.nan)).any()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (np.full((2, 4), 2500, np.uint16), "uint16, .* millimetres; .* divide them by 1000"),
        (np.array([[0, 0, np.nan, 2500.0], [0, 0, 101, 101]]), "is 101 or more, .*millimetres"),
        (np.full((2, 4), True), "bool"),
        (np.zeros((4, 2)), r"shape \(4, 2\); the camera's is \(2, 4\)"),
        (np.zeros((2, 4, 2)), r"expected \(2, 4\)"),
    ],
)
def test_what_is_no_depth_is_refused_in_words(given: Any, words: str) -> None:
    with pytest.raises(ValueError, match=f"depth_m .*{words}"):
        depth_from(given, size=(2, 4))
