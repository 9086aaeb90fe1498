"""Times and poses of films from the points of a skeleton whose motion and bones are known."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics, angle_of
from cardbox_tracker.commands.main import build_parser
from cardbox_tracker.commands.request import Request, TrackArguments
from cardbox_tracker.commands.tracking_request import points_named, tracking_request
from cardbox_tracker.common.errors import CameraError, CardboxError
from cardbox_tracker.detectors.image_points import LEG_POINT_NAMES, POINT_NAMES, ImagePoints
from cardbox_tracker.measuring.film_cameras import Film, FilmCamera, Seen, film_cameras
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.recording import FurtherFilm, RecordingRequest

CAMERA = Camera(320, 240, 280.0, 280.0, 159.5, 119.5)
STATURE_M, OFFSET_S = 1.7, 0.37
NAMES = (*POINT_NAMES, *LEG_POINT_NAMES)


def other_camera(angle_deg: float) -> Extrinsics:
    """Return a camera that looks, like the first one, at a place 4 m before the first one."""
    turn = np.asarray(cv2.Rodrigues(np.radians([0.0, angle_deg, 0.0]))[0])
    ahead_m = np.array([0.0, 0.0, 4.0])
    return Extrinsics(turn, ahead_m - turn @ ahead_m)


def skeleton(times_s: np.ndarray, seed: int) -> np.ndarray:
    """Return 25 points (n, 25, 3), m, of a person who walks and waves, right, down, away."""
    rng, shares = np.random.default_rng(seed), {}
    # Sums of waves that do not repeat.
    hz = rng.uniform(0.2, 1.5, (12, 6))
    # People turn and walk slower than they wave.
    hz[:3] *= 0.2
    phase = 2 * np.pi * np.multiply.outer(times_s, hz)
    angle = np.sin(phase + rng.uniform(0.0, 6.0, (12, 6))).sum(axis=-1) / 3.0
    yaw = 0.6 * angle[:, 0]
    across, none = np.stack([np.cos(yaw), 0 * yaw, np.sin(yaw)], -1), np.zeros(len(yaw))
    ahead = np.stack([np.sin(yaw), 0 * yaw, -np.cos(yaw)], -1)
    hips = np.stack([0.5 * angle[:, 1], none, 4.0 + 0.5 * angle[:, 2]], -1) / STATURE_M
    down = np.array([0.0, 1.0, 0.0])

    def hanging(lift: np.ndarray, aside: np.ndarray) -> np.ndarray:
        """Return unit directions (n, 3) that are lifted forwards and aside, rad."""
        forward = np.cos(lift)[:, None] * down + np.sin(lift)[:, None] * ahead
        return np.cos(aside)[:, None] * forward + np.sin(aside)[:, None] * across

    for number, (side, sign) in enumerate((("left", 1.0), ("right", -1.0))):
        lift, bend, walk = angle[:, 3 + 4 * number : 6 + 4 * number].T
        shares[f"{side}_hip"] = hips + 0.06 * sign * across
        shares[f"{side}_shoulder"] = hips - 0.304 * down + 0.0985 * sign * across
        # The trunk is as long as its points are apart.
        shares[f"{side}_shoulder"] += down * (0.304 - np.sqrt(0.304**2 - 0.0385**2))
        upper = hanging(1.2 + lift, 0.4 * sign * (1 + walk))
        shares[f"{side}_elbow"] = shares[f"{side}_shoulder"] + 0.160 * upper
        fore = hanging(2.0 + lift + 0.5 * bend, 0.3 * sign + none)
        shares[f"{side}_wrist"] = shares[f"{side}_elbow"] + 0.146 * fore
        for name in ("little_finger", "index"):
            shares[f"{side}_{name}"] = shares[f"{side}_wrist"] + 0.05 * fore
        shares[f"{side}_knee"] = shares[f"{side}_hip"] + 0.224 * hanging(0.4 * walk, none)
        shares[f"{side}_ankle"] = shares[f"{side}_knee"] + 0.22 * hanging(0.4 * walk - 0.2, none)
        shares[f"{side}_heel"] = shares[f"{side}_ankle"] + 0.03 * down
        shares[f"{side}_foot"] = shares[f"{side}_heel"] + 0.12 * ahead
        for name, aside in (("ear", 0.045), ("eye", 0.02)):
            shares[f"{side}_{name}"] = hips - 0.43 * down + aside * sign * across + 0.04 * ahead
    shares["nose"] = hips - 0.42 * down + 0.07 * ahead
    return STATURE_M * np.stack([shares[name] for name in NAMES], 1)


def film(
    name: str,
    pose: Extrinsics,
    begins_s: float,
    hz: float,
    seed: int = 1,
    noise_px: float = 0.3,
    seconds: float = 8.0,
    exchanged_s: tuple[float, float] = (0.0, 0.0),
    noise_seed: int = 0,
    **given: object,
) -> Film:
    """Return a film, from ``begins_s`` on, of the person with this seed.

    The detector takes left for right in part of the time.
    """
    times_s = np.arange(0.0, seconds, 1.0 / hz)
    rng = np.random.default_rng([*name.encode(), round(hz), noise_seed])
    there_m = skeleton(times_s + begins_s, seed) @ pose.rotation.T + pose.translation_m
    px = CAMERA.project(there_m) + rng.normal(0.0, noise_px, (*there_m.shape[:2], 2))
    sightings = []
    for time_s, at, places in zip(times_s, px, there_m, strict=True):
        space = places - places.mean(axis=0)
        found = {
            one: (*uv, 1.0, *xyz) for one, uv, xyz in zip(NAMES, at.tolist(), space, strict=True)
        }
        points, (begin_s, end_s) = ImagePoints.of(found), exchanged_s
        is_exchanged = begin_s <= time_s < end_s
        sightings.append((float(time_s), points.exchanged() if is_exchanged else points))
    return Film(name, [Seen(sightings, CAMERA)], **given)  # type: ignore[arg-type]


FIRST = Extrinsics(np.eye(3), np.zeros(3))


def check_pose(found: FilmCamera, true: Extrinsics, degrees: float, share: float) -> None:
    angle_rad, away_m = found.extrinsics.difference(true)
    assert np.degrees(angle_rad) < degrees
    assert away_m < share * np.linalg.norm(true.centre_m)


@pytest.mark.parametrize("angle_deg", [38.0, 70.0, -110.0])
def test_offset_and_pose_follow_from_the_person(angle_deg: float) -> None:
    true = other_camera(angle_deg)
    films = [film("a", FIRST, 0.0, 30.0), film("b", true, OFFSET_S, 25.0)]
    (found,) = film_cameras(films, (STATURE_M,))
    assert found.offset_s == pytest.approx(OFFSET_S, abs=0.5 / 30)
    check_pose(found, true, degrees=2.0, share=0.05)
    assert not found.is_doubtful
    assert 0.0 < found.turn_stddev_rad < np.radians(5.0)


def test_a_film_that_begins_before_the_first_one_has_a_negative_offset() -> None:
    films = [film("a", FIRST, 2.0, 30.0), film("b", other_camera(60.0), 0.0, 30.0)]
    (found,) = film_cameras(films, (STATURE_M,))
    assert found.offset_s == pytest.approx(-2.0, abs=0.5 / 30)


def test_distances_grow_with_the_stature() -> None:
    films = [film("a", FIRST, 0.0, 15.0), film("b", other_camera(60.0), 0.0, 15.0)]
    near, far = (film_cameras(films, (tall,))[0].extrinsics for tall in (STATURE_M, 2.0))
    grown = np.linalg.norm(far.centre_m) / np.linalg.norm(near.centre_m)
    assert grown == pytest.approx(2.0 / STATURE_M, rel=0.01)


def test_offset_and_pose_that_are_given_stay() -> None:
    # Neither is true.
    pose = other_camera(64.0)
    given = {"offset_s": 0.4, "extrinsics": pose}
    films = [film("a", FIRST, 0.0, 30.0), film("b", other_camera(60.0), OFFSET_S, 30.0, **given)]
    (found,) = film_cameras(films, (STATURE_M,))
    assert found.offset_s == pytest.approx(0.4, abs=1e-3)
    check_pose(found, pose, degrees=0.1, share=0.001)


def test_three_films_stand_in_one_frame() -> None:
    poses = [other_camera(50.0), other_camera(-60.0)]
    films = [film("a", FIRST, 0.0, 15.0)]
    films += [film(f"b{k}", pose, 0.3 * (k + 1), 15.0) for k, pose in enumerate(poses)]
    for number, (found, true) in enumerate(
        zip(film_cameras(films, (STATURE_M,)), poses, strict=True)
    ):
        assert found.offset_s == pytest.approx(0.3 * (number + 1), abs=0.5 / 15)
        check_pose(found, true, degrees=2.0, share=0.05)


def test_people_of_two_films_are_found_in_each_other() -> None:
    true = other_camera(60.0)
    one = [film("a", FIRST, 0.0, 15.0, seed).people[0] for seed in (1, 2)]
    two = [film("b", true, OFFSET_S, 15.0, seed).people[0] for seed in (2, 1)]
    (found,) = film_cameras([Film("a", one), Film("b", two)], (STATURE_M,))
    check_pose(found, true, degrees=2.0, share=0.05)


def test_two_people_show_an_offset_that_neither_shows_alone() -> None:
    true = other_camera(120.0)
    given = {"noise_px": 3.0, "seconds": 1.2}
    one = [film("a", FIRST, 0.0, 30.0, seed, **given).people[0] for seed in (1, 2)]
    two = [film("b", true, 0.1, 30.0, seed, **given).people[0] for seed in (1, 2)]
    for ours, theirs in zip(one, two, strict=True):
        with pytest.raises(CameraError, match="do not show the same people"):
            film_cameras([Film("a", [ours]), Film("b", [theirs])], (STATURE_M,))
    (found,) = film_cameras([Film("a", one), Film("b", two)], (STATURE_M,))
    assert found.offset_s == pytest.approx(0.1, abs=0.5 / 30)


def test_a_detector_may_take_left_for_right() -> None:
    first, true = film("a", FIRST, 0.0, 30.0, noise_px=1.0, seconds=2.0), other_camera(60.0)
    poses = [
        film_cameras(
            [first, film("b", true, 0.1, 30.0, noise_px=1.0, seconds=2.0, exchanged_s=part)],
            (STATURE_M,),
        )[0].extrinsics
        for part in ((0.0, 0.0), (0.3, 1.1))
    ]
    angle_rad, away_m = poses[0].difference(poses[1])
    assert np.degrees(angle_rad) < 0.01
    assert away_m < 1e-3


def test_noise_does_not_draw_cameras_apart() -> None:
    true, turned_deg = other_camera(25.0), []
    for seed in range(3):
        films = [
            film(name, pose, 0.0, 15.0, noise_px=1.0, seconds=6.0, noise_seed=seed)
            for name, pose in (("a", FIRST), ("b", true))
        ]
        (found,) = film_cameras(films, (STATURE_M,))
        turned_deg.append(np.degrees(angle_of(found.extrinsics.rotation)))
    assert np.mean(turned_deg) == pytest.approx(25.0, abs=0.5)


def test_the_head_hides_the_face_of_who_looks_away() -> None:
    away, back = (
        film("a", other_camera(angle_deg), 0.0, 15.0, seconds=1.0).people[0]
        for angle_deg in (0.0, 180.0)
    )
    nose = NAMES.index("nose")
    assert (away.sure[:, nose] == 1.0).all()
    assert (back.sure[:, nose] < 0.5).all()


@pytest.mark.parametrize(
    "other",
    [
        film("b.mp4", other_camera(60.0), 0.0, 30.0, seed=8),
        film("b.mp4", other_camera(60.0), 0.0, 30.0, seconds=0.6),
        Film("b.mp4", []),
    ],
    ids=["another motion", "too short", "nobody"],
)
def test_films_of_something_else_are_refused(other: Film) -> None:
    with pytest.raises(CameraError, match=r"b\.mp4 and a\.mp4.*--offset"):
        film_cameras([film("a.mp4", FIRST, 0.0, 30.0), other], (STATURE_M,))


class Numbered:
    """Finds the person of a film whose images have nothing but a number; counts the images."""

    def __init__(self, films: list[tuple[Extrinsics, float, float]]) -> None:
        self.found, self.calls = list[list[dict[str, list[float]]]](), 0
        for pose, begins_s, hz in films:
            there_m = skeleton(begins_s + np.arange(0.0, 8.0, 1.0 / hz), 1) @ pose.rotation.T
            there_m += pose.translation_m
            values = np.concatenate(
                [CAMERA.project(there_m), np.ones((*there_m.shape[:2], 1)), there_m], axis=-1
            )
            self.found.append([dict(zip(NAMES, one.tolist(), strict=True)) for one in values])

    def detect(self, image: np.ndarray) -> list[dict[str, list[float]]]:
        self.calls += 1
        which, number = divmod(int(image[0, 0, 0]), 128)
        return [self.found[which][number]]


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return two folders of images of one scene, at 15 and 12 Hz."""
    paths = []
    for which, count in enumerate((120, 96)):
        path = tmp_path_factory.mktemp("ab"[which])
        for number in range(count):
            image = np.full((CAMERA.height, CAMERA.width), 128 * which + number, np.uint8)
            cv2.imwrite(str(path / f"{number:03}.png"), image)
        paths.append(path)
    return paths[0], paths[1]


def test_films_are_one_recording_whose_images_are_detected_once(
    folders: tuple[Path, Path],
) -> None:
    true, fov_deg = other_camera(60.0), float(np.degrees(2 * np.arctan(160.0 / 280.0)))
    own = Numbered([(FIRST, 0.0, 15.0), (true, OFFSET_S, 12.0)])
    detector = points_named(own)
    cameras = [GivenCamera(fov_deg=fov_deg, fps=hz) for hz in (15.0, 12.0)]
    request = RecordingRequest(
        folders[0],
        detector,
        points=detector,
        camera=cameras[0],
        films=(FurtherFilm(folders[1], cameras[1]),),
        statures_m=(STATURE_M,),
    )
    with request.open() as recording:
        check_pose(recording.films[0].camera, true, degrees=2.0, share=0.05)
        sets = list(recording.frames())
        again = [one.stamp_ns for one in recording.frames(2.0, 4.0)]
        remarks = " ".join(recording.films[0].remarks("a", recording.first.duration_s))
    assert own.calls == 120 + 96
    assert [one.stamp_ns for one in sets] == [round(1e9 * k / 15.0) for k in range(120)]
    assert all(2e9 <= stamp_ns <= 4e9 for stamp_ns in again)
    assert len(again) == 31
    pairs = [one.frames for one in sets if one.frames[1] is not None]
    # The other film begins 0.37 s later and has fewer images, each of which is used once.
    assert len({two.recorded.name for _, two in pairs if two and two.recorded}) == len(pairs) > 85
    apart_ns = [abs(one.stamp_ns - two.stamp_ns) for one, two in pairs if one and two]
    assert max(apart_ns) <= 0.5e9 / 15.0
    assert "overlaps with a from 0.3" in remarks


@pytest.mark.parametrize(
    ("options", "fault"),
    [
        ({"fov_deg": (60.0, 43.0, 40.0)}, r"--fov has 3 values.*one for each film"),
        ({"fov_deg": (60.0, 400.0)}, r"the field of view is 400 degrees"),
        ({"offset_s": (0.1, 0.2)}, r"--offset has 2 values"),
        ({"offset_s": (float("nan"),)}, r"--offset: expected seconds"),
        ({"cameras": ("cam0", "cam1")}, r"--cameras.*several films"),
        ({"camera_roll_deg": 90.0}, r"--camera-roll-deg.*several films"),
        ({"films": ("missing.mp4",)}, r"no recording missing\.mp4"),
        ({"detector": None}, r"--detector mediapipe"),
    ],
)
def test_options_that_do_not_fit_several_films_are_told(
    folders: tuple[Path, Path], options: dict[str, object], fault: str
) -> None:
    given = {"films": (folders[1],), "fov_deg": 60.0, "stature_m": 1.7, "detector": Numbered([])}
    with pytest.raises(CardboxError, match=fault):
        tracking_request(Request(folders[0], **(given | options)))  # type: ignore[arg-type]


def test_the_command_takes_further_films() -> None:
    words = ["track", "a.mp4", "b.mp4", "c.mp4", "--fov", "60,43,43", "--offset", "0.4,-1.2"]
    asked = TrackArguments.of(build_parser(words).parse_args(words))
    assert (str(asked.recording), *map(str, asked.films)) == ("a.mp4", "b.mp4", "c.mp4")
    assert asked.fovs_deg == (60.0, 43.0, 43.0)
    assert asked.offset_s == (0.4, -1.2)
