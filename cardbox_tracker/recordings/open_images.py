"""Opens a recording of any kind: a bag, a video or a folder of images; finds those in a folder."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from cardbox_tracker.common.errors import BagError, CardboxError, in_cell
from cardbox_tracker.recordings.bag_files import FILE_ENDINGS, files_of_one, is_bag_file
from cardbox_tracker.recordings.bag_reader import REPAIR_ROS1, BagReader
from cardbox_tracker.recordings.given_camera import GivenCamera, told_focal
from cardbox_tracker.recordings.image_folder import SUFFIXES, ImageFolder, image_files
from cardbox_tracker.recordings.video_reader import FORMATS, VideoReader
from cardbox_tracker.recordings.video_reader import SUFFIXES as VIDEO_SUFFIXES

ImageRecording = BagReader | ImageFolder | VideoReader
"""Context of an open recording, whose methods raise BagError if it cannot be read.

A camera is named by its namespace; None is the only one.
"""

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
    return told_focal(image_files(path)[0] if path.is_dir() else path) is not None


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
    if path.suffix.lower() in (".csv", ".parquet"):
        raise BagError(f"{path} is a table; give the recording that it is of")
    return VideoReader(path, camera)


SUMMARY = "_summary.csv"
"""Name of the summary in a folder of results, by which such folders are left out."""

FORMULA = ("=", "+", "-", "@")
"""What spreadsheets take for the beginning of a formula."""

_DEEPEST = 50


def is_one_recording(path: Path) -> bool:
    """Return whether a path is a single recording, not a folder of them.

    A folder is one if it or its ``bag`` is a rosbag2, if it has just one bag or the parts of one,
    or if it has images and no rosbag2 in its folders.
    """
    if not path.is_dir() or _is_rosbag2(path):
        return True
    if files_of_one(path):
        return True
    return bool(image_files(path)) and not any(map(_is_rosbag2, path.iterdir()))


def _is_rosbag2(path: Path) -> bool:
    return any((folder / "metadata.yaml").is_file() for folder in (path, path / "bag"))


def recordings_in(folder: Path, output: Path | None = None) -> dict[str, Path]:
    """Return the recordings in and below ``folder``, which is none itself, by name, in order.

    A name is the path from ``folder`` on, with "/". It has the ending of the file only where
    another recording would have the same name. Hidden entries, folders of results and ``output``
    are left out, and links to folders are followed only if they are recordings. Raises CardboxError
    if a folder cannot be read, or folders are nested too deep.
    """
    left_out = None if output is None else output.resolve()
    paths = {path.relative_to(folder): path for path in _found(folder, left_out, 0)}
    short = {path: path if paths[path].is_dir() else path.with_suffix("") for path in paths}
    count = Counter([*short.values(), *paths])
    names = {
        (short[path] if count[short[path]] == 1 + (short[path] == path) else path).as_posix(): path
        for path in paths
    }
    return {_plain(name): paths[names[name]] for name in sorted(names)}


def _found(folder: Path, left_out: Path | None, depth: int) -> Iterator[Path]:
    if depth > _DEEPEST:
        raise CardboxError(
            f"{folder} is nested more than {_DEEPEST} folders deep; give the folder that "
            "has the recordings"
        )
    try:
        with os.scandir(folder) as entries:
            names = sorted(entry.name for entry in entries if not entry.name.startswith("."))
        if SUMMARY in names:
            return
        for path in (folder / name for name in names):
            if path.is_file():
                if is_bag_file(path) or path.suffix.lower() in VIDEO_SUFFIXES:
                    yield path
            elif path.is_dir() and path.resolve() != left_out:
                if is_one_recording(path):
                    yield path
                elif not path.is_symlink():
                    yield from _found(path, left_out, depth + 1)
    except OSError as error:
        raise CardboxError(
            f"cannot read the folder {folder}: {error.strerror}; give a folder whose "
            "folders can be read"
        ) from None


def _plain(name: str) -> str:
    """Return a name that a table, a terminal and a spreadsheet show as it is."""
    shown = in_cell(name)
    return f"./{shown}" if shown.startswith(FORMULA) else shown
