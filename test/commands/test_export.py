"""'cardbox export': each format from a table and a bag, and mistakes in words."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.applications.exporting.formats import FORMATS, read_result
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.files import body_of_person
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.legs import legs_m
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.person.skeleton import KeypointState
from cardbox_tracker.recordings.result_bag import result_bag
from cardbox_tracker.recordings.result_table import result_table
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.tracking.estimate import Estimate, Hand, Legs
from cardbox_tracker.tracking.tracker import Tracker

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A table, a bag and the model of a person of whom two of four images are sure."""
    folder = tmp_path_factory.mktemp("results")
    body = BodyModel.of(hip_height_m=-0.51)
    tracker = Tracker(body, Camera(64, 48, 66.0, 66.0, 31.5, 23.5))
    grey, posture = np.zeros((48, 64), np.uint8), np.full(12, 0.2)
    points = tracker.camera.reference_to_optical(pose(body.rigid, posture).keypoints_m)
    sure, unsure = (
        Estimate(state, posture, np.full(12, 0.1), points, 10, 0.9)
        for state in ("tracking", "uncertain")
    )
    with (
        result_bag(folder / "person", "camera") as bag,
        result_table(folder / "person.csv", has_points=False) as table,
    ):
        for i, estimate in enumerate((sure, unsure, Estimate("lost"), sure)):
            frame = RecordedFrame(i * 10**8, i / 10, grey, grey)
            bag(frame, estimate, tracker)
            table(frame, estimate)
    save_body_model(body, folder / "person.yaml")
    save_body_model(body.with_values(sizes=body.sizes * 1.1), folder / "other.yaml")
    return folder


def words_and_numbers(path: Path) -> tuple[list[str], list[float]]:
    """Return a file's texts and its decimal fractions, which tables round."""
    words = re.split(r"[\s,]", path.read_text(encoding="utf-8"))
    is_fraction = [re.fullmatch(r"-?\d+\.\d+", word) is not None for word in words]
    numbers = [float(word) for word, found in zip(words, is_fraction, strict=True) if found]
    return [word for word, found in zip(words, is_fraction, strict=True) if not found], numbers


@pytest.mark.filterwarnings("ignore:builtin type:DeprecationWarning")
@pytest.mark.parametrize("name", FORMATS)
def test_a_table_and_a_bag_give_the_same_file(
    name: str, results: Path, tmp_path: Path, cardbox: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    if name == "c3d":
        pytest.importorskip("ezc3d", reason="ezc3d is not installed")
    monkeypatch.chdir(tmp_path)
    done = cardbox(
        "export", results / "person.csv", "--to", name, "--model", results / "person.yaml"
    )
    assert done.code == 0, done.err
    made = tmp_path / f"person{FORMATS[name].suffix}"
    assert done.out.splitlines() == [
        "exported 3 of 4 images, 1 of them uncertain; 1 without a posture are gaps",
        f"wrote {made.name}",
    ]
    (tmp_path / "bag").mkdir()
    other = tmp_path / "bag" / made.name
    assert cardbox("export", results / "person", "--to", name, "--output", other).code == 0
    if name != "c3d":
        (words, numbers), (other_words, other_numbers) = map(words_and_numbers, (made, other))
        assert words == other_words
        assert numbers == pytest.approx(other_numbers, abs=1e-3)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bag", made.name]


@pytest.mark.filterwarnings("ignore:builtin type:DeprecationWarning")
@pytest.mark.parametrize("name", FORMATS)
def test_each_format_takes_a_low_pass_and_a_filled_gap(
    name: str, results: Path, tmp_path: Path, cardbox: Callable
) -> None:
    if name == "c3d":
        pytest.importorskip("ezc3d", reason="ezc3d is not installed")
    words = ("export", results / "person.csv", "--to", name, "--cutoff", "4")
    words += ("--model", results / "person.yaml", "--output")
    done = cardbox(*words, tmp_path / "a")
    assert done.code == 0, done.err
    assert done.out.startswith("exported 4 of 4 images, 1 of them uncertain; 0 without")
    assert "1 of them were gaps that are filled" in done.out
    done = cardbox(*words, tmp_path / "b", "--fill", "0.19")
    assert done.out.startswith("exported 3 of 4 images") and "filled" not in done.out
    done = cardbox(*words[:4], "--cutoff", "5", "--output", tmp_path / "c")
    done.assert_refused("export", "the cut-off is 5 Hz, expected 0.01 to 4.5 Hz")


@pytest.fixture(scope="module")
def whole_body(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Tables and a bag as ``track`` writes them of two people with legs and hands."""
    folder = tmp_path_factory.mktemp("whole")
    body = BodyModel.of(hip_height_m=-0.51, camera_pitch_rad=0.3, camera_roll_rad=0.2)
    tracker = Tracker(body, Camera(64, 48, 66.0, 66.0, 31.5, 23.5))
    grey, rng = np.zeros((48, 64), np.uint8), np.random.default_rng(0)
    has = dict.fromkeys(("has_points", "has_people", "has_hands"), True)
    with (
        result_bag(folder / "all_bag", "camera") as bag,
        result_table(folder / "all.csv", **has) as table,
        result_table(folder / "flat.parquet", **has) as flat,
    ):
        for i in range(4):
            posture, angles = rng.uniform(-0.2, 0.4, 12), rng.uniform(0, 1, 8)
            posed = pose(body.rigid, posture[None])
            legs_there = legs_m(body, posed.hip, posture[None, 3], angles[None])[0]
            points, legs_there = map(
                tracker.camera.reference_to_optical, (posed.keypoints_m[0], legs_there)
            )
            hand = Hand(1.0, np.array([0.0, 0.0, -1.0]), np.full(3, 0.1), np.full(3, 0.2))
            states = (KeypointState.TRACKED,) * 5 + (KeypointState.HIDDEN,)
            legs = Legs(angles, np.full(8, 0.1), legs_there, np.full(6, 0.07), states)
            for person in (1, 2):
                estimate = Estimate(
                    *("tracking", posture, np.full(12, 0.1), points, 10, 0.9),
                    person=person,
                    hands=(hand, None),
                    legs=legs,
                )
                frame = RecordedFrame(1_700_000_000 * 10**9 + i * 10**8, i / 10, grey, grey)
                bag(frame, estimate, tracker)
                for add in (table, flat):
                    add(frame, estimate.as_camera_stands(0.2))
    for stem in ("all", "flat"):
        for number in (1, 2):
            save_body_model(body, body_of_person(folder / f"{stem}.body.yaml", number))
    return folder


@pytest.mark.filterwarnings("ignore:builtin type:DeprecationWarning")
@pytest.mark.parametrize("person", ["1", "2"])
@pytest.mark.parametrize("name", ["all.csv", "flat.parquet", "all_bag"])
def test_what_track_writes_is_exported_to_every_format(
    name: str, person: str, whole_body: Path, tmp_path: Path, cardbox: Callable
) -> None:
    for to in FORMATS:
        if to == "c3d":
            pytest.importorskip("ezc3d", reason="ezc3d is not installed")
        words = ("--to", to, "--person", person, "--output", tmp_path / f"a.{to}")
        done = cardbox("export", whole_body / name, *words)
        assert done.code == 0, done.err
        assert "exported 4 of 4 images" in done.out and "level" not in done.out
    lines = (tmp_path / "a.trc").read_text().split("\n")
    markers = lines[3].split("\t")[2::3]
    assert {"LKnee", "RAnkle", "LPalm"} <= set(markers) or name == "all_bag"
    right_ankle = lines[6].split("\t")[2 + 3 * markers.index("RAnkle") :][:3]
    assert all(right_ankle) == (name == "all_bag")  # it is hidden, which a bag does not say


@pytest.mark.parametrize("name", ["all.csv", "all_bag"])
def test_which_of_several_people_is_used_is_told(
    name: str, whole_body: Path, tmp_path: Path, cardbox: Callable
) -> None:
    words = ("export", whole_body / name, "--to", "trc", "--output")
    assert "person 1 is used; --person K gives another" in cardbox(*words, tmp_path / "a.trc").err
    assert not cardbox(*words, tmp_path / "b.trc", "--person", "1").err


@pytest.mark.parametrize("name", ["all.csv", "flat.parquet", "all_bag"])
def test_all_people_in_one_call(
    name: str, whole_body: Path, tmp_path: Path, cardbox: Callable
) -> None:
    words = ("export", whole_body / name, "--to", "trc", "--output")
    done = cardbox(*words, tmp_path / "all_{n}.trc")
    assert done.code == 0 and not done.err
    each = [tmp_path / f"all_{number}.trc" for number in (1, 2)]
    assert sorted(tmp_path.iterdir()) == each
    for number, path in enumerate(each, 1):
        alone = tmp_path / f"alone{number}" / path.name
        alone.parent.mkdir()
        assert cardbox(*words, alone, "--person", str(number)).code == 0
        assert path.read_bytes() == alone.read_bytes()
    cardbox(*words, tmp_path / "all_{n}.trc").assert_refused("export", "all_1.trc exists")
    assert cardbox(*words, tmp_path / "b_{n}.trc", "--person", "2").code == 0
    assert (tmp_path / "b_2.trc").is_file() and not (tmp_path / "b_1.trc").exists()
    result = read_result(whole_body / name)
    assert [*result.people] == [1, 2] and not read_result(whole_body / name, person=2).people
    result.save(tmp_path / "c_{n}.trc")
    rest = [path.read_text().split("\n")[3:] for path in (each[1], tmp_path / "c_2.trc")]
    assert rest[0] == rest[1]


def test_who_is_never_seen_has_no_file_among_all(
    whole_body: Path, tmp_path: Path, cardbox: Callable
) -> None:
    lines = (whole_body / "all.csv").read_text().splitlines()
    names = lines[0].split(",")
    rows = [line.split(",") for line in lines[1:]]
    gone = [
        [*row[:1], "no_person", *row[2:]] if row[names.index("person")] == "2" else row
        for row in rows
    ]
    table = tmp_path / "one.csv"
    table.write_text("\n".join([lines[0], *map(",".join, gone)]) + "\n")
    done = cardbox(
        "export", table, "--to", "isb", "--output", tmp_path / "{n}.csv", "--cutoff", "4"
    )
    assert done.code == 0, done.err
    assert "person 2 is in no image, and has no file" in done.out
    assert (tmp_path / "1.csv").is_file() and not (tmp_path / "2.csv").exists()


def test_damaged_results_are_refused_by_all_that_read_them(
    whole_body: Path, tmp_path: Path, cardbox: Callable
) -> None:
    lines = (whole_body / "all.csv").read_text().splitlines()
    table = tmp_path / "back.csv"
    table.write_text("\n".join([lines[0], *lines[:0:-1]]))
    export = ("--to", "trc", "--output", tmp_path / "a.trc")
    for command, *rest in (("export", *export), ("reba",)):
        cardbox(command, table, *rest).assert_refused(command, "back.csv, line 5: the stamp 17")
    tracker = Tracker(BodyModel(), Camera(64, 48, 66.0, 66.0, 31.5, 23.5))
    grey, posture = np.zeros((48, 64), np.uint8), np.zeros(12)
    estimate = Estimate("tracking", posture, np.full(12, -0.1), np.zeros((6, 3)), 1, 0.9)
    with result_bag(tmp_path / "bag", "camera") as add:
        add(RecordedFrame(10**9, 0.0, grey, grey), estimate, tracker)
    robot = ("--robot", ROOT / "config" / "example_arm.urdf", "--csv", tmp_path / "r.csv")
    view = ("--save", tmp_path / "a.rrd")
    for command, *rest in (("export", *export), ("retarget", *robot), ("view", *view)):
        done = cardbox(command, tmp_path / "bag", *rest)
        done.assert_refused(command, "image 1 of", "torso_y_stddev_m is '-0.1'")


def test_without_a_model_the_camera_is_taken_as_level(
    results: Path, tmp_path: Path, cardbox: Callable
) -> None:
    done = cardbox("export", results / "person.csv", "--to", "trc", "--output", tmp_path / "a.trc")
    assert "the camera is taken as level, and the floor is not known; --model" in done.out
    done = cardbox("export", results / "person.csv", "--to", "isb", "--output", tmp_path / "a.csv")
    assert "level" not in done.out


def test_the_body_beside_the_table_is_found(
    results: Path, tmp_path: Path, cardbox: Callable
) -> None:
    """'cardbox track --stature' writes it there, and nobody has to name it."""
    for name in ("person.csv", "person.yaml"):
        shutil.copy(results / name, tmp_path / name.replace(".yaml", ".body.yaml"))
    made, named = tmp_path / "made.bvh", tmp_path / "named.bvh"
    words = ("export", tmp_path / "person.csv", "--to", "bvh", "--output")
    done = cardbox(*words, made)
    assert done.code == 0, done.err
    assert "took the body of " in done.out
    assert cardbox(*words, named, "--model", results / "person.yaml").code == 0
    assert made.read_bytes() == named.read_bytes()


def test_a_body_beside_the_table_that_is_anothers(
    results: Path, tmp_path: Path, cardbox: Callable
) -> None:
    shutil.copy(results / "person.csv", tmp_path)
    save_body_model(BodyModel.of(hip_height_m=0.2), tmp_path / "person.body.yaml")
    done = cardbox("export", tmp_path / "person.csv", "--to", "trc", "--output", tmp_path / "a")
    done.assert_refused("export", "not those of the body", "beside the table OUT.csv")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("person.csv", "--to", "bvh"), "BVH needs the bones of the person: give --model"),
        (("person.csv", "--to", "fbx"), "--to: expected one of trc, bvh"),
        (("person.csv",), "the following arguments are required: --to"),
        (("person.csv", "--to", "trc", "--model", "FOLDER/other.yaml"), "not those of the body"),
        (
            ("person.csv", "--to", "trc", "--model", "FOLDER/none.yaml"),
            "expected the body model",
        ),
        (("person.csv", "--to", "trc", "--fill", "1"), "--fill needs a low-pass; give --cutoff"),
        (("person.yaml", "--to", "trc"), "has no column"),
        (("person.csv", "--to", "sto", "--output", "FOLDER/a.mot"), "give --to mot, or a name"),
        (("nothing.csv", "--to", "trc"), "there are no results"),
    ],
)
def test_mistakes_of_export(
    words: tuple[str, ...], expected: str, results: Path, tmp_path: Path, cardbox: Callable
) -> None:
    rest = [word.replace("FOLDER", str(results)) for word in words[1:]]
    done = cardbox("export", results / words[0], "--output", tmp_path / "made", *rest)
    done.assert_refused("export", expected)
    assert list(tmp_path.iterdir()) == []


def test_files_are_not_replaced_without_force(
    results: Path, tmp_path: Path, cardbox: Callable
) -> None:
    output = tmp_path / "a.trc"
    output.write_text("mine")
    words = ("export", results / "person.csv", "--to", "trc", "--output", output)
    cardbox(*words).assert_refused("export", "exists; choose another name, or give --force")
    assert output.read_text() == "mine"
    assert cardbox(*words, "--force").code == 0
    assert output.read_text().startswith("PathFileType")


def test_images_alone_are_no_results(files: Path, tmp_path: Path, cardbox: Callable) -> None:
    done = cardbox("export", files / "session", "--to", "isb", "--output", tmp_path / "a.csv")
    done.assert_refused("export", "has no results of the tracker", "cardbox track BAG")
