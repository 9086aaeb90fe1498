"""The focal length that phones write into films and images."""

from __future__ import annotations

import struct
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from cardbox_tracker.camera.film_headers import shown_s
from cardbox_tracker.common.errors import CameraError
from cardbox_tracker.recordings.given_camera import GivenCamera, told_focal
from cardbox_tracker.recordings.open_images import open_images, tells_lens

KEYS = ("com.apple.quicktime.make", "com.apple.quicktime.camera.focal_length.35mm_equivalent")


def equivalent_mm(path: Path) -> float | None:
    told = told_focal(path)
    return None if told is None else told.focal


def box(kind: str, content: bytes) -> bytes:
    return struct.pack(">I4s", 8 + len(content), kind.encode()) + content


def metadata(value: bytes, version: bytes = b"") -> bytes:
    """Return a box ``meta`` with a maker and a value of the second key."""
    keys = b"".join(box("mdta", key.encode()) for key in KEYS)
    items = b"".join(
        struct.pack(">II", 8 + len(data), number) + data
        for number, data in ((1, box("data", struct.pack(">II", 1, 0) + b"me")), (2, value))
    )
    parts = box("keys", struct.pack(">II", 0, len(KEYS)) + keys) + box("ilst", items)
    return box("meta", version + parts)


def film(path: Path, size: tuple[int, int], *more: bytes) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 30.0, size)
    for _ in range(3):
        writer.write(np.full((size[1], size[0], 3), 90, np.uint8))
    writer.release()
    path.write_bytes(path.read_bytes() + b"".join(more))
    return path


@pytest.mark.parametrize(
    ("kind", "value"),
    [(21, struct.pack(">i", 26)), (22, b"\x1a"), (23, struct.pack(">f", 26)), (1, b"26")],
)
def test_the_focal_length_of_a_film_is_read(kind: int, value: bytes, tmp_path: Path) -> None:
    data = box("data", struct.pack(">II", kind, 0) + value)
    for number, more in enumerate(
        (
            box("moov", metadata(data)),
            box("moov", box("trak", metadata(data, bytes(4)))),
            box("free", bytes(5)) + box("moov", box("udta", metadata(data))),
        )
    ):
        path = film(tmp_path / f"{number}.mp4", (64, 48), more)
        assert equivalent_mm(path) == 26.0


def test_a_phones_film_needs_no_field_of_view(tmp_path: Path) -> None:
    """26 mm: the diagonal of 43.27 mm, 400 px, makes a focal length of 240.4 px."""
    more = box("moov", metadata(box("data", struct.pack(">IIi", 21, 0, 26))))
    for size in ((320, 240), (240, 320)):
        path = film(tmp_path / f"{size[0]}.mp4", size, more)
        assert tells_lens(path)
        with open_images(path) as images:
            assert images.calibration().k[0, 0] == pytest.approx(400 * 26 / 43.27)
            assert "the file tells the field of view" in images.remarks[0]
        with open_images(path, GivenCamera(45.0)) as images:
            assert images.remarks == []


@pytest.mark.parametrize(
    "value",
    [struct.pack(">II", 21, 0) + b"\xff" * 128, struct.pack(">II", 23, 0), b"", bytes(8)],
)
def test_metadata_that_are_no_number_say_nothing(value: bytes, tmp_path: Path) -> None:
    path = film(tmp_path / "f.mp4", (64, 48), box("moov", metadata(box("data", value))))
    assert equivalent_mm(path) is None
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA405] = (28, 29)
    Image.new("RGB", (40, 30)).save(tmp_path / "1.jpg", exif=exif)
    assert equivalent_mm(tmp_path / "1.jpg") is None


def test_a_film_of_boxes_is_read_to_a_limit(tmp_path: Path) -> None:
    path = tmp_path / "boxes.mp4"
    path.write_bytes(box("meta", b"") * 1_000_000)
    begin_s = time.process_time()
    assert equivalent_mm(path) is shown_s(path) is None
    assert time.process_time() - begin_s < 0.3


def test_images_of_a_phone_need_no_field_of_view(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA405] = 28
    Image.new("RGB", (400, 300)).save(tmp_path / "1.jpg", exif=exif)
    assert equivalent_mm(tmp_path / "1.jpg") == 28.0
    with open_images(tmp_path) as images:
        assert images.calibration().k[0, 0] == pytest.approx(500 * 28 / 43.27)


def test_without_any_word_a_usual_field_of_view_is_assumed_and_said(tmp_path: Path) -> None:
    for size in ((320, 240), (240, 320)):
        path = film(tmp_path / f"{size[0]}.mp4", size)
        assert not tells_lens(path)
        with open_images(path) as images:
            focal = images.calibration().k[0, 0]
            assert 2 * np.degrees(np.arctan(160 / focal)) == pytest.approx(65.0)
            assert "nothing tells the camera's field of view" in images.remarks[0]


@pytest.mark.parametrize(
    "content",
    [
        b"",
        box("moov", metadata(box("data", b"\0"))),
        box("moov", metadata(box("data", struct.pack(">IIi", 21, 0, 0)))),
        box("moov", metadata(box("data", struct.pack(">II", 1, 0) + b"wide"))),
        box("moov", metadata(box("data", struct.pack(">IIi", 21, 0, 26))))[:-40],
        struct.pack(">I4sQ", 1, b"moov", 3),
        b"\xff\xd8\xff\xe1damaged",
        b"\x89PNG damaged",
    ],
)
def test_damaged_and_odd_files_tell_nothing(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.mov"
    path.write_bytes(content)
    assert equivalent_mm(path) is None
    assert equivalent_mm(tmp_path / "none.mp4") is None


@pytest.mark.parametrize(
    ("model", "more", "equivalent", "by"),
    [
        # 4.54 mm across 4:3 have a diagonal of 5.675 mm.
        ("iPhone 5", {0x920A: 4.12}, 4.12 * 43.27 / 5.675, "iPhone 5"),
        # 200 px a millimetre across 4000 px of the sensor, of which the image was made smaller.
        ("EOS", {0x920A: 24.0, 0xA20E: 2000.0, 0xA210: 3, 0xA002: 4000}, 24 * 43.27 / 25, "sensor"),
        ("EOS", {0x920A: 24.0, 0xA20E: 508.0, 0xA210: 2}, 24 * 43.27 / 25, "sensor"),
        ("EOS", {0x920A: 24.0, 0xA20E: 508.0, 0xA210: 2, 0xA405: 30}, 30.0, "the file"),
        ("EOS", {0x920A: 24.0}, None, ""),
        ("EOS", {0x920A: 24.0, 0xA20E: 5.0}, None, ""),
        ("EOS", {0x920A: 24.0, 0xA20E: 0.0}, None, ""),
    ],
)
def test_millimetres_count_with_the_size_of_the_sensor(
    tmp_path: Path, model: str, more: dict[int, float], equivalent: float | None, by: str
) -> None:
    exif = Image.Exif()
    exif[0x0110] = model
    exif.get_ifd(0x8769).update(more)
    Image.new("RGB", (400, 300)).save(tmp_path / "1.jpg", exif=exif)
    told = told_focal(tmp_path / "1.jpg")
    if equivalent is None:
        assert told is None
        return
    assert told is not None
    assert told.focal == pytest.approx(equivalent)
    assert by in told.by
    assert (told.stddev > 0.03) == (0xA405 not in more)


@pytest.mark.parametrize(
    ("name", "size", "across_deg"),
    [
        # Measured by others: 70.4 across 16:9 (gist.github.com/khancyr), and as high in 4:3.
        ("HD Pro Webcam C920", (1280, 720), 70.42),
        ("C920", (960, 720), 55.8),
        ("logitech c920s", (720, 1280), 43.3),
        ("C930e", (1920, 1080), 82.1),
    ],
)
def test_a_webcams_name_tells_the_field_of_view(
    tmp_path: Path, name: str, size: tuple[int, int], across_deg: float
) -> None:
    with open_images(film(tmp_path / "a.mp4", size), GivenCamera(webcam=name)) as images:
        lens = images.calibration()
        assert name in images.remarks[0]
    assert 2 * np.degrees(np.arctan(size[0] / 2 / lens.k[0, 0])) == pytest.approx(
        across_deg, abs=0.3
    )
    assert (lens.focal_stddev, lens.told_by) == (0.05, f"the webcam {name}")


def test_an_unknown_webcam_is_refused() -> None:
    for name in ("C9200", "Integrated Camera", ""):
        with pytest.raises(CameraError, match=r"c920.*field of view"):
            GivenCamera(webcam=name).check()
