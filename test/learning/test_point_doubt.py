"""The fit of the doubt about points, on frames whose coefficients are known."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.body.model import PROPORTIONS
from cardbox_tracker.estimation.filtering import point_doubt
from cardbox_tracker.evaluation.recorded.session import RecordedSession
from cardbox_tracker.evaluation.truth import GroundTruth
from learning import point_doubt as tool
from learning.logistic import chances
from learning.point_doubt import SHIPPED, Frames, fitted, kept, report, together

TRUE = np.array([-1.0, 4.0, -2.0, 20.0, 0.5])
SCALE = np.array([0.3, 1.0, 0.1, 3.0])


def frames(source: str, count: int, seed: int) -> Frames:
    """Frames of a source that are wrong with the chance of the coefficients ``TRUE``."""
    rng = np.random.default_rng(seed)
    features = rng.random((count, len(SCALE))) * SCALE
    return Frames(source, features, rng.random(count) < chances(TRUE, features))


def test_the_shipped_coefficients_give_the_chance_of_the_package() -> None:
    features = np.array([0.2, 0.5, 0.03, 2.0])
    expected = point_doubt.chance_of_error(features)
    assert chances(SHIPPED, features[None])[0] == pytest.approx(expected)


def test_known_coefficients_are_recovered() -> None:
    """Wrong and right frames weigh alike, which moves the intercept alone."""
    every = together([frames("a", 100_000, 0)])
    found = fitted(every, inverse_penalty=1e6)
    share = every.is_wrong.mean()
    assert found[0] == pytest.approx(TRUE[0] - np.log(share / (1.0 - share)), abs=0.15)
    np.testing.assert_allclose(found[1:] * SCALE, TRUE[1:] * SCALE, atol=0.15)


def test_each_source_weighs_alike() -> None:
    """A source with the opposite coefficients cancels another one, however small it is."""
    one, other = frames("a", 40_000, 1), frames("b", 8_000, 2)
    opposite = other._replace(is_wrong=~other.is_wrong)
    found = fitted(together([one, opposite]))
    assert np.abs(found[1:] * SCALE).max() < 0.25


def test_the_shares_of_certain_and_of_wrong_frames() -> None:
    features = np.zeros((4, 4))
    features[3, 2] = 2.0 * point_doubt.FAR_M
    every = together([Frames("a", features, np.array([True, False, False, True]))])
    # The last one is far from its point, so that it is uncertain with any chance.
    assert kept(every, np.array([0.1, 0.1, 0.9, 0.0]), 0.25) == pytest.approx((0.5, 0.5))
    share, wrong = kept(every, np.ones(4), 0.25)
    assert share == 0.0 and np.isnan(wrong)


def rows_of_sources(text: str, sources: int) -> list[list[str]]:
    rows = [line.split() for line in text.splitlines()]
    (start,) = (number for number, row in enumerate(rows) if row[:2] == ["left", "out"])
    return rows[start + 1 : start + 1 + sources]


def test_the_report_judges_sources_that_are_left_out() -> None:
    """The fit orders the frames of another source better than coefficients of other data."""
    rows = rows_of_sources(report([frames(one, 4_000, n) for n, one in enumerate("aabc", 3)]), 3)
    assert [row[0] for row in rows] == ["a", "b", "c"]
    assert all(0.7 < float(row[1]) < 1.0 and float(row[1]) > float(row[2]) for row in rows)


def test_a_source_without_wrong_frames_has_no_area() -> None:
    right = frames("b", 100, 7)._replace(is_wrong=np.zeros(100, bool))
    one, other = rows_of_sources(report([frames("a", 1_000, 6), right]), 2)
    # Nothing can be fitted to the right frames alone.
    assert one[1] == "nan" and 0.0 < float(one[2]) < 1.0
    assert other[1:4] == ["nan", "nan", "0.0"]


def test_without_wrong_frames_there_is_no_fit() -> None:
    right = frames("a", 100, 8)._replace(is_wrong=np.zeros(100, bool))
    with pytest.raises(ValueError, match="class"):
        report([right])


def test_images_with_truth_and_points_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hand that is 21 cm off makes an image wrong; images without points have no features."""
    shipped = point_doubt.chance_of_error
    stamps_ns = [10, 20, 30, 40]
    off_m = dict(zip([*stamps_ns, 50], [0.19, 0.21, 0.5, 0.0, 0.5], strict=True))
    true_m = np.zeros((4, 6, 3))
    true_m[3, 0] = np.nan
    session = RecordedSession(
        *("name", Path("bag"), None),
        GroundTruth({}, {}, 0, 2.5, 10.0, "left", stature_m=1.6, source="films, CC0"),
        *({}, 0.0, np.array(stamps_ns), np.full(4, "a"), true_m, np.zeros((4, 3)), {}, None),
    )
    bodies: list[Any] = []

    class Tracker:
        def __init__(self, body: Any, *_: object) -> None:
            bodies.append(body)

        def track(self, stamp_ns: int) -> SimpleNamespace:
            # The image 30 is without points.
            if stamp_ns != 30:
                assert np.isinf(point_doubt.FAR_M)
                point_doubt.chance_of_error(np.full(4, float(stamp_ns)))
            found = np.zeros((6, 3))
            found[5, 2] = off_m[stamp_ns]
            return SimpleNamespace(keypoints_m=found)

    @contextmanager
    def opened(_: RecordedSession) -> Iterator[SimpleNamespace]:
        yield SimpleNamespace(first=SimpleNamespace(camera=None))

    images = [SimpleNamespace(stamp_ns=stamp, observations=stamp) for stamp in off_m]
    monkeypatch.setattr(tool, "first_camera_of", lambda _: session)
    monkeypatch.setattr(tool, "opened", opened)
    monkeypatch.setattr(tool, "motions", lambda *_: images)
    monkeypatch.setattr(tool, "Tracker", Tracker)
    found = tool.frames_of(Path("films"))
    assert found.source == "films"
    np.testing.assert_array_equal(found.features[:, 0], [10.0, 20.0])
    assert found.is_wrong.tolist() == [False, True]
    (body,) = bodies
    assert body.source == PROPORTIONS and body.placement.distance_m == 2.5
    assert point_doubt.chance_of_error is shipped and np.isfinite(point_doubt.FAR_M)
