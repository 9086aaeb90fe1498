"""Appearance: probabilities by one byte each, round trip as text, refusal of damaged ones."""

from __future__ import annotations

import base64
import zlib

import numpy as np
import pytest

from cardbox_tracker.common.errors import BodyModelError
from cardbox_tracker.person.appearance import (
    COLOR_STEPS,
    PARTS,
    UNSEEN,
    Appearance,
    bins_of,
    steps_of_levels,
)
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import dumps_body_model, loads_body_model


def histograms(channels: int, seed: int = 0) -> np.ndarray:
    """Each part has been seen in a few colours."""
    rng = np.random.default_rng(seed)
    bins = bins_of(channels)
    seen = np.zeros((len(PARTS), bins))
    for row in seen:
        row[rng.choice(bins, 20, replace=False)] = rng.random(20)
    return (1 - UNSEEN) * seen / seen.sum(axis=1, keepdims=True) + UNSEEN / bins


def appearance(channels: int = 3, seed: int = 0) -> Appearance:
    return Appearance.of(histograms(channels, seed), np.linspace(90.0, 110.5, channels))


@pytest.mark.parametrize("channels", [1, 3])
def test_probabilities_are_kept_to_some_percent(channels: int) -> None:
    kept = appearance(channels)
    # Half a step: 1/510 of the way from the least probability to 1.
    half_step = -np.log(UNSEEN / bins_of(channels)) / 510
    error = np.abs(np.log(kept.histograms / histograms(channels)))
    assert error.max() <= half_step + 1e-12
    assert kept.is_grey == (channels == 1)
    assert kept.brightness.tolist() == np.linspace(90.0, 110.5, channels).tolist()
    assert kept.histograms.sum(axis=1) == pytest.approx(1.0, abs=0.02)
    # What was never seen stays exactly at its share.
    assert kept.histograms.min() == pytest.approx(UNSEEN / bins_of(channels), rel=1e-12)


@pytest.mark.parametrize("channels", [1, 3])
def test_text_is_read_back_whole(channels: int) -> None:
    first = appearance(channels)
    again = Appearance.from_text(first.to_text())
    assert again == first
    assert hash(again) == hash(first)
    assert again.to_text() == first.to_text()
    assert Appearance.from_text("\n".join(first.to_text())) == first


def test_equality_sees_levels_brightness_and_channels() -> None:
    first = appearance()
    assert first == appearance()
    assert first != appearance(seed=1)
    assert first != Appearance(first.levels, first.brightness + 1)
    assert first != appearance(1)
    assert first != "appearance"
    assert repr(first) == "Appearance(colour)"
    assert repr(appearance(1)) == "Appearance(grey)"
    with pytest.raises(ValueError, match="read-only"):
        first.levels[0, 0] = 3


def packed(raw: bytes) -> str:
    return base64.b64encode(zlib.compress(raw)).decode()


@pytest.mark.parametrize(
    "text",
    [
        "",
        "no base64 at all!",
        "äöü",
        base64.b64encode(b"not compressed").decode(),
        packed(b""),
        packed(bytes([2]) + bytes(1000)),
        packed(bytes([3]) + bytes(10)),
        packed(bytes([3]) + bytes(6 + 5 * 1728 + 1)),
        packed(bytes([1]) + bytes(2 + 5 * 32 - 1)),
        packed(bytes(10_000_000)),
        appearance().to_text()[:200],
    ],
)
def test_damaged_text_is_refused(text: str) -> None:
    with pytest.raises(BodyModelError, match=r"appearance.*base64"):
        Appearance.from_text(text)


@pytest.mark.parametrize(
    ("levels", "brightness"),
    [
        (np.zeros((5, 32), np.uint8), np.zeros(3)),
        (np.zeros((4, 32), np.uint8), np.zeros(1)),
        (np.zeros((5, 32)), np.zeros(1)),
        (np.zeros((5, 32), np.uint8), np.zeros((1, 1))),
        (np.zeros((5, 12**2), np.uint8), np.zeros(2)),
    ],
)
def test_other_shapes_are_refused(levels: np.ndarray, brightness: np.ndarray) -> None:
    with pytest.raises(BodyModelError, match=r"5 .*32 .*1728"):
        Appearance(levels, brightness)


def test_levels_fall_into_equal_steps_after_the_light_is_equalled() -> None:
    same = steps_of_levels(np.full(3, 100.0), np.full(3, 100.0))
    assert same.shape == (3, 256)
    assert [same[0, level] for level in (0, 21, 22, 255)] == [0, 0, 1, COLOR_STEPS - 1]
    # In half the light 50 is what 100 was, step 4 of 12; the brightest stay in the last step.
    darker = steps_of_levels(np.array([50.0]), np.array([100.0]))
    assert darker[0, 50] == int(100 * 32 / 256)
    assert darker[0, 255] == 31


@pytest.mark.parametrize("channels", [1, 3])
def test_a_model_file_holds_it(channels: int) -> None:
    plain = BodyModel()
    body = plain.with_values(appearance=appearance(channels))
    text = dumps_body_model(body)
    again = loads_body_model(text)
    assert again == body
    assert hash(again) == hash(body)
    assert dumps_body_model(again) == text
    assert again != plain
    assert again.with_values(appearance=None) == plain
    assert len(text) < 16_000
    assert max(map(len, text.splitlines())) <= 100
    assert "appearance" not in dumps_body_model(plain)
    assert loads_body_model(dumps_body_model(plain)).appearance is None
    assert str(again) == str(plain)


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        ("17", "appearance .* int; .*base64"),
        ("[a, b]", "appearance .* list; .*base64"),
        ("", "appearance .* NoneType; .*base64"),
        ("eNoz", "appearance .*base64"),
    ],
)
def test_a_model_file_with_a_damaged_one_is_refused_by_name(value: str, reason: str) -> None:
    text = dumps_body_model(BodyModel()) + f"appearance: {value}\n"
    with pytest.raises(BodyModelError, match=f"someone.yaml: {reason}"):
        loads_body_model(text, "someone.yaml")
