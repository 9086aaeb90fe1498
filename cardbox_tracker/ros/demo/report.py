"""The demo's report: report.json, angles.png, overlay.mp4, and a printed table."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from cardbox_tracker.applications.drawing.video import video_file
from cardbox_tracker.applications.reporting.plots import angles_plot
from cardbox_tracker.camera.encodings import SentImage, decode_bgr
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import atomic_path
from cardbox_tracker.recordings.bag_reader import BagReader, stamp_ns_of
from cardbox_tracker.recordings.result_reader import Results, read_results
from cardbox_tracker.recordings.result_table import POINT_COLUMNS
from cardbox_tracker.recordings.truth import GroundTruth, tracking_error
from cardbox_tracker.tracking.estimate import UNCERTAIN

_VIDEO_HZ = 15.0


def figures(results: Results, truth: GroundTruth, start_ns: int) -> dict[str, object]:
    """Return the errors of the images from a stamp on, metres, and how many have a posture.

    Raises:
        CardboxError: no image has a posture.
    """
    expected = {stamp for stamp in truth.frames if stamp >= start_ns}
    points_m = results.of(POINT_COLUMNS).reshape(-1, len(POINT_COLUMNS) // 3, 3)
    images = zip(results.stamp_ns.tolist(), results.state, points_m, strict=True)
    found = {s: (state, m) for s, state, m in images if s in expected and np.isfinite(m).all()}
    error = tracking_error({stamp: m for stamp, (_, m) in found.items()}, truth)
    return {
        "cameras": max(1, len(truth.cameras)),
        "frames": len(expected),
        "frames_tracked": len(found),
        "frames_uncertain": sum(state == UNCERTAIN for state, _ in found.values()),
        "mean_3d_error_m": error.mean_m,
        "error_by_keypoint_m": error.by_keypoint_m,
        "error_by_segment_m": error.by_segment_m,
        "lateral_error_m": error.lateral_m,
        "vertical_error_m": error.vertical_m,
        "depth_error_m": error.depth_m,
    }


def write_report(output: Path, truth: GroundTruth, start_ns: int, run: dict[str, object]) -> None:
    """Write all files about the bag in ``output``, and print the table.

    Args:
        output: folder of the results.
        truth: ground truth of the session.
        start_ns: stamp of the first image after the initialization.
        run: further values of report.json.

    Raises:
        CardboxError: most images were not tracked, or a file cannot be written.
    """
    results = read_results(output / "bag")
    report = run | figures(results, truth, start_ns)
    with atomic_path(output / "report.json") as path:
        path.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    with atomic_path(output / "angles.png") as path:
        path.write_bytes(angles_plot(results))
    topic = "".join(f"/{name}" for name in [*truth.cameras][:1]) + "/overlay"
    with BagReader(output / "bag") as bag, video_file(output / "overlay.mp4", _VIDEO_HZ) as add:
        for image in map(bag.deserialize, bag.messages([topic])):
            if stamp_ns_of(image) >= start_ns:
                add(decode_bgr(SentImage.of(image)))
    rows = {
        "images after initialization": "{frames}",
        "of them tracked": "{frames_tracked}",
        "  of these uncertain": "{frames_uncertain}",
        "mean 3D error": "{mean_3d_error_m:.3f} m",
        "  of it in depth": "{depth_error_m:.3f} m",
        "initialization IoU": "{initialization_iou:.2f}",
        "joint states a second": "{fps:.1f}",
    }
    print("\n".join(f"  {name:32s}{text.format(**report):>10s}" for name, text in rows.items()))
    print(
        f"see {output}/overlay.mp4 and {output}/angles.png; "
        f"all figures are in {output}/report.json, the bag of results is {output}/bag"
    )
    tracked, expected = report["frames_tracked"], report["frames"]
    assert isinstance(tracked, int) and isinstance(expected, int)
    if 2 * tracked < expected:
        raise CardboxError(
            f"only {tracked} of {expected} images were tracked: the nodes were too slow; "
            "end other programs on this computer and run the demo again"
        )
