"""``model_file`` is checked at the start, and a failed write does not lose the measurement."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.measuring.config import InitializationResult
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import load_body_model
from cardbox_tracker.person.posture import REFERENCE_NAMES
from cardbox_tracker.ros.nodes import initializer_node, reference_capture
from cardbox_tracker.ros.nodes.camera_node import CameraNode
from cardbox_tracker.ros.nodes.tracker_node import TrackerNode

BODY = BodyModel.of(distance_m=2.3)


@pytest.fixture
def context(ros_domain: int) -> Iterator[Context]:
    # Nodes whose construction fails live on for a while, so they get their own context.
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain)
    yield context
    context.try_shutdown()


@pytest.mark.parametrize("make", [TrackerNode, initializer_node.InitializerNode, CameraNode])
def test_a_home_folder_is_known_to_every_node(
    make: Any, context: Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr("cardbox_tracker.ros.nodes.camera_node.open_video", lambda _: Mock())
    monkeypatch.setattr("cardbox_tracker.ros.nodes.camera_node.oblong", lambda _: 1.0)
    (tmp_path / "bad.yaml").write_text("- nothing\n")
    name = "calibration_file" if make is CameraNode else "model_file"
    more = {"file": "video", "rate_hz": 15.0} if make is CameraNode else {}
    parameters = {name: "~/bad.yaml", **more}
    overrides = [Parameter(key, value=value) for key, value in parameters.items()]
    with pytest.raises(CardboxError, match=rf"{tmp_path}/bad\.yaml: .*mapping"):
        make(context=context, parameter_overrides=overrides, enable_rosout=False)


@pytest.mark.promise("Outputs are written whole or not at all, never over inputs")
def test_a_folder_that_is_gone_costs_no_second_posing(
    context: Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "people"
    folder.mkdir()
    path = folder / "model.yaml"
    result = InitializationResult(BODY, dict.fromkeys(REFERENCE_NAMES, 0.9), {}, {})
    monkeypatch.setattr(reference_capture, "initialize_body", lambda *_: result)
    node = initializer_node.InitializerNode(
        context=context,
        parameter_overrides=[Parameter("model_file", value=str(path))],
        enable_rosout=False,
    )
    references = node._references
    monkeypatch.setattr(type(references), "has_silhouettes", True)
    monkeypatch.setattr(references, "check_running", lambda: None)
    node._camera = Camera(32, 24, 30.0, 30.0, 15.5, 11.5)
    captured = {name: np.zeros((24, 32), np.uint8) for name in REFERENCE_NAMES}
    references.captured = dict(captured)
    shutil.rmtree(folder)
    with pytest.raises(CardboxError, match=r"not saved: .*call initialize"):
        node._measure()
    assert references.captured.keys() == captured.keys()
    folder.mkdir()
    assert f"saved to {path}" in node._measure()
    assert load_body_model(path) == BODY
    assert not references.captured
    node.close()
    node.destroy_node()
