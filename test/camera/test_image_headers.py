"""The size of an image is known, and bounded, before anything is decoded."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.camera.encodings import (
    SentImage,
    decode_as_sent,
    decode_bgr,
    decode_compressed,
    decode_grey,
)
from cardbox_tracker.camera.image_headers import compressed_size
from cardbox_tracker.common.errors import EncodingError


def png_of(width: int, height: int) -> bytes:
    """Return a black PNG; of its rows there are no more than a hundred."""
    rows = zlib.compress((b"\0" + bytes(width)) * min(height, 100))

    def chunk(name: bytes, data: bytes) -> bytes:
        body = name + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    parts = chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + parts


def jpeg_of(width: int, height: int) -> bytes:
    """Return a small JPEG that says it has another size."""
    data = bytearray(cv2.imencode(".jpg", np.zeros((16, 16), np.uint8))[1].tobytes())
    at = data.index(b"\xff\xc0") + 5
    data[at : at + 4] = struct.pack(">HH", height, width)
    return bytes(data)


@pytest.mark.promise("No input fills memory, disk or log, or holds up a program")
@pytest.mark.parametrize("make", [png_of, jpeg_of])
@pytest.mark.parametrize(("width", "height"), [(20000, 15000), (65000, 65000), (8192, 4097)])
def test_an_image_too_large_is_refused_before_memory_is_taken(
    make: Callable[[int, int], bytes], width: int, height: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = make(width, height)
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("it was decoded"))
    with pytest.raises(EncodingError, match=rf"{width}x{height} .*33\.6 million"):
        decode_compressed(data)
    monkeypatch.undo()
    small = make(64, 48) if make is png_of else data_of(".jpg")
    assert decode_compressed(small).shape[:2] == (48, 64)
    with pytest.raises(EncodingError, match=r"0\.003 million"):
        decode_compressed(make(64, 48), most_pixels=3000)


def data_of(extension: str) -> bytes:
    return bytes(cv2.imencode(extension, np.zeros((48, 64), np.uint8))[1].tobytes())


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@pytest.mark.parametrize("extension", [".bmp", ".tiff", ".webp", ".pgm", ".jp2"])
def test_no_decoder_but_those_of_jpeg_and_png_is_reached(
    extension: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = data_of(extension)
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("it was decoded"))
    with pytest.raises(EncodingError, match=r"expected .*JPEG or PNG"):
        decode_compressed(data)


@pytest.mark.parametrize("decode", [decode_grey, decode_bgr, decode_as_sent])
def test_a_raw_image_too_large_is_refused_whatever_its_bytes(decode: Callable) -> None:
    with pytest.raises(EncodingError, match="60000x60000"):
        decode(SentImage(b"", 60000, 60000, 60000, "mono8"))


@given(st.binary(max_size=60), st.sampled_from([b"\xff\xd8", b"\x89PNG\r\n\x1a\n", b""]))
def test_any_header_has_a_size_or_is_refused(data: bytes, magic: bytes) -> None:
    try:
        assert min(compressed_size(magic + data)) > 0
    except EncodingError as error:
        assert "JPEG" in str(error)


@given(st.integers(1, 40), st.integers(1, 40), st.sampled_from([".jpg", ".png"]), st.booleans())
def test_the_size_in_the_header_is_that_of_the_pixels(
    width: int, height: int, extension: str, progressive: bool
) -> None:
    options = [cv2.IMWRITE_JPEG_PROGRESSIVE, int(progressive)] if extension == ".jpg" else []
    image = np.zeros((height, width, 3), np.uint8)
    data = cv2.imencode(extension, image, options)[1].tobytes()
    assert compressed_size(data) == (width, height)
    assert decode_compressed(data).shape[:2] == (height, width)
