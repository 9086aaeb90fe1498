"""'cardbox track' and 'initialize' on a video, in an empty folder."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from cardbox_tracker.body.model_file import load_body_model
from cardbox_tracker.detection.model_files import ModelFiles
from cardbox_tracker.estimation.standing_camera import StandingCamera
from cardbox_tracker.recordings import detector as detector_module
from cardbox_tracker.recordings import standing
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.silhouettes import SilhouetteSource, TimeSpan

FPS = 4.0
GIVEN = ("--background", "0:3.9", "--start", 16, "--stature", 1.72)


@pytest.fixture(scope="module")
def film(files: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the synthetic session as a video; its field of view is in ``film.fov`` beside it."""
    path = tmp_path_factory.mktemp("film") / "me.mp4"
    with BagReader(files / "session") as bag:
        calibration = bag.calibration()
        size = calibration.width, calibration.height
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), FPS, size)
        for image in bag.images():
            writer.write(np.repeat(image.as_sent[..., None], 3, axis=2))
        writer.release()
    fov_deg = 2 * np.degrees(np.arctan(size[0] / 2 / calibration.k[0, 0]))
    path.with_suffix(".fov").write_text(f"{fov_deg:.3f}")
    return path


@pytest.fixture
def fov(film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Work in an empty folder; return the film's field of view."""
    monkeypatch.chdir(tmp_path)
    return film.with_suffix(".fov").read_text()


def test_a_film_is_tracked_with_a_stature(
    film: Path, fov: str, tmp_path: Path, cardbox: Callable[..., Any]
) -> None:
    done = cardbox("track", film, "--fov", fov, *GIVEN, "--video", "out.mp4")
    assert done.code == 0, done.err
    for name in ("me.csv", "me.body.yaml", "out.mp4"):
        assert f"wrote {name}" in done.out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["me.body.yaml", "me.csv", "out.mp4"]
    with (tmp_path / "me.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["time_s"]) for row in rows[:3]] == pytest.approx([16.0, 16.25, 16.5])
    assert sum(row["state"] == "tracking" for row in rows) > 0.8 * len(rows)
    body = load_body_model("me.body.yaml")
    assert body.unknown == ()
    assert body.placement.distance_m == pytest.approx(2.0, rel=0.25)
    overlay = cv2.VideoCapture("out.mp4")
    assert overlay.get(cv2.CAP_PROP_FPS) == pytest.approx(FPS)
    assert overlay.get(cv2.CAP_PROP_FRAME_COUNT) == len(rows)
    assert overlay.read()[1].shape == (480, 640, 3)
    # The body that was used tracks the film again, and nothing is lost.
    cardbox("track", film, "--fov", fov, *GIVEN).assert_refused("track", "me.csv exists")
    words = ("--background", "0:3.9", "--model", "me.body.yaml", "--start", 16, "--csv", "b.csv")
    assert cardbox("track", film, "--fov", fov, *words).code == 0


def test_the_overlay_has_the_aspect_and_the_resolution_of_a_film_held_upright(
    files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cardbox: Callable[..., Any]
) -> None:
    """The film is 720 px wide and 960 px high, with stripes that the working resolution blurs."""
    monkeypatch.chdir(tmp_path)
    writer = cv2.VideoWriter("up.mp4", cv2.VideoWriter.fourcc(*"mp4v"), 30.0, (720, 960))
    stripes = np.zeros((960, 720, 3), np.uint8)
    stripes[:, ::4] = stripes[:, 1::4] = 200
    for _ in range(6):
        writer.write(stripes)
    writer.release()
    given = ("--model", files / "person.yaml", "--background", "0:0.1", "--start", 0.1)
    done = cardbox("track", "up.mp4", "--fov", 45, *given, "--video", "overlay.mp4")
    assert done.code == 0, done.err
    overlay = cv2.VideoCapture("overlay.mp4")
    assert overlay.get(cv2.CAP_PROP_FPS) == pytest.approx(30.0)
    image = overlay.read()[1]
    assert image.shape == (960, 720, 3)
    assert image[700:900].mean(axis=(0, 2)).std() > 60


def test_the_body_that_exists_is_kept(
    film: Path, fov: str, tmp_path: Path, cardbox: Callable[..., Any]
) -> None:
    (tmp_path / "me.body.yaml").write_text("mine")
    done = cardbox("track", film, "--fov", fov, *GIVEN)
    done.assert_refused("track", "me.body.yaml exists")
    assert (tmp_path / "me.body.yaml").read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--stature", 1.72), "does not tell the camera's field of view; give --fov DEG"),
        (("--fov", 60, "--stature", 172), "stature is 172 m; expected 1.1 to 2.2 m"),
        (("--fov", 60, "--stature", 1.7, "--distance", 90), "distance_m is 90 m"),
        (("--fov", 60, "--stature", 1.7, "--start", 99), "no image lies after --start 99 s"),
        (("--fov", 60, "--model", "FILES/person.yaml"), "--model needs --start T"),
        (
            ("--fov", 60, "--model", "FILES/person.yaml", "--start", 1, "--distance", 2),
            "--distance has no effect with --model",
        ),
        (("--fov", 60, "--calibration", "a"), "not allowed with argument --fov"),
        (("--fov", 60, "--stature", 1.7, "--model", "a"), "not allowed with argument --stature"),
        (("--fov", 60), "one of the arguments --model --stature is required"),
        (("--stature", 1.7, "--calibration", "none.yaml"), "none.yaml: No such file"),
        (("--stature", 1.7, "--fov", 60, "--fps", 0), "--fps: expected a number above 0 to 1000"),
        (("--stature", 1.7, "--fov", 60, "--camera-roll-deg", 90), "expected a number from -45"),
        (("--stature", 1.7, "--fov", 60, "--camera-pitch-deg", 95), "camera_pitch_rad is"),
        (("--stature", 1.7, "--fov", 60, "--depth", "/d", "--cameras", "a"), "a rosbag2, which"),
        (("--stature", 1.7, "--fov", 60, "--cameras", "a"), "omit --cameras"),
    ],
)
def test_mistakes_with_a_film(
    film: Path,
    fov: str,
    files: Path,
    tmp_path: Path,
    words: tuple[object, ...],
    expected: str,
    cardbox: Callable[..., Any],
) -> None:
    given = [str(word).replace("FILES", str(files)) for word in words]
    done = cardbox("track", film, "--background", "0:3.9", *given)
    done.assert_refused("track", expected)
    assert list(tmp_path.iterdir()) == []


def test_a_film_without_a_background_needs_somebody_who_steps_aside(
    film: Path, fov: str, cardbox: Callable[..., Any]
) -> None:
    both = ("--silhouettes", "person_in_view", "--background", "0:3.9")
    done = cardbox("track", film, "--fov", fov, "--stature", 1.7, *both)
    done.assert_refused("track", "--silhouettes person_in_view takes the place of --background")


def test_somebody_is_measured_in_a_film(
    film: Path, fov: str, spans: dict[str, str], cardbox: Callable[..., Any]
) -> None:
    words = [word for option in spans.items() for word in option]
    given = ("--fov", fov, "--distance", 2, "--output", "me.yaml")
    done = cardbox("initialize", film, *words, *given)
    assert done.code == 0, done.err
    assert load_body_model("me.yaml").size("upper_arm_length") == pytest.approx(0.27, rel=0.1)


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (
            StandingCamera(np.radians(12.0), np.radians(5.0), np.radians(4.0), 2.0, True),
            (
                "pitch 12 degrees down (standard deviation 5)",
                "upright at 20:21 s",
                "roll 4.0 degrees",
            ),
        ),
        (StandingCamera(0.0, 0.2, 0.0, 2.0, False), ("taken as 0",)),
        (None, ("nobody stands upright at 16:46 s",)),
    ],
)
def test_the_cameras_pitch_is_found_from_who_stands_upright(
    found: StandingCamera | None,
    expected: tuple[str, ...],
    film: Path,
    fov: str,
    monkeypatch: pytest.MonkeyPatch,
    cardbox: Callable[..., Any],
) -> None:
    """The detector, an optional library, is replaced by the silhouettes of the empty scene."""
    monkeypatch.setattr(detector_module, "installed_models", lambda: ModelFiles(film, film))
    stood = None if found is None else standing.Standing(found, TimeSpan(20.0, 21.0))
    monkeypatch.setattr(standing, "camera_of_standing", lambda *_: stood)

    def opened(bag: Any, detector: Any, camera: Any, points: Any) -> SilhouetteSource:
        rolls.append(bag.calibration().roll_rad)
        return SilhouetteSource(bag, TimeSpan(0.0, 3.9))

    rolls: list[float] = []
    monkeypatch.setattr("cardbox_tracker.recordings.recording.DetectorSilhouetteSource", opened)
    words = ("--fov", fov, "--stature", 1.72, "--start", 16, "--detector", "mediapipe")
    done = cardbox("track", film, *words)
    assert done.code == 0, done.err
    for part in expected:
        assert part in done.err
    pitch_rad = load_body_model("me.body.yaml").camera_pose.pitch_rad
    assert pitch_rad == pytest.approx(0.0 if found is None else found.pitch_rad)
    assert rolls == [0.0 if found is None else found.roll_rad]
    given = ("--camera-pitch-deg", 3, "--force")
    assert "found" not in cardbox("track", film, *words, *given).err
    pitch_rad = load_body_model("me.body.yaml").camera_pose.pitch_rad
    assert pitch_rad == pytest.approx(np.radians(3.0))
