"""Decoding of images, against mosaics and rows made by hand."""

from __future__ import annotations

import array

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from cardbox_tracker.camera.encodings import (
    SUPPORTED_ENCODINGS,
    SentImage,
    decode_as_sent,
    decode_bgr,
    decode_compressed,
    decode_grey,
)
from cardbox_tracker.common.errors import EncodingError

Bytes = NDArray[np.uint8]

BLUE, GREEN, RED = (200, 40, 20), (30, 180, 60), (10, 50, 220)
H, W = 6, 8
BYTES_PER_PIXEL = {"rgb8": 3, "bgr8": 3, "8UC3": 3, "rgba8": 4, "bgra8": 4, "8UC4": 4} | {
    "yuv422": 2,
    "yuv422_yuy2": 2,
    "yuyv": 2,
    "uyvy": 2,
    "mono16": 2,
    "16UC1": 2,
    "rgb16": 6,
    "bgr16": 6,
    "16UC3": 6,
    "rgba16": 8,
    "bgra16": 8,
    "16UC4": 8,
    **{f"bayer_{pattern}16": 2 for pattern in ("rggb", "bggr", "gbrg", "grbg")},
}
# Rows of a message in rows of the image: brightness first, then colours.
ROWS = {"nv12": 1.5, "nv21": 1.5, "nv24": 3}


def expected_grey(bgr: tuple[int, int, int]) -> float:
    """Brightness after ITU-R BT.601."""
    return 0.114 * bgr[0] + 0.587 * bgr[1] + 0.299 * bgr[2]


def padded(rows: Bytes, padding: int) -> bytes:
    """Rows (H, bytes) with junk behind each of them."""
    junk = np.full((len(rows), padding), 255, np.uint8)
    return np.hstack([rows, junk]).tobytes()


def mosaic(pattern: str, bgr: tuple[int, int, int]) -> Bytes:
    """An image of one colour through a Bayer filter whose first four pixels are ``pattern``."""
    level = dict(zip("bgr", bgr, strict=True))
    cell = np.array([level[c] for c in pattern], np.uint8).reshape(2, 2)
    return np.tile(cell, (H // 2, W // 2))


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
@pytest.mark.parametrize("colour", [BLUE, GREEN, RED])
def test_a_bayer_pattern_is_named_after_its_first_four_pixels(
    pattern: str, colour: tuple[int, int, int]
) -> None:
    raw = mosaic(pattern, colour)
    image = decode_bgr(SentImage(raw.tobytes(), H, W, W, f"bayer_{pattern}8"))
    np.testing.assert_array_equal(image, np.broadcast_to(colour, (H, W, 3)))
    grey = decode_grey(SentImage(raw.tobytes(), H, W, W, f"bayer_{pattern}8"))
    np.testing.assert_allclose(grey, expected_grey(colour), atol=1.0)


@pytest.mark.parametrize(
    ("encoding", "order"),
    [
        *[("rgb8", "rgb"), ("bgr8", "bgr"), ("rgba8", "rgba"), ("bgra8", "bgra")],
        *[("8UC3", "bgr"), ("8UC4", "bgra")],
    ],
)
def test_colour_channels_are_in_the_order_of_the_name(encoding: str, order: str) -> None:
    level = dict(zip("bgra", (*RED, 99), strict=True))
    raw = np.tile(np.array([level[c] for c in order], np.uint8), (H, W))
    image = decode_bgr(SentImage(padded(raw, 5), H, W, raw.shape[1] + 5, encoding))
    np.testing.assert_array_equal(image, np.broadcast_to(RED, (H, W, 3)))
    grey = decode_grey(SentImage(padded(raw, 5), H, W, raw.shape[1] + 5, encoding))
    np.testing.assert_allclose(grey, expected_grey(RED), atol=1.0)


@pytest.mark.parametrize(
    ("encoding", "luma", "u"),
    [("yuv422", 1, 0), ("uyvy", 1, 0), ("yuv422_yuy2", 0, 1), ("yuyv", 0, 1)],
)
def test_yuv422_brightness_is_the_luma_and_u_makes_blue(encoding: str, luma: int, u: int) -> None:
    raw = np.full((H, 2 * W), 128, np.uint8)
    brightness = np.arange(40, 40 + H * W, dtype=np.uint8).reshape(H, W)
    raw[:, luma::2] = brightness
    np.testing.assert_array_equal(
        decode_grey(SentImage(padded(raw, 3), H, W, 2 * W + 3, encoding)), brightness
    )
    neutral = decode_bgr(SentImage(raw.tobytes(), H, W, 2 * W, encoding)).astype(int)
    assert np.ptp(neutral, axis=2).max() <= 1
    raw[:, u::4] = 200
    blue = decode_bgr(SentImage(raw.tobytes(), H, W, 2 * W, encoding)).astype(int)
    assert np.all(blue[..., 0] > blue[..., 2] + 50)


@pytest.mark.parametrize(("order", "is_bigendian"), [(">u2", True), ("<u2", False)])
def test_mono16_honours_its_byte_order(order: str, is_bigendian: bool) -> None:
    values = np.arange(H * W).reshape(H, W) * 1300 + 7
    raw = values.astype(order).view(np.uint8)
    grey = decode_grey(SentImage(padded(raw, 6), H, W, 2 * W + 6, "mono16", is_bigendian))
    np.testing.assert_array_equal(grey, values // 256)


def test_mono8_of_a_message_is_not_copied() -> None:
    data = array.array("B", range(H * W))
    grey = decode_grey(SentImage(data, H, W, W, "mono8"))
    data[9] = 222
    assert grey[1, 1] == 222


@pytest.mark.parametrize("kind", [bytes, bytearray, memoryview, np.array])
def test_every_kind_of_bytes_is_read(kind: type) -> None:
    source = np.arange(H * W, dtype=np.uint8)
    data = kind(source) if kind is np.array else kind(source.tobytes())
    np.testing.assert_array_equal(decode_grey(SentImage(data, H, W, W, "mono8")).ravel(), source)


@given(
    height=st.integers(1, 9),
    width=st.integers(1, 9),
    padding=st.integers(0, 5),
    seed=st.integers(0, 2**32 - 1),
)
def test_padding_never_reaches_the_image(height: int, width: int, padding: int, seed: int) -> None:
    pixels = np.random.default_rng(seed).integers(0, 256, (height, width), dtype=np.uint8)
    grey = decode_grey(SentImage(padded(pixels, padding), height, width, width + padding, "mono8"))
    np.testing.assert_array_equal(grey, pixels)


@pytest.mark.parametrize("encoding", SUPPORTED_ENCODINGS)
def test_every_encoding_gives_bytes_of_the_images_size(encoding: str) -> None:
    step = W * BYTES_PER_PIXEL.get(encoding, 1) + 4
    data = bytes(int(H * ROWS.get(encoding, 1)) * step)
    grey, bgr = (
        decode(SentImage(data, H, W, step, encoding)) for decode in (decode_grey, decode_bgr)
    )
    assert (grey.shape, grey.dtype.name) == ((H, W), "uint8")
    assert (bgr.shape, bgr.dtype.name) == ((H, W, 3), "uint8")


@pytest.mark.parametrize("encoding", ["32FC1", "", "MONO8", "yuv420"])
def test_an_unknown_encoding_is_named_with_the_supported_ones(encoding: str) -> None:
    with pytest.raises(EncodingError) as error:
        decode_grey(SentImage(bytes(H * W), H, W, W, encoding))
    assert f"'{encoding}'" in str(error.value)
    assert all(name in str(error.value) for name in SUPPORTED_ENCODINGS)


@pytest.mark.parametrize("encoding", SUPPORTED_ENCODINGS)
@pytest.mark.parametrize("decode", [decode_grey, decode_bgr])
def test_too_few_bytes_are_refused_with_both_counts(encoding: str, decode: object) -> None:
    step = W * BYTES_PER_PIXEL.get(encoding, 1)
    count = int(H * ROWS.get(encoding, 1)) * step
    with pytest.raises(EncodingError, match=rf"{encoding}.*{count - 1}.*{count}"):
        decode(SentImage(bytes(count - 1), H, W, step, encoding))  # type: ignore[operator]


@pytest.mark.parametrize(
    ("height", "width", "step", "encoding"),
    [(H, W, W - 1, "mono8"), (H, W, W, "rgb8"), (0, W, W, "mono8"), (H, 0, 0, "bgr8")],
)
def test_a_size_that_cannot_be_is_refused(
    height: int, width: int, step: int, encoding: str
) -> None:
    with pytest.raises(EncodingError, match=encoding):
        decode_grey(SentImage(bytes(1000), height, width, step, encoding))


@pytest.mark.parametrize("encoding", ["yuv422", "yuv422_yuy2"])
def test_an_odd_width_is_refused_where_two_pixels_share_colour(encoding: str) -> None:
    with pytest.raises(EncodingError, match="even"):
        decode_grey(SentImage(bytes(1000), H, 7, 14, encoding))


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
@pytest.mark.parametrize("shape", [(1, 1), (1, 8), (8, 2), (2, 2)])
@pytest.mark.parametrize("decode", [decode_grey, decode_bgr])
def test_a_mosaic_too_small_to_interpolate_is_refused(
    pattern: str, shape: tuple[int, int], decode: object
) -> None:
    h, w = shape
    with pytest.raises(EncodingError, match="3x3"):
        decode(SentImage(bytes([90]) * (h * w), h, w, w, f"bayer_{pattern}8"))  # type: ignore[operator]


@pytest.mark.parametrize("shape", [(3, 3), (3, 8), (5, 3)])
@pytest.mark.parametrize("decode", [decode_grey, decode_bgr])
def test_a_mosaic_of_odd_size_has_no_black_border(shape: tuple[int, int], decode: object) -> None:
    h, w = shape
    image = decode(SentImage(bytes([90]) * (h * w), h, w, w, "bayer_grbg8"))  # type: ignore[operator]
    np.testing.assert_array_equal(image, 90)


@pytest.mark.parametrize("extension", [".jpg", ".png"])
def test_compressed_images_come_with_the_channels_they_have(extension: str) -> None:
    for image in (np.full((40, 48), 90, np.uint8), np.full((40, 48, 3), GREEN, np.uint8)):
        data = cv2.imencode(extension, image)[1].tobytes()
        np.testing.assert_allclose(decode_compressed(array.array("B", data)), image, atol=4)


@pytest.mark.parametrize(
    ("encoding", "shape"),
    [("mono8", (H, W)), ("mono16", (H, W)), ("bgr8", (H, W, 3)), ("bayer_rggb8", (H, W, 3))],
)
def test_an_image_as_sent_has_colours_if_its_encoding_has(
    encoding: str, shape: tuple[int, ...]
) -> None:
    step = W * BYTES_PER_PIXEL.get(encoding, 1)
    assert decode_as_sent(SentImage(bytes(H * step), H, W, step, encoding)).shape == shape


@pytest.mark.parametrize("data", [b"", b"\xff\xd8\xff", b"no image at all" * 9])
def test_bytes_that_are_no_image_are_refused(data: bytes) -> None:
    with pytest.raises(EncodingError, match=f"{len(data)} bytes"):
        decode_compressed(data)


@pytest.mark.parametrize("extension", [".jpg", ".png"])
def test_an_image_cut_short_is_refused(extension: str) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (60, 80), dtype=np.uint8)
    data = cv2.imencode(extension, noise)[1].tobytes()
    with pytest.raises(EncodingError, match="JPEG or PNG"):
        decode_compressed(data[: len(data) // 2])


def test_zeros_behind_a_jpeg_do_no_harm() -> None:
    data = cv2.imencode(".jpg", np.full((16, 16), 77, np.uint8))[1].tobytes()
    np.testing.assert_allclose(decode_compressed(data + bytes(100)), 77, atol=2)


@pytest.mark.parametrize(("height", "width"), [(0, 0), (0, 4), (4, 0)])
def test_an_image_without_pixels_is_told_as_such(height: int, width: int) -> None:
    with pytest.raises(EncodingError, match=f"{width}x{height}; .*one pixel"):
        decode_grey(SentImage(b"", height, width, 0, "mono8"))


def scene() -> Bytes:
    """A smooth image of many colours, (48, 64, 3)."""
    v, u = np.mgrid[:48, :64] / (48, 64)[0]
    return np.clip(np.dstack([60 + 90 * u, 90 + 80 * v, 180 - 60 * u]), 0, 255).astype(np.uint8)


def sent_as(encoding: str, bgr: Bytes) -> tuple[bytes, int]:
    """The data of a message with the image, and the bytes of its rows."""
    width = bgr.shape[1]
    y, u, v = np.moveaxis(cv2.cvtColor(bgr, cv2.COLOR_BGR2YUV), 2, 0)
    if encoding in ("nv12", "nv21"):
        rows = cv2.cvtColor(bgr, cv2.COLOR_BGR2YUV_I420)
        u, v = rows[len(bgr) :].reshape(2, len(bgr) // 2, width // 2)
        pairs = np.dstack([u, v] if encoding == "nv12" else [v, u])
        return rows[: len(bgr)].tobytes() + pairs.tobytes(), width
    if encoding == "nv24":
        return y.tobytes() + np.dstack([u, v]).tobytes(), width
    if encoding == "8UC1":
        return cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY).tobytes(), width
    if encoding in ("bgr16", "16UC3"):
        return (bgr.astype("<u2") << 8).tobytes(), 6 * width
    colours = np.empty_like(y)
    colours[:, ::2], colours[:, 1::2] = u[:, ::2], v[:, ::2]
    order = [y, colours] if encoding in ("yuyv", "yuv422_yuy2") else [colours, y]
    return np.dstack(order).tobytes(), 2 * width


@pytest.mark.parametrize(
    "encoding",
    [
        *["yuyv", "uyvy", "yuv422", "yuv422_yuy2", "nv12", "nv21", "nv24"],
        *["8UC1", "bgr16", "16UC3"],
    ],
)
def test_every_encoding_gives_the_colours_of_the_scene(encoding: str) -> None:
    bgr = scene()
    data, step = sent_as(encoding, bgr)
    image = decode_as_sent(SentImage(data, *bgr.shape[:2], step, encoding))
    expected = bgr if image.ndim == 3 else cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY)
    assert np.abs(image.astype(int) - expected).mean() < (0.5 if image.ndim == 2 else 2)
    grey = decode_grey(SentImage(data, *bgr.shape[:2], step, encoding))
    brightness = cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY)
    assert np.abs(grey.astype(int) - brightness).mean() < 1


@pytest.mark.parametrize("encoding", ["nv12", "nv21", "nv24"])
def test_rows_of_two_planes_may_be_padded_or_count_the_colours(encoding: str) -> None:
    bgr = scene()
    data, step = sent_as(encoding, bgr)
    expected = decode_bgr(SentImage(data, 48, 64, step, encoding))
    rows = np.frombuffer(data, np.uint8).reshape(-1, 64)
    np.testing.assert_array_equal(
        decode_bgr(SentImage(padded(rows, 8), 48, 64, 72, encoding)), expected
    )
    np.testing.assert_array_equal(decode_bgr(SentImage(data, 48, 64, 96, encoding)), expected)
