"""A film by a camera that shakes gives what the film by a still one gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from cardbox_tracker import Request, track
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.commands import scene
from cardbox_tracker.commands.tracking_request import PersonRequest, TrackingRequest
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.own_network import OwnModel
from cardbox_tracker.detectors.person_choice import PersonChoice
from cardbox_tracker.measuring.scene import FOUND
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.recordings import measured_scene
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.measured_scene import Watched, turns_in, watch
from cardbox_tracker.recordings.recording import Recording, RecordingRequest
from cardbox_tracker.recordings.turned_back import Turned
from cardbox_tracker.search.config import TrackerConfig

CAMERA = Camera(320, 240, 280.0, 280.0, 159.5, 119.5)
FOV_DEG = float(np.degrees(2 * np.arctan(160 / 280)))
# Usual proportions: with others nothing tells the distance, and processors differ.
JOINTS = {
    "nose": (160, 66),
    "left_shoulder": (180, 85),
    "right_shoulder": (140, 85),
    "left_elbow": (191, 113),
    "right_elbow": (129, 113),
    "left_wrist": (197, 138),
    "right_wrist": (123, 138),
    "left_hip": (171, 142),
    "right_hip": (149, 142),
    "left_knee": (172, 184),
    "right_knee": (148, 184),
    "left_ankle": (172, 226),
    "right_ankle": (148, 226),
}
IMAGES, LARGE = 16, (480, 360)
# Grey rooms have none of these colours.
_HUES = {name: 13 * number for number, name in enumerate(JOINTS)}


def to_track(asked: RecordingRequest, person: PersonRequest) -> TrackingRequest:
    return TrackingRequest(asked, person, "default", TrackerConfig(), 0, ())


class FindsDots:
    """Finds the coloured dots at the joints of the only person."""

    def detect(self, image: NDArray[np.uint8]) -> list[Mapping[str, Any]]:
        hue, saturation, _ = cv2.split(cv2.cvtColor(image, cv2.COLOR_BGR2HSV))
        found = {}
        for name, its in _HUES.items():
            away = np.abs(np.asarray(hue, int) - its)
            rows, columns = np.nonzero(
                (np.minimum(away, 180 - away) <= 4) & (np.asarray(saturation) > 120)
            )
            if len(rows) > 5:
                found[name] = columns.mean(), rows.mean(), 0.9
        return [found] if found else []


def room() -> NDArray[np.uint8]:
    rng = np.random.default_rng(2)
    rough = [rng.uniform(0, 110, (LARGE[1] // k, LARGE[0] // k)) for k in (6, 20)]
    return np.asarray(sum(np.asarray(cv2.resize(one, LARGE)) for one in rough), np.uint8)


def shake(number: int) -> NDArray[np.float64]:
    vector = np.radians([1.5 * np.sin(1.1 * number), 2 * np.sin(0.9 * number), np.sin(number)])
    return np.asarray(cv2.Rodrigues(vector)[0])


def write_film(folder: Path, moves: bool) -> Path:
    """Write images of somebody whose arms rise before a wall."""
    folder.mkdir()
    there, k = CAMERA.k, CAMERA.k
    there[:2, 2] += 80, 60
    for number in range(IMAGES):
        shown = np.repeat(room()[..., None], 3, axis=2)
        for name, (column, row) in JOINTS.items():
            up = number * {"elbow": 1, "wrist": 3}.get(name.split("_")[-1], 0)
            color = cv2.cvtColor(np.uint8([[[_HUES[name], 255, 220]]]), cv2.COLOR_HSV2BGR)[0, 0]
            at = 80 + column, 60 + row - up
            cv2.circle(shown, at, 5, color.tolist(), -1, cv2.LINE_AA)
        turn = shake(number) if moves else np.eye(3)
        matrix = k @ turn @ np.linalg.inv(there)
        image = cv2.warpPerspective(shown, matrix, (320, 240))
        cv2.imwrite(str(folder / f"{number:03}.png"), image)
    return folder


@pytest.fixture(scope="module")
def shaken(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_film(tmp_path_factory.mktemp("films") / "shaken", moves=True)


def request(folder: Path) -> RecordingRequest:
    finds = Detector(OwnModel.of(FindsDots, "FindsDots"))
    camera = GivenCamera(fov_deg=FOV_DEG, fps=10.0)
    return RecordingRequest(folder, finds, points=finds, camera=camera)


@pytest.fixture(scope="module")
def turned(shaken: Path) -> Turned:
    """How the images are turned back."""
    with request(shaken).open() as source:
        found = turns_in(source, watch(source))
    assert found is not None
    return found[0]


def test_points_of_turned_images_are_those_of_a_still_camera(shaken: Path, turned: Turned) -> None:
    asked = request(shaken)
    assert turned.found.unknown == 0 and "turns by up to" in turned.remark
    with replace(asked, turned=turned).open() as source:
        camera, frames = source.first.camera, [taken.first for taken in source.frames()]
        pictures = [taken.picture().shape for taken in source.frames() if taken.picture]
    assert camera.fx == pytest.approx(CAMERA.fx, rel=0.02)
    assert camera.width > 320 and len(set(pictures)) == 1 and pictures[0][1] > 320
    for number, frame in enumerate(frames):
        assert frame.points is not None and frame.covered is not None
        rays = camera.rays(frame.points.px[[0, 5, 6, 11, 12]])
        true_px = np.array([JOINTS[name] for name in list(JOINTS)[:3] + list(JOINTS)[7:9]])
        true = CAMERA.rays(true_px.astype(float))
        assert np.abs(rays[:, :2] - true[:, :2]).max() < 2.0 / CAMERA.fx, number
        assert 0 < np.count_nonzero(frame.covered) < 0.3 * frame.covered.size


def test_a_detector_sees_the_images_as_they_were_recorded(shaken: Path, turned: Turned) -> None:
    images: list[NDArray[np.uint8]] = []

    class Looks(FindsDots):
        def detect(self, image: NDArray[np.uint8]) -> list[Mapping[str, Any]]:
            images.append(image.copy())
            return super().detect(image)

    finds = Detector(OwnModel.of(Looks, "Looks"))
    asked = replace(request(shaken), silhouettes=finds, points=finds, turned=turned)
    with asked.open() as source:
        masks = [taken.first.silhouette.shape for taken in source.frames()]
        assert {*masks} == {(source.first.camera.height, source.first.camera.width)}
    assert len(images) == IMAGES
    for number, image in enumerate(images):
        recorded = cv2.imread(str(shaken / f"{number:03}.png"))
        apart = np.abs(image.astype(int) - recorded)[20:-20, 20:-20]
        assert np.median(apart) < 6.0, number


def test_who_is_at_a_place_of_the_first_image_is_there_in_turned_ones(turned: Turned) -> None:
    placed = turned.placed(PersonChoice("place", (160.0, 120.0)))
    assert np.array(placed.place) + turned.found.corner_px == pytest.approx((160, 120), abs=1.0)


def test_the_place_is_of_the_first_image_also_if_turned_images_are_read_again(
    shaken: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    choices = list[PersonChoice | None]()

    def watched(source: Recording, start_s: float, end_s: float, choice: PersonChoice) -> Watched:
        choices.append(choice)
        return watch(source, start_s, end_s, choice)

    monkeypatch.setattr(scene, "watch", watched)
    # As if roll or field of view were found.
    monkeypatch.setattr(scene, "_corrected", lambda recording, _: replace(recording))
    finds = Detector(OwnModel.of(FindsDots, "FindsDots"), people=4)
    asked = replace(request(shaken), silhouettes=finds, points=finds)
    choice = PersonChoice("place", (160.0, 120.0))
    person = PersonRequest(BodyModel(), None, 0.0, is_pitch_given=True, choice=choice)
    with scene.measured_scene(to_track(asked, person)) as measured:
        assert measured.chosen is not None
    as_recorded, as_turned, again = choices
    assert as_recorded == choice != as_turned == again


def test_the_turns_show_a_field_of_view_that_is_not_given(
    shaken: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(measured_scene, "_MOST_TURNED", 8)
    person = PersonRequest(BodyModel(), None, 0.0, is_pitch_given=True)
    asked = replace(request(shaken), camera=GivenCamera(fps=10.0))
    with asked.open() as source:
        assert source.first.camera.fx < 0.91 * CAMERA.fx
    with scene.measured_scene(to_track(asked, person)) as (source, found, _, remarks):
        camera, fov_rad = source.first.camera, found.camera.fov_rad
    assert camera.fx == pytest.approx(CAMERA.fx, rel=0.03)
    # Of the turned images, which are wider.
    assert fov_rad.mean == pytest.approx(2 * np.arctan(camera.width / 2 / camera.fx))
    assert np.degrees(fov_rad.mean) > 1.05 * FOV_DEG
    assert (fov_rad.origin, fov_rad.by) == (FOUND, "the turns of the camera")
    assert fov_rad.stddev / np.sin(fov_rad.mean) == pytest.approx(0.07, abs=0.02)
    said = "degrees across the image, found from the turns of the camera"
    assert any(said in remark for remark in remarks)


def test_a_table_of_points_says_nothing_of_a_camera_that_moves(shaken: Path) -> None:
    asked = request(shaken)
    assert asked.shows_turns
    assert not RecordingRequest(shaken, asked.silhouettes, ("a", "b")).shows_turns


def test_track_gives_the_same_for_a_film_that_shakes(
    shaken: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given: dict[str, Any] = {"detector": FindsDots, "fov_deg": FOV_DEG, "stature_m": 1.75}
    given |= {"fps": 10.0, "camera_pitch_deg": 0.0}
    still, moved = (
        track(Request(film, **given)).to_pandas()
        for film in (write_film(tmp_path / "still", moves=False), shaken)
    )
    assert "turned back into the view of the first" in capsys.readouterr().err
    names = [f"{side}_hand_{axis}" for side in ("left", "right") for axis in "xyz"]
    away_m = np.abs(still[names].to_numpy() - moved[names].to_numpy())
    assert np.median(away_m) < 0.02
