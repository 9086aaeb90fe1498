"""People who walk on a floor, and edges, show the camera within the deviations that are told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.image_points import (
    LEG_POINT_NAMES,
    POINT_NAMES,
    ImagePoints,
    LegPoints,
)
from cardbox_tracker.measuring.people_camera import LEVELS, people_camera
from cardbox_tracker.measuring.scene import SceneCamera, Value
from cardbox_tracker.measuring.scene_camera import (
    FoundCamera,
    background_shift,
    lens_of,
    other_lens,
    scene_camera,
)
from cardbox_tracker.person.proportions import MARKED_HEIGHTS

CAMERA = Camera(640, 480, 500.0, 500.0, 319.5, 239.5)
STATURE_M, HEIGHT_M = 1.7, 1.5
WALK = [(2.6 + 0.5 * k, 0.4 * (-1) ** k) for k in range(6)]
STAND = [(3.0, 0.0)] * 6
BLANK = np.full((480, 640), 128, np.uint8)
# Nose, ears, shoulders, hips, knees and ankles are marked this far ahead of the ankles, statures.
FORWARD = np.array([0.09, 0.045, 0.0, 0.0, 0.01, 0.0])


def points(
    distance_m: float, aside_m: float, pitch_deg: float, roll_deg: float, on_m: float = 0.0
) -> ImagePoints:
    """Return who stands at a place before a camera ``HEIGHT_M`` above the floor, or on a box."""
    view = CAMERA.with_pitch(np.radians(pitch_deg))
    c, s = np.cos(np.radians(roll_deg)), np.sin(np.radians(roll_deg))
    px = dict[str, np.ndarray]()
    for name in (*POINT_NAMES, *LEG_POINT_NAMES):
        # Heels and toes are at the ankles.
        level = name.split("_")[-1].replace("heel", "ankle").replace("foot", "ankle")
        at = LEVELS.index(level) if level in LEVELS else LEVELS.index("shoulder")
        across_m = 0.0 if name == "nose" else 0.12 * (1 if "left" in name else -1)
        there = np.array(
            (
                STATURE_M * FORWARD[at] - distance_m,
                aside_m + across_m,
                STATURE_M * MARKED_HEIGHTS[at] - HEIGHT_M + on_m,
            )
        )
        u, v = view.project(view.reference_to_optical(there)) - (CAMERA.cx, CAMERA.cy)
        px[name] = np.array((c * u + s * v + CAMERA.cx, c * v - s * u + CAMERA.cy))
    legs = LegPoints(np.array([px[name] for name in LEG_POINT_NAMES]), np.ones(8))
    whole = np.array([px[name] for name in POINT_NAMES])
    return ImagePoints(whole, np.ones(len(POINT_NAMES)), legs=legs)


def film(
    places: Sequence[tuple[float, float]], pitch_deg: float, roll_deg: float = 0.0
) -> list[tuple[float, ImagePoints]]:
    """Return the points at places, ten seconds apart."""
    return [(10.0 * k, points(*at, pitch_deg, roll_deg)) for k, at in enumerate(places)]


def doors(pitch_deg: float, shift_px: int = 0) -> np.ndarray:
    """Return the image (480, 640) of doors, 4 m before a camera that looks down."""
    image = np.full((480, 640), 90, np.uint8)
    view = CAMERA.with_pitch(np.radians(pitch_deg))
    for left_m in (-1.6, -0.3, 1.1):
        corners = [
            (-4.0, left_m + across, up) for across, up in ((0, 2), (0.5, 2), (0.5, -3), (0, -3))
        ]
        px = view.project(view.reference_to_optical(np.array(corners)))
        cv2.fillPoly(image, [np.rint(px * 16).astype(np.int32)], 200, cv2.LINE_AA, 4)
    return np.roll(image, shift_px, axis=1)


def found(
    pitch_deg: float,
    image: np.ndarray = BLANK,
    places: Sequence[tuple[float, float]] = WALK,
    given: tuple[float, float] | None = None,
    roll_deg: float = 0.0,
) -> FoundCamera:
    people = [film(places, pitch_deg, roll_deg)]
    return scene_camera(people, [(0.0, image)], CAMERA, [STATURE_M], given)


@pytest.mark.parametrize("pitch_deg", [-8.0, 5.0, 25.0])
def test_who_walks_shows_pitch_and_height_with_any_focal_length(pitch_deg: float) -> None:
    factor, places = 1.2, [(at_m + 0.8, aside_m) for at_m, aside_m in WALK]
    wrong = Camera(640, 480, 500.0 * factor, 500.0 * factor, 319.5, 239.5, focal_stddev=0.2)
    shown = people_camera([film(places, pitch_deg)], [STATURE_M], wrong)
    assert shown is not None
    errors = shown.values - (np.radians(pitch_deg), 0.0, HEIGHT_M, -np.log(factor))
    stddevs = np.sqrt(np.diag(shown.covariance))
    assert (np.abs(errors) < 2 * stddevs).all()
    assert stddevs[0] < np.radians(4.0)
    # A camera that looks ahead sees the same with any focal length from another distance.
    assert stddevs[3] < (0.17 if pitch_deg == 25.0 else 0.2)
    known = people_camera([film(places, pitch_deg)], [STATURE_M], CAMERA)
    assert known is not None
    (far,) = known.distances
    assert far is not None
    assert far.distances * STATURE_M == pytest.approx([at_m for at_m, _ in places], rel=0.05)
    assert far.times_s == pytest.approx(10.0 * np.arange(len(places)))


def test_the_distance_is_as_sure_by_more_images_of_the_same_time() -> None:
    """Who keeps the posture makes the same errors, so more images tell no more, and no less."""
    stddevs = []
    for count in (3, 24):
        seen = [(4.0 * k / (count - 1), points(3.0, 0.0, 8.0, 0.0)) for k in range(count)]
        cut = [(at_s, replace(one, legs=None)) for at_s, one in seen]
        pitch = np.radians(8.0), 0.001
        shown = people_camera([cut], [STATURE_M], CAMERA, pitch, (0.0, 0.01))
        assert shown is not None and shown.distances[0] is not None
        stddevs.append(shown.distances[0].stddev)
    # 0.016 and 0.013 of 0.29 statures between hips and shoulders are 0.07.
    assert stddevs == pytest.approx([0.065] * 2, rel=0.15)


@pytest.mark.parametrize("straight", [0, 1], ids=["no legs", "legs once"])
def test_a_trunk_that_leans_again_and_again_is_no_camera_that_looks_up(
    straight: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Somebody who is seen to the hips leans by 0 to 40 degrees in a film of 400 s."""
    upper_m = np.maximum(MARKED_HEIGHTS - MARKED_HEIGHTS[LEVELS.index("hip")], 0.0)
    sights = []
    for number in range(40):
        lean_rad = np.radians(40.0) * (number % 4) / 3
        with monkeypatch.context() as leaning:
            lowered = MARKED_HEIGHTS - upper_m * (1.0 - np.cos(lean_rad))
            leaning.setattr(f"{__name__}.MARKED_HEIGHTS", lowered)
            leaning.setattr(f"{__name__}.FORWARD", FORWARD + upper_m * np.sin(lean_rad))
            one = points(3.0, 0.0, 0.0, 0.0)
        sights.append((10.0 * number, one if number < straight else replace(one, legs=None)))
    shown = people_camera([sights], [STATURE_M], CAMERA)
    assert shown is not None
    stddev = np.degrees(np.sqrt(shown.covariance[0, 0]))
    assert stddev > 6.0 and abs(np.degrees(shown.values[0])) < stddev


def test_a_distance_is_as_unsure_as_the_pitch_makes_it() -> None:
    sights = [[(at_s, replace(one, legs=None)) for at_s, one in film(STAND, 20.0)]]
    seen = (sights, [(0.0, BLANK)], CAMERA, [STATURE_M])
    stddevs = []
    for stddev in (0.001, 0.05, 0.1):
        (far,) = scene_camera(*seen, (np.radians(20.0), stddev)).distances
        assert far is not None
        stddevs.append(far.stddev)
    sure, some, unsure = np.square(stddevs)
    assert sure < some < unsure
    # Variances grow with that of the pitch.
    assert (unsure - sure) / (some - sure) == pytest.approx(4.0, rel=0.01)


@pytest.mark.parametrize("places", [STAND, WALK], ids=["stands", "walks"])
def test_without_feet_the_hips_are_marked_higher(
    places: Sequence[tuple[float, float]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """MediaPipe marks them 0.022 of the stature higher; without this, they seem farther away."""
    marked = MARKED_HEIGHTS + 0.022 * (np.array(LEVELS) == "hip")
    monkeypatch.setattr(f"{__name__}.MARKED_HEIGHTS", marked)
    cut = [(at_s, replace(one, legs=None)) for at_s, one in film(places, 8.0)]
    shown = people_camera([cut], [STATURE_M], CAMERA, (np.radians(8.0), 0.2), (0.0, 0.01))
    assert shown is not None
    (far,) = shown.distances
    assert far is not None
    assert far.distances * STATURE_M == pytest.approx([at_m for at_m, _ in places], rel=0.02)


def test_a_pitch_that_people_show_stays_unsure_by_0_7_degrees() -> None:
    """More images do not help against what all of them have."""
    shown = people_camera([film(WALK * 4, 12.0)], [STATURE_M], CAMERA)
    assert shown is not None
    expected = np.hypot(np.degrees(np.sqrt(shown.covariance[0, 0])), 0.7)
    stddev = np.degrees(found(12.0, places=WALK * 4).camera.pitch_rad.stddev)
    assert stddev == pytest.approx(expected, rel=0.1)
    assert expected < 0.85


def test_who_stays_in_one_place_shows_little() -> None:
    walks, stands = (found(15.0, places=places).camera for places in (WALK, STAND))
    assert walks.pitch_rad.stddev < np.radians(2.0)
    assert stands.pitch_rad.stddev > np.radians(4.0)
    assert stands.height_m is not None and walks.height_m is not None
    assert stands.height_m.stddev > 2 * walks.height_m.stddev
    nobody = scene_camera([[]], [(0.0, BLANK)], CAMERA, [None])
    assert nobody.camera.height_m is None and not nobody.sources
    assert nobody.camera.pitch_rad.origin == "usual"
    assert nobody.camera.pitch_rad.stddev > np.radians(11.0)


def squatting(pitch_deg: float, bend_deg: float, bow_deg: float = 0.0) -> ImagePoints:
    """Return who bends knees and hips, and leans forward, at one place; 0 degrees for upright.

    ``bow_deg`` is a further lean of the trunk.
    """
    view, bend = CAMERA.with_pitch(np.radians(pitch_deg)), np.radians(bend_deg)
    tilt = bend / 2 + np.radians(bow_deg)
    # Ankles, knees, hips, and what is above, forward and up, in statures.
    shin, thigh = MARKED_HEIGHTS[4] - MARKED_HEIGHTS[5], MARKED_HEIGHTS[3] - MARKED_HEIGHTS[4]
    ankle = np.array((0.0, MARKED_HEIGHTS[5]))
    knee = ankle + shin * np.array((np.sin(bend / 2), np.cos(bend / 2)))
    hip = knee + thigh * np.array((-np.sin(bend), np.cos(bend)))
    lean = np.array(((np.cos(tilt), np.sin(tilt)), (-np.sin(tilt), np.cos(tilt))))
    px, there_m = dict[str, np.ndarray](), dict[str, np.ndarray]()
    for name in (*POINT_NAMES, *LEG_POINT_NAMES):
        level = name.split("_")[-1].replace("heel", "ankle").replace("foot", "ankle")
        at = LEVELS.index(level) if level in LEVELS else LEVELS.index("shoulder")
        above = lean @ (FORWARD[at], MARKED_HEIGHTS[at] - MARKED_HEIGHTS[3])
        forward, up = STATURE_M * {3: hip, 4: knee, 5: ankle}.get(at, hip + above)
        aside_m = 0.0 if name == "nose" else 0.12 * (1 if "left" in name else -1)
        there = np.array((forward - 3.0, aside_m, up - HEIGHT_M))
        px[name] = view.project(view.reference_to_optical(there))
        there_m[name] = view.reference_to_optical(there)
    legs = LegPoints(
        np.array([px[name] for name in LEG_POINT_NAMES]),
        np.ones(8),
        np.array([there_m[name] for name in LEG_POINT_NAMES]),
    )
    whole, in_space = (np.array([one[name] for name in POINT_NAMES]) for one in (px, there_m))
    return ImagePoints(whole, np.ones(len(POINT_NAMES)), None, in_space, legs)


@pytest.mark.parametrize("pitch_deg", [0.0, 20.0])
def test_who_squats_or_steps_on_a_box_does_not_tilt_the_camera(pitch_deg: float) -> None:
    bends = [0.0, 10.0, 45.0, 80.0, 80.0, 45.0, 10.0] * 3
    squats = [(2.0 * k, squatting(pitch_deg, bend)) for k, bend in enumerate(bends)]
    steps = [
        (2.0 * k, points(3.0, 0.1 * (k % 3), pitch_deg, 0.0, 0.3 * (k % 5 == 4))) for k in range(20)
    ]
    for people, upright in ((squats, squats[::7]), (steps, [*steps[:4], *steps[5:9]])):
        shown, by_upright = (people_camera([one], [STATURE_M], CAMERA) for one in (people, upright))
        assert shown is not None and by_upright is not None
        assert abs(shown.values[0] - by_upright.values[0]) < np.sqrt(shown.covariance[0, 0])


def test_who_bows_in_a_whole_film_shows_no_pitch() -> None:
    bows = [(2.0 * k, squatting(10.0, 10.0 * (k % 3), 25.0)) for k in range(12)]
    assert people_camera([bows], [STATURE_M], CAMERA) is None
    stands = [(2.0 * k, squatting(10.0, 0.0, 5.0 * (k % 3))) for k in range(12)]
    assert people_camera([stands], [STATURE_M], CAMERA) is not None


@pytest.mark.parametrize("roll_deg", [12.0, 25.0, -12.0])
def test_a_roll_is_found(roll_deg: float) -> None:
    shown = found(8.0, places=[(at_m + 1.0, 0.0) for at_m, _ in WALK], roll_deg=roll_deg)
    roll = shown.camera.roll_rad
    assert np.degrees(roll.mean) == pytest.approx(roll_deg, abs=2.0)
    assert roll.origin == "found"


def test_edges_decide_where_people_show_little_and_lose_against_who_walks() -> None:
    edges = found(12.0, doors(14.0), STAND)
    assert np.degrees(edges.camera.pitch_rad.mean) == pytest.approx(14.0, abs=1.0)
    assert edges.camera.pitch_rad.stddev < np.radians(2.5)
    against = found(12.0, doors(25.0), WALK)
    assert np.degrees(against.camera.pitch_rad.mean) == pytest.approx(12.0, abs=1.5)
    assert any("25 degrees" in one and "12 degrees" in one for one in against.remarks)


def test_a_given_pitch_is_kept_and_what_contradicts_it_is_told() -> None:
    shown = found(12.0, given=(np.radians(12.0), 0.01))
    assert not shown.remarks and shown.camera.pitch_rad.origin == "given"
    wrong = found(12.0, given=(np.radians(30.0), 0.01))
    assert wrong.camera.pitch_rad.mean == np.radians(30.0)
    assert any(
        "a camera pitch of 30 degrees down" in one and "12 deg" in one for one in wrong.remarks
    )


def test_a_camera_that_moves_is_told() -> None:
    people = [film(WALK, 8.0)]
    noise = np.random.default_rng(1).integers(0, 255, (60, 80)).astype(np.uint8)
    room = cv2.resize(noise, (640, 480), interpolation=cv2.INTER_CUBIC)
    # From one picture to the next: 1 % of the width counts, in more than a quarter of the pairs.
    for shifts_px, moves in (
        ((5, 5, 5, 5), False),
        ((9, 9, 9, 9), True),
        ((15, 0, 0, 0), False),
        ((15, 15, 0, 0), True),
    ):
        places_px = np.cumsum((0, *shifts_px)).tolist()
        pictures = [(10.0 * k, np.roll(room, px, axis=1)) for k, px in enumerate(places_px)]
        shown = scene_camera(people, pictures, CAMERA, [STATURE_M])
        assert any("camera does not stand still" in one for one in shown.remarks) is moves
        assert shown.moves is moves


def test_a_pan_before_a_wall_without_corners_is_told() -> None:
    people, rng = [film(WALK, 8.0)], np.random.default_rng(2)
    rough = cv2.resize(rng.normal(0, 3, (120, 160)), (640, 480), interpolation=cv2.INTER_CUBIC)
    # The lens darkens the corners, which stay where they are.
    rows, columns = np.indices(rough.shape)
    dark = np.hypot(rows - 240, columns - 320) / 20
    rolling = ((rough, 0, False), (rough, 40, True), (0.0 * rough, 0, False))
    for rough, shift_px, moves in rolling:
        rolled = [np.roll(rough, shift_px * k, axis=1) for k in range(4)]
        # The corners are those of the noise.
        noisy = [128 + one - dark + rng.normal(0, 4, rough.shape) for one in rolled]
        pictures = [(10.0 * k, one.astype(np.uint8)) for k, one in enumerate(noisy)]
        free = np.full(rough.shape, 255, np.uint8)
        assert not background_shift(pictures[0][1], pictures[1][1], free)
        assert scene_camera(people, pictures, CAMERA, [STATURE_M]).moves is moves


@pytest.mark.parametrize("places", [STAND, WALK], ids=["stands", "walks"])
def test_a_given_distance_shows_an_unknown_lens_alone(
    places: Sequence[tuple[float, float]],
) -> None:
    guessed = Camera(640, 480, 250.0, 250.0, 319.5, 239.5, focal_stddev=0.2)
    given = [film(places, 12.0)], [(0.0, BLANK)]
    shown = scene_camera(*given, guessed, [STATURE_M], distance_m=places[0][0])
    lens = shown.camera.fov_rad
    assert lens.mean == pytest.approx(lens_of(CAMERA).mean, rel=0.05)
    assert abs(lens.mean - lens_of(CAMERA).mean) < 2 * lens.stddev < np.radians(15.0)
    assert (lens.origin, lens.by) == ("found", "the given distance and the given stature")
    assert not [remark for remark in shown.remarks if "field of view" in remark]


def test_a_lens_that_is_known_stays_and_a_distance_that_contradicts_it_is_told() -> None:
    given = [film(STAND, 12.0)], [(0.0, BLANK)], CAMERA, [STATURE_M]
    for distance_m, told in ((3.0, []), (6.0, ["3.0 m away", "6.0 m is given"])):
        shown = scene_camera(*given, distance_m=distance_m)
        assert shown.camera.fov_rad == lens_of(CAMERA)
        remarks = [remark for remark in shown.remarks if "field of view" in remark]
        assert len(remarks) == bool(told)
        assert all(words in remarks[0] for words in told)


@pytest.mark.parametrize("pitch_deg", [0.0, 20.0])
def test_the_floor_tells_another_lens_from_people_who_stand_elsewhere(pitch_deg: float) -> None:
    """The scene has somebody 3 m away; who stands elsewhere keeps the camera's height."""
    value = Value(np.radians(pitch_deg), np.radians(4.0))
    scene = SceneCamera(lens_of(CAMERA), value, Value(0.0, 0.01), Value(HEIGHT_M, 0.2))
    half = replace(CAMERA, fx=250.0, fy=250.0)
    decided = []
    for places, camera, away in (
        ([(2.0, 0.0)] * 6, CAMERA, np.log(2 / 3)),
        (STAND, half, np.log(1 / 2)),
    ):
        people = [film(places, pitch_deg)]
        decided.append(other_lens(people, [STATURE_M], camera, scene, away))
    elsewhere, other = decided
    if pitch_deg:
        assert elsewhere < -2.0 and other > 2.0
    else:
        # A camera that looks ahead sees the same with any lens from another distance.
        assert abs(elsewhere) < 2.0 and abs(other) < 2.0
    assert other_lens([], [], CAMERA, scene, 0.5) == 0.0
