"""The file of a body model is checked before anybody poses."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.ros.nodes.saved_model import SavedModel

BODY = BodyModel.of(distance_m=2.3)


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("fifo", "a pipe or a device"),
        ("/dev/zero", "a pipe or a device"),
        ("/dev/null", "a pipe or a device"),
        (".", "directory"),
        ("missing/model.yaml", "No such file .*; choose a folder"),
        ("text/model.yaml", "Not a directory"),
        ("n" * 300, "File name too long"),
        ("~nobody-here/model.yaml", "user"),
        ("text", "mapping"),
    ],
)
def test_what_cannot_be_used_is_told_at_the_start(name: str, words: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "text").write_text("no model")
    with pytest.raises(CardboxError, match=words):
        SavedModel(name if name.startswith("~") else str(tmp_path / name))


def test_a_file_that_is_there_is_read_and_one_that_is_not_is_written(tmp_path: Path) -> None:
    path = tmp_path / "model.yaml"
    saved = SavedModel(str(path))
    assert saved.body is None and not saved.warning
    assert saved.save(BODY) == f"; saved to {path}"
    assert SavedModel(str(path)).body == BODY
    none = SavedModel("")
    assert none.body is None and none.save(BODY) == ""


def test_a_file_that_can_only_be_read_is_used_with_a_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_body_model(BODY, tmp_path / "model.yaml")
    opened = os.open

    def refuse(path: str, flags: int, *rest: int) -> int:
        # Root may write everywhere.
        if flags & os.O_CREAT:
            raise PermissionError(13, "Permission denied")
        return opened(path, flags, *rest)

    monkeypatch.setattr("os.open", refuse)
    saved = SavedModel(str(tmp_path / "model.yaml"))
    assert saved.body == BODY
    assert "Permission denied" in saved.warning and "will not be saved" in saved.warning
