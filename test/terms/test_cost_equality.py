"""The compiled cost is the reference cost to the last pixel, and both count what one counts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import NEAR_PLANE_M, clip_near, fill_convex, render, snap
from cardbox_tracker.person import parts as indices
from cardbox_tracker.person.cardbox import TORSO_PATCHES, _frontal, _place, cardbox_patches
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import BodyParts, Part, body_parts, parts_of_bodies, shape_of
from cardbox_tracker.person.posture import JOINT_LIMITS, LEFT_ARM, RIGHT_ARM, TORSO
from cardbox_tracker.person.sizes import DEFAULT_SIZES, SIZE_INDEX, SIZE_LIMITS
from cardbox_tracker.terms.bit_planes import fill_planes, new_planes
from cardbox_tracker.terms.cardbox_kernels import trunk_costs
from cardbox_tracker.terms.compiled import CompiledSilhouette
from cardbox_tracker.terms.kernel_arguments import intrinsics_of, place_of
from cardbox_tracker.terms.silhouette import SilhouetteTerm, rows_above_hips
from lab.experiments.reference import ReferenceSilhouette

SMALL = ((33, 57), (57, 33), (64, 48), (97, 41), (160, 120))
LARGE = ((320, 240), (321, 241), (640, 480))
SILHOUETTES = ("person", "speckled person", "noise", "empty", "full")
POSTURES = 3


@dataclass(frozen=True)
class Case:
    """One body before one camera, several postures, one silhouette."""

    body: BodyModel
    camera: Camera
    postures: np.ndarray
    silhouette: np.ndarray

    def terms(self) -> tuple[ReferenceSilhouette, CompiledSilhouette]:
        return (
            ReferenceSilhouette(self.body, self.camera),
            CompiledSilhouette(self.body, self.camera),
        )


def make_case(
    seed: int, size: tuple[int, int], distance_m: float, pitch_rad: float, kind: str
) -> Case:
    """Everything but the arguments is drawn from continuous distributions by ``seed``.

    So no corner comes to lie on the very border between two places of the 1/256 px grid, where the
    last bit of a product decides.
    """
    rng = np.random.default_rng(seed)
    width, height = size
    focal = rng.uniform(0.5, 2.0) * width
    middle = rng.uniform(-0.1, 1.1, 2) * size
    camera = Camera(width, height, focal, focal * rng.uniform(0.8, 1.2), *middle, pitch_rad)
    body = BodyModel.of(
        random_sizes(rng),
        distance_m=distance_m * rng.uniform(0.9, 1.1),
        hip_height_m=rng.uniform(-0.6, 0.1) * distance_m,
        camera_pitch_rad=pitch_rad,
    )
    low, high = JOINT_LIMITS.T
    postures = rng.uniform(low, high, (POSTURES, 12))
    postures[:, 0] = rng.normal(0.0, 0.2 * distance_m, POSTURES)
    # Whoever turns for the side reference goes beyond the joint limits.
    postures[-1, 3] = rng.uniform(-np.pi, np.pi)
    return Case(body, camera, postures, make_silhouette(rng, kind, body, camera, postures[0]))


def random_sizes(rng: np.random.Generator) -> np.ndarray:
    """A person, or anything within the limits."""
    if rng.random() < 0.5:
        return np.clip(DEFAULT_SIZES * rng.uniform(0.7, 1.4, 18), *SIZE_LIMITS.T)
    return rng.uniform(*SIZE_LIMITS.T)


def make_silhouette(
    rng: np.random.Generator, kind: str, body: BodyModel, camera: Camera, posture: np.ndarray
) -> np.ndarray:
    shape = (camera.height, camera.width)
    if kind == "noise":
        return np.where(rng.random(shape) < rng.uniform(0.1, 0.9), 255, 0).astype(np.uint8)
    if kind in ("empty", "full"):
        return np.full(shape, 255 if kind == "full" else 0, np.uint8)
    silhouette = np.zeros(shape, np.uint8)
    drawn = ReferenceSilhouette(body, camera).draw(posture + rng.normal(0.0, 0.15, 12))
    silhouette[: len(drawn)] = drawn
    if kind == "speckled person":
        silhouette[rng.random(shape) < 0.05] ^= 255
    return silhouette


CASE = {
    "seed": st.integers(0, 2**32 - 1),
    "distance_m": st.sampled_from((0.34, 0.4, 0.7, 1.5, 2.0, 3.0, 8.0)),
    "pitch_rad": st.sampled_from((0.0, 0.0, 0.1, -0.1, 0.5, -0.4, 1.2)),
    "kind": st.sampled_from(SILHOUETTES),
}
SMALL_CASES = st.builds(make_case, size=st.sampled_from(SMALL), **CASE)
LARGE_CASES = st.builds(make_case, size=st.sampled_from(LARGE), **CASE)


def assert_all_equal(case: Case) -> None:
    terms = case.terms()
    reference, compiled = (term.look(case.silhouette) for term in terms)
    assert compiled.frame.rows == reference.frame.rows
    assert compiled.frame.foreground_px == reference.frame.foreground_px
    postures = case.postures
    np.testing.assert_array_equal(compiled.postures(postures), reference.postures(postures))
    for posture in postures[:2]:
        got, expected = compiled.overlap(posture), reference.overlap(posture)
        assert got[0] == expected[0]
        assert got[1] == pytest.approx(expected[1], abs=1e-12)
    torsos = postures[:, TORSO]
    for arms in (None, postures[0], postures[1], None):
        expected = reference.torsos_beside(arms)(torsos)
        np.testing.assert_array_equal(compiled.torsos_beside(arms)(torsos), expected)
    for torso in torsos[:2]:
        rate, expect = compiled.arms_beside(torso), reference.arms_beside(torso)
        for side, joints in (("left", LEFT_ARM), ("right", RIGHT_ARM)):
            arms = postures[:, joints]
            np.testing.assert_array_equal(rate(side, arms), expect(side, arms))


@settings(max_examples=60)
@given(SMALL_CASES)
def test_every_cost_of_small_images_is_equal(case: Case) -> None:
    assert_all_equal(case)


@settings(max_examples=8)
@given(LARGE_CASES)
def test_every_cost_of_large_images_is_equal(case: Case) -> None:
    assert_all_equal(case)


@settings(max_examples=60)
@given(SMALL_CASES, st.integers(0, 2**32 - 1))
def test_costs_of_other_bodies_in_one_place_are_equal(case: Case, seed: int) -> None:
    rng = np.random.default_rng(seed)
    sizes = np.array([random_sizes(rng) for _ in case.postures])
    expected = []
    for one, posture in zip(sizes, case.postures, strict=True):
        reference = ReferenceSilhouette(case.body.with_values(sizes=one), case.camera)
        expected.append(reference.look(case.silhouette).postures(posture[None])[0])
    compiled = CompiledSilhouette(case.body, case.camera).look(case.silhouette)
    np.testing.assert_array_equal(compiled.bodies(sizes, case.postures), expected)


@settings(max_examples=60)
@given(SMALL_CASES)
def test_the_model_itself_as_silhouette_leaves_no_pixel_over(case: Case) -> None:
    """Equal counts could hide pixels that differ; a cost of 0 cannot."""
    reference, compiled = case.terms()
    for posture in case.postures:
        silhouette = np.zeros((case.camera.height, case.camera.width), np.uint8)
        silhouette[: reference.rows] = reference.draw(posture)
        seen = compiled.look(silhouette)
        assert seen.postures(posture[None]).tolist() == [0]
        assert seen.overlap(posture) == (0, 1.0 if silhouette.any() else 0.0)


@settings(max_examples=60)
@given(SMALL_CASES)
def test_a_trunk_with_a_neck_is_equal(case: Case) -> None:
    reference, compiled = case.terms()
    parts, shoulder = shape_of(case.body.sizes, 0.6)
    cardbox = parts, shoulder, place_of(case.body), intrinsics_of(case.camera)
    torsos = np.ascontiguousarray(case.postures[:, TORSO])
    planes = new_planes(case.camera.width, compiled.rows)
    silhouette = case.silhouette[: compiled.rows]
    silhouette_px = fill_planes(silhouette, np.zeros((1, 0), np.uint64), planes)
    got = np.zeros(len(torsos), np.int64)
    size = compiled.rows, case.camera.width
    trunk_costs(torsos, cardbox, size, planes, silhouette_px, got)
    neck = _frontal(parts_of_bodies(case.body.sizes, 0.6).neck)[None]
    for cost, posture in zip(got, case.postures, strict=True):
        patches, frames = cardbox_patches(case.body, posture), pose(case.body.rigid, posture)
        placed = _place(neck, frames.torso_rotation, frames.hip)
        trunk = np.concatenate([patches[TORSO_PATCHES], placed])
        drawn = render(trunk, case.camera, reference.rows)
        assert cost == np.count_nonzero(drawn ^ silhouette)


def test_the_kernels_take_parts_and_lengths_in_their_order() -> None:
    names = [name.removesuffix("_m").upper() for name in BodyParts._fields[:6]]
    assert [getattr(indices, name) for name in names] == list(range(6))
    names = [name.removesuffix("_m").upper() for name in Part._fields]
    assert [getattr(indices, name) for name in names] == list(range(6))
    parts, shoulder = shape_of(DEFAULT_SIZES)
    expected = body_parts(DEFAULT_SIZES)
    np.testing.assert_array_equal(parts, expected[:6])
    np.testing.assert_array_equal(shoulder, expected[6:])


@pytest.mark.parametrize("kept", range(16))
@pytest.mark.parametrize("beyond_m", [0.0, 1e-12, 0.05])
def test_corners_on_the_near_plane_are_before_it(kept: int, beyond_m: float) -> None:
    """Each set of corners exactly on the plane; the others ``beyond_m`` nearer than it."""
    x, y = 0.03, 0.02
    on = np.array([kept >> c & 1 for c in range(4)], bool)
    depth = np.where(on, NEAR_PLANE_M, NEAR_PLANE_M - beyond_m)
    corners = np.array([(-x, -y), (x, -y), (x, y), (-x, y)])
    quad = np.column_stack([corners, depth])
    seen = CompiledSilhouette(hand_body(), HAND_CAMERA).look(np.zeros((48, 64), np.uint8))
    mask = np.zeros((seen.frame.rows, 64), np.uint8)
    fill_convex(mask, snap(HAND_CAMERA.project(clip_near(quad))))
    assert seen.polygons(quad[None, None]).tolist() == [np.count_nonzero(mask)]
    assert mask.any() == (beyond_m == 0.0 or on.sum() > 2)


# A body made of rectangles on whole pixels: 20 px a metre at 2 m, the torso's top at the height of
# the camera, so that it is seen edge-on, as are all patches in the plane of X and Z.
HAND_CAMERA = Camera(64, 48, 40.0, 40.0, 31.5, 23.5)
HAND_SIZES = {
    "torso_top_width": 0.4,
    "torso_bottom_width": 0.4,
    "torso_height": 0.4,
    "waist_width": 0.3,
    "waist_height": 0.2,
    "head_width": 0.2,
    "head_height": 0.3,
    "neck_length": 0.1,
    "torso_depth": 0.2,
    "waist_depth": 0.2,
    "head_depth": 0.2,
    "head_offset": 0.0,
    "shoulder_breadth": 0.5,
    "shoulder_drop": 0.0,
    "upper_arm_length": 0.3,
    "upper_arm_width": 0.1,
    "forearm_length": 0.3,
    "forearm_width": 0.1,
}
TRUNK_PX = 8 * 8 + 4 * 6 + 6 * 4
ARM_PX = 12 * 2


def hand_body() -> BodyModel:
    sizes = np.empty(len(HAND_SIZES))
    for name, value in HAND_SIZES.items():
        sizes[SIZE_INDEX[name]] = value
    return BodyModel.of(sizes, distance_m=2.0, hip_height_m=-0.6)


def hand_trunk() -> np.ndarray:
    expected = np.zeros((48, 64), np.uint8)
    expected[16:22, 30:34] = 255  # head
    expected[24:32, 28:36] = 255  # torso
    expected[32:36, 29:35] = 255  # waist
    return expected


def hand_full() -> np.ndarray:
    expected = hand_trunk()
    # The person's left is to the right of the image.
    expected[24:36, 36:38] = 255
    expected[24:36, 26:28] = 255
    return expected


@pytest.fixture(params=[ReferenceSilhouette, CompiledSilhouette])
def term(request: pytest.FixtureRequest) -> SilhouetteTerm:
    return request.param(hand_body(), HAND_CAMERA)


def test_the_model_by_hand_covers_the_pixels_of_its_rectangles() -> None:
    drawn = ReferenceSilhouette(hand_body(), HAND_CAMERA).draw(np.zeros(12))
    np.testing.assert_array_equal(drawn, hand_full()[:36])


def test_costs_by_hand_before_nobody(term: SilhouetteTerm) -> None:
    seen = term.look(np.zeros((48, 64), np.uint8))
    rest, upright = np.zeros(12), np.zeros((1, 4))
    aside = np.array([[0.05, 0.0, 0.0, 0.0]])  # one pixel to the right
    assert (seen.frame.rows, seen.frame.foreground_px) == (36, 0)
    assert seen.postures(rest[None]).tolist() == [TRUNK_PX + 2 * ARM_PX]
    assert seen.torsos_beside(None)(upright).tolist() == [TRUNK_PX]
    rate_arms = seen.arms_beside(np.zeros(4))
    assert rate_arms("left", upright).tolist() == [TRUNK_PX + ARM_PX]
    assert rate_arms("right", upright).tolist() == [TRUNK_PX + ARM_PX]
    assert seen.overlap(rest) == (TRUNK_PX + 2 * ARM_PX, 0.0)
    # The arms stay, and 8 pixels of the torso move onto the left one.
    assert seen.torsos_beside(rest)(aside).tolist() == [TRUNK_PX + 2 * ARM_PX - 8]
    assert seen.torsos_beside(None)(aside).tolist() == [TRUNK_PX]


def test_costs_by_hand_before_somebody(term: SilhouetteTerm) -> None:
    silhouette = hand_full()
    silhouette[24:26, 28:33] = 0  # 10 px of the torso are missing
    silhouette[0, :5] = 255  # 5 px too many
    silhouette[36:] = 255  # legs
    seen = term.look(silhouette)
    assert seen.frame.foreground_px == TRUNK_PX + 2 * ARM_PX - 10 + 5
    assert seen.postures(np.zeros((1, 12))).tolist() == [15]
    cost_px, iou = seen.overlap(np.zeros(12))
    common, union = TRUNK_PX + 2 * ARM_PX - 10, TRUNK_PX + 2 * ARM_PX + 5
    assert cost_px == 15
    assert iou == pytest.approx(common / union)
    # Without arms both of them are missing, with one the other is.
    assert seen.torsos_beside(None)(np.zeros((1, 4))).tolist() == [15 + 2 * ARM_PX]
    assert seen.arms_beside(np.zeros(4))("left", np.zeros((2, 4))).tolist() == [15 + ARM_PX] * 2


def test_an_observation_never_changes(term: SilhouetteTerm) -> None:
    """Neither by what is asked of it nor by those that follow."""
    first = term.look(hand_full())
    rate_torsos, rate_arms = first.torsos_beside(np.zeros(12)), first.arms_beside(np.zeros(4))
    upright = np.zeros((1, 4))
    before = [rate_torsos(upright)[0], rate_arms("left", upright)[0]]
    second = term.look(np.zeros((48, 64), np.uint8))
    second.torsos_beside(np.ones(12))(upright)
    second.arms_beside(np.full(4, 0.1))("left", upright)
    first.torsos_beside(None)(upright)
    first.arms_beside(np.full(4, 0.2))("right", upright)
    assert [rate_torsos(upright)[0], rate_arms("left", upright)[0]] == before
    assert first.postures(np.zeros((1, 12))).tolist() == [0]


def test_a_model_outside_of_the_image_costs_the_silhouette(term: SilhouetteTerm) -> None:
    seen = term.look(hand_full())
    away = np.zeros((2, 12))
    away[:, 0] = (-2.9, 2.9)
    assert seen.postures(away).tolist() == [TRUNK_PX + 2 * ARM_PX] * 2
    assert seen.overlap(away[0]) == (TRUNK_PX + 2 * ARM_PX, 0.0)


def test_nothing_against_nothing_costs_nothing(term: SilhouetteTerm) -> None:
    away = np.zeros(12)
    away[0] = 2.9
    assert term.look(np.zeros((48, 64), np.uint8)).overlap(away) == (0, 0.0)


def test_read_only_and_strided_silhouettes_are_taken(term: SilhouetteTerm) -> None:
    frozen = hand_full()
    frozen.setflags(write=False)
    assert term.look(frozen).postures(np.zeros((1, 12))).tolist() == [0]
    wide = np.zeros((48, 128), np.uint8)
    wide[:, ::2] = hand_full()
    assert term.look(wide[:, ::2]).postures(np.zeros((1, 12))).tolist() == [0]


@pytest.mark.parametrize("shape", [(64, 48), (48, 63), (47, 64), (48, 64, 2)])
def test_a_silhouette_of_another_size_is_refused(
    term: SilhouetteTerm, shape: tuple[int, ...]
) -> None:
    with pytest.raises(ValueError, match=r"silhouette .*\(48, 64\)"):
        term.look(np.zeros(shape, np.uint8))


@pytest.mark.parametrize("shape", [(48, 65), (48, 64, 3, 1), (96, 128, 3)])
def test_an_image_of_another_size_is_refused(term: SilhouetteTerm, shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"image .*\(48, 64\)"):
        term.frame(hand_full(), np.zeros(shape, np.uint8))


@pytest.mark.parametrize(
    ("hip_height_m", "pitch_rad", "rows"),
    [
        # 20 px a metre below row 23.5; whatever lies outside of the image is its border.
        (-0.6, 0.0, 36),
        (0.0, 0.0, 24),
        (-1.1, 0.0, 46),
        (-3.0, 0.0, 48),
        (2.0, 0.0, 1),
        # Looking down by as much as the hips are low moves them to the middle.
        (-0.6, np.arctan2(0.6, 2.0), 24),
        # Behind a camera that looks up steeply is no row of the image.
        (-4.0, -1.2, 48),
    ],
)
def test_rows_above_the_hips_by_hand(hip_height_m: float, pitch_rad: float, rows: int) -> None:
    body = hand_body().with_values(hip_height_m=hip_height_m)
    assert rows_above_hips(body, HAND_CAMERA.with_pitch(pitch_rad)) == rows
