"""Observations: named channels, what they refuse, and other ones that are made of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.view import View
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.tracking.observation import CHANNELS, Channel, Observation, pixels_from
from cardbox_tracker.tracking.tracked_camera import TrackedCamera

CAMERA = Camera(160, 120, 165.0, 165.0, 79.5, 59.5)
MASK = np.full((120, 160), 255, np.uint8)
DEPTH_M = np.full((120, 160), 2.0, np.float32)
POINTS = ImagePoints.of({"nose": (80.0, 20.0, 0.9)})


def test_channels_have_the_data_that_was_given() -> None:
    one = Observation(MASK, depth_m=DEPTH_M, stamp_ns=5, points=POINTS)
    assert one.silhouette is MASK and one.depth_m is DEPTH_M and one.points is POINTS
    assert one.image is None and one.stamp_ns == 5
    assert set(one.channels) == {"silhouette", "depth_m", "points"}
    assert Observation().channels == {} and Observation().silhouette is None


def test_another_observation_has_other_channels_and_the_rest() -> None:
    one = Observation(MASK, depth_m=DEPTH_M, stamp_ns=5)
    other = one.having(points=POINTS, depth_m=None)
    assert other.silhouette is MASK and other.points is POINTS and other.depth_m is None
    assert other.stamp_ns == 5 and one.having(stamp_ns=7).stamp_ns == 7
    assert set(one.channels) == {"silhouette", "depth_m"}
    with pytest.raises(ValueError, match=r"no channel .dept.; expected any of silhouette, cov"):
        one.having(dept=DEPTH_M)


@pytest.mark.parametrize(
    ("channels", "text"),
    [
        ({"silhouette": MASK[:, :80]}, r"silhouette of the first camera .*\(120, 80\)"),
        ({"image": MASK[:60]}, r"image of the first camera .*\(60, 160\)"),
        ({"depth_m": DEPTH_M[:60]}, r"depth_m of the first camera .*\(60, 160\)"),
        ({"points": [1, 2]}, "points of the first camera are of the type list; .*ImagePoints"),
        ({"marks": np.zeros(3)}, r"marks of the first camera has the shape \(3,\)"),
        ({"marks": np.array([["a", "b"]])}, "marks of the first camera .*type <U1"),
    ],
)
def test_a_channel_that_does_not_fit_the_camera_is_named(
    monkeypatch: pytest.MonkeyPatch, channels: dict[str, Any], text: str
) -> None:
    monkeypatch.setitem(CHANNELS, "marks", Channel(pixels_from, View.upright_px))
    config = default_preset()
    camera = TrackedCamera(BodyModel(), CAMERA, config)
    camera.reset(config)
    with pytest.raises(ValueError, match=text):
        camera.frame(Observation(**{"silhouette": MASK, **channels}), None, True)
    frame = camera.frame(Observation(MASK, marks=np.ones((4, 2), np.int32)), None, True)
    assert frame["marks"].dtype == np.float64 and frame["marks"].shape == (4, 2)


@pytest.mark.parametrize("stamp", [float("nan"), 1.5, "now"])
def test_a_stamp_that_is_no_whole_number_is_refused(stamp: Any) -> None:
    with pytest.raises(ValueError, match=r"stamp_ns of an observation is .*nanoseconds"):
        Observation(MASK, stamp_ns=stamp)
    assert Observation(MASK, stamp_ns=np.int64(7)).stamp_ns == 7


def test_without_a_silhouette_there_are_no_channels_either() -> None:
    config = default_preset()
    camera = TrackedCamera(BodyModel(), CAMERA, config)
    camera.reset(config)
    for given in (None, Observation(), Observation(image=MASK, depth_m=DEPTH_M, points=POINTS)):
        frame = camera.frame(given, None, True)
        assert not frame.silhouette.any() and frame.foreground_px == 0
        assert frame.image is None and frame.depth_m is None and frame.points is None
        assert frame.before is None
