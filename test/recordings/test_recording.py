"""The cameras of a recording, whose topics are below namespaces if there are several."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
import yaml

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import BagError, CameraError, CardboxError
from cardbox_tracker.detectors import detector as detector_module
from cardbox_tracker.detectors.detector import Detector, PersonDetector
from cardbox_tracker.detectors.image_points import POINT_INDEX
from cardbox_tracker.detectors.model_files import ModelFiles
from cardbox_tracker.detectors.point_table import PointTable
from cardbox_tracker.detectors.pose_network import Detection
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.other_silhouettes import Within
from cardbox_tracker.recordings.recording import Recording, RecordingRequest
from cardbox_tracker.recordings.silhouettes import SilhouetteSource, TimeSpan

PERIOD_NS = 100_000_000
LATER_NS = 8_000_000
EMPTY = TimeSpan(0.0, 0.55)
CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten images of an empty scene and something in it; the second camera lacks the eighth."""
    folder = tmp_path_factory.mktemp("two") / "bag"
    rng = np.random.default_rng(0)
    with BagWriter(folder) as bag:
        for i in range(10):
            for number, name in enumerate(("one", "two")):
                if (i, name) == (7, "two"):
                    continue
                stamp = 10**18 + i * PERIOD_NS + number * LATER_NS
                image = rng.normal(100, 1, (48, 64)).astype(np.uint8)
                if i >= 6:
                    image[10:40, 20 + 5 * number : 40] = 200
                bag.write_image(f"/{name}/image_raw", stamp, f"{name}_frame", image, "mono8")
                bag.write_camera_info(f"/{name}/camera_info", stamp, f"{name}_frame", CAMERA)
    return folder


@pytest.fixture
def chain(tmp_path: Path) -> Path:
    file = tmp_path / "camchain.yaml"
    moved = np.eye(4)
    moved[0, 3] = -0.5
    text = yaml.safe_dump({"one": {}, "two": {"T_cn_cnm1": moved.tolist()}})
    file.write_text(text, encoding="utf-8")
    return file


@pytest.fixture
def sources(two: Path, chain: Path) -> Iterator[Recording]:
    with RecordingRequest(two, EMPTY, ["one", "/two/"], chain).open() as opened:
        yield opened


def test_each_camera_has_its_own_silhouettes(sources: Recording, two: Path) -> None:
    sets = list(sources.frames(0.55))
    assert [s.stamp_ns - 10**18 for s in sets] == [i * PERIOD_NS for i in range(6, 10)]
    assert [None in s.frames for s in sets] == [False, True, False, False]
    with BagReader(two) as bag:
        alone = SilhouetteSource(bag, EMPTY, camera="two")
        expected = [frame.silhouette for frame in alone.frames(0.6)]
    found = [s.frames[1].silhouette for s in sets if s.frames[1] is not None]
    np.testing.assert_array_equal(found, expected)
    assert np.count_nonzero(found[0]) > 100
    np.testing.assert_allclose(sources.others[0].extrinsics.centre_m, [0.5, 0.0, 0.0])


def test_a_recording_is_read_to_its_end_or_an_earlier_one(sources: Recording) -> None:
    sets = list(sources.frames(0.55, 0.8))
    assert [s.stamp_ns - 10**18 for s in sets] == [i * PERIOD_NS for i in range(6, 9)]


def test_a_camera_whose_stamps_stand_still_is_not_used(
    two: Path, chain: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "stuck"
    with BagReader(two) as old, BagWriter(folder) as new:
        for message in old.messages():
            new.write_raw(message.topic, message.msgtype, message.raw, message.time_ns)
        for _ in range(5):
            stamp = 10**18 + 9 * PERIOD_NS + LATER_NS
            image = np.zeros((48, 64), np.uint8)
            new.write_image("/two/image_raw", stamp, "two_frame", image, "mono8")
    with RecordingRequest(folder, EMPTY, ["one", "two"], chain).open() as opened:
        sets = list(opened.frames(0.55))
        account = opened.sources[1].account
    # Neither a time of its own, nor a further image of the first camera's time.
    assert len(sets) == 4
    assert "left out 5 " in account


def test_what_is_missing_is_said(two: Path, chain: Path) -> None:
    with (
        pytest.raises(CameraError, match="camera two"),
        RecordingRequest(two, EMPTY, ["one", "two"]).open(),
    ):
        pass
    with pytest.raises(BagError, match=r"0 image topics .*/three/"), BagReader(two) as bag:
        bag.image_topic("three")
    with pytest.raises(BagError, match="--cameras NAMESPACE"), RecordingRequest(two, EMPTY).open():
        pass
    with (
        pytest.raises(CardboxError, match="different namespaces"),
        RecordingRequest(two, EMPTY, ["one", "one"]).open(),
    ):
        pass
    with (
        pytest.raises(CameraError, match="left camera"),
        RecordingRequest(two, EMPTY, ["two", "one"], chain, depth="stereo").open(),
    ):
        pass


def test_depth_images_cut_out_the_person_without_a_background(two: Path, tmp_path: Path) -> None:
    folder = tmp_path / "ranged"
    depth = np.full((96, 128), 3000, np.uint16)
    depth[20:80, 40:80] = 1500
    with BagReader(two) as old, BagWriter(folder) as new:
        for message in old.messages():
            new.write_raw(message.topic, message.msgtype, message.raw, message.time_ns)
        for i in range(9):
            new.write_image("/one/depth", 10**18 + i * PERIOD_NS, "one_frame", depth, "16UC1")
    with RecordingRequest(folder, Within("/one/depth", 2.0), ["one"]).open() as source:
        frames = list(source.first.frames(0.25))
        # Of ten images the last one has no depth image, and two are before that time.
        assert len(frames) == 9 - 3
        assert "/one/depth" in source.first.remarks[0]
        for frame in frames:
            assert frame.silhouette.shape == (source.first.camera.height, source.first.camera.width)
        # A quarter of the image's height times a third of its width is near.
        near = np.mean([np.count_nonzero(frame.silhouette) for frame in frames])
        assert near / frames[0].silhouette.size == pytest.approx(60 / 96 * 40 / 128, rel=0.05)
        assert np.array_equal(frames[0].depth_m > 2.0, frames[0].silhouette == 0)
    within = Within("/one/depth", 2.0)
    with RecordingRequest(folder, within, ["one"], depth="/one/depth").open() as sources:
        # Read once, for the silhouette and for whoever asks for the depth.
        taken = list(sources.frames(0.25))
        assert len(taken) == len(frames)
        assert all(t.depth_m is t.frames[0].depth_m is not None for t in taken if t.frames[0])
        assert (
            "/one/depth" not in sources.first.account and "/two/image_raw" in sources.first.account
        )
        assert not any("is nearer than" in remark for remark in sources.first.remarks)
    with RecordingRequest(folder, Within("/one/depth", 1.2), ["one"]).open() as source:
        list(source.first.frames())
        (_, remark) = source.first.remarks
        assert "--within 1.2 m: the nearest depths are 1.5 m" in remark
    with RecordingRequest(folder, Within("/one/depth", 3.5), ["one"]).open() as source:
        list(source.first.frames())
        (_, remark) = source.first.remarks
        assert "most of /one/depth is nearer than --within 3.5 m in 9 images" in remark
    with (
        pytest.raises(CardboxError, match="one camera"),
        RecordingRequest(folder, within, ["one", "two"]).open(),
    ):
        pass
    with (
        pytest.raises(CardboxError, match=r"0\.1 m; .*0\.3 to 20 m"),
        RecordingRequest(folder, Within("/one/depth", 0.1), ["one"]).open(),
    ):
        pass


def test_a_topic_without_depth_is_refused(two: Path) -> None:
    with (
        RecordingRequest(two, EMPTY, ["one"], depth="/one/camera_info").open() as opened,
        pytest.raises(BagError, match=r"/one/camera_info .*sensor_msgs/msg/Camera"),
    ):
        next(opened.frames())
    with (
        RecordingRequest(two, EMPTY, ["one"], depth="/one/image_raw").open() as opened,
        pytest.raises(CardboxError, match=r"'mono8'.*16UC1"),
    ):
        next(opened.frames())


def test_depth_comes_with_the_images_of_its_time(two: Path, tmp_path: Path) -> None:
    folder = tmp_path / "with_depth"
    with BagReader(two) as old, BagWriter(folder) as new:
        for message in old.messages():
            new.write_raw(message.topic, message.msgtype, message.raw, message.time_ns)
        for i in (6, 8):
            depth = np.full((48, 64), 1000 + i, np.uint16)
            stamp = 10**18 + i * PERIOD_NS + LATER_NS
            new.write_image("/one/depth", stamp, "one_frame", depth, "16UC1")
    with RecordingRequest(folder, EMPTY, ["one"], depth="/one/depth").open() as opened:
        depths = [s.depth_m for s in opened.frames(0.55)]
        assert [d is not None for d in depths] == [True, False, True, False]
        assert depths[2] is not None
        assert depths[2].shape == (opened.first.camera.height, opened.first.camera.width)
        np.testing.assert_allclose(depths[2], 1.008, rtol=1e-6)


def test_one_camera_is_a_list_of_one(two: Path) -> None:
    with RecordingRequest(two, EMPTY, ["one"]).open() as opened:
        sets = list(opened.frames(0.55))
        alone = list(opened.first.frames(0.55))
    assert (opened.names, opened.others) == (("one",), [])
    for taken, frame in zip(sets, alone, strict=True):
        (observation,) = taken.observations
        assert (taken.stamp_ns, observation.stamp_ns) == (frame.stamp_ns, frame.stamp_ns)
        np.testing.assert_array_equal(observation.silhouette, frame.silhouette)
        np.testing.assert_array_equal(taken.first.silhouette, frame.silhouette)
        assert observation.depth_m is None


def test_a_camera_without_an_image_gives_an_empty_observation(sources: Recording) -> None:
    seen = [taken.observations for taken in sources.frames(0.55)]
    assert [one[1].silhouette is None for one in seen] == [False, True, False, False]
    assert all(one[0].stamp_ns is not None for one in seen)


def test_the_masks_of_a_detector_are_the_silhouettes(
    two: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[tuple[Path, Path]] = []

    class Network:
        """Finds somebody in the upper half of images that are not flat."""

        several = 0

        def __init__(self, *models: Path) -> None:
            started.append(models)

        def forget(self) -> None:
            pass

        def __call__(self, image: np.ndarray, _: int) -> Detection | None:
            assert image.ndim == 3
            if image.std() < 10:
                return None
            mask = np.zeros(image.shape[:2], np.uint8)
            mask[: len(mask) // 2] = 128
            return Detection(np.zeros((33, 2)), np.ones(33), mask)

    monkeypatch.setattr(detector_module, "PoseNetwork", Network)
    detector = detector_module.Detector(ModelFiles(tmp_path / "a", tmp_path / "b"))
    with RecordingRequest(two, detector, ["one"]).open() as source:
        frames = list(source.first.frames())
        # Of ten images the first six show the empty scene.
        assert [bool(frame.silhouette.any()) for frame in frames] == [False] * 6 + [True] * 4
        assert frames[-1].silhouette.mean() == pytest.approx(255 / 2)
        assert "6 images" in source.first.remarks[-1]
        assert len(list(source.frames(0.65))) == 3
    assert started == [detector.models]


def test_given_points_of_several_people_precede_those_of_the_masks(
    two: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def all_in(_: PersonDetector, __: int, image: np.ndarray) -> list[Detection]:
        mask = np.full(image.shape[:2], 255, np.uint8)
        return [Detection(np.zeros((33, 2)), np.ones(33), mask)]

    monkeypatch.setattr(detector_module, "PoseNetwork", Mock())
    monkeypatch.setattr(PersonDetector, "all_in", all_in)
    table = tmp_path / "points.csv"
    rows = [f"{10**18},one,{person},left_wrist,{u},30,0.9" for person, u in ((1, 20), (2, 50))]
    table.write_text("\n".join(["stamp_ns,camera,person,joint,u,v,score", *rows]) + "\n")
    models = ModelFiles(tmp_path / "a", tmp_path / "b")
    detector, given = Detector(models)._replace(people=2), PointTable(table, people=2)
    with RecordingRequest(two, detector, ["one"], points=given).open() as source:
        frame, scale = next(iter(source.first.frames())), source.first.camera.width / CAMERA.width
    assert frame.people is not None
    columns = [one.px[POINT_INDEX["left_wrist"], 0] for one in frame.people]
    assert columns == pytest.approx([scale * 20.5 - 0.5, scale * 50.5 - 0.5])
