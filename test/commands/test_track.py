"""'cardbox track' of a recording: bags and films, error messages, nothing lost."""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.commands import scene as scene_module
from cardbox_tracker.detectors import detector as detector_module
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.detectors.model_files import ModelFiles
from cardbox_tracker.measuring.people_camera import FORWARD, LEVELS, Distances
from cardbox_tracker.measuring.scene import SceneCamera, Value, load_scene, save_scene
from cardbox_tracker.measuring.scene_camera import FoundCamera
from cardbox_tracker.person.model import BodyModel, body_from_proportions
from cardbox_tracker.person.model_file import load_body_model
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.proportions import MARKED_HEIGHTS, stature_of
from cardbox_tracker.person.sizes import SIZE_INDEX
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.measured_scene import Watched
from cardbox_tracker.recordings.silhouettes import SilhouetteSource, TimeSpan
from cardbox_tracker.recordings.truth import beside_shoulders

FPS = 4.0
GIVEN = ("--background", "0:3.9", "--start", 16, "--stature", 1.72)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--start", "-1"), "--start: expected seconds from the start of the recording, got '-1'"),
        (("--start", "soon"), "got 'soon'"),
        (("--start", "99"), "no image lies after --start 99 s"),
        (
            ("--background", "90:99"),
            "0 images lie in the background span 90:99 s of a",
        ),
        (("--preset", "fast"), "--preset: expected one of paper, default, got 'fast'"),
        (("--effort", "5"), "--effort is 5; expected 0.25 to 4"),
        (("--settings", "FOLDER/missing.yaml"), "missing.yaml: No such file or directory; exp"),
        (("--settings", "FOLDER/list.yaml"), "list.yaml: expected names and values"),
        (("--settings", "FOLDER/person.yaml"), "person.yaml: 'format' is no setting; "),
        (("--seed", "-3"), "--seed: expected a whole number of 0 or more, got '-3'"),
        (("--model", "FOLDER/missing.yaml"), "missing.yaml: No such file or directory; exp"),
        (("--model", "FOLDER/session"), "directory"),
        (("--model", "FOLDER/text.txt"), "text.txt"),
        (("--model", "FOLDER/binary.yaml"), "binary.yaml"),
        (("--model", "FOLDER/list.yaml"), "list.yaml"),
        (("--model", "FOLDER/lacking.yaml"), "head_width"),
        (("--model", "FOLDER/negative.yaml"), "head_width is -0.17 m; expected 0.08 to 0.35 m"),
        (("--model", "FOLDER/centimetres.yaml"), "(is it given in centimetres?)"),
        (("--csv", "FOLDER/missing/out.csv"), "out.csv: No such file or directory; choose"),
        (("--csv", "FOLDER/text.txt/out.csv"), "out.csv: Not a directory; choose a folder"),
        (("--csv", "FOLDER/empty folder"), "it is a folder; give the name of a file"),
        (("--video", "FOLDER/out.gif"), "its name must end in .mp4"),
        (("--video", "FOLDER/missing/out.mp4"), "out.mp4: No such file or directory"),
        (("--bag", "FOLDER/session"), "session: it is read, as"),
        (("--csv", "FOLDER/session/session.mcap"), "session.mcap: it is read, as"),
        (("--csv", "FOLDER/person.yaml"), "person.yaml: it is read, as"),
        (("--csv", "FOLDER/text.txt"), "text.txt exists; choose another name, or give --force"),
        (("--bag", "FOLDER/out.csv"), "out.csv is given for two outputs"),
        (("--bag", "FOLDER/missing/out"), "No such file or directory; choose a folder"),
        (("--bag", "FOLDER/text.txt/out"), "Not a directory"),
    ],
)
def test_mistakes_of_track(
    files: Path, words: tuple[str, str], expected: str, cardbox: Callable
) -> None:
    before = sorted(path.name for path in files.iterdir())
    option, value = words
    options = {
        "--background": "0:3.9",
        "--model": f"{files / 'person.yaml'}",
        "--start": "15.6",
        "--csv": f"{files / 'out.csv'}",
    } | {option: value.replace("FOLDER", str(files))}
    done = cardbox("track", files / "session", *(f"{n}={text}" for n, text in options.items()))
    done.assert_refused("track", expected)
    assert sorted(path.name for path in files.iterdir()) == before


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--within=2.5",), "--within needs the topic of depth images: give --depth TOPIC"),
        (("--within=2.5", "--depth=stereo"), "--within needs the topic of depth images"),
        ((), "session needs --background T0:T1 or --within M or --silhouettes"),
        (("--within=nan", "--depth=/d", "--cameras", "camera"), "the limit of the depth is nan m"),
        (("--within=2.5", "--depth=/d", "--cameras", "camera"), "has no topic /d; it has"),
    ],
)
def test_a_background_or_depth_tells_the_person_from_the_scene(
    files: Path, words: tuple[str, ...], expected: str, cardbox: Callable
) -> None:
    given = (f"--model={files / 'person.yaml'}", "--start=15.6", f"--csv={files / 'out.csv'}")
    cardbox("track", files / "session", *given, *words).assert_refused("track", expected)
    assert not (files / "out.csv").exists()


@pytest.mark.parametrize("option", ["--detector", "--settings", "--model"])
def test_a_file_that_is_read_is_not_replaced(
    files: Path, tmp_path: Path, option: str, cardbox: Callable
) -> None:
    table = tmp_path / "read.csv"
    text = "lost_frames: 5\n" if option == "--settings" else (files / "person.yaml").read_text()
    table.write_text(text)
    given = ("--background=0:3.9", f"--model={files / 'person.yaml'}", "--start=15.6", "--force")
    done = cardbox("track", files / "session", *given, f"{option}={table}", f"--csv={table}")
    done.assert_refused("track", "read.csv: it is read, as")
    assert table.read_text() == text


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("missing", "there is no recording"),
        ("empty folder", "not a rosbag2 recording (it has no metadata.yaml)"),
        ("text.txt", "cannot read the recording"),
        ("person.yaml", "cannot read the recording"),
        ("no images", "has 0 image topics; expected one"),
        ("no camera_info", "has 0 CameraInfo topics; expected one"),
        ("cut.mcap", "cut.mcap"),
    ],
)
@pytest.mark.parametrize("command", ["initialize", "track"])
def test_recordings_that_are_none(
    files: Path, command: str, name: str, expected: str, spans: dict[str, str], cardbox: Callable
) -> None:
    output = files / "output"
    if command == "initialize":
        options = spans | {"--distance": "2", "--output": f"{output}"}
    else:
        options = {
            "--background": "0:3.9",
            "--model": f"{files / 'person.yaml'}",
            "--start": "1",
            "--csv": f"{output}",
        }
    done = cardbox(command, files / name, *(f"{n}={text}" for n, text in options.items()))
    done.assert_refused(command, expected, name)
    assert not output.exists()


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
    files: Path, film: Path, fov: str, tmp_path: Path, off_m: Callable, cardbox: Callable[..., Any]
) -> None:
    more = ("--video", "out.mp4", "--json", "out.json")
    done = cardbox("track", film, "--fov", fov, *GIVEN, *more)
    assert done.code == 0, done.err
    written = ["me.body.yaml", "me.csv", "me.scene.yaml", "out.json", "out.mp4"]
    assert all(f"wrote {name}" in done.out for name in written)
    assert sorted(path.name for path in tmp_path.iterdir()) == written
    with (tmp_path / "me.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    # Nothing tells the pitch of this camera.
    assert "a level camera is assumed" in done.err
    assert {row["vertical_state"] for row in rows} == {"uncertain"}
    told = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
    assert told["images"] == told["tracked"] == len(rows)
    assert told["uncertain"] == sum(row["state"] == "uncertain" for row in rows)
    assert told["used"] == {"colours": len(rows) - 1}
    assert "downward pitch 0 +- 16 degrees (usual)" in told["assumed"]
    assert [float(row["time_s"]) for row in rows[:3]] == pytest.approx([16.0, 16.25, 16.5])
    apart_m = beside_shoulders(off_m(tmp_path / "me.csv", files / "session"))
    errors_m = np.linalg.norm(apart_m, axis=2)
    # Each row has a posture; how far away and how large the person is, is guessed.
    assert len(errors_m) == len(rows) > 30
    assert errors_m.mean() < 0.1 and errors_m.mean(axis=1).max() < 0.17
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


def test_the_distance_of_nobody_is_not_found(
    film: Path, fov: str, cardbox: Callable[..., Any]
) -> None:
    words = ("--stature", 1.75, "--background", "0:2", "--start", 2, "--end", 3.5)
    done = cardbox("track", film, "--fov", fov, *words)
    assert done.code == 0, done.err
    assert "tracked 0 of" in done.out
    assert "m (usual: nobody shows it)" in done.out
    assert "m (found)" not in done.out


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
        ((), "me.mp4 needs --fov DEG or --calibration FILE, and --stature M or --model FILE ("),
        (("--fov", 60, "--stature", 172), "stature is 172 m; expected 1.1 to 2.2 m"),
        (("--fov", 60, "--stature", 1.7, "--distance", 90), "distance_m is 90 m"),
        (("--fov", 60, "--stature", 1.7, "--start", 99), "no image lies after --start 99 s"),
        (
            ("--fov", 60, "--model", "FILES/person.yaml", "--start", 1, "--distance", 2),
            "--distance has no effect with --model",
        ),
        (("--stature", 1.7, "--fov", 60, "--fps", 0), "--fps: expected a number above 0 to 1000"),
        (("--stature", 1.7, "--fov", 60, "--camera-roll-deg", 190), "expected a number from -180"),
        (("--stature", 1.7, "--fov", 60, "--camera-pitch-deg", 95), "camera_pitch_rad is"),
        (("--stature", 1.7, "--fov", 60, "--depth", "/d", "--cameras", "a"), "a rosbag2, which"),
        (("--stature", 1.7, "--fov", 60, "--cameras", "a"), "omit --cameras"),
        (("--stature", 1.7, "--fov", 60, "--blur"), "--blur has no effect without pictures"),
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


def test_somebody_is_measured_in_a_film(
    film: Path, fov: str, spans: dict[str, str], cardbox: Callable[..., Any]
) -> None:
    words = [word for option in spans.items() for word in option]
    given = ("--fov", fov, "--distance", 2, "--output", "me.yaml")
    done = cardbox("initialize", film, *words, *given)
    assert done.code == 0, done.err
    assert load_body_model("me.yaml").size("upper_arm_length") == pytest.approx(0.27, rel=0.1)


@pytest.mark.parametrize(
    ("pitch_deg", "roll_deg", "sources", "expected"),
    [
        (
            12.0,
            14.0,
            ("people who stand or walk",),
            ("pitch 12 degrees down (standard deviation 5), found from people", "roll 14.0"),
        ),
        (-6.0, 0.0, ("the edges",), ("pitch 6 degrees up", "found from the edges", "it moves")),
        (10.0, 0.0, (), ("neither people nor edges", "that of most cameras")),
    ],
)
def test_the_cameras_pitch_is_found_from_the_recording(
    pitch_deg: float,
    roll_deg: float,
    sources: tuple[str, ...],
    expected: tuple[str, ...],
    film: Path,
    fov: str,
    quick_sight: None,
    monkeypatch: pytest.MonkeyPatch,
    cardbox: Callable[..., Any],
) -> None:
    """The detector, an optional library, is replaced by the silhouettes of the empty scene."""

    def found_in(*seen: Any) -> FoundCamera:
        pitch_of = pitch if seen[4] is None else Value(*seen[4])
        return found._replace(camera=tilt._replace(pitch_rad=pitch_of))

    monkeypatch.setattr(detector_module, "installed_models", lambda: ModelFiles(film, film))
    pitch, roll = (Value(float(np.radians(d)), 0.0873) for d in (pitch_deg, roll_deg))
    tilt = SceneCamera(Value(1.0, 0.01), pitch, roll)
    remarks = ("it moves",) if pitch_deg < 0.0 else ()
    far = Distances(np.zeros(1), np.full(1, 2.0 / 1.72), 0.1)
    found = FoundCamera(tilt, sources, remarks, (far,))
    monkeypatch.setattr("cardbox_tracker.commands.scene.scene_camera", found_in)

    def opened(bag: Any, detector: Any, camera: Any, points: Any) -> SilhouetteSource:
        rolls.append(bag.calibration().roll_rad)
        return SilhouetteSource(bag, TimeSpan(0.0, 3.9))

    rolls: list[float] = []
    monkeypatch.setattr("cardbox_tracker.recordings.recording.DetectorSilhouetteSource", opened)
    words = ("--fov", fov, "--stature", 1.72, "--start=16", "--end=17.5", "--detector=mediapipe")
    done = cardbox("track", film, *words)
    assert done.code == 0, done.err
    for part in expected:
        assert part in done.err
    pitch_rad = load_body_model("me.body.yaml").camera_pose.pitch_rad
    assert pitch_rad == pytest.approx(pitch.mean)
    # Images are turned back when the roll is known.
    assert rolls == [0.0, roll.mean] if roll.mean else [0.0]
    # What is given is used.
    cardbox("track", film, *words, "--camera-pitch-deg", 30, "--force")
    pitch_rad = load_body_model("me.body.yaml").camera_pose.pitch_rad
    assert pitch_rad == pytest.approx(np.radians(30))


@pytest.mark.usefixtures("quick_sight")
def test_a_film_with_its_own_scene_has_the_same_bytes(
    film: Path, cardbox: Callable[..., Any], tmp_path: Path
) -> None:
    common = ("track", film, "--background=0:3.9", "--start=16", "--end=17.5")
    a, b = tmp_path / "a.csv", tmp_path / "b.csv"
    done = cardbox(*common, "--fov=60", "--stature=1.72", f"--csv={a}")
    assert done.code == 0, done.err
    done = cardbox(*common, f"--scene={tmp_path / 'a.scene.yaml'}", f"--csv={b}")
    assert done.code == 0, done.err
    assert a.read_bytes() == b.read_bytes()
    assert (tmp_path / "a.scene.yaml").read_text() == (tmp_path / "b.scene.yaml").read_text()


@pytest.mark.usefixtures("quick_sight")
def test_a_film_with_the_scene_of_another_lens_has_no_sure_place(
    film: Path, cardbox: Callable[..., Any], tmp_path: Path
) -> None:
    common = ("track", film, "--background=0:3.9", "--start=16", "--end=17.5")
    done = cardbox(*common, "--fov=60", "--stature=1.72", f"--csv={tmp_path / 'a.csv'}")
    assert done.code == 0, done.err
    scene = load_scene(tmp_path / "a.scene.yaml")
    lens = scene.camera.fov_rad._replace(mean=math.radians(95.0))
    save_scene(replace(scene, camera=scene.camera._replace(fov_rad=lens)), tmp_path / "b.yaml")
    b = tmp_path / "b.csv"
    done = cardbox(*common, f"--scene={tmp_path / 'b.yaml'}", f"--csv={b}")
    assert done.code == 0, done.err
    assert re.search(r"somebody is 0\.[4-7]\d times as far away as in the scene", done.err)
    with b.open(encoding="utf-8") as file:
        assert {row["place_state"] for row in csv.DictReader(file)} == {"uncertain"}


@pytest.mark.parametrize("factor", [0.75, 1.0, 1.3])
def test_points_show_a_body_of_short_bones_nearer(factor: float) -> None:
    """Levels of somebody upright, and points in space, whatever the breadths of the body are."""
    camera = Camera(640, 480, 500.0, 500.0, 319.5, 239.5)
    body = body_from_proportions(1.7, 3.0, hip_height_m=-0.7)
    stature_m = stature_of(body_parts(body.sizes))
    points = {}
    heights = dict(zip(LEVELS, zip(MARKED_HEIGHTS, FORWARD, strict=True), strict=True))
    # Hips are marked higher without feet.
    heights |= {"hip": (MARKED_HEIGHTS[3] + 0.022, 0.0), "elbow": (MARKED_HEIGHTS[2] - 0.16, 0.0)}
    for name in ("nose", "ear", "shoulder", "elbow", "hip"):
        for side, beside in {"left": -0.1, "right": 0.1}.items():
            up, forward = heights[name]
            there = stature_m * np.array((beside, 0.9 - up, -forward)) + (0.0, 0.0, 3.0)
            known = name if name == "nose" else f"{side}_{name}"
            points[known] = (*camera.project(there).tolist(), 1.0, *there.tolist())
    sights = [(0.1 * number, ImagePoints.of(points)) for number in range(30)]
    bones = ("torso_height", "waist_height", "head_height", "neck_length", "shoulder_breadth")
    bones += ("shoulder_drop", "upper_arm_length", "forearm_length")
    sizes = body.sizes.copy()
    sizes[[SIZE_INDEX[name] for name in bones]] *= factor
    given = sights, body.with_values(sizes=sizes), camera
    assert list(scene_module._by_points(*given)) == pytest.approx([math.log(factor)] * 2, abs=0.05)
    assert list(scene_module._by_points([], *given[1:])) == []


@pytest.mark.parametrize(
    ("pitch_deg", "height_m", "fov_rad", "is_told"),
    [
        (3.0, 1.5, 1.0, False),
        (17.0, 1.5, 1.0, True),
        (3.0, 2.2, 1.0, True),
        (3.0, 1.5, 1.1, True),
    ],
)
def test_people_who_contradict_a_scene_are_told(
    monkeypatch: pytest.MonkeyPatch,
    pitch_deg: float,
    height_m: float,
    fov_rad: float,
    is_told: bool,
) -> None:
    def camera(deg: float, metres: float) -> SceneCamera:
        pitch = Value(math.radians(deg), math.radians(2.0))
        return SceneCamera(Value(1.0, 0.01), pitch, Value(0.0, 0.01), Value(metres, 0.1))

    found = FoundCamera(camera(pitch_deg, height_m))
    monkeypatch.setattr(scene_module, "scene_camera", lambda *_: found)
    watched = Watched((), (), [[]])
    given = camera(2.0, 1.6)._replace(fov_rad=Value(fov_rad, 0.01))
    told = scene_module._contradiction(
        watched, [BodyModel()], given, Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
    )
    assert bool(told) is is_told
    if is_told:
        assert "2 degrees down" in told and f"{height_m:.2f} m" in told and "leave --scene" in told
        assert "a field of view of 56 degrees, not" in told
