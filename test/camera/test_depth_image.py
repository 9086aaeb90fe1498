"""Depth images that are packed as PNG, by hand."""

from __future__ import annotations

import struct
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.camera.depth_image import (
    at_size,
    decode_depth,
    depth_from_image,
    median_depth,
    unpack_depth,
)
from cardbox_tracker.camera.encodings import SentImage
from cardbox_tracker.common.errors import EncodingError


def packed(pixels: np.ndarray, a: float = 0.0, b: float = 0.0) -> bytes:
    """The bytes of a compressedDepth message: format, two parameters, PNG."""
    return struct.pack("<iff", 0, a, b) + cv2.imencode(".png", pixels)[1].tobytes()


def test_millimetres_are_stored_as_they_are() -> None:
    pixels = np.array([[0, 1500], [2300, 65_535]], np.uint16)
    depth_m = unpack_depth(packed(pixels), "16UC1; compressedDepth png")
    assert depth_m.dtype == np.float32
    assert np.allclose(depth_m, [[0.0, 1.5], [2.3, 65.535]])
    # Older releases do not name the format of the picture.
    assert np.array_equal(depth_m, unpack_depth(packed(pixels), "16UC1; compressedDepth"))


def test_metres_are_stored_as_inverse_depths() -> None:
    # 100 / 2 m + 5 = 55; 0 is unknown, and so is what would be behind the camera.
    pixels = np.array([[55, 0, 4]], np.uint16)
    depth_m = unpack_depth(packed(pixels, 100.0, 5.0), "32FC1; compressedDepth png")
    assert np.allclose(depth_m, [[2.0, 0.0, 0.0]])


def test_a_message_of_either_kind_is_read() -> None:
    pixels = np.full((3, 4), 1200, np.uint16)
    sent = SimpleNamespace(data=packed(pixels), format="16UC1; compressedDepth png")
    raw = SimpleNamespace(
        data=pixels.tobytes(), height=3, width=4, step=8, encoding="16UC1", is_bigendian=0
    )
    assert np.array_equal(depth_from_image(sent), depth_from_image(raw))


@pytest.mark.parametrize(
    ("encoding", "pixels"),
    [
        ("bgr8; jpeg compressed bgr8", np.zeros((2, 2), np.uint16)),
        ("16UC1; compressedDepth rvl", None),
        ("16UC1; compressedDepth png", np.zeros((2, 2), np.uint8)),
        ("16UC1; compressedDepth png", np.zeros((2, 2, 3), np.uint16)),
        ("8UC1; compressedDepth png", np.zeros((2, 2), np.uint16)),
    ],
)
def test_what_is_no_depth_is_refused(encoding: str, pixels: np.ndarray | None) -> None:
    data = packed(pixels) if pixels is not None else bytes(40)
    with pytest.raises(EncodingError, match="expected '16UC1"):
        unpack_depth(data, encoding)


@pytest.mark.promise("No input fills memory, disk or log, or holds up a program")
@pytest.mark.parametrize(("width", "height"), [(20_000, 15_000), (60_000, 60_000), (2**31, 1)])
@pytest.mark.parametrize("kind", ["16UC1", "32FC1"])
def test_a_depth_image_too_large_is_refused_before_memory_is_taken(
    kind: str, width: int, height: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = bytearray(packed(np.full((4, 4), 7, np.uint16)))
    # The size follows the message's header, the magic number and the name of the first chunk.
    data[12 + 16 : 12 + 24] = struct.pack(">II", width, height)
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("it was decoded"))
    with pytest.raises(EncodingError, match=rf"{width}x{height} .*33\.6 million"):
        unpack_depth(bytes(data), f"{kind}; compressedDepth png")
    with pytest.raises(EncodingError, match=rf"{width}x{height} .*33\.6 million"):
        decode_depth(SentImage(b"", height, width, 4 * width, kind, is_bigendian=False))


def test_what_opencv_cannot_decode_is_refused_in_our_words(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise cv2.error("(-215:Assertion failed) pixels <= CV_IO_MAX_IMAGE_PIXELS")

    data = packed(np.full((4, 4), 7, np.uint16))
    monkeypatch.setattr(cv2, "imdecode", fail)
    with pytest.raises(EncodingError, match="expected '16UC1"):
        unpack_depth(data, "16UC1; compressedDepth png")


@given(st.binary(max_size=60), st.booleans())
def test_broken_bytes_are_refused(data: bytes, is_begun: bool) -> None:
    begun = packed(np.full((4, 4), 7, np.uint16))[:24] if is_begun else b""
    with pytest.raises(EncodingError):
        unpack_depth(begun + data, "16UC1; compressedDepth png")


@pytest.mark.promise("Depth in another unit or of another view is refused with a reason")
@pytest.mark.parametrize("packing", ["32FC1", "32FC1; compressedDepth png"])
def test_millimetres_for_metres_are_told(packing: str) -> None:
    depth = np.full((4, 6), 2300.0, np.float32)
    depth[0], depth[1, 0] = 0.0, np.nan
    if ";" in packing:
        # n = a / z + b with a = 2,300,000 is 1,000.
        pixels = np.where(depth > 0, 1000, 0).astype(np.uint16)
        message = SimpleNamespace(data=packed(pixels, 2.3e6), format=packing)
    else:
        message = raw_depth(depth)
    with pytest.raises(EncodingError, match=r"2\.3e\+03 or more, .* divide them by 1000"):
        depth_from_image(message)


@pytest.mark.promise("Depth in another unit or of another view is refused with a reason")
def test_depth_of_32_bit_that_is_labelled_as_16_is_told() -> None:
    message = raw_depth(np.full((4, 6), 2.3))
    message.encoding = "16UC1"
    with pytest.raises(EncodingError, match=r"24 bytes .* expected 12 .* 32FC1"):
        depth_from_image(message)
    # Padding is empty, however long it is.
    padded = np.zeros((4, 12), np.uint16)
    padded[:, :6] = 2300
    message.data = padded.tobytes()
    np.testing.assert_allclose(depth_from_image(message), np.full((4, 6), 2.3))


@pytest.mark.promise("Depth in another unit or of another view is refused with a reason")
@pytest.mark.parametrize(
    ("size", "is_same"),
    [((640, 480), True), ((160, 120), True), ((640, 360), False), ((1280, 1024), False)],
)
def test_depth_of_another_shape_has_another_view(size: tuple[int, int], is_same: bool) -> None:
    depth_m = np.ones((size[1], size[0]), np.float32)
    if is_same:
        assert at_size(depth_m, 320, 240).shape == (240, 320)
    else:
        with pytest.raises(EncodingError, match=f"{size[0]}x{size[1]}, another shape .* 320x240"):
            at_size(depth_m, 320, 240)
    # The working size of a film is rounded to eight pixels.
    assert at_size(np.ones((1080, 1920), np.float32), 368, 208).shape == (208, 368)


def raw_depth(depth: np.ndarray) -> SimpleNamespace:
    height, width = depth.shape
    size = {"height": height, "width": width, "step": 4 * width}
    data = depth.astype(np.float32).tobytes()
    return SimpleNamespace(data=data, encoding="32FC1", is_bigendian=0, **size)


def test_a_few_far_values_are_no_other_unit() -> None:
    """Stereo measures almost the same place in both images as very far away."""
    depth = np.full((4, 6), 2.0, np.float32)
    depth[0], depth[1] = 5000.0, np.inf
    assert np.array_equal(depth_from_image(raw_depth(depth)), np.where(depth < 1e9, depth, 0.0))
    for nothing in (0.0, np.nan, np.inf, -1.0, -np.inf):
        assert not depth_from_image(raw_depth(np.full((4, 6), nothing))).any()


def test_the_median_is_of_what_is_known() -> None:
    depths = [np.array([[1.0, 0.0, 0.0]]), np.array([[3.0, 2.0, np.nan]]), np.array([[4.0, 0, 0]])]
    found = median_depth([depth.astype(np.float32) for depth in depths])
    np.testing.assert_array_equal(found, [[3.0, 2.0, 0.0]])
