"""The tracker and the initialization take masks, images and depths as people have them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.measuring.measure import initialize_body
from cardbox_tracker.person.appearance import PARTS, Appearance, bins_of
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import REFERENCE_NAMES, reference_posture
from cardbox_tracker.search.config import PRESETS
from cardbox_tracker.terms.compiled import CompiledSilhouette
from cardbox_tracker.tracking.estimate import TRACKING
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.precompile import quickest
from cardbox_tracker.tracking.tracker import Tracker

CAMERA = Camera(96, 72, 99.0, 99.0, 47.5, 35.5)
# With colours, images are used.
BODY = BodyModel().with_values(
    appearance=Appearance(np.zeros((len(PARTS), bins_of(3)), np.uint8), np.full(3, 128.0))
)
SIZE = (CAMERA.height, CAMERA.width)


def silhouette(name: str = "front") -> np.ndarray:
    return render(cardbox_patches(BODY, reference_posture(name)), CAMERA)


def tracker(has_depth: bool = False) -> Tracker:
    config = quickest(PRESETS["default"]())
    return Tracker(BODY, CAMERA, config.with_depth() if has_depth else config)


@pytest.mark.parametrize(
    "convert",
    [
        lambda mask: mask > 0,
        lambda mask: mask // 255,
        lambda mask: mask.astype(np.int32),
        lambda mask: mask / 255,
        lambda mask: mask[..., None],
        lambda mask: np.asfortranarray(mask // 255),
        lambda mask: np.where(mask, 129, 127).astype(np.uint8),
    ],
)
def test_any_mask_is_tracked_like_its_silhouette(convert: Callable[[Any], Any]) -> None:
    postures = []
    for mask in (silhouette(), convert(silhouette())):
        tracking = tracker()
        for _ in range(2):
            estimate = tracking.track(mask)
        assert estimate.state == TRACKING
        postures.append(estimate.posture)
    np.testing.assert_array_equal(*postures)


IMAGE = np.full((*SIZE, 3), 90, np.uint8)
DEPTH = np.full(SIZE, 2.0)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"silhouette": np.full(SIZE, np.nan)}, "silhouette .*nan"),
        ({"silhouette": -silhouette().astype(int)}, "silhouette .*from -255 to 0"),
        ({"silhouette": silhouette().astype(object)}, "silhouette .*object"),
        ({"silhouette": silhouette()[:, :50]}, "silhouette .*first camera.*resize it"),
        ({"silhouette": "front.png"}, "silhouette .*str"),
        ({"image": np.zeros((*SIZE, 4), np.uint8)}, "image .*fourth channel"),
        ({"image": IMAGE.astype(np.uint16) * 257}, "image .*divide by 257"),
        ({"image": IMAGE[:-1]}, r"image .*\(71, 96, 3\)"),
        ({"depth_m": (1000 * DEPTH).astype(np.uint16)}, "depth_m .*millimetres"),
        ({"depth_m": 1000 * DEPTH}, "depth_m .*millimetres"),
        ({"depth_m": DEPTH[:9]}, r"depth_m .*\(9, 96\)"),
    ],
)
def test_what_cannot_be_tracked_is_refused_and_changes_nothing(
    given: dict[str, Any], words: str
) -> None:
    whole = {"silhouette": silhouette(), "image": IMAGE, "depth_m": DEPTH}
    tracking, untroubled = tracker(has_depth=True), tracker(has_depth=True)
    with pytest.raises(ValueError, match=words):
        tracking.track(Observation(**(whole | given)))
    one, other = (t.track(Observation(**whole)).posture for t in (tracking, untroubled))
    np.testing.assert_array_equal(one, other)


def test_images_and_depths_of_other_types_give_the_same() -> None:
    unknown = DEPTH.copy()
    unknown[::2], unknown[1::4, ::2], unknown[1::4, 1::2] = np.nan, -1.0, np.inf
    zero = np.where(np.isfinite(unknown) & (unknown > 0), unknown, 0.0)
    pairs = [(IMAGE, zero.astype(np.float32)), ((IMAGE / 255)[:, ::-1][:, ::-1], unknown)]
    postures = []
    for image, depth_m in pairs:
        tracking = tracker(has_depth=True)
        for _ in range(2):
            estimate = tracking.track(Observation(silhouette(), image, depth_m))
        postures.append(estimate.posture)
    np.testing.assert_array_equal(*postures)


@pytest.mark.parametrize(
    ("observations", "words"),
    [
        (None, "NoneType; expected a silhouette"),
        (3, "int; expected"),
        ([silhouette()], "type ndarray; expected an Observation"),
        ("front.png", "expected"),
        ([], "0 observations"),
    ],
)
def test_what_is_no_observation_is_refused(observations: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        tracker().track(observations)


def test_the_cost_of_a_mask_is_that_of_its_silhouette() -> None:
    term = CompiledSilhouette(BODY, CAMERA)
    posture = reference_posture("front")
    assert term.look(silhouette() // 255).overlap(posture) == term.look(silhouette()).overlap(
        posture
    )


def test_references_may_be_masks() -> None:
    """They are too alike in both forms; nothing is measured, which would take long."""
    seen = []
    for convert in (lambda mask: mask, lambda mask: mask > 0, lambda mask: mask / 255):
        with pytest.raises(InitializationError) as caught:
            initialize_body({n: convert(silhouette("arms")) for n in REFERENCE_NAMES}, CAMERA)
        seen.append(str(caught.value))
    assert len(set(seen)) == 1 and "too alike" in seen[0]


def test_impossible_references_are_refused() -> None:
    masks = {name: silhouette(name).astype(float) for name in REFERENCE_NAMES}
    with pytest.raises(ValueError, match=r"reference 'side' .*nan"):
        initialize_body({**masks, "side": np.full(SIZE, np.nan)}, CAMERA)
    with pytest.raises(ValueError, match=r"image of the reference 'front' .*\(72, 96, 4\)"):
        initialize_body(masks, CAMERA, images={"front": [np.zeros((*SIZE, 4), np.uint8)]})
    with pytest.raises(ValueError, match=r"reference 'front' .*the camera's is"):
        initialize_body({n: silhouette(n)[:-5] for n in REFERENCE_NAMES}, CAMERA)
