"""Images and videos of rare kinds are read as what they show, or refused in words."""

from __future__ import annotations

import io
import itertools
import struct
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from cardbox_tracker.camera.encodings import SentImage, decode_as_sent, decode_compressed
from cardbox_tracker.common.errors import BagError, CardboxError, EncodingError
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.open_images import open_images

FOV = GivenCamera(fov_deg=60.0)
READ = "Any damaged or hostile input is read or refused with a reason"


def encoded(extension: str, image: np.ndarray, *options: int) -> bytes:
    return bytes(cv2.imencode(extension, image, list(options))[1].tobytes())


def halves(height: int = 48, width: int = 64) -> np.ndarray:
    """Return an image whose left half is blue and whose right half is white."""
    image = np.full((height, width, 3), 255, np.uint8)
    image[:, : width // 2] = (200, 40, 20)
    return image


def as_cmyk(image: np.ndarray) -> bytes:
    """Return a JPEG of four inks without black, inverted as Adobe writes them."""
    pillow = pytest.importorskip("PIL.Image")

    inks = np.dstack([255 - image[..., ::-1], np.zeros(image.shape[:2], np.uint8)])
    file = io.BytesIO()
    pillow.fromarray(inks, "CMYK").save(file, "JPEG", quality=95)
    return file.getvalue()


KINDS: dict[str, Callable[[np.ndarray], bytes]] = {
    "progressive": lambda image: encoded(".jpg", image, cv2.IMWRITE_JPEG_PROGRESSIVE, 1),
    "CMYK": as_cmyk,
    "16 bit": lambda image: encoded(".png", image.astype(np.uint16) * 257),
    "alpha": lambda image: encoded(".png", np.dstack([image, image[..., :1]])),
    "odd": lambda image: encoded(".png", image),
}


@pytest.mark.promise(READ)
@pytest.mark.parametrize("kind", KINDS)
def test_an_image_shows_what_it_shows(kind: str) -> None:
    shape = (5, 7) if kind == "odd" else (48, 64)
    image = halves(*shape)
    found = decode_compressed(KINDS[kind](image))
    assert found.dtype == np.uint8
    assert found.shape == image.shape
    error = np.abs(found.astype(int) - image)
    # JPEG blurs the edge between the halves.
    edge = shape[1] // 2
    assert max(error[:, : edge - 2].max(), error[:, edge + 2 :].max()) <= 12


@pytest.mark.promise(READ)
@pytest.mark.parametrize("size", [(1, 1), (7, 5), (1, 65_000)])
@pytest.mark.parametrize("extension", [".jpg", ".png"])
def test_odd_sizes_are_read(extension: str, size: tuple[int, int], tmp_path: Path) -> None:
    data = encoded(extension, np.full((size[1], size[0], 3), 80, np.uint8))
    (tmp_path / f"1{extension}").write_bytes(data)
    with open_images(tmp_path, FOV) as images:
        (image,) = images.images()
        assert image.as_sent.shape == (size[1], size[0], 3)


@pytest.mark.promise(READ)
def test_why_no_image_of_a_folder_can_be_read_is_told(tmp_path: Path) -> None:
    (tmp_path / "1.png").write_bytes(encoded(".png", np.zeros((6000, 8000), np.uint8)))
    with (
        pytest.raises(BagError, match=r"1\.png: an image of 8000x6000 is larger than the 33\.6"),
        open_images(tmp_path, FOV),
    ):
        pass


@pytest.mark.promise(READ)
@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("padding", [0, 1, 13])
def test_padded_rows_in_either_byte_order(padding: int, big: bool) -> None:
    values = np.arange(35, dtype=np.uint16).reshape(5, 7) * 1800
    rows = values.astype(">u2" if big else "<u2").view(np.uint8)
    data = np.pad(rows, ((0, 0), (0, padding)), constant_values=255).tobytes()
    found = decode_as_sent(SentImage(data, 5, 7, 14 + padding, "mono16", big))
    assert np.array_equal(found, values >> 8)
    with pytest.raises(EncodingError, match="incomplete"):
        decode_as_sent(SentImage(data[:-1], 5, 7, 14 + padding, "mono16", big))


def film(path: Path, count: int, width: int = 64, height: int = 48) -> bytearray:
    code = cv2.VideoWriter.fourcc(*("mp4v" if path.suffix == ".mp4" else "MJPG"))
    writer = cv2.VideoWriter(str(path), code, 30.0, (width, height))
    for number in range(count):
        writer.write(np.full((height, width, 3), 10 * number, np.uint8))
    writer.release()
    return bytearray(path.read_bytes())


def read(path: Path) -> list[int]:
    """Return the stamps of a video, whose images must have one size."""
    with open_images(path, FOV) as video:
        found = list(video.images())
        assert len({image.as_sent.shape for image in found}) <= 1
    return [image.stamp_ns for image in found]


def in_box(data: bytearray, box: bytes, offset: int, value: int) -> None:
    """Replace a number in a box of an MP4 file."""
    struct.pack_into(">I", data, data.index(box) + offset, value)


@pytest.mark.promise(READ)
@pytest.mark.parametrize(
    ("box", "offset", "value", "count"),
    [
        (b"stts", 16, 0, 12),  # all images at one time
        (b"stts", 16, 2**31 - 1, None),  # hours between two images
        (b"stsz", 12, 2**32 - 1, None),  # four billion images
        (b"stsz", 12, 0, None),  # no image
        (b"mdhd", 16, 0, None),  # no unit of time
        (b"tkhd", 84, 2**32 - 1, None),  # a picture 65,535 px wide
    ],
)
def test_numbers_of_a_video_that_cannot_be(
    tmp_path: Path, box: bytes, offset: int, value: int, count: int | None
) -> None:
    data = film(tmp_path / "film.mp4", 12)
    in_box(data, box, offset, value)
    (tmp_path / "film.mp4").write_bytes(data)
    try:
        stamps = read(tmp_path / "film.mp4")
    except BagError:
        assert count is None
    else:
        assert all(one < other for one, other in itertools.pairwise(stamps))
        assert count in (None, len(stamps))


@pytest.mark.promise(READ)
def test_images_of_a_video_that_claim_a_huge_size_are_refused(tmp_path: Path) -> None:
    data = film(tmp_path / "film.avi", 3)
    at = -1
    while (at := data.find(b"\xff\xc0", at + 1)) > 0:
        data[at + 5 : at + 9] = struct.pack(">HH", 15_000, 20_000)
    (tmp_path / "film.avi").write_bytes(data)
    with pytest.raises(BagError, match="no image that can be decoded"):
        read(tmp_path / "film.avi")


@pytest.mark.promise(READ)
@pytest.mark.parametrize("suffix", [".mp4", ".avi"])
@pytest.mark.parametrize("seed", range(10))
def test_a_damaged_video(tmp_path: Path, suffix: str, seed: int) -> None:
    path = tmp_path / f"film{suffix}"
    data, rng = film(path, 8), np.random.default_rng(seed)
    for at in rng.integers(0, len(data), 8):
        data[at] = rng.integers(256)
    path.write_bytes(data[: rng.integers(len(data) // 2, len(data))] if seed % 2 else data)
    try:
        read(path)
    except CardboxError as error:
        assert 0 < len(str(error)) < 2000


@pytest.mark.promise(READ)
def test_an_8k_video_is_read(tmp_path: Path) -> None:
    film(tmp_path / "film.mp4", 2, 7680, 4320)
    assert len(read(tmp_path / "film.mp4")) == 2


@pytest.mark.promise(READ)
def test_the_images_of_a_variable_rate_have_their_own_times(tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    data = film(path, 12)
    (per_s,) = struct.unpack_from(">I", data, data.index(b"mdhd") + 16)
    spacings = [per_s // 30 * count for count in (1, 1, 5, 1, 2, 30, 1, 1, 1, 3, 1, 1)]
    table = b"".join(struct.pack(">II", 1, spacing) for spacing in spacings)
    at = data.index(b"stts") - 4
    (size,) = struct.unpack_from(">I", data, at)
    box = struct.pack(">I4sII", 16 + len(table), b"stts", 0, len(spacings)) + table
    # The boxes around it grow, and the whole is longer than it was; the images stand before them.
    for name in (b"moov", b"trak", b"mdia", b"minf", b"stbl"):
        start = data.index(name) - 4
        (before,) = struct.unpack_from(">I", data, start)
        struct.pack_into(">I", data, start, before + len(box) - size)
    in_box(data, b"elst", 12, 2**31 - 1)
    data[at : at + size] = box
    path.write_bytes(data)
    expected = np.concatenate([[0], np.cumsum(spacings[:-1])]) / per_s
    np.testing.assert_allclose(np.array(read(path)) / 1e9, expected, atol=1e-3)


@pytest.mark.promise(READ)
def test_a_video_of_16_bit_is_read_as_8(tmp_path: Path) -> None:
    path = tmp_path / "film.mkv"
    code = cv2.VideoWriter.fourcc(*"FFV1")
    options = [cv2.VIDEOWRITER_PROP_DEPTH, cv2.CV_16U, cv2.VIDEOWRITER_PROP_IS_COLOR, 0]
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, 30.0, (64, 48), options)
    if not writer.isOpened():
        pytest.skip("this OpenCV writes no video of 16 bit")
    image = np.full((48, 64), 65_535, np.uint16)
    image[:, :32] = 200 * 257
    for _ in range(5):
        writer.write(image)
    writer.release()
    with open_images(path, FOV) as video:
        found = [one.as_sent for one in video.images()]
    assert [(one.dtype, one.shape) for one in found] == [(np.uint8, (48, 64, 3))] * 5
    assert np.abs(found[0][:, [10, 50]].mean(axis=(0, 2)) - [200, 255]).max() < 3
