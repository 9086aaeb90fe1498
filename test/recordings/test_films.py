"""Films of other cameras: oblong pixels, edit lists, raw streams, mirrored ones."""

from __future__ import annotations

import struct
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
import yaml

from cardbox_tracker.camera.film_headers import check_times, oblong, shown_s, with_square_pixels
from cardbox_tracker.common.errors import CameraError
from cardbox_tracker.detectors.image_points import POINT_NAMES, ImagePoints
from cardbox_tracker.detectors.point_table import why_not
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.open_images import open_images

FOV = GivenCamera(fov_deg=60.0)


def film(path: Path, count: int = 30, size: tuple[int, int] = (64, 48)) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 15.0, size)
    for number in range(count):
        writer.write(np.full((size[1], size[0], 3), 60 + number, np.uint8))
    writer.release()
    return path


def with_times(path: Path, shown: float) -> Path:
    """Write into the header of an MP4 that only a part of its images is shown."""
    data = bytearray(path.read_bytes())
    at = data.index(b"tkhd") + 4 + 20
    (duration,) = struct.unpack_from(">I", data, at)
    struct.pack_into(">I", data, at, round(shown * duration))
    path.write_bytes(data)
    return path


def corners(image: np.ndarray) -> list[int]:
    """Return which quarters of an image are the brightest, from the top left row by row."""
    rows, columns = (np.array_split(np.arange(side), 2) for side in image.shape[:2])
    means = [image[np.ix_(row, column)].mean() for row in rows for column in columns]
    return np.argsort(means).tolist()


@pytest.mark.parametrize("box", ["tkhd", "mvhd"])
@pytest.mark.parametrize(
    ("matrix", "order"),
    [
        ((1, 0, 0, 1), [0, 1, 2, 3]),
        ((-1, 0, 0, 1), [1, 0, 3, 2]),
        ((1, 0, 0, -1), [2, 3, 0, 1]),
        ((-1, 0, 0, -1), [3, 2, 1, 0]),
        ((0, 1, -1, 0), [1, 3, 0, 2]),
        ((0, -1, 1, 0), [2, 0, 3, 1]),
        ((0, 1, 1, 0), [0, 2, 1, 3]),
        ((0, -1, -1, 0), [3, 1, 2, 0]),
    ],
)
def test_images_are_turned_and_mirrored_as_players_do(
    tmp_path: Path, box: str, matrix: tuple[int, ...], order: list[int]
) -> None:
    path = tmp_path / "a.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 15.0, (64, 48))
    quarters = np.kron([[50, 90], [130, 170]], np.ones((24, 32))).astype(np.uint8)
    for _ in range(3):
        writer.write(np.dstack([quarters] * 3))
    writer.release()
    data = bytearray(path.read_bytes())
    at = data.index(box.encode()) + 4 + (40 if box == "tkhd" else 36)
    struct.pack_into(">2i4x2i", data, at, *(65536 * one for one in matrix))
    path.write_bytes(data)
    with open_images(path, FOV) as video:
        image, *_ = (image.as_sent for image in video.images())
    assert corners(image) == order
    assert image.shape[:2] == ((48, 64) if matrix[0] else (64, 48))


@pytest.mark.parametrize("enabled", [0, 1])
def test_of_several_streams_the_one_that_players_show_is_read(tmp_path: Path, enabled: int) -> None:
    path, sizes = tmp_path / "a.mp4", ((64, 48), (128, 96))
    with av.open(str(path), "w") as output:
        streams = [output.add_stream("mpeg4", rate=15) for _ in sizes]
        for stream, (stream.width, stream.height) in zip(streams, sizes, strict=True):
            stream.pix_fmt = "yuv420p"
        for number in range(30):
            for stream, size in zip(streams, sizes, strict=True):
                shown = np.full((size[1], size[0], 3), 60 + 4 * number, np.uint8)
                output.mux(stream.encode(av.VideoFrame.from_ndarray(shown, format="bgr24")))
        for stream in streams:
            output.mux(stream.encode())
    data, at = bytearray(path.read_bytes()), -1
    for number in range(2):
        at = data.index(b"tkhd", at + 1)
        data[at + 7] = 3 if number == enabled else 2
    path.write_bytes(data)
    with open_images(path, FOV) as video:
        assert video.duration_s == pytest.approx(29 / 15, abs=1e-3)
        images = list(video.images())
        assert [round(image.stamp_ns / 1e9 * 15) for image in images] == list(range(30))
        assert {image.as_sent.shape[1::-1] for image in images} == {sizes[enabled]}
        later, first = (images[number].as_sent.mean() for number in (20, 0))
        assert later - first == pytest.approx(80, abs=4)
        assert any("streams beside" in text for text in video.left_out(""))
        assert not video.remarks


@pytest.mark.parametrize("share", [1.0, 0.5, 0.8])
def test_the_length_of_a_film_is_what_it_shows(tmp_path: Path, share: float) -> None:
    path = with_times(film(tmp_path / "a.mp4"), share)
    assert shown_s(path) == pytest.approx(2 * share, abs=0.01)
    with open_images(path, FOV) as video:
        assert video.duration_s == pytest.approx((30 * share - 1) / 15, abs=1e-3)
        count = len(list(video.images()))
        assert video.duration_s == pytest.approx((count - 1) / 15, abs=1e-3)
        assert video.remarks == []


@pytest.mark.parametrize("suffix", ["avi", "mkv"])
def test_the_stated_length_counts_from_the_first_image(tmp_path: Path, suffix: str) -> None:
    with open_images(film(tmp_path / f"a.{suffix}"), FOV) as video:
        assert video.duration_s == pytest.approx(29 / 15, abs=1e-3)


def test_a_webm_that_states_1000_images_a_second_is_whole(tmp_path: Path) -> None:
    """Browsers write the clock of the file as the rate: 30 images of 33 ms are no lack of 928."""
    with av.open(str(tmp_path / "a.webm"), "w") as file:
        stream = file.add_stream("libvpx", 1000)
        stream.width, stream.height = 64, 48
        for number in range(30):
            image = av.VideoFrame.from_ndarray(np.full((48, 64, 3), number, np.uint8), "bgr24")
            image.pts = 33 * number
            file.mux(stream.encode(image))
        file.mux(stream.encode())
    with open_images(tmp_path / "a.webm", FOV) as video:
        stamps_ns = [image.stamp_ns for image in video.images()]
        np.testing.assert_allclose(stamps_ns, 33e6 * np.arange(30), atol=1e3)
        assert video.duration_s == pytest.approx(0.957)
        assert video.remarks == [] and video.left_out("") == []


@pytest.mark.parametrize(
    "start", [b"\0\0\0\1\x67\x64", b"\0\0\1\x67\x64", b"\0\0\0\1\x40\x01", b"\xff\xd8\xff\xe0"]
)
def test_a_raw_stream_needs_its_rate(tmp_path: Path, start: bytes) -> None:
    path = tmp_path / "raw.h264"
    path.write_bytes(start + bytes(100))
    with pytest.raises(CameraError, match=r"neither times nor a rate; give --fps"):
        check_times(path, "give --fps")


@pytest.mark.parametrize("start", [b"\0\0\1\xba", b"\0\0\1\xb3", b"\0\0\0\x18ftyp", b"\x1aE\xdf"])
def test_films_with_times_do_not(tmp_path: Path, start: bytes) -> None:
    path = tmp_path / "film"
    path.write_bytes(start + bytes(100))
    check_times(path, "")


class Opened:
    """An open film that states the shape of its pixels."""

    def __init__(self, across: float, down: float, turned_deg: int = 0) -> None:
        self.values = {
            cv2.CAP_PROP_SAR_NUM: across,
            cv2.CAP_PROP_SAR_DEN: down,
            cv2.CAP_PROP_ORIENTATION_META: turned_deg,
        }

    def get(self, name: int) -> float:
        return self.values[name]


@pytest.mark.parametrize(
    ("across", "down", "turned_deg", "size"),
    [
        (0, 1, 0, (64, 48)),
        (1, 1, 0, (64, 48)),
        (4, 3, 0, (85, 48)),
        (16, 15, 0, (68, 48)),
        (8, 9, 0, (64, 54)),
        (4, 3, 90, (64, 64)),
        (4, 3, 180, (85, 48)),
        (1000, 1, 0, (64, 48)),
    ],
)
def test_images_of_oblong_pixels_are_stretched_as_players_do(
    across: float, down: float, turned_deg: int, size: tuple[int, int]
) -> None:
    shape = oblong(Opened(across, down, turned_deg))  # type: ignore[arg-type]
    image = with_square_pixels(np.zeros((48, 64, 3), np.uint8), shape)
    assert image.shape[1::-1] == size


def calibration(path: Path, width: int, height: int, fx: float, fy: float) -> Path:
    k = [fx, 0, (width - 1) / 2, 0, fy, (height - 1) / 2, 0, 0, 1]
    path.write_text(
        yaml.safe_dump(
            {
                "image_width": width,
                "image_height": height,
                "camera_matrix": {"data": k},
                "distortion_model": "plumb_bob",
                "distortion_coefficients": {"data": [0.0] * 5},
            }
        )
    )
    return path


@pytest.mark.parametrize(
    ("width", "height", "fx", "fy"), [(720, 576, 700, 1024 / 720 * 700), (1024, 576, 995.6, 995.6)]
)
def test_a_calibration_may_be_of_stored_or_of_shown_images(
    tmp_path: Path, width: int, height: int, fx: float, fy: float
) -> None:
    given = GivenCamera(calibration=calibration(tmp_path / "camera.yaml", width, height, fx, fy))
    found = given.calibrated(Path("film.avi"), 1024, 576, stored=(720, 576))
    assert (found.width, found.height) == (1024, 576)
    assert found.k[0, 0] == pytest.approx(995.6, abs=0.1)
    assert found.k[1, 1] == pytest.approx(995.6, abs=0.1)
    with pytest.raises(CameraError, match="another shape"):
        given.calibrated(Path("film.avi"), 640, 480)


def test_points_of_a_mirrored_film_are_noticed() -> None:
    silhouette = np.zeros((120, 160), np.uint8)
    silhouette[20:100, 20:60] = 255
    rows = np.linspace(25, 95, len(POINT_NAMES))
    ones = np.ones(len(POINT_NAMES))
    inside = ImagePoints(np.column_stack([40 * ones, rows]), ones)
    mirrored = ImagePoints(np.column_stack([119 * ones, rows]), ones)
    outside = ImagePoints(np.column_stack([80 * ones, rows]), ones)
    assert "only when they are mirrored; give --mirrored" in why_not(silhouette, mirrored)
    assert "mirrored" not in why_not(silhouette, outside)
    assert why_not(silhouette, inside) == ""


def test_a_folder_of_16_bits_has_one_scale(tmp_path: Path) -> None:
    grey = np.random.default_rng(0).integers(0, 256, (48, 64)).astype(np.uint16)
    for number in range(3):
        cv2.imwrite(str(tmp_path / f"{number}.png"), (grey << 2) // (number + 1))
    with open_images(tmp_path, FOV) as folder:
        images = [image.as_sent for image in folder.images()]
        assert any("0 to 1023 are scaled" in remark for remark in folder.remarks)
    for number, image in enumerate(images):
        np.testing.assert_array_equal(image, ((grey << 2) // (number + 1)) >> 2)
