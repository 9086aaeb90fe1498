"""The demo's report: report.json, joint_states.png, overlay.mp4, and a printed table."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

import matplotlib
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.drawing.overlay import draw_overlay
from cardbox_tracker.applications.drawing.video import video_file
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import atomic_path
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.person.skeleton import JOINT_NAMES
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.truth import GroundTruth, tracking_error
from cardbox_tracker.search.config import PRESETS
from cardbox_tracker.segmentation.silhouettes import SilhouettePipeline
from cardbox_tracker.terms.compiled import CompiledSilhouette
from cardbox_tracker.tracking.estimate import TRACKING, UNCERTAIN, Estimate


@dataclass(frozen=True)
class DemoResult:
    """Published data and ground truth.

    Attributes:
        body: the measured person.
        truth: ground truth of the session.
        start_ns: stamp of the first image after the initialization.
        postures: (12,) by stamp.
        keypoints_m: (6, 3) by stamp, metres in the optical frame.
        silhouettes: (H, W) by stamp.
        fps: received joint states per second.
        initialization_iou: mean fit of the references, as the initializer reported it.
        places_m: ``torso_x`` and ``torso_z`` (2,) by stamp; empty if they are kept constant.
        states: tracking state by stamp; a missing state means ``tracking``.
    """

    body: BodyModel
    truth: GroundTruth
    start_ns: int
    postures: dict[int, NDArray[np.float64]]
    keypoints_m: dict[int, NDArray[np.float64]]
    silhouettes: dict[int, NDArray[np.uint8]] = field(repr=False)
    fps: float
    initialization_iou: float
    places_m: dict[int, NDArray[np.float64]] = field(default_factory=dict)
    states: dict[int, str] = field(default_factory=dict)


matplotlib.use("Agg")

_VIDEO_SCALE = 2


def write_report(
    result: DemoResult, session: Path, output: Path, preset: str, seed: int
) -> dict[str, object]:
    """Write all files to ``output``, print the table and return the content of report.json.

    Raises:
        CardboxError: most images were not tracked, or a file cannot be written.
    """
    with BagReader(session) as bag:
        first = next(iter(result.truth.cameras), None)
        height, width = next(iter(result.silhouettes.values())).shape
        pitch_rad = result.body.camera_pose.pitch_rad
        camera = bag.calibration(first).camera(width, height, pitch_rad)
    expected = [stamp for stamp in result.truth.frames if stamp >= result.start_ns]
    tracked = [stamp for stamp in expected if stamp in result.postures]
    estimates = rate(result, camera, tracked)
    error = tracking_error({s: result.keypoints_m[s] for s in tracked}, result.truth)
    report: dict[str, object] = {
        "preset": preset,
        "seed": seed,
        "cameras": max(1, len(result.truth.cameras)),
        "frames": len(expected),
        "frames_tracked": len(tracked),
        "frames_uncertain": sum(result.states.get(stamp) == UNCERTAIN for stamp in tracked),
        "mean_3d_error_m": error.mean_m,
        "error_by_keypoint_m": error.by_keypoint_m,
        "error_by_segment_m": error.by_segment_m,
        "lateral_error_m": error.lateral_m,
        "vertical_error_m": error.vertical_m,
        "depth_error_m": error.depth_m,
        "mean_cost_px": float(np.mean([estimate.cost_px for estimate in estimates.values()])),
        "mean_iou": float(np.mean([estimate.iou for estimate in estimates.values()])),
        "fps": result.fps,
        "initialization_iou": result.initialization_iou,
    }
    with atomic_path(output / "report.json") as path:
        path.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    save_body_model(result.body, output / "body.yaml")
    plot_joint_states(result, tracked, output / "joint_states.png")
    body = PRESETS[preset]().with_shoulders(result.body)
    write_overlay(result, body, camera, estimates, session, output / "overlay.mp4")
    print_table(report, output)
    if 2 * len(tracked) < len(expected):
        raise CardboxError(
            f"only {len(tracked)} of {len(expected)} images were tracked: the nodes were too slow; "
            "end other programs on this computer and run the demo again"
        )
    return report


def rate(result: DemoResult, camera: Camera, stamps: Iterable[int]) -> dict[int, Estimate]:
    """Return the published estimates by stamp, with cost and IoU from the published silhouettes."""
    estimates = {}
    body, term = result.body, CompiledSilhouette(result.body, camera)
    for stamp in stamps:
        if stamp not in result.silhouettes:
            continue
        estimate = Estimate(
            result.states.get(stamp) or TRACKING,
            posture=result.postures[stamp],
            keypoints_m=result.keypoints_m.get(stamp),
            offset_m=result.places_m.get(stamp),
        )
        placed = estimate.placed(result.body)
        if placed != body:
            body, term = placed, CompiledSilhouette(placed, camera)
        cost_px, iou = term.look(result.silhouettes[stamp]).overlap(result.postures[stamp])
        estimates[stamp] = replace(estimate, cost_px=cost_px, iou=iou)
    return estimates


def plot_joint_states(result: DemoResult, stamps: list[int], path: Path) -> None:
    """Plot the estimated and the true positions of the 12 joints over time."""
    from matplotlib import pyplot as plt

    time_s = (np.array(stamps) - result.truth.start_ns) / 1e9
    estimate = np.array([result.postures[stamp] for stamp in stamps])
    postures = [result.truth.frames[stamp].posture for stamp in stamps]
    figure, axes = plt.subplots(6, 2, figsize=(13, 14), sharex=True)
    for i, (axis, name) in enumerate(zip(axes.T.ravel(), JOINT_NAMES, strict=True)):
        scale, unit = (1.0, "m") if name == "torso_y" else (180.0 / np.pi, "deg")
        axis.plot(time_s, [p[i] * scale for p in postures if p is not None], "k", lw=1.2)
        axis.plot(time_s, estimate[:, i] * scale, "tab:orange", lw=1.0)
        axis.set_ylabel(f"{name}\n[{unit}]", fontsize=8)
        axis.grid(alpha=0.3)
    axes[0, 0].legend(["truth", "estimate"], loc="upper right", fontsize=8)
    for axis in axes[-1]:
        axis.set_xlabel("seconds from the session's start")
    figure.tight_layout()
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=90)
    plt.close(figure)


def write_overlay(
    result: DemoResult,
    body: BodyModel,
    camera: Camera,
    estimates: dict[int, Estimate],
    session: Path,
    path: Path,
) -> None:
    """Write a video of the session's images with the published postures drawn over them."""
    nothing = Estimate("not_tracked")
    with BagReader(session) as bag, video_file(path, 15.0) as write:
        first = next(iter(result.truth.cameras), None)
        pipeline = SilhouettePipeline(bag.calibration(first), (camera.width, camera.height))
        for image in bag.images(bag.image_topic(first)):
            if image.stamp_ns >= result.start_ns:
                small = pipeline.prepare(image.as_sent)
                estimate = estimates.get(image.stamp_ns, nothing)
                write(draw_overlay(small, body, camera, estimate, _VIDEO_SCALE))


def print_table(report: dict[str, object], output: Path) -> None:
    """Print the main figures and the paths of the files."""
    rows = [
        ("images after initialization", f"{report['frames']}"),
        ("of them tracked", f"{report['frames_tracked']}"),
        ("  of these uncertain", f"{report['frames_uncertain']}"),
        ("mean 3D error", f"{100 * _number(report, 'mean_3d_error_m'):.1f} cm"),
        ("  of it in depth", f"{100 * _number(report, 'depth_error_m'):.1f} cm"),
        ("mean cost", f"{_number(report, 'mean_cost_px'):.0f} px"),
        ("initialization IoU", f"{_number(report, 'initialization_iou'):.2f}"),
        ("joint states a second", f"{_number(report, 'fps'):.1f}"),
    ]
    print("\n".join(f"  {name:32s}{value:>10s}" for name, value in rows))
    print(
        f"see {output}/overlay.mp4 and {output}/joint_states.png; "
        f"all figures are in {output}/report.json, the bag of results is {output}/bag"
    )


def _number(report: dict[str, object], key: str) -> float:
    value = report[key]
    assert isinstance(value, int | float)
    return float(value)
