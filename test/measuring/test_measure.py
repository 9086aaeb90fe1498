"""Measuring people: bodies that are known are found again from their three silhouettes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cardbox_tracker.applications.simulation.person import FINGER_REACH
from cardbox_tracker.applications.simulation.renderer import Renderer
from cardbox_tracker.applications.simulation.session import session_camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.measuring.config import (
    InitializationConfig,
    InitializationResult,
    check_fit,
    fit_text,
)
from cardbox_tracker.measuring.measure import initialize_body
from cardbox_tracker.measuring.shoulders import GIRDLE_RISE
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import REFERENCE_NAMES, reference_posture
from cardbox_tracker.person.sizes import SIZE_INDEX, SIZE_LIMITS, SUBSETS
from cardbox_tracker.terms.silhouette import rows_above_hips
from lab.experiments.measuring import random_body

CAMERA = session_camera()
BODIES = 8
# So far away that tall people with arms stretched sideways are in the image.
DISTANCE_M = 2.3

# Seen directly, in the silhouette of one part alone. At 2.3 m a pixel is 7 mm; two edges that are
# off by a pixel each make 1.4 cm, and posture and prior take a pixel or two more; on average the
# errors are less than two pixels.
SHOWN = (
    "head_width",
    "head_height",
    "neck_length",
    "torso_depth",
    "head_depth",
    "head_offset",
    "shoulder_drop",
    "upper_arm_width",
    "forearm_width",
)
SHOWN_M = 0.03
# Where one part ends and the next begins in the same direction: the outline shows the sum, and the
# proportions of people decide, who differ from them by several centimetres.
SHARED_M = 0.06


def as_people_are(body: BodyModel, name: str) -> BodyModel:
    """The body as it shows in a reference: open hands, and shoulders that rise with the arms."""
    sizes = body.sizes.copy()
    sizes[SIZE_INDEX["forearm_length"]] *= 1.0 + FINGER_REACH
    if name == "arms":
        sizes[SIZE_INDEX["shoulder_drop"]] -= GIRDLE_RISE * body.size("shoulder_breadth")
    return body.with_values(sizes=np.clip(sizes, SIZE_LIMITS[:, 0], SIZE_LIMITS[:, 1]))


def references_of(body: BodyModel) -> dict[str, np.ndarray]:
    camera = CAMERA.with_pitch(body.camera_pose.pitch_rad)
    silhouettes = {}
    for name in REFERENCE_NAMES:
        posture = reference_posture(name, body.side_turn)
        posture[0] = body.placement.lateral_m
        silhouette = render(cardbox_patches(as_people_are(body, name), posture), camera)
        # The model ends at the hips; a person goes on, down to the image's lower border.
        middle = round(camera.cx + camera.fx * body.placement.lateral_m / body.placement.distance_m)
        silhouette[rows_above_hips(body, camera) :, middle - 20 : middle + 20] = 255
        silhouettes[name] = silhouette
    return silhouettes


def measure(body: BodyModel, **values: object) -> InitializationResult:
    config = InitializationConfig(
        distance_m=body.placement.distance_m,
        camera_pitch_rad=body.camera_pose.pitch_rad,
        side_turn=body.side_turn,
    )
    return initialize_body(references_of(body), CAMERA, replace(config, **values))


def heights_m(body: BodyModel) -> dict[str, float]:
    """Heights above the camera of what the outline shows."""
    top = body.placement.hip_height_m + body.size("waist_height") + body.size("torso_height")
    return {
        "shoulder": top - body.size("shoulder_drop"),
        "torso's top": top,
        "crown": top + body.size("neck_length") + body.size("head_height"),
    }


@pytest.fixture(scope="module")
def measured() -> list[tuple[BodyModel, InitializationResult]]:
    """People of several statures and places, each with a seed of their own."""
    pairs = []
    for number in range(BODIES):
        rng = np.random.default_rng(number)
        body = random_body(rng, DISTANCE_M).with_values(
            lateral_m=float(rng.uniform(-0.08, 0.08)),
            hip_height_m=float(rng.uniform(-0.6, -0.52)),
            side_turn=("left", "right")[number % 2],
        )
        pairs.append((body, measure(body, seed=number)))
    return pairs


Measured = list[tuple[BodyModel, InitializationResult]]


@pytest.mark.parametrize("name", SHOWN)
def test_what_the_outline_shows_is_found(measured: Measured, name: str) -> None:
    errors = [abs(result.body.size(name) - body.size(name)) for body, result in measured]
    assert max(errors) < SHOWN_M
    assert np.mean(errors) < SHOWN_M / 2


@pytest.mark.parametrize("name", sorted(set(SIZE_INDEX) - set(SHOWN)))
def test_what_two_parts_share_is_found_roughly(measured: Measured, name: str) -> None:
    errors = [abs(result.body.size(name) - body.size(name)) for body, result in measured]
    assert np.mean(errors) < SHARED_M


def test_heights_and_lateral_place_are_found(measured: Measured) -> None:
    for body, result in measured:
        expected = heights_m(body)
        for name, height in heights_m(result.body).items():
            assert height == pytest.approx(expected[name], abs=SHOWN_M), name
        assert result.body.placement.lateral_m == pytest.approx(
            body.placement.lateral_m, abs=SHOWN_M
        )


def test_the_hips_follow_from_the_stature(measured: Measured) -> None:
    """No outline shows them; people of one stature differ in them by several centimetres."""
    errors = [
        abs(result.body.placement.hip_height_m - body.placement.hip_height_m)
        for body, result in measured
    ]
    assert np.mean(errors) < SHARED_M


def test_arms_are_as_long_as_they_are(measured: Measured) -> None:
    def reach_m(body: BodyModel) -> float:
        arm = body.size("upper_arm_length") + body.size("forearm_length")
        return body.size("shoulder_breadth") / 2 + arm

    errors = [abs(reach_m(result.body) - reach_m(body)) for body, result in measured]
    assert max(errors) < SHARED_M
    assert np.mean(errors) < SHOWN_M / 2


def test_the_fit_is_told_and_good(measured: Measured) -> None:
    for _, result in measured:
        assert set(result.iou) == set(REFERENCE_NAMES)
        assert result.mean_iou == pytest.approx(np.mean(list(result.iou.values())))
        assert result.mean_iou > 0.9


def test_what_was_given_is_in_the_body(measured: Measured) -> None:
    for body, result in measured:
        assert result.body.side_turn == body.side_turn
        assert result.body.placement.distance_m == body.placement.distance_m
        assert result.body.camera_pose.pitch_rad == body.camera_pose.pitch_rad
        assert np.all(result.body.sizes >= SIZE_LIMITS[:, 0])
        assert np.all(result.body.sizes <= SIZE_LIMITS[:, 1])
        # Tenths of a millimetre, so that the file is the body.
        np.testing.assert_array_equal(result.body.sizes, np.round(result.body.sizes, 4))


def test_rounds_end_and_never_make_it_worse(measured: Measured) -> None:
    config = InitializationConfig()
    for _, result in measured:
        for subset in SUBSETS:
            passes = result.costs_px[subset]
            assert len(passes) == 2
            assert result.rounds[subset] == sum(len(costs) - 1 for costs in passes)
            for costs in passes:
                assert 1 < len(costs) <= config.max_rounds + 1
                assert np.all(np.diff(costs) <= 0)


def test_a_pitched_camera_changes_nothing() -> None:
    body = BodyModel.of(hip_height_m=-0.6, camera_pitch_rad=np.radians(8.0), lateral_m=0.05)
    result = measure(body)
    assert result.mean_iou > 0.9
    expected = heights_m(body)
    for name, height in heights_m(result.body).items():
        assert height == pytest.approx(expected[name], abs=SHOWN_M), name
    assert result.body.placement.lateral_m == pytest.approx(0.05, abs=SHOWN_M)


def test_a_distance_too_large_makes_everything_as_much_larger() -> None:
    """A silhouette gives sizes up to scale."""
    body = BodyModel.of(hip_height_m=-0.51)
    near, far = measure(body).body, measure(body, distance_m=2.2).body
    for name in ("head_width", "torso_depth", "forearm_width"):
        assert far.size(name) == pytest.approx(1.1 * near.size(name), rel=0.06)
    crowns = [heights_m(found)["crown"] for found in (near, far)]
    assert crowns[1] == pytest.approx(1.1 * crowns[0], abs=SHOWN_M)


@pytest.mark.parametrize("seed", range(3))
def test_a_rounded_person_with_legs_is_measured(seed: int) -> None:
    """The cardbox never fits them exactly; 0.80 is what recorded people have to reach."""
    body = random_body(np.random.default_rng(seed)).with_values(side_turn="right")
    renderer = Renderer(CAMERA, np.random.default_rng(seed))
    references = {
        name: renderer.silhouette(body, reference_posture(name, "right"))
        for name in REFERENCE_NAMES
    }
    result = initialize_body(references, CAMERA, InitializationConfig(side_turn="right", seed=seed))
    assert result.mean_iou >= 0.80
    assert heights_m(result.body)["crown"] == pytest.approx(heights_m(body)["crown"], abs=SHOWN_M)
    expected = body.size("upper_arm_length") + body.size("forearm_length")
    arm = result.body.size("upper_arm_length") + result.body.size("forearm_length")
    assert arm == pytest.approx(expected, abs=SHARED_M)


def test_the_seed_decides_every_number() -> None:
    body = BodyModel.of(hip_height_m=-0.51)
    first, second = measure(body, seed=7), measure(body, seed=7)
    assert first.body == second.body
    assert (first.iou, first.rounds, first.costs_px) == (second.iou, second.rounds, second.costs_px)
    assert measure(body, seed=8).body != first.body


def test_progress_goes_to_one() -> None:
    told: list[float] = []
    references = references_of(BodyModel.of(hip_height_m=-0.51))
    config = InitializationConfig(hypotheses=20, max_rounds=3)
    initialize_body(references, CAMERA, config, told.append)
    assert told == sorted(told)
    assert 0 < told[0] < 1
    assert told[-1] == pytest.approx(1.0)


def test_rounds_have_a_maximum() -> None:
    result = measure(BodyModel.of(hip_height_m=-0.51), max_rounds=4)
    assert result.rounds == dict.fromkeys(SUBSETS, 8)


def test_a_poor_fit_is_refused_with_its_numbers() -> None:
    """What is no person at all: three crosses of unlike shape."""
    references = {}
    for name, (width, height) in {"front": (160, 12), "side": (12, 160), "arms": (280, 6)}.items():
        silhouette = np.zeros((240, 320), np.uint8)
        silhouette[20:230, 157:163] = 255
        silhouette[120 - height // 2 : 120 + height // 2, 160 - width // 2 : 160 + width // 2] = 255
        references[name] = silhouette
    references["side"][40:70, 40:280] = 255
    with pytest.raises(InitializationError) as caught:
        initialize_body(references, CAMERA, InitializationConfig(check_postures=False))
    text = str(caught.value)
    assert "IoU front 0." in text
    for part in ("mean 0.", "0.60", "person_distance_m (2 m)", "pitch (0 degrees", "(left)"):
        assert part in text


def test_one_reference_that_fits_poorly_is_refused_by_name() -> None:
    body = BodyModel.of(hip_height_m=-0.51)
    reached = measure(body).iou
    least = max(reached.values())
    poor = sorted(name for name in reached if reached[name] < least)
    with pytest.raises(InitializationError) as caught:
        measure(body, least_iou=least)
    text = str(caught.value)
    for name in poor:
        assert f"'{name}'" in text.split("poorly")[0]
    assert f"{least:.2f}" in text


@pytest.mark.parametrize(
    ("swapped", "text"),
    [
        (("front", "side"), "'front' and 'side' .*swapped"),
        (("front", "arms"), "'front' and 'arms' .*swapped"),
        (("side", "arms"), "'side' and 'arms' .*swapped"),
    ],
)
def test_swapped_references_are_refused_before_any_work(
    swapped: tuple[str, str], text: str
) -> None:
    references = references_of(BodyModel.of(hip_height_m=-0.51))
    first, second = swapped
    references[first], references[second] = references[second], references[first]
    told: list[float] = []
    with pytest.raises(InitializationError, match=text):
        initialize_body(references, CAMERA, InitializationConfig(), told.append)
    assert told == []


def test_the_bones_of_the_arms_do_not_depend_on_the_seed() -> None:
    body = BodyModel.of(hip_height_m=-0.51)
    first, second = measure(body, seed=7).body, measure(body, seed=8).body
    for name in ("shoulder_breadth", "upper_arm_length", "forearm_length"):
        assert first.size(name) == second.size(name)
    # Rounding to a tenth of a millimetre leaves no more than that.
    assert heights_m(first)["shoulder"] == pytest.approx(heights_m(second)["shoulder"], abs=3e-4)


def test_without_arms_nothing_is_measured() -> None:
    references = references_of(BodyModel.of(hip_height_m=-0.51))
    arms = references["arms"]
    arms[:] = 0
    arms[20:, 150:169] = 255
    with pytest.raises(InitializationError, match=r"'arms': no arms .*; capture"):
        initialize_body(references, CAMERA, InitializationConfig(check_postures=False))


def test_arms_of_another_posture_are_measured_where_the_check_is_off() -> None:
    references = references_of(BodyModel.of(hip_height_m=-0.51))
    columns = np.flatnonzero(references["arms"].any(axis=0))
    references["arms"][:, columns[-1] - 45 :] = 0
    with pytest.raises(InitializationError, match=r"left arm .*bent"):
        initialize_body(references, CAMERA, InitializationConfig())
    config = InitializationConfig(check_postures=False, least_iou=0.3)
    assert initialize_body(references, CAMERA, config).mean_iou > 0.6


@pytest.mark.parametrize("iou", [0.5999, 0.595, 0.6 - 1e-6])
def test_a_fit_below_its_bound_is_not_told_as_the_bound(iou: float) -> None:
    result = InitializationResult(BodyModel(), {"front": iou, "side": iou, "arms": iou}, {}, {})
    with pytest.raises(InitializationError, match=r"mean 0\.59,.* 0\.60"):
        check_fit(result, InitializationConfig())


def test_a_reference_that_fits_so_so_is_warned_of_by_name() -> None:
    result = InitializationResult(BodyModel(), {"front": 0.9, "side": 0.799, "arms": 0.8}, {}, {})
    check_fit(result, InitializationConfig())
    assert "side 0.79, arms 0.80, mean 0.83; warning: 'side' below 0.80" in fit_text(result)
    fine = InitializationResult(BodyModel(), dict.fromkeys(("front", "side", "arms"), 0.8), {}, {})
    assert "warning" not in fit_text(fine)


def test_the_required_fit_is_a_setting() -> None:
    body = BodyModel.of(hip_height_m=-0.51)
    reached = measure(body).mean_iou
    assert measure(body, min_iou=reached - 0.001).mean_iou == reached
    with pytest.raises(InitializationError, match=r"expected 0\.9"):
        measure(body, min_iou=reached + 0.001)


@pytest.mark.parametrize(
    ("name", "replacement", "text"),
    [
        ("front", None, "'front': nobody"),
        ("side", "front", "'front' and 'side' .*alike"),
        ("arms", "front", "'front' and 'arms' .*alike"),
    ],
)
def test_unusable_references_are_refused_before_any_work(
    name: str, replacement: str | None, text: str
) -> None:
    references = references_of(BodyModel.of(hip_height_m=-0.51))
    nobody = np.zeros((240, 320), np.uint8)
    references[name] = nobody if replacement is None else references[replacement]
    told: list[float] = []
    with pytest.raises(InitializationError, match=text):
        initialize_body(references, CAMERA, InitializationConfig(), told.append)
    assert told == []


def test_a_person_cut_off_at_the_border_is_refused() -> None:
    with pytest.raises(InitializationError, match=r"'arms': .*cut off .*right"):
        measure(BodyModel.of(hip_height_m=-0.51, lateral_m=0.3))
