"""Sessions as films: size, times, optical axis and truth of a film, and the report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.tracking.estimate import NO_PERSON, TRACKING, Estimate, Place
from cardbox_tracker.tracking.place import STATURE
from lab.evaluation.films import SHAPES, film_figures, films_report, make_film
from lab.evaluation.session import load_session


@pytest.mark.parametrize("shape", SHAPES)
def test_a_film_shows_the_motions_with_the_axis_in_the_middle(
    shape: str, unmeasured: Path, tmp_path: Path
) -> None:
    session = load_session(unmeasured)
    film = make_film(unmeasured, shape, tmp_path / "film.mp4")
    video = cv2.VideoCapture(str(film.path))
    width, height = (int(video.get(p)) for p in (cv2.CAP_PROP_FRAME_WIDTH, 4))
    assert int(video.get(cv2.CAP_PROP_FRAME_COUNT)) == len(film.stamps_ns)
    assert (width < height) == (shape == "upright")
    # The empty scene is cut off, and nothing of the motions.
    begins_ns = session.truth.start_ns + 1e9 * session.start_s
    scored = {stamp for stamp in session.stamps_ns.tolist() if stamp >= begins_ns}
    assert film.stamps_ns[0] >= begins_ns
    assert scored and scored <= set(film.stamps_ns)
    # Shapes stay as they are; an upright phone points at the person.
    turned, straight = film.session.keypoints_m, session.keypoints_m
    np.testing.assert_allclose(
        np.linalg.norm(turned[:, 0] - turned[:, 2], axis=1),
        np.linalg.norm(straight[:, 0] - straight[:, 2], axis=1),
    )
    focal = width / 2 / np.tan(np.radians(film.fov_deg) / 2)
    columns = focal * turned[..., 0] / turned[..., 2]
    if shape == "upright":
        assert abs(np.median(columns.mean(axis=1))) < 0.05 * width
    # The person is where the truth says.
    last = film.stamps_ns.index(int(session.stamps_ns[-1]))
    video.set(cv2.CAP_PROP_POS_FRAMES, 0)
    images = [video.read()[1] for _ in range(last + 1)]
    assert images[last] is not None and np.ptp(images[last]) > 50


def test_motions_are_compared_where_each_shows_all_joints(unmeasured: Path, tmp_path: Path) -> None:
    whole = make_film(unmeasured, "across", tmp_path / "a.mp4").session
    film = make_film(unmeasured, "across", tmp_path / "b.mp4", is_compared=True)
    kept = film.session
    assert 0 < len(kept.stamps_ns) < len(whole.stamps_ns)
    assert len(kept.keypoints_m) == len(kept.segments) == len(kept.stamps_ns)
    stamps = np.array(film.stamps_ns)
    for session in (kept, whole):
        shares = (session.stamps_ns - stamps[0]) / (stamps[-1] - stamps[0])
        angles = np.degrees(np.arctan2(session.keypoints_m[..., 0], session.keypoints_m[..., 2]))
        away = np.abs(angles + (30.0 * shares - 15.0)[:, None]).max()
        assert (away < film.fov_deg / 2 + 1.0) == (session is kept)


def test_figures_have_the_pitch_and_what_is_sure_and_wrong(
    unmeasured: Path, tmp_path: Path
) -> None:
    film = make_film(unmeasured, "across", tmp_path / "film.mp4")
    truth = dict(zip(film.session.stamps_ns.tolist(), film.session.keypoints_m, strict=True))
    place = Place(np.full(3, 0.1), 0.0, STATURE)
    known: dict[str, Any] = {"place": place, "pitch_stddev_rad": 0.1}
    away = np.array([0.4, 0.0, 0.0])
    estimates = [
        Estimate(TRACKING, np.zeros(12), keypoints_m=truth[stamp] + (0.0, 0.0, 0.1), **known)
        if stamp in truth
        else Estimate(NO_PERSON)
        for stamp in film.stamps_ns
    ]
    body = BodyModel().with_values(camera_pitch_rad=np.radians(9.0))
    found = film_figures(film, estimates, body)
    assert found["absolute"] == pytest.approx(10.0)
    assert found["aligned"] == pytest.approx(0.0, abs=1e-6)
    seen = len(set(truth) & set(film.stamps_ns))
    assert (found["tracking"], found["tracking_beyond_30"]) == (seen, 0)
    verdicts = ("vertical", "vertical_wrong", "place", "place_wrong")
    assert [found[name] for name in verdicts] == [seen, 0, seen, 0]
    assert found["pitch_found_deg"] == pytest.approx(9.0)
    tilted = body.with_values(camera_pitch_rad=np.radians(found["pitch_deg"] + 11.0))
    aside = [
        one if one.keypoints_m is None else replace(one, keypoints_m=one.keypoints_m + away)
        for one in estimates
    ]
    wrong = film_figures(film, aside, tilted)
    assert [wrong[name] for name in verdicts] == [seen] * 4
    unsure = [replace(one, place=None, pitch_stddev_rad=0.2) for one in aside]
    assert [film_figures(film, unsure, tilted)[name] for name in verdicts] == [0] * 4
    entry = {
        "name": "waves, across",
        "group": "people",
        "shape": "across",
        "given": "nothing",
        "mediapipe_aligned": None,
        "runs": [found],
    }
    results = {"films": [entry, entry], "command": "made", "provenance": {"commit": "abc"}}
    report = films_report(results)
    assert "| waves, across | nothing | 0.0 | 10.0 |  | " in report
    assert f"| 9.0 / {found['pitch_deg']:.1f} |" in report
    assert "**mean of 2 in people, across**" in report


def test_a_film_needs_a_session(tmp_path: Path) -> None:
    with pytest.raises(CardboxError):
        make_film(tmp_path, "across", tmp_path / "film.mp4")
