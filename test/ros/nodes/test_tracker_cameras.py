"""The tracker node with two cameras: either may be silent, and the fit of each is reported."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

rclpy = pytest.importorskip("rclpy", reason="rclpy is not installed")

from builtin_interfaces.msg import Time  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from std_msgs.msg import Header  # noqa: E402

from cardbox_tracker.camera.camera import Camera  # noqa: E402
from cardbox_tracker.camera.extrinsics import Extrinsics  # noqa: E402
from cardbox_tracker.camera.rasterisation import render  # noqa: E402
from cardbox_tracker.camera.view import OtherCamera, View  # noqa: E402
from cardbox_tracker.person.cardbox import cardbox_patches  # noqa: E402
from cardbox_tracker.person.model import BodyModel  # noqa: E402
from cardbox_tracker.person.model_file import save_body_model  # noqa: E402
from cardbox_tracker.person.posture import reference_posture  # noqa: E402
from cardbox_tracker.ros.messages.conversions import (  # noqa: E402
    camera_info_message,
    image_message,
)
from cardbox_tracker.ros.nodes.tracker_node import TrackerNode  # noqa: E402

CAMERA = Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
BODY = BodyModel.of(distance_m=2.3, hip_height_m=-0.4)
BASELINE_M = 0.3
S = 10**9


def silhouettes() -> list[np.ndarray]:
    moved = Extrinsics(np.eye(3), np.array([-BASELINE_M, 0.0, 0.0]))
    view = View.of(BODY, CAMERA, OtherCamera(CAMERA, moved))
    state = np.append(reference_posture("front"), [0.0, 0.0])
    posture = view.states(state)[:12]
    there = render(cardbox_patches(view.body, posture), view.camera)
    return [render(cardbox_patches(BODY, state[:12]), CAMERA), there]


@pytest.fixture
def node(make_node: Callable[..., Any], hands: Any, tmp_path: Path) -> Iterator[TrackerNode]:
    save_body_model(BODY, tmp_path / "body.yaml")
    values = {"model_file": str(tmp_path / "body.yaml"), "cameras": ["left", "right"]}
    made = TrackerNode(
        intra_process=hands,
        context=make_node().context,
        enable_rosout=False,
        parameter_overrides=[Parameter(name, value=value) for name, value in values.items()],
    )
    for number, name in enumerate(("left", "right")):
        info = camera_info_message(Header(frame_id=name), CAMERA)
        info.p[3] = -number * BASELINE_M * info.p[0]
        hands.give(f"/{name}/silhouette/camera_info", info)
    yield made
    made.destroy_node()


def test_each_fit_is_told_and_a_camera_may_be_silent(node: TrackerNode, hands: Any) -> None:
    seen = silhouettes()

    def show(first: int, names: tuple[str, ...]) -> dict[str, str]:
        for number in range(first, first + 10):
            header = Header(stamp=Time(sec=1, nanosec=number * S // 15))
            for name, pixels in zip(("left", "right"), seen, strict=True):
                if name in names:
                    hands.give(f"/{name}/silhouette", image_message(header, pixels, "mono8"))
        return node.diagnostics.extra()

    both = show(0, ("left", "right"))
    assert (both["images tracking"], both["left late"], both["right late"]) == ("10", "0", "0")
    assert min(float(both[f"{name} iou"]) for name in ("left", "right")) > 0.6
    # The node waits for the other camera, so the last images are not yet tracked.
    alone = show(10, ("right",))
    # One outline leaves more doubt than two.
    assert sum(int(alone.get(f"images {state}", 0)) for state in ("tracking", "uncertain")) > 14
    assert alone["left iou"] == "sees nobody"
    assert float(alone["right iou"]) > 0.6
