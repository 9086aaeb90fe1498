"""Videos, folders of images, and bags without a CameraInfo as recordings."""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from cardbox_tracker.camera.camera import Calibration, Camera
from cardbox_tracker.camera.film_headers import codecs
from cardbox_tracker.common.errors import BagError, CameraError, CardboxError
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.image_folder import _numbered
from cardbox_tracker.recordings.open_images import open_images
from cardbox_tracker.recordings.other_silhouettes import PersonInView
from cardbox_tracker.recordings.recording import RecordingRequest
from cardbox_tracker.recordings.silhouettes import TimeSpan

FOV = GivenCamera(fov_deg=60.0)
EMPTY = TimeSpan(0.0, 0.3)
Image = np.ndarray


def pictures(count: int, width: int, height: int) -> list[Image]:
    """Ten images of a wall, then a white block in the upper left quarter."""
    wall = np.random.default_rng(0).integers(90, 110, (height, width, 3)).astype(np.uint8)
    images = [wall.copy() for _ in range(count)]
    for image in images[10:]:
        image[: height // 2, : width // 2] = 230
    return images


def film(path: Path, images: Sequence[Image], fps: float) -> Path:
    code = cv2.VideoWriter.fourcc(*("mp4v" if path.suffix == ".mp4" else "MJPG"))
    height, width = images[0].shape[:2]
    writer = cv2.VideoWriter(str(path), code, fps, (width, height))
    for image in images:
        writer.write(image)
    writer.release()
    return path


def turned_by_flag(path: Path, clockwise_deg: int) -> None:
    """Write a rotation into the track header of an MP4 file, as phones do."""
    c, s = {0: (1, 0), 90: (0, 1), 180: (-1, 0), 270: (0, -1)}[clockwise_deg]
    data = bytearray(path.read_bytes())
    # Version and flags, five times, and two reserved words and four shorts precede the matrix.
    at = data.index(b"tkhd") + 4 + 4 + 20 + 8 + 8
    one = 1 << 16
    struct.pack_into(">9i", data, at, c * one, s * one, 0, -s * one, c * one, 0, 0, 0, 1 << 30)
    path.write_bytes(data)


@pytest.mark.parametrize(
    ("size", "expected"),
    [
        ((640, 480), (320, 240)),
        ((160, 120), (320, 240)),
        ((1920, 1080), (368, 208)),
        ((1080, 1920), (208, 370)),
        ((720, 720), (280, 280)),
        ((2000, 100), (1240, 62)),
    ],
)
def test_the_working_size_keeps_the_aspect_ratio(
    size: tuple[int, int], expected: tuple[int, int]
) -> None:
    assert Calibration.of_fov(*size, 60.0).working_size() == expected


@pytest.mark.parametrize(
    ("name", "fps", "size"),
    [
        ("a.mp4", 15.0, (320, 240)),
        ("b.mp4", 240.0, (108, 192)),
        ("c.avi", 29.97, (192, 108)),
        ("d.MP4", 60.0, (640, 480)),
    ],
)
def test_a_video_has_the_times_and_the_size_of_its_images(
    tmp_path: Path, name: str, fps: float, size: tuple[int, int]
) -> None:
    path = film(tmp_path / name.lower(), pictures(20, *size), fps).rename(tmp_path / name)
    with open_images(path, FOV) as video:
        stamps = [image.stamp_ns / 1e9 for image in video.images()]
        assert stamps == pytest.approx(np.arange(20) / fps, abs=1e-4)
        assert video.duration_s == pytest.approx(19 / fps, abs=1e-4)
        again = [image.as_sent.shape for image in video.images()]
        assert again == [(size[1], size[0], 3)] * 20
        calibration = video.calibration()
        assert (calibration.width, calibration.height) == size
        # Half the width is seen under half the angle.
        assert calibration.k[0, 0] * np.tan(np.radians(30)) == pytest.approx(size[0] / 2)
        assert not [remark for remark in video.remarks if "ends after" in remark]


@pytest.mark.parametrize(("clockwise_deg", "row", "column"), [(90, 0, 1), (180, 1, 1), (270, 1, 0)])
def test_a_phones_rotation_flag_turns_the_images(
    tmp_path: Path, clockwise_deg: int, row: int, column: int
) -> None:
    """The block in the upper left quarter is in the upper right one after 90 degrees."""
    path = film(tmp_path / "phone.mp4", pictures(20, 192, 108), 30.0)
    turned_by_flag(path, clockwise_deg)
    with RecordingRequest(path, EMPTY, camera=FOV).open() as recording:
        upright = clockwise_deg != 180
        camera = recording.first.camera
        assert (camera.width, camera.height) == ((208, 370) if upright else (368, 208))
        *_, last = recording.first.frames()
        height, width = last.silhouette.shape
        quarters = last.silhouette.reshape(2, height // 2, 2, width // 2).mean(axis=(1, 3))
        assert np.unravel_index(quarters.argmax(), (2, 2)) == (row, column)


def test_silhouettes_of_a_video_are_those_of_its_images(tmp_path: Path) -> None:
    images = pictures(20, 320, 240)
    video = film(tmp_path / "film.avi", images, 30.0)
    folder = tmp_path / "images"
    folder.mkdir()
    for number, image in enumerate(images):
        cv2.imwrite(str(folder / f"image{number}.png"), image)
    found = []
    for path in (video, folder):
        with RecordingRequest(path, EMPTY, camera=FOV).open() as recording:
            found.append([frame.silhouette for frame in recording.first.frames(0.34)])
    assert len(found[0]) == len(found[1]) == 9
    for one, other in zip(*found, strict=True):
        assert np.mean(one != other) < 0.01
        assert np.count_nonzero(one) == pytest.approx(320 * 240 / 4, rel=0.05)


def test_a_given_rate_replaces_that_of_the_file(tmp_path: Path) -> None:
    path = film(tmp_path / "slow.mp4", pictures(12, 64, 48), 30.0)
    with open_images(path, GivenCamera(60.0, fps=240.0)) as video:
        assert [image.stamp_ns for image in video.images()][6] == 25_000_000
        assert video.duration_s == pytest.approx(11 / 240)


def test_images_of_two_cameras_in_one_folder_are_told(tmp_path: Path) -> None:
    for name in ("left01.png", "left02.png", "right01.png", "right02.png"):
        cv2.imwrite(str(tmp_path / name), np.zeros((12, 16), np.uint8))
    with open_images(tmp_path, GivenCamera(fov_deg=60.0)) as images:
        assert "2 series of images, 'left, right'" in images.remarks[-1]
    (tmp_path / "right02.png").unlink()
    with open_images(tmp_path, GivenCamera(fov_deg=60.0)) as images:
        assert not images.remarks


def test_images_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    for number in (0, 2, 10, 9, 1):
        cv2.imwrite(str(tmp_path / f"f{number}.JPG"), np.full((48, 64, 3), 20 * number, np.uint8))
    (tmp_path / "notes.txt").write_text("not an image")
    with open_images(tmp_path, FOV) as images:
        levels = [round(float(image.as_sent.mean()) / 20) for image in images.images()]
        assert levels == [0, 1, 2, 9, 10]
        assert [image.stamp_ns for image in images.images()][3] == 300_000_000
        assert "6 that the numbering lacks (after f2.JPG)" in images.left_out("")
    with open_images(tmp_path, GivenCamera(60.0, fps=10.0)) as images:
        assert images.duration_s == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("names", "places"),
    [
        (("a_0", "a_2", "a_4", "a_8"), [0, 1, 2, 4]),
        (("a_1", "a_5", "a_20"), [0, 1, 2]),
        (("a_1", "a_2", "b_9"), [0, 1, 2]),
        (("10", "11", "12", "900"), [0, 1, 2, 890]),
        (("one",), [0]),
    ],
)
def test_a_gap_in_the_numbers_is_one_of_time(names: tuple[str, ...], places: list[int]) -> None:
    assert _numbered([Path(f"{name}.png") for name in names]) == places


def test_a_damaged_image_within_a_video_is_left_out(tmp_path: Path) -> None:
    """Bytes of three images of 60 are set to zero; OpenCV then fails once, and goes on."""
    noise = np.random.default_rng(1).integers(0, 256, (60, 96, 128, 3), np.uint8)
    path = film(tmp_path / "film.avi", list(noise), 30.0)
    data = bytearray(path.read_bytes())
    begins = [at.start() for at in re.finditer(b"00dc", data)]
    for at in begins[20:23]:
        data[at + 8 : at + 3000] = bytes(2992)
    path.write_bytes(data)
    with open_images(path, FOV) as video:
        stamps = [image.stamp_ns / 1e9 for image in video.images()]
        assert len(stamps) == 57
        assert stamps[-1] == pytest.approx(59 / 30, abs=1e-4)
        assert video.left_out("") == ["3 that cannot be decoded"]
        assert any("3 images of" in remark for remark in video.remarks)


def test_exif_turns_an_image(tmp_path: Path) -> None:
    """The orientation 6 asks for a turn by 90 degrees clockwise."""
    cv2.imwrite(str(tmp_path / "a.jpg"), np.zeros((48, 64, 3), np.uint8))
    plain = (tmp_path / "a.jpg").read_bytes()
    entry = struct.pack("<HHIHH", 0x0112, 3, 1, 6, 0)
    exif = b"Exif\0\0II*\0" + struct.pack("<IH", 8, 1) + entry + bytes(4)
    header = b"\xff\xe1" + struct.pack(">H", len(exif) + 2)
    (tmp_path / "a.jpg").write_bytes(plain[:2] + header + exif + plain[2:])
    with open_images(tmp_path, FOV) as images:
        assert next(images.images()).as_sent.shape == (64, 48, 3)
        assert images.calibration().working_size() == (240, 320)


def test_images_that_do_not_belong_are_skipped_and_counted(tmp_path: Path) -> None:
    for number, image in enumerate(pictures(20, 320, 240)):
        cv2.imwrite(str(tmp_path / f"{number:03}.png"), image)
    (tmp_path / "012.png").write_bytes(b"\x89PNG nothing")
    cv2.imwrite(str(tmp_path / "014.png"), np.zeros((50, 50, 3), np.uint8))
    with RecordingRequest(tmp_path, EMPTY, camera=FOV).open() as recording:
        assert len(list(recording.first.frames())) == 18
        (remark,) = recording.first.remarks
        assert "2 images cannot be decoded" in remark
        assert "012.png" in remark


def test_a_video_that_was_cut_off_is_read_to_its_end_with_a_remark(tmp_path: Path) -> None:
    path = film(tmp_path / "film.avi", pictures(30, 320, 240), 30.0)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    with RecordingRequest(path, EMPTY, camera=FOV).open() as recording:
        count = len(list(recording.first.frames()))
        assert 10 <= count < 28
        (remark,) = recording.first.remarks
        assert f"ends after {count} images and" in remark and "of 1.0 s" in remark
        assert "left out the rest of the video" in recording.first.account


@pytest.mark.parametrize("kind", ["cut", "zero", "no images", "text"])
def test_videos_without_images_are_refused(tmp_path: Path, kind: str) -> None:
    path = tmp_path / ("film.txt" if kind == "text" else "film.mp4")
    film(tmp_path / "whole.mp4", pictures(20, 64, 48), 30.0)
    whole = (tmp_path / "whole.mp4").read_bytes()
    path.write_bytes({"cut": whole[: len(whole) // 2], "text": b"hello"}.get(kind, b""))
    if kind == "no images":
        film(path, pictures(1, 64, 48), 30.0)
        data = bytearray(path.read_bytes())
        at = data.index(b"mdat")
        path.write_bytes(data[: at + 4] + bytes(len(data) - at - 4))
    with pytest.raises(BagError, match=r"expected .*video"), open_images(path, FOV):
        pass


def test_codecs_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    path = film(tmp_path / "film.mp4", pictures(20, 64, 48), 30.0)
    path.write_bytes(path.read_bytes().replace(b"mp4v", b"av01"))
    assert codecs(path) == " (it has the codecs av01)"
    path.write_bytes(b"\x1aE\xdf\xa3\x86\x85V_AV1\x83\x86A_OPUS" + bytes(99))
    with pytest.raises(BagError, match="codecs A_OPUS, V_AV1"), open_images(path, FOV):
        pass


def test_recordings_that_are_none_are_refused(tmp_path: Path) -> None:
    (tmp_path / "one.png").write_bytes(b"")
    (tmp_path / "empty").mkdir()
    for path, text in (
        (tmp_path / "missing.mp4", "there is no recording"),
        (tmp_path / "empty", "no JPEG or PNG images"),
        (tmp_path / "one.png", "single image"),
        (Path("/dev/null"), "pipe or a device"),
    ):
        with pytest.raises(BagError, match=text):
            open_images(path)
    with pytest.raises(BagError, match="can be decoded"), open_images(tmp_path, FOV):
        pass


def test_one_camera_needs_a_possible_field_of_view(tmp_path: Path) -> None:
    path = film(tmp_path / "film.mp4", pictures(20, 192, 108), 30.0)
    for fov_deg in (0.0, 180.0, float("nan")):
        with (
            pytest.raises(CameraError, match="field of view is"),
            RecordingRequest(path, EMPTY, camera=GivenCamera(fov_deg)).open(),
        ):
            pass
    with (
        pytest.raises(BagError, match="omit --cameras"),
        RecordingRequest(path, EMPTY, ["left"]).open(),
    ):
        pass
    with (
        pytest.raises(CardboxError, match="0 images lie in the background span"),
        RecordingRequest(path, TimeSpan(50, 60), camera=FOV).open(),
    ):
        pass


def test_an_upright_video_with_a_wide_field_of_view_is_doubted(tmp_path: Path) -> None:
    path = film(tmp_path / "film.mp4", pictures(2, 108, 192), 30.0)
    for fov_deg, count in ((65.0, 1), (40.0, 0)):
        with open_images(path, GivenCamera(fov_deg)) as video:
            assert len(video.remarks) == count


def test_a_calibration_file_replaces_the_field_of_view(tmp_path: Path) -> None:
    path = film(tmp_path / "film.mp4", pictures(20, 192, 108), 30.0)
    data = {
        "image_width": 1920,
        "image_height": 1080,
        "distortion_model": "plumb_bob",
        "camera_matrix": {"rows": 3, "cols": 3, "data": [1500, 0, 960, 0, 1500, 540, 0, 0, 1]},
        "distortion_coefficients": {"rows": 1, "cols": 5, "data": [0.1, 0, 0, 0, 0]},
    }
    file = tmp_path / "camera.yaml"
    file.write_text(yaml.safe_dump(data))
    with RecordingRequest(path, EMPTY, camera=GivenCamera(calibration=file)).open() as recording:
        assert recording.first.camera.fx == pytest.approx(1500 * 368 / 1920)
        assert len(list(recording.first.frames())) == 20
    upright = film(tmp_path / "upright.mp4", pictures(2, 108, 192), 30.0)
    with (
        pytest.raises(CameraError, match=r"1920x1080, but .* 108x192"),
        RecordingRequest(upright, EMPTY, camera=GivenCamera(calibration=file)).open(),
    ):
        pass


def test_a_bag_without_camera_info_takes_the_field_of_view(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        for number, image in enumerate(pictures(20, 320, 240)):
            stamp_ns = 10**18 + number * 33_333_333
            bag.write_image("/cam/image_raw", stamp_ns, "lens", image[..., 0].copy(), "mono8")
    with (
        pytest.raises(BagError, match="give --fov"),
        RecordingRequest(tmp_path / "bag", EMPTY).open(),
    ):
        pass
    with RecordingRequest(tmp_path / "bag", EMPTY, camera=FOV).open() as recording:
        assert recording.first.camera.fx == pytest.approx(160 / np.tan(np.radians(30)))
        assert recording.first.frame_id == "lens"
        assert len(list(recording.first.frames())) == 20
        assert recording.first.remarks == []
    with pytest.raises(BagError, match="--fps"):
        open_images(tmp_path / "bag", GivenCamera(fps=30.0))


def test_a_given_field_of_view_replaces_the_camera_info_with_a_remark(tmp_path: Path) -> None:
    camera = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
    with BagWriter(tmp_path / "bag") as bag:
        for number in range(4):
            bag.write_image("/image_raw", number + 1, "a", np.zeros((48, 64), np.uint8), "mono8")
            bag.write_camera_info("/camera_info", number + 1, "a", camera)
    with open_images(tmp_path / "bag", FOV) as images:
        assert images.calibration().k[0, 0] == pytest.approx(32 / np.tan(np.radians(30)))
        assert "replaces" in images.remarks[0]
    with open_images(tmp_path / "bag") as images:
        assert images.calibration().k[0, 0] == 60.0
        assert images.remarks == []


def test_a_rolled_cameras_images_are_turned_back(tmp_path: Path) -> None:
    """A camera turned clockwise by 10 degrees sees a plumb line lean to the left at its top."""
    image = np.full((240, 320, 3), 20, np.uint8)
    lean = 100 * np.tan(np.radians(10.0))
    ends = [(round(160 - lean), 20), (round(160 + lean), 220)]
    cv2.line(image, *ends, (255, 255, 255), 3)
    cv2.imwrite(str(tmp_path / "a.png"), image)
    cv2.imwrite(str(tmp_path / "b.png"), image)
    camera = GivenCamera(60.0, roll_rad=np.radians(10.0))
    with RecordingRequest(tmp_path, TimeSpan(0, 1), camera=camera).open() as recording:
        (_, _, level, *_), _ = recording.first.images()
        columns = [np.average(np.arange(320), weights=level[v, :, 0] > 128) for v in (60, 180)]
        assert columns[0] == pytest.approx(columns[1], abs=1.5)
        calibration = recording.first._pipeline.calibration
        there = calibration.rectified(np.array(ends, float), 320, 240)
        assert there[0, 0] == pytest.approx(there[1, 0], abs=1.0)


def swaying(aside_px: int, count: int, rng: np.random.Generator) -> list[Image]:
    """Images of a person in bright checks who sways before a wall with noise."""
    shirt = np.kron(rng.integers(160, 250, (36, 10)), np.ones((5, 5)))
    wall = np.tile(np.arange(60, 140, dtype=np.float32)[::-1].repeat(4), (240, 1))
    images = []
    for number in range(count):
        image = wall + rng.normal(0, 1.0, wall.shape)
        left = aside_px + round(3 * np.sin(number / 5))
        image[60:, left : left + 50] = shirt
        images.append(np.repeat(np.clip(image, 0, 255).astype(np.uint8)[..., None], 3, axis=2))
    return images


@pytest.mark.parametrize("fps", [15.0, 60.0])
def test_the_scene_is_learned_while_the_person_is_in_view(tmp_path: Path, fps: float) -> None:
    rng = np.random.default_rng(1)
    # Live, each view takes two seconds at 15 Hz.
    count = round(5 * fps)
    images = [*swaying(60, count, rng), *swaying(200, count, rng)]
    path = film(tmp_path / "film.avi", images, fps)
    with RecordingRequest(path, PersonInView(), camera=FOV).open() as recording:
        frames = list(recording.first.frames())
        assert len(frames) == 2 * count
        for frame, left in ((frames[5], 60), (frames[-1], 200)):
            truth = np.zeros((240, 320), bool)
            truth[60:, left : left + 50] = True
            person = frame.silhouette > 0
            assert np.mean(person[truth]) > 0.85
            assert np.mean(person[~truth]) < 0.05


def test_a_person_who_never_steps_aside_is_reported(tmp_path: Path) -> None:
    path = film(tmp_path / "film.avi", swaying(60, 75, np.random.default_rng(1)), 15.0)
    with (
        pytest.raises(CardboxError, match=r"hides .* all the time.*--detector mediapipe"),
        RecordingRequest(path, PersonInView(), camera=FOV).open(),
    ):
        pass
    short = film(tmp_path / "short.avi", pictures(12, 320, 240), 15.0)
    with (
        pytest.raises(CardboxError, match=r"less than 2 s.*--detector mediapipe"),
        RecordingRequest(short, PersonInView(), camera=FOV).open(),
    ):
        pass
