"""Depth images, and depth from a rectified pair."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from cardbox_tracker.camera.depth_image import at_size, decode_depth
from cardbox_tracker.camera.encodings import SentImage
from cardbox_tracker.camera.stereo import StereoDepth
from cardbox_tracker.common.errors import CameraError, EncodingError


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


@pytest.mark.parametrize("big", [False, True])
def test_depth_is_in_metres_whatever_its_encoding(big: bool) -> None:
    order = ">" if big else "<"
    metres = np.array([[1.0, 2.5], [0.0, 0.75]], np.float32)
    for encoding, raw in (
        ("16UC1", (1000 * metres).astype(f"{order}u2")),
        ("32FC1", np.where(metres > 0, metres, np.nan).astype(f"{order}f4")),
    ):
        step = 2 * raw.itemsize + 3
        rows = np.zeros((2, step), np.uint8)
        rows[:, : 2 * raw.itemsize] = raw.view(np.uint8)
        found = decode_depth(SentImage(rows.tobytes(), 2, 2, step, encoding, big))
        np.testing.assert_allclose(found, metres, rtol=1e-6)
    assert at_size(found, 4, 4).shape == (4, 4)


def test_what_is_no_depth_is_refused() -> None:
    with pytest.raises(EncodingError, match="16UC1"):
        decode_depth(SentImage(b"", 1, 1, 1, "rgb8", False))
    with pytest.raises(EncodingError, match="incomplete"):
        decode_depth(SentImage(b"12", 2, 2, 4, "16UC1", False))


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@pytest.mark.parametrize(
    ("baseline_m", "words"),
    [(-0.12, "left camera the first"), (0.0, "left camera"), (np.nan, "left"), (120.0, "millim")],
)
def test_a_baseline_that_cannot_be_is_refused(baseline_m: float, words: str) -> None:
    with pytest.raises(CameraError, match=words):
        StereoDepth(250.0, baseline_m)


def test_a_wall_is_found_at_its_distance(rng: np.random.Generator) -> None:
    fx, baseline_m, shift = 200.0, 0.1, 10
    wall = rng.integers(0, 255, (60, 160)).astype(np.uint8)
    left, right = wall[:, :140], wall[:, shift : 140 + shift]
    depth = StereoDepth(fx, baseline_m)(left, right)
    seen = depth[:, 60:130]
    assert np.median(seen[seen > 0]) == pytest.approx(fx * baseline_m / shift, rel=0.02)
    assert np.mean(seen > 0) > 0.8
    with pytest.raises(CameraError, match="left camera"):
        StereoDepth(fx, -baseline_m)


@pytest.mark.promise("Cameras that disagree, or that come and go, are reported")
@pytest.mark.parametrize("texture", [0.0, 1.0, 20.0])
def test_which_image_is_the_left_one_is_seen(rng: np.random.Generator, texture: float) -> None:
    """Noise of two grey values: a wall without texture does not tell the sides apart."""
    wall = cv2.GaussianBlur(rng.normal(0.0, 1.0, (120, 220)), (0, 0), 2.0)
    wall = 128.0 + texture * wall / wall.std()
    left, right = (
        np.clip(part + rng.normal(0.0, 2.0, part.shape), 0, 255).astype(np.uint8)
        for part in (wall[:, :200], wall[:, 12:212])
    )
    stereo = StereoDepth(300.0, 0.12)
    assert not stereo.seem_swapped(left, right, stereo(left, right))
    assert stereo.seem_swapped(right, left, stereo(right, left)) == (texture > 0.0)
