"""Open a recording of any kind: a bag, a video or a folder of images."""

from __future__ import annotations

import os
from pathlib import Path

from cardbox_tracker.common.errors import BagError
from cardbox_tracker.recordings.bag_files import FILE_ENDINGS, is_bag_file
from cardbox_tracker.recordings.bag_reader import REPAIR_ROS1, BagReader
from cardbox_tracker.recordings.given_camera import GivenCamera, equivalent_mm
from cardbox_tracker.recordings.image_folder import SUFFIXES, ImageFolder, image_files
from cardbox_tracker.recordings.image_recording import ImageRecording
from cardbox_tracker.recordings.video_reader import FORMATS, VideoReader
from cardbox_tracker.recordings.video_reader import SUFFIXES as VIDEO_SUFFIXES

# Endings of compressed files and archives.
_PACKED = frozenset((".zst", ".zstd", ".gz", ".bz2", ".xz", ".lz4", ".zip", ".tar", ".tgz", ".7z"))


def is_bag(path: Path) -> bool:
    """Return whether a path is that of a bag, as its name or its content says."""
    if not path.is_dir():
        return path.suffix in FILE_ENDINGS
    if any((folder / "metadata.yaml").exists() for folder in (path, path / "bag")):
        return True
    return any(map(is_bag_file, path.iterdir()))


def check_exists(path: Path) -> None:
    """Raise BagError unless there is a file or folder of that path."""
    if not path.exists():
        raise BagError(
            f"there is no recording {path}; give a rosbag2 folder or file, a video ({FORMATS}), or "
            "a folder of images"
        )


def is_film(path: Path) -> bool:
    """Return whether a path is a video or a folder of images, which do not tell their camera."""
    if path.is_dir():
        return not is_bag(path) and bool(image_files(path))
    return path.is_file() and path.suffix.lower() in VIDEO_SUFFIXES


def tells_lens(path: Path) -> bool:
    """Return whether a recording may tell its camera: a bag, or a film with a focal length."""
    if not is_film(path):
        return True
    return equivalent_mm(image_files(path)[0] if path.is_dir() else path) is not None


def _check_packed(path: Path) -> None:
    """Raise BagError for a file, or the files of a folder, that another program has to open."""
    for file in sorted(path.iterdir()) if path.is_dir() else [path]:
        if file.suffix == ".active":
            raise BagError(f"{file} was left open by its recorder: {REPAIR_ROS1}")
        if file.suffix in _PACKED:
            raise BagError(
                f"{file} is compressed, without the metadata.yaml that its recorder wrote beside "
                f"it; unpack it first, such as with 'zstd -d {file.name}' (its ending says which "
                "program), or give the whole folder"
            )


def open_images(path: str | os.PathLike[str], camera: GivenCamera | None = None) -> ImageRecording:
    """Return the context of a recording: rosbag2 folder or file, video, or folder of images.

    ``camera`` has what the recording does not tell. Raises BagError if it is none of these.
    """
    path, camera = Path(path), camera or GivenCamera()
    if is_bag(path):
        if camera.fps is not None:
            raise BagError(f"--fps has no effect on {path}: the images of a bag have stamps")
        return BagReader(path, camera)
    if path.is_dir() and image_files(path):
        return ImageFolder(path, camera)
    check_exists(path)
    _check_packed(path)
    if path.is_dir():
        raise BagError(
            f"{path} is not a rosbag2 recording (it has no metadata.yaml), and it has no JPEG or "
            "PNG images; give a bag, a video, or a folder of images"
        )
    if not path.is_file():
        raise BagError(f"{path} is a pipe or a device; give a recording: a bag, a video or images")
    if path.suffix.lower() in SUFFIXES:
        raise BagError(f"{path} is a single image; give the folder of all images, or a video")
    return VideoReader(path, camera)
