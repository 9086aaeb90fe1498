"""The policy allows the nodes what they have in the running graph, and nothing else."""

from __future__ import annotations

import contextlib
import importlib
import warnings
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")
with contextlib.suppress(ImportError), warnings.catch_warnings():
    # What rclpy imports with the first message uses modules that Python has deprecated.
    warnings.simplefilter("ignore", DeprecationWarning)
    importlib.import_module("lark")

from lab.tools import sros2_policy

NODES = ("camera", "play_bag", "background", "initializer", "tracker")


@pytest.mark.promise("The SROS 2 policy is what the running nodes need, and no more")
@pytest.mark.parametrize("layout", sros2_policy.LAYOUTS, ids=lambda layout: layout.file)
def test_the_policy_is_that_of_the_running_nodes(
    tmp_path: Path, ros_domains: Iterator[int], layout: sros2_policy.Layout
) -> None:
    graph = sros2_policy.read_graph(tmp_path, layout, next(ros_domains))
    assert sros2_policy.policy(graph) == layout.path.read_text(encoding="utf-8"), (
        "write it again: python -m lab.tools.sros2_policy"
    )


ONE, TWO, STEREO = sros2_policy.LAYOUTS


def allowed(node: str, kind: str, verb: str, layout: sros2_policy.Layout = ONE) -> set[str]:
    root = ElementTree.parse(layout.path).getroot()
    parts = root.findall(f".//enclave[@path='/cardbox/{node}']//{kind}s[@{verb}='ALLOW']/{kind}")
    return {str(part.text) for part in parts}


def test_nobody_may_do_what_is_not_theirs() -> None:
    # The tracker publishes the body that it found of a stature.
    assert {node for node in NODES if "body_model" in allowed(node, "topic", "publish")} == {
        "initializer",
        "tracker",
    }
    assert allowed("tracker", "topic", "subscribe") >= {"silhouette", "body_model"}
    assert "image_raw" not in allowed("tracker", "topic", "subscribe")
    for node in NODES:
        assert not allowed(node, "service", "request")
    assert "tracker/reset" in allowed("operator", "service", "request")
    assert not [name for name in allowed("operator", "service", "request") if "parameters" in name]
    assert allowed("operator", "topic", "publish") == {"/rosout", "/parameter_events"}


def test_several_cameras_have_an_enclave_each_and_the_tracker_hears_all() -> None:
    for layout in (TWO, STEREO):
        silhouettes = {f"{name}/silhouette" for name in layout.cameras}
        assert allowed("tracker", "topic", "subscribe", layout) >= silhouettes | {"/tf_static"}
        assert "silhouette" not in allowed("tracker", "topic", "subscribe", layout)
        operator = allowed("operator", "service", "request", layout)
        for name in layout.cameras:
            own = allowed(f"{name}/background", "topic", "subscribe", layout)
            assert {"image_raw", "camera_info"} <= own, "relative to the camera's namespace"
            assert f"{name}/background/learn" in operator
    assert "depth" in allowed("tracker", "topic", "subscribe", STEREO)
    assert allowed("stereo_depth", "topic", "publish", STEREO) >= {"depth", "depth/camera_info"}
    assert not allowed("stereo_depth", "topic", "publish", TWO)
