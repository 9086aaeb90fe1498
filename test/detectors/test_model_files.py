"""The network files: taken out of a wheel, checked by hash, or refused with the remedy."""

from __future__ import annotations

import hashlib
import zipfile
from pathlib import Path

import pytest

from cardbox_tracker.commands.main import main
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors import model_files
from cardbox_tracker.detectors.model_files import (
    install_models,
    installed_hands,
    installed_models,
    model_folder,
)

CONTENTS = {
    "pose_detection.tflite": b"detector",
    "pose_landmark_full.tflite": b"landmarks",
    "hand_landmark_full.tflite": b"hands",
}


@pytest.fixture
def wheel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A wheel with two small files, which the package expects instead of the networks."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    files = {
        name: model_files.ModelFile(f"inside/{name}", hashlib.sha256(content).hexdigest())
        for name, content in CONTENTS.items()
    }
    monkeypatch.setattr(model_files, "FILES", files)
    path = tmp_path / "some.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in CONTENTS.items():
            archive.writestr(f"inside/{name}", content)
    return path


def test_files_are_installed_and_found_again(wheel: Path) -> None:
    models = install_models(wheel)
    assert models == installed_models()
    assert models.detector.read_bytes() == b"detector"
    assert models.landmarks.parent == model_folder()
    assert installed_hands().read_bytes() == b"hands"


def test_people_are_found_where_a_former_version_installed_no_hands(wheel: Path) -> None:
    models = install_models(wheel)
    installed_hands().unlink()
    assert installed_models() == models
    with pytest.raises(CardboxError, match=r"hand_landmark_full\.tflite.*--install"):
        installed_hands()


def test_missing_files_are_named_with_the_remedy(wheel: Path) -> None:
    with pytest.raises(CardboxError, match=r"pose_detection\.tflite.*cardbox detector --install"):
        installed_models()


def test_a_damaged_file_is_not_used(wheel: Path) -> None:
    install_models(wheel).landmarks.write_bytes(b"other")
    with pytest.raises(CardboxError, match=r"pose_landmark_full\.tflite.*--install"):
        installed_models()


def test_a_wheel_with_another_file_is_refused(wheel: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "other.whl", "w") as archive:
        for name in CONTENTS:
            archive.writestr(f"inside/{name}", b"another network")
    with pytest.raises(CardboxError, match=r"other\.whl.*mediapipe==0\.10\.21"):
        install_models(tmp_path / "other.whl")
    assert not model_folder().exists()


@pytest.mark.parametrize("content", [b"", b"no archive", b"PK\x05\x06" + bytes(18)])
def test_a_file_that_is_no_such_wheel_is_refused(
    wheel: Path, tmp_path: Path, content: bytes
) -> None:
    (tmp_path / "bad.whl").write_bytes(content)
    with pytest.raises(CardboxError, match=r"bad\.whl.*--wheel"):
        install_models(tmp_path / "bad.whl")


def test_the_command_names_what_is_missing(wheel: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["detector"]) == 1
    assert "cardbox detector --install" in capsys.readouterr().err
