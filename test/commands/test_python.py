"""A film in one call from Python, as the documents show it, with a network that is a fake."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import cardbox_tracker
from cardbox_tracker.applications.demo.film import DemoFilm
from cardbox_tracker.applications.drawing.video import video_file
from cardbox_tracker.applications.simulation.person import person_frames
from cardbox_tracker.applications.simulation.renderer import Renderer
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.image_points import COCO_NAMES
from cardbox_tracker.detectors.own_network import OwnModel
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture

ROOT = Path(__file__).resolve().parents[2]
BODY = BodyModel.of(hip_height_m=-0.51)
CAMERA = Camera(width=320, height=240, fx=277.1, fy=277.1, cx=159.5, cy=119.5)
GIVEN = {"fov_deg": 60, "stature_m": 1.75, "camera_pitch_deg": 0}
JOINTS = [f"{side}_{name}" for side in ("left", "right") for name in ("shoulder", "elbow", "wrist")]


def code_in(page: str, number: int) -> str:
    return re.findall(r"```python\n(.*?)```", (ROOT / "docs" / page).read_text(), re.DOTALL)[number]


def coco_points() -> np.ndarray:
    """The points (1, 17, 3) that a network of COCO finds in each image of the film."""
    points = np.zeros((1, 17, 3), np.float32)
    px = CAMERA.project(CAMERA.reference_to_optical(person_frames(BODY, FRONT).keypoints_m))
    points[0, [5, 7, 9, 6, 8, 10]] = np.column_stack([px, np.ones(6)])
    points[0, [11, 12]] = points[0, [5, 6]] + (0.0, 70.0, 0.0)
    points[0, 0] = *points[0, [5, 6], :2].mean(axis=0) - (0.0, 30.0), 1.0
    return points


FRONT = reference_posture("front")


class FakeYolo:
    """Has the interface of Ultralytics that the example uses."""

    def __init__(self, network: str) -> None:
        assert network.endswith("-pose.pt")

    def __call__(self, image: np.ndarray, verbose: bool) -> list[Any]:
        data = SimpleNamespace(cpu=lambda: SimpleNamespace(numpy=coco_points))
        return [SimpleNamespace(keypoints=SimpleNamespace(data=data))]


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A film of somebody who stands, in a folder with the example's detector."""
    folder = tmp_path_factory.mktemp("film")
    renderer = Renderer(CAMERA, np.random.default_rng(0))
    with video_file(folder / "film.mp4", 10.0) as add:
        for _ in range(6):
            add(np.repeat(renderer.image(BODY, FRONT)[0][..., None], 3, axis=2))
    (folder / "my_detector.py").write_text(code_in("extending.md", 0))
    return folder / "film.mp4"


@pytest.fixture
def network(film: Path, quick_sight: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Be in the folder of the film, with the package that the example needs."""
    monkeypatch.setitem(sys.modules, "ultralytics", SimpleNamespace(YOLO=FakeYolo))
    monkeypatch.chdir(film.parent)
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield
    sys.modules.pop("my_detector", None)


def test_command_and_python_track_alike_with_a_detector_of_ones_own(
    network: None, film: Path, tmp_path: Path, cardbox: Callable
) -> None:
    words = "--fov=60", "--stature=1.75", "--camera-pitch-deg=0"
    name = "--detector-class", "my_detector:MyDetector"
    done = cardbox("track", film, *words, *name, "--csv", tmp_path / "a.csv")
    assert done.code == 0, done.err
    detector = sys.modules["my_detector"].MyDetector()
    given = {"detector": detector, **GIVEN}
    result = cardbox_tracker.track(film, csv=tmp_path / "b.csv", **given)
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    assert not done.err.startswith("Traceback")
    assert len(result.state) == 6
    assert result.scene is not None and result.body is not None
    assert result.scene.numbers()["fov_deg"]["mean"] == pytest.approx(60.0, abs=0.5)
    assert result.scene.camera.roll_rad.origin == "usual"
    assert (result.path, result.of(["left_hand_x"]).shape) == (film, (6, 1))
    assert_same(result, cardbox_tracker.read_result(tmp_path / "a.csv"))
    before = sorted(tmp_path.iterdir())
    alone = cardbox_tracker.track(cardbox_tracker.Request(film, **given))
    assert_same(alone, result)
    assert sorted(tmp_path.iterdir()) == before


def assert_same(one: cardbox_tracker.Result, other: cardbox_tracker.Result) -> None:
    """Fail unless both have the same values, bodies and scene."""
    for name in ("numbers", "texts"):
        ours, theirs = getattr(one, name), getattr(other, name)
        assert list(ours) == list(theirs)
        for column, values in ours.items():
            np.testing.assert_array_equal(values, theirs[column], column)
    np.testing.assert_array_equal(one.stamp_ns, other.stamp_ns)
    np.testing.assert_array_equal(one.time_s, other.time_s)
    assert (one.state, one.bodies, one.scene) == (other.state, other.bodies, other.scene)
    assert one.has_others == other.has_others


def test_the_loop_over_images_of_python_tracks_a_real_person(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    demo, found = DemoFilm.load(), list[Any]()
    (tmp_path / "film.mp4").symlink_to(demo.path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Detector, "installed", lambda: demo.detector)
    code = code_in("python.md", 1)
    for shown, given in (("1.75", demo.stature_m), ("60", demo.fov_deg)):
        code = code.replace(shown, str(given))
    exec(code, {"print": found.append})
    keypoints_m = np.array(found, float)
    assert keypoints_m.shape == demo.true_m.shape and np.isfinite(keypoints_m).all()
    assert np.nanmean(demo.errors_m(keypoints_m)) < 0.08


def test_the_examples_of_readme_and_python_run(
    network: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = Detector(OwnModel.of(Standing, "it"))
    monkeypatch.setattr(Detector, "installed", classmethod(lambda cls: own))
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=dict))
    names: dict[str, Any] = {}
    exec(code_in("python.md", 0), names)
    result, frame = names["result"], names["table"]
    # A head line, a line for each image, and four lines before them.
    trc = Path("film.trc").read_text()
    assert len(trc.splitlines()) == 6 + 6
    assert frame["stamp_ns"].tolist() == result.stamp_ns.tolist()
    assert list(frame)[:2] == ["state", "torso_y"] and "left_hand_state" in frame
    with pytest.raises(CardboxError, match=r"no format has the ending of x\.xlsx; those are \.trc"):
        result.save("x.xlsx")
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(CardboxError, match="pip install 'cardbox_tracker"):
        result.to_pandas()
    Path("film.trc").unlink()
    (code,) = re.findall(
        r"(?m)^    from cardbox_tracker.*\n(?:    .*\n)+", (ROOT / "README.md").read_text()
    )
    exec("\n".join(line.strip() for line in code.splitlines()))
    assert Path("film.trc").read_text() == trc


class Standing:
    """Finds the person of the film."""

    def detect(self, image: np.ndarray) -> list[dict[str, Any]]:
        found = dict(zip(COCO_NAMES, coco_points()[0], strict=True))
        return [found]


class TwoStanding:
    """Finds two people side by side."""

    def detect(self, image: np.ndarray) -> list[dict[str, Any]]:
        (left,) = Standing().detect(image)
        return [left, {name: np.add(point, (90.0, 0.0, 0.0)) for name, point in left.items()}]


def test_each_of_several_people_has_files(network: None, film: Path, tmp_path: Path) -> None:
    files = {"csv": tmp_path / "a.csv", "json": tmp_path / "a.json", "plot": tmp_path / "a.png"}
    given = {"detector": TwoStanding(), "people": 2, **GIVEN}
    first = cardbox_tracker.track(film, export="trc", **files, **given)
    for name in ("a.png", "a.person_2.png", "a.trc", "a.person_2.trc"):
        assert (tmp_path / name).stat().st_size > 1000
    told = json.loads(files["json"].read_text())
    assert [one["tracked"] for one in told["people"].values()] == [6, 6]
    assert list(first.people) == [1, 2]
    for number, one in first.people.items():
        assert_same(one, cardbox_tracker.read_result(files["csv"], number))
    assert_same(first, first.people[1])
    second = cardbox_tracker.track(film, person=2, **given)
    assert_same(second, first.people[2])


def test_pandas_has_the_columns_of_the_table(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    from cardbox_tracker.recordings.result_table import result_table
    from cardbox_tracker.recordings.silhouettes import RecordedFrame
    from cardbox_tracker.tracking.estimate import Estimate

    grey = np.zeros((2, 2), np.uint8)
    seen = Estimate("tracking", np.zeros(12), np.ones(12), np.ones((6, 3)), 10, 0.9)
    with result_table(tmp_path / "a.csv", has_points=True) as add:
        for number, estimate in enumerate((seen, Estimate("lost"))):
            add(RecordedFrame(number, number / 10, grey, grey), estimate)
    result = cardbox_tracker.read_result(tmp_path / "a.csv")
    found, written = result.to_pandas(), pandas.read_csv(tmp_path / "a.csv")
    assert list(found) == [name for name in written if name != "stamp"]
    numbers = ["stamp_ns", "time_s", *result.numbers]
    np.testing.assert_array_equal(found[numbers], written[numbers])


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"fov": 60}, "no keyword fov; did you mean 'fov_deg'"),
        ({"fov_deg": "wide"}, "argument --fov: expected degrees, .*, got 'wide'"),
        ({"seed": 1.5}, "argument --seed: expected a whole number of 0 or more, got 1.5"),
        ({"hands": "no"}, "argument --hands: expected True or False, got 'no'"),
        ({"preset": "fast"}, "argument --preset: expected one of paper, default, got 'fast'"),
        ({"people": 0}, "argument --people: expected auto or a number from 1 to 6, got 0"),
        ({"fov_deg": 60}, "needs --stature M or --model FILE"),
        ({"output": "x"}, "track has no keyword output"),
        ({"detector": "nothing", **GIVEN}, "--detector is 'nothing'; expected mediapipe, or"),
        ({"detector": 7, **GIVEN}, r"the detector int has no function detect\(image\)"),
        (
            {"detector": 7, "detector_class": "a:B", **GIVEN},
            "--detector and --detector-class both name",
        ),
        ({"detector_class": "json:nothing", **GIVEN}, "imported from json:nothing: Attrib"),
        ({"detector_class": "nothing", **GIVEN}, "imported from nothing: ModuleNotFound"),
        ({"stature_m": (1.75, 1.6), "fov_deg": 60}, "--stature has several values"),
        (
            {"export": "trc", **GIVEN},
            "export writes beside the table: give csv, or save the result",
        ),
        ({"background": (3, 1)}, r"argument --background: .*got \(3, 1\)"),
        (
            {"export": 0.0, **GIVEN},
            r"argument --export: a value is .* another type, .* got 0\.0",
        ),
        ({"csv": "a\0.csv", **GIVEN}, r"cannot write 'a\\x00.csv': embedded null byte"),
    ],
)
def test_mistakes(network: None, film: Path, options: dict[str, Any], expected: str) -> None:
    with pytest.raises(CardboxError, match=expected):
        cardbox_tracker.track(film, **options)


@pytest.mark.parametrize("recording", [None, 7, (), ("a", 7), str])
def test_what_is_no_path_is_no_recording(recording: Any) -> None:
    with pytest.raises(CardboxError, match=r"track has no recording, but .*; give a path"):
        cardbox_tracker.track(recording)


def test_a_folder_of_recordings_is_none(network: None, film: Path) -> None:
    with pytest.raises(CardboxError, match="is no recording; track its recordings one by one"):
        cardbox_tracker.track(film.parent, **GIVEN)


def test_a_file_among_data_runs_no_code(
    network: None, film: Path, tmp_path: Path, cardbox: Callable
) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "film.mp4").write_bytes(film.read_bytes())
    options = tmp_path / "data" / "film.options"
    options.write_text("--detector-class my_detector:MyDetector")
    words = "track", tmp_path / "data", "--output", tmp_path / "out", "--fov=60", "--stature=1.75"
    done = cardbox(*words)
    assert done.code == 1
    assert "film.options: --detector-class would run code" in done.err
    assert "my_detector" not in sys.modules


def test_one_detector_only(film: Path, cardbox: Callable) -> None:
    done = cardbox("track", film, "--detector=mediapipe", "--detector-class=a:B")
    assert "--detector and --detector-class both name a detector" in done.err
