"""``model_file``: checked at the start, and no measurement is lost where it cannot be written."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

rclpy = pytest.importorskip("rclpy", reason="rclpy is not installed")

from rclpy.context import Context  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402

from cardbox_tracker.body.model import BodyModel  # noqa: E402
from cardbox_tracker.body.model_file import load_body_model, save_body_model  # noqa: E402
from cardbox_tracker.body.posture import REFERENCE_NAMES  # noqa: E402
from cardbox_tracker.errors import CardboxError  # noqa: E402
from cardbox_tracker.estimation.initialization.config import InitializationResult  # noqa: E402
from cardbox_tracker.ros.nodes import initializer_node, second_camera  # noqa: E402
from cardbox_tracker.ros.nodes.camera_node import CameraNode  # noqa: E402
from cardbox_tracker.ros.nodes.saved_model import SavedModel  # noqa: E402
from cardbox_tracker.ros.nodes.tracker_node import TrackerNode  # noqa: E402
from cardbox_tracker.vision.camera import Camera  # noqa: E402

BODY = BodyModel.of(distance_m=2.3)


@pytest.fixture
def context(ros_domain: int) -> Iterator[Context]:
    # Nodes whose construction fails live on for a while; here nobody meets them.
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain)
    yield context
    context.try_shutdown()


@pytest.mark.promise("A model_file that cannot be used is told when the node starts")
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("fifo", "a pipe or a device"),
        ("/dev/zero", "a pipe or a device"),
        ("/dev/null", "a pipe or a device"),
        (".", "directory"),
        ("missing/model.yaml", "No such file or directory; choose a folder"),
        ("text/model.yaml", "Not a directory"),
        ("n" * 300, "File name too long"),
        ("~nobody-here/model.yaml", "there is no such user"),
        ("text", "expected a mapping"),
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
    # Root may write everywhere.
    monkeypatch.setattr("cardbox_tracker.files.os.access", lambda *_: False)
    saved = SavedModel(str(tmp_path / "model.yaml"))
    assert saved.body == BODY
    assert "Permission denied" in saved.warning and "will not be saved" in saved.warning


@pytest.mark.parametrize("make", [TrackerNode, initializer_node.InitializerNode, CameraNode])
def test_a_home_folder_is_known_to_every_node(
    make: Any, context: Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr("cardbox_tracker.ros.nodes.camera_node.open_video", lambda _: None)
    (tmp_path / "bad.yaml").write_text("- nothing\n")
    name = "calibration_file" if make is CameraNode else "model_file"
    parameters = (
        {name: "~/bad.yaml", "file": "video"} if make is CameraNode else {name: "~/bad.yaml"}
    )
    overrides = [Parameter(key, value=value) for key, value in parameters.items()]
    with pytest.raises(CardboxError, match=rf"{tmp_path}/bad\.yaml: expected a mapping"):
        make(context=context, parameter_overrides=overrides, enable_rosout=False)


@pytest.mark.promise("A measurement that cannot be saved costs no second posing")
def test_a_folder_that_is_gone_costs_no_second_posing(
    context: Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "people"
    folder.mkdir()
    path = folder / "model.yaml"
    result = InitializationResult(BODY, dict.fromkeys(REFERENCE_NAMES, 0.9), {}, {})
    monkeypatch.setattr(second_camera, "initialize_body", lambda *_: result)
    node = initializer_node.InitializerNode(
        context=context,
        parameter_overrides=[Parameter("model_file", value=str(path))],
        enable_rosout=False,
    )
    references = node._references
    monkeypatch.setattr(references, "check_running", lambda: None)
    node._camera = Camera(32, 24, 30.0, 30.0, 15.5, 11.5)
    captured = {name: np.zeros((24, 32), np.uint8) for name in REFERENCE_NAMES}
    references.captured = dict(captured)
    shutil.rmtree(folder)
    with pytest.raises(CardboxError, match=r"published, but not saved: .*call initialize again"):
        node._measure()
    assert references.captured.keys() == captured.keys()
    folder.mkdir()
    assert f"saved to {path}" in node._measure()
    assert load_body_model(path) == BODY
    assert not references.captured
    node.close()
    node.destroy_node()
