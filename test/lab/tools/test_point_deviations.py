"""Differences of points and bones from a truth that the test makes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.image_points import POINT_INDEX, POINT_NAMES, ImagePoints
from cardbox_tracker.recordings.truth import GroundTruth
from cardbox_tracker.terms import joint_points_kernels as kernels
from lab.evaluation.session import RecordedSession
from lab.tools import point_deviations as tool

PITCH_RAD = 0.3
CAMERA = Camera(640, 480, 600.0, 600.0, 320.0, 240.0, PITCH_RAD)
KEYPOINTS_M = np.array(
    [
        *[(0.15, -0.2, 2.5), (0.25, 0.05, 2.45), (0.1, 0.1, 2.2)],
        *[(-0.15, -0.2, 2.5), (-0.3, 0.0, 2.6), (-0.35, -0.25, 2.5)],
    ]
)
HIPS_M = np.array([0.0, 0.3, 2.6])
JOINTS_M = tool.true_points(KEYPOINTS_M, HIPS_M)
KINDS = {
    **{name: name for name in ("shoulder", "elbow", "wrist")},
    **dict.fromkeys(("index", "little_finger"), "knuckles"),
}
NAMES = {
    f"{side}_{name}": tool.POINTS[kind][arm]
    for arm, side in enumerate(("left", "right"))
    for name, kind in KINDS.items()
} | {"left_hip": kernels.HIPS, "right_hip": kernels.HIPS}


def seen(outwards_px: float = 0.0, is_level: bool = True) -> ImagePoints:
    """Points of the true joints, moved outwards, in space as from a level camera, or as seen."""
    px, scores = np.full((len(POINT_NAMES), 2), np.nan), np.zeros(len(POINT_NAMES))
    spatial_m = np.full((len(POINT_NAMES), 3), np.nan)
    c, s = np.cos(PITCH_RAD), np.sin(PITCH_RAD)
    level = np.array([(1.0, 0.0, 0.0), (0.0, c, s), (0.0, -s, c)])
    for name, row in NAMES.items():
        index, away = POINT_INDEX[name], outwards_px if "left" in name else -outwards_px
        px[index] = CAMERA.project(JOINTS_M[None, row])[0] + (away, 0.0)
        scores[index] = 1.0
        spatial_m[index] = level @ JOINTS_M[row] if is_level else JOINTS_M[row]
    return ImagePoints(px, scores, spatial_m=spatial_m)


def session(source: str, points: list[ImagePoints]) -> tool.Differences:
    rows = [tool.differences_of(one, JOINTS_M, CAMERA) for one in points]
    return tool.Differences(source, *map(np.array, zip(*rows, strict=True)))


def test_true_points_have_no_difference() -> None:
    off_px, metres, _, _ = tool.differences_of(seen(), JOINTS_M, CAMERA)
    np.testing.assert_allclose(off_px, 0.0, atol=1e-9)
    np.testing.assert_allclose(metres, 0.0, atol=1e-9)


def test_offsets_point_outwards_on_both_sides() -> None:
    off_px, metres, _, _ = tool.differences_of(seen(6.0), JOINTS_M, CAMERA)
    arms = [row for kind, rows in tool.POINTS.items() if kind != "hips" for row in rows]
    np.testing.assert_allclose(off_px[arms], np.tile([6.0, 0.0], (8, 1)), atol=1e-9)
    np.testing.assert_allclose(metres[arms, 0], 6.0 * JOINTS_M[arms, 2] / 600.0)


def test_points_with_a_small_score_are_unknown() -> None:
    points = seen()
    scores = points.scores.copy()
    scores[POINT_INDEX["left_elbow"]] = 0.4
    changed = ImagePoints(points.px, scores, spatial_m=points.spatial_m)
    off_px, _, bones, _ = tool.differences_of(changed, JOINTS_M, CAMERA)
    assert np.isnan(off_px[kernels.ELBOW]).all() and np.isfinite(off_px).sum() == 16
    assert np.isnan(bones[:2]).all() and np.isfinite(bones[2:]).all()


def test_bones_of_a_level_detector_are_compared_along_the_horizontal() -> None:
    """The person is in the middle of the image, so that the bearing is 0."""
    _, _, level, unturned = tool.differences_of(seen(), JOINTS_M, CAMERA)
    np.testing.assert_allclose(level, 0.0, atol=1e-3)
    assert np.abs(unturned[:4]).max() > 0.1


def test_bones_of_a_detector_that_knows_the_pitch_are_compared_along_the_axis() -> None:
    _, _, level, unturned = tool.differences_of(seen(is_level=False), JOINTS_M, CAMERA)
    np.testing.assert_allclose(unturned, 0.0, atol=1e-9)
    assert np.abs(level[:4]).max() > 0.1


def test_the_median_of_equal_weights_is_the_usual_one() -> None:
    values = np.random.default_rng(0).standard_normal(501)
    found = tool.weighted_median(values, np.ones(501))
    assert found == pytest.approx(np.median(values))
    assert tool.weighted_median(np.array([1.0, 2.0, 9.0]), np.array([1.0, 1.0, 8.0])) > 7.0


def test_the_deviation_is_that_of_one_direction() -> None:
    offsets = np.random.default_rng(1).normal((5.0, -2.0), 3.0, (20_000, 2))
    found = tool.offset_and_deviation(offsets, np.ones(len(offsets)))
    assert found == pytest.approx((5.0, -2.0, 3.0), abs=0.15)


def test_sources_weigh_alike_in_the_last_row() -> None:
    """Mean of the bones: five images that know the pitch, against one that does not."""
    every = {
        "one": session("a", [seen()]),
        "other": session("b", [seen(is_level=False)] * 5),
    }
    rows = [line.split(" | ") for line in tool.report(every).splitlines()]
    means = {row[0].strip("| "): row for row in rows[-3:]}
    one, other, both = (float(means[name][2].split()[0]) for name in ("one", "other", "all"))
    assert one == 0.0 and abs(other) > 0.1
    assert both == pytest.approx(0.5 * other, abs=0.011)


def test_unknown_kinds_have_a_dash() -> None:
    hidden = session("a", [seen()])
    hidden.px[:, kernels.HIPS], hidden.metres[:, kernels.HIPS] = np.nan, np.nan
    assert tool.report({"one": hidden}).splitlines()[2].endswith("| - |")


def measured(monkeypatch: pytest.MonkeyPatch, stamps_ns: list[int]) -> tool.Differences:
    """Measure images, of which that of 10 ns has a truth, and that of 20 ns nobody."""
    session = RecordedSession(
        *("name", Path("bag"), None),
        GroundTruth({}, {}, 0, 2.5, float(np.degrees(PITCH_RAD)), "left", source="films, CC0"),
        *({}, 0.0, np.array([10, 20]), np.full(2, "a"), np.array([KEYPOINTS_M] * 2)),
        *(np.zeros((2, 3)), {}, None, np.array([HIPS_M] * 2)),
    )

    @contextmanager
    def opened(_: RecordedSession) -> Iterator[SimpleNamespace]:
        yield SimpleNamespace(first=SimpleNamespace(camera=CAMERA.with_pitch(0.0)))

    images = [
        SimpleNamespace(
            stamp_ns=stamp, first=SimpleNamespace(points=None if stamp == 20 else seen())
        )
        for stamp in stamps_ns
    ]
    monkeypatch.setattr(tool, "first_camera_of", lambda _: session)
    monkeypatch.setattr(tool, "opened", opened)
    monkeypatch.setattr(tool, "motions", lambda *_: images)
    return tool.measured(Path("films"))


def test_images_with_truth_are_measured_with_the_pitch_of_the_truth(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = measured(monkeypatch, [10, 20, 30])
    assert found.source == "films" and len(found.px) == 1
    np.testing.assert_allclose(found.px, 0.0, atol=1e-9)
    np.testing.assert_allclose(found.bones, 0.0, atol=1e-3)


def test_a_session_in_which_nobody_is_found_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(CardboxError, match="finds nobody in the images of films"):
        measured(monkeypatch, [20, 30])
