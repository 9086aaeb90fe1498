"""Videos are written whole or not at all."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import cv2
import numpy as np
import pytest

from cardbox_tracker.applications.drawing import video
from cardbox_tracker.applications.drawing.video import video_file
from cardbox_tracker.common.errors import CardboxError

LEVELS = (30, 90, 150, 210)


def write(path: Path | str, count: int = len(LEVELS)) -> None:
    with video_file(path, 10.0) as add:
        for level in LEVELS[:count]:
            add(np.full((48, 64, 3), level, np.uint8))


def test_every_image_is_in_the_video(tmp_path: Path) -> None:
    name = "a.mp4"
    write(tmp_path / name)
    assert [entry.name for entry in tmp_path.iterdir()] == [name]
    video = cv2.VideoCapture(str(tmp_path / name))
    assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(10)
    for level in LEVELS:
        found, image = video.read()
        assert found
        assert image.shape == (48, 64, 3)
        assert image.mean() == pytest.approx(level, abs=4)
    assert not video.read()[0]
    video.release()


def test_mp4_has_a_codec_that_browsers_play(tmp_path: Path) -> None:
    write(tmp_path / "a.mp4")
    video = cv2.VideoCapture(str(tmp_path / "a.mp4"))
    assert int(video.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little") == b"h264"
    levels = []
    while (read := video.read())[0]:
        levels.append(read[1].mean())
    assert levels == pytest.approx(LEVELS, abs=4)
    # A browser that loads the file begins to play before its end is there.
    content = (tmp_path / "a.mp4").read_bytes()
    assert content.index(b"moov") < content.index(b"mdat")


@pytest.mark.parametrize("name", ["a.gif", "a", "mp4", "a.mp4.txt", "a.avi"])
def test_a_wrong_ending_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(CardboxError, match=r"must end in \.mp4"):
        write(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_nothing_appears_before_the_video_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    with video_file(path, 10.0) as add:
        add(np.zeros((48, 64, 3), np.uint8))
        assert not path.exists()
    assert path.stat().st_size > 0


def test_an_error_on_the_way_leaves_the_old_video(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    write(path)
    old = path.read_bytes()
    with pytest.raises(RuntimeError, match="stop"), video_file(path, 10.0):
        raise RuntimeError("stop")
    assert path.read_bytes() == old
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.mp4"]


def test_a_full_disk_is_told_with_the_name_of_the_video(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(image: np.ndarray) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(video, "_encoder", lambda *_: nullcontext(full))
    with pytest.raises(CardboxError, match=r"cannot write the video .*a\.mp4: .*No space left"):
        write(tmp_path / "a.mp4")


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(CardboxError, match=r"none/a\.mp4"):
        write(tmp_path / "none" / "a.mp4")


def test_the_first_image_gives_the_size(tmp_path: Path) -> None:
    name = "a.mp4"
    with video_file(tmp_path / name, 10.0) as add:
        add(np.full((81, 45, 3), 90, np.uint8))
        add(np.full((48, 64, 3), 90, np.uint8))
    video = cv2.VideoCapture(str(tmp_path / name))
    assert [video.read()[1].shape for _ in range(2)] == [(80, 44, 3)] * 2
    assert not video.read()[0]
