"""Silhouettes of a recording: spans of time, the background, and every image once."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from unittest.mock import Mock

import cv2
import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import BagError, CardboxError
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.image_points import POINT_INDEX
from cardbox_tracker.detectors.model_files import ModelFiles
from cardbox_tracker.detectors.point_table import PointTable
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.image_folder import ImageFolder
from cardbox_tracker.recordings.other_silhouettes import DetectorSilhouetteSource
from cardbox_tracker.recordings.silhouettes import SilhouetteSource, TimeSpan
from cardbox_tracker.segmentation.background_config import BackgroundConfig


@pytest.mark.parametrize(
    ("text", "expected"),
    [("0:4", (0, 4)), ("6.8:8.2", (6.8, 8.2)), ("1e1:20", (10, 20)), ("0:inf", (0, np.inf))],
)
def test_spans_are_read(text: str, expected: tuple[float, float]) -> None:
    assert TimeSpan.parse(text) == expected
    assert TimeSpan.parse(str(TimeSpan.parse(text))) == expected


@pytest.mark.parametrize(
    "text", ["5", "9:3", "3:3", "-1:3", ":", "1:", ":2", "", "a:b", "1:2:3", "nan:3", "0:nan"]
)
def test_what_is_no_span_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="T0:T1 in seconds"):
        TimeSpan.parse(text)


def test_the_ends_belong_to_a_span() -> None:
    span = TimeSpan(1.0, 2.0)
    assert [span.contains(t) for t in (0.99, 1.0, 1.5, 2.0, 2.01)] == [0, 1, 1, 1, 0]


def test_every_image_comes_once_and_in_order(recording: Any, source: SilhouetteSource) -> None:
    with BagReader(recording.folder) as bag:
        stamps = [image.stamp_ns for image in bag.images()]
    frames = list(source.frames())
    assert [frame.stamp_ns for frame in frames] == stamps
    assert [frame.time_s for frame in frames] == pytest.approx(np.arange(len(stamps)) / 5.0)
    later = [frame.stamp_ns for frame in source.frames(2.0, 3.0)]
    assert later == stamps[10:16]


def test_a_second_pass_without_pictures_decodes_nothing(
    recording: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    decoded = Mock(side_effect=SilhouetteSource._prepared)
    monkeypatch.setattr(SilhouetteSource, "_prepared", lambda *given: decoded(*given))
    with BagReader(recording.folder) as bag:
        source = SilhouetteSource(bag, TimeSpan(0.0, 1.0))
        source.keep_images()
        first = list(source.frames(1.0, 2.0))
        decoded.reset_mock()
        source.has_pictures = False
        second = list(source.frames(1.0, 2.0))
        assert not decoded.called
        for one, other in zip(first, second, strict=True):
            assert (one.stamp_ns, one.time_s) == (other.stamp_ns, other.time_s)
            assert np.array_equal(one.image, other.image)
            assert np.array_equal(one.silhouette, other.silhouette)
            assert other.recorded is None
        # Images after the kept ones, and pictures, are in the recording alone.
        assert list(source.frames(1.0, 4.0))[-1].time_s == pytest.approx(4.0)
        assert decoded.called
        source.has_pictures = True
        assert all(frame.recorded is not None for frame in source.frames(1.0, 2.0))


def test_kept_images_end_where_there_is_no_room(
    recording: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cardbox_tracker.recordings.silhouettes._MOST_KEPT", 1_000_000)
    with BagReader(recording.folder) as bag:
        source = SilhouetteSource(bag, TimeSpan(0.0, 1.0))
        source.keep_images()
        whole = [frame.stamp_ns for frame in source.frames()]
        assert 0.0 < source._kept_s < bag.duration_s
        source.has_pictures = False
        assert [frame.stamp_ns for frame in source.frames()] == whole


def test_silhouettes_are_the_person_and_the_empty_scene_has_none(
    recording: Any, source: SilhouetteSource
) -> None:
    archive = np.load(recording.folder / "masks.npz")
    masks = np.unpackbits(archive["packed"], axis=1).reshape(archive["shape"])
    fits = []
    for frame, mask in zip(source.frames(), masks, strict=True):
        assert frame.silhouette.shape == frame.image.shape == (240, 320)
        assert set(np.unique(frame.silhouette)) <= {0, 255}
        seen = frame.silhouette > 0
        if mask.any():
            fits.append(np.count_nonzero(seen & (mask > 0)) / np.count_nonzero(seen | (mask > 0)))
        else:
            assert not seen.any()
    assert np.mean(fits) > 0.95


def test_images_of_a_camera_with_colours_have_them(tmp_path: Path) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (48, 64, 3), dtype=np.uint8)
    camera = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
    with BagWriter(tmp_path / "bag") as bag:
        for number in range(4):
            bag.write_camera_info("/camera_info", number * 10**8, "optical", camera)
            bag.write_image("/image_raw", number * 10**8, "optical", pixels, "rgb8")
    with BagReader(tmp_path / "bag") as reader:
        colours = SilhouetteSource(reader, TimeSpan(0, 0.25), size=(64, 48))
        frame = next(colours.frames(0.3))
    np.testing.assert_array_equal(frame.image, pixels[:, :, ::-1])


def test_as_many_images_are_learned_from_as_a_live_node_does(tmp_path: Path) -> None:
    empty = np.full((48, 64), 90, np.uint8)
    other = empty.copy()
    other[10:40, 20:40] = 200
    camera = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
    with BagWriter(tmp_path / "bag") as bag:
        for number in range(8):
            bag.write_camera_info("/camera_info", number * 10**8, "optical", camera)
            image = empty if number < 4 else other
            bag.write_image("/image_raw", number * 10**8, "optical", image, "mono8")
    with BagReader(tmp_path / "bag") as reader:
        found = [
            next(SilhouetteSource(reader, TimeSpan(0, 1), config, (64, 48)).frames(0.6)).silhouette
            for config in (BackgroundConfig(learn_images=4), BackgroundConfig(learn_images=8))
        ]
    np.testing.assert_array_equal(found[0] > 0, other == 200)
    assert not found[1][other == 200].all()


def test_images_are_brought_to_the_working_size(recording: Any) -> None:
    with BagReader(recording.folder) as bag:
        small = SilhouetteSource(bag, TimeSpan(0, 3.9), size=(160, 120))
        frame = next(small.frames(7.0))
    assert frame.silhouette.shape == (120, 160)
    assert (small.camera.width, small.camera.height, small.camera.fx) == (160, 120, 165.0)


@pytest.mark.parametrize(("span", "count"), [(TimeSpan(50, 60), 0), (TimeSpan(0.0, 0.1), 1)])
def test_a_background_without_images_is_refused(recording: Any, span: TimeSpan, count: int) -> None:
    with (
        BagReader(recording.folder) as bag,
        pytest.raises(
            BagError,
            match=rf"{count} images .*background.* {span} s .*24\.2 s;",
        ),
    ):
        SilhouetteSource(bag, span)


def test_a_span_without_images_is_refused_by_name(source: SilhouetteSource) -> None:
    with pytest.raises(
        CardboxError,
        match=r"arms.* 90:91 s .*24\.2 s; give",
    ):
        source.held(TimeSpan(90, 91), "arms")


def test_given_points_of_several_people_come_before_the_detectors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number in range(2):
        cv2.imwrite(str(tmp_path / f"{number}.png"), np.full((48, 64), 90, np.uint8))
    table = tmp_path / "points.csv"
    rows = [
        f"{frame},{person},nose,{10 + 20 * person},9,1" for frame in (0, 1) for person in (0, 1)
    ]
    table.write_text("\n".join(["frame,person,joint,u,v,score", *rows]))
    monkeypatch.setattr(Detector, "start", lambda _: Mock(all_in=Mock(return_value=[])))
    with ImageFolder(tmp_path, GivenCamera(fov_deg=60.0)) as images:
        detector = Detector(ModelFiles(tmp_path, tmp_path), people=2)
        source = DetectorSilhouetteSource(images, detector, points=PointTable(table, people=2))
        frames = list(source.frames())
    found = [[one.px[POINT_INDEX["nose"], 0] for one in frame.people or ()] for frame in frames]
    # The images are five times as large as the recorded ones.
    assert found == [pytest.approx([52.0, 152.0])] * 2
