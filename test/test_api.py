"""The Python interface: its names, that each is there, and that importing the package is cheap."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cardbox_tracker
from cardbox_tracker.applications.simulation.person import person_frames
from cardbox_tracker.common import errors

ROOT = Path(__file__).resolve().parents[1]

# Written out, so that no name disappears or is added unnoticed.
PUBLIC = {
    "BackgroundConfig",
    "BackgroundFileError",
    "NotFiniteError",
    "BackgroundLearner",
    "BackgroundModel",
    "BagError",
    "BodyModel",
    "BodyModelError",
    "Calibration",
    "Camera",
    "CameraError",
    "CardboxError",
    "Depth",
    "Detector",
    "EncodingError",
    "Estimate",
    "Extrinsics",
    "ImagePoints",
    "InitializationConfig",
    "InitializationError",
    "InitializationResult",
    "JOINT_NAMES",
    "KEYPOINT_NAMES",
    "Observation",
    "OtherCamera",
    "PRESETS",
    "Request",
    "Result",
    "RosMissingError",
    "SceneWatch",
    "Session",
    "SilhouetteExtractor",
    "Tracker",
    "TrackerConfig",
    "body_from_proportions",
    "initialize_body",
    "load_body_model",
    "load_calibration",
    "load_extrinsics",
    "read_result",
    "save_body_model",
    "track",
}


def fresh(program: str) -> str:
    """Return what ``program`` prints in an interpreter that has imported nothing yet."""
    command = [sys.executable, "-c", program]
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=True).stdout


def typed() -> dict[str, str]:
    """Return the names that type checkers see, with the modules that they come from."""
    tree = ast.parse(Path(cardbox_tracker.__file__).read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    return {
        alias.name: str(node.module)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def test_the_names_are_these() -> None:
    assert set(cardbox_tracker.__all__) == PUBLIC
    assert len(cardbox_tracker.__all__) == len(PUBLIC)


@pytest.mark.parametrize("name", sorted(PUBLIC))
def test_each_name_is_what_its_module_and_the_type_checker_have(name: str) -> None:
    module = importlib.import_module(typed()[name])
    assert getattr(cardbox_tracker, name) is getattr(module, name)
    assert name in dir(cardbox_tracker)


def test_nothing_else_is_exported() -> None:
    program = "import cardbox_tracker; print(*dir(cardbox_tracker))"
    shown = {name for name in fresh(program).split() if not name.startswith("_")}
    assert shown - PUBLIC <= {"Any", "TYPE_CHECKING", "annotations", "import_module"}
    assert set(typed()) == PUBLIC
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = cardbox_tracker.no_such_name


def test_all_errors_are_exported() -> None:
    there = {
        name
        for name, value in vars(errors).items()
        if isinstance(value, type) and issubclass(value, errors.CardboxError)
    }
    assert there <= PUBLIC
    assert all(getattr(errors, name).__doc__ for name in there)


def test_importing_the_package_loads_no_large_library() -> None:
    program = (
        "import sys, cardbox_tracker; list(dir(cardbox_tracker)); print([n for n in "
        "('numpy', 'numba', 'cv2', 'rclpy', 'rosbags', 'yaml') if n in sys.modules])"
    )
    assert fresh(program) == "[]\n"


def examples() -> str:
    """Return the Python blocks of docs/python.md but the first two, of a film, as one program."""
    text = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    return "\n".join(re.findall(r"(?ms)^```python\n(.*?)^```$", text)[2:])


def test_the_examples_of_the_document_run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    names: dict[str, Any] = {}
    exec(compile(examples(), "docs/python.md", "exec"), names)
    state, *rest = capsys.readouterr().out.split(maxsplit=1)
    estimate, time_s = names["estimate"], names["time_s"]
    # A hand that points to the camera may be doubted.
    assert state == estimate.state in ("tracking", "uncertain")
    assert "left_hand" in rest[0]
    assert estimate.iou > 0.85
    true_m = person_frames(names["body"], names["wave"](time_s)).keypoints_m
    off_m = estimate.keypoints_m - names["camera"].reference_to_optical(true_m)
    assert np.linalg.norm(off_m, axis=1).max() < 0.1
    assert names["silhouette"].shape == (240, 320)
    assert set(names["silhouette"].ravel().tolist()) == {0, 255}


def test_the_document_names_all_of_the_interface() -> None:
    text = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    for name in PUBLIC:
        assert name in text, f"docs/python.md does not mention {name}"
