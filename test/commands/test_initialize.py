"""'cardbox initialize', 'body' and 'calibrate-extrinsics': results and error messages."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.applications.simulation.session import SessionFormat, synthesize_session
from cardbox_tracker.person.model_file import load_body_model
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.bag_writer import BagWriter

SPAN = "expected T0:T1, seconds from the start of the recording"
SPANS = {
    "--background": "0:3.9",
    "--front": "6.8:8.2",
    "--side": "9.8:11.2",
    "--arms": "12.8:14.2",
}


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        *((("--" + name, "9:3"), f"--{name}: {SPAN}") for name in ("front", "side", "arms")),
        (("--background", "5"), f"--background: {SPAN}"),
        (("--depth", "/depth"), "--depth and --distance"),
        (("--distance", "far"), "--distance: expected a number, got 'far'"),
        (("--distance", "-2"), "distance_m is -2 m; expected 0.3 to 20 m"),
        (("--distance", "0"), "distance_m is 0 m; expected 0.3 to 20 m"),
        (("--distance", "nan"), "distance_m is nan; expected a finite number of m"),
        (("--distance", "200"), "distance_m is 200 m; expected 0.3 to 20 m"),
        (("--camera-pitch-deg", "95"), "camera_pitch_rad is 1.65806 rad; expected -1.4 to 1.4 rad"),
        (("--person", "left@3"), "--person chooses in each span: leave @T out"),
        (("--side-turn", "back"), "--side-turn: expected one of left, right, got 'back'"),
        (("--seed", "-1"), "--seed: expected a whole number of 0 or more, got '-1'"),
        (("--front", "90:99"), "no image lies in the front span 90:99 s of a recording of"),
        (("--front", "0:3"), "reference 'front': nobody is in the image"),
        (("--side", "6.6:8"), "'front' and 'side' are too alike"),
        (("--output", "FOLDER/text.txt"), "text.txt exists; choose another name, or give"),
        (("--output", "FOLDER/session/session.mcap"), "session.mcap: it is read, as"),
        (("--output", "FOLDER/missing/new.yaml"), "No such file or directory; choose a folder"),
        (("--output", "FOLDER/text.txt/new.yaml"), "Not a directory; choose a folder"),
        (("--output", "FOLDER/empty folder"), "it is a folder; give the name of a file"),
    ],
)
def test_mistakes_of_initialize(
    files: Path, words: tuple[str, str], expected: str, spans: dict[str, str], cardbox: Callable
) -> None:
    before = sorted(path.name for path in files.iterdir())
    option, value = words
    options = spans | {"--distance": "2", "--output": f"{files / 'new.yaml'}"}
    options[option] = value.replace("FOLDER", str(files))
    done = cardbox("initialize", files / "session", *(f"{n}={text}" for n, text in options.items()))
    done.assert_refused("initialize", expected)
    assert sorted(path.name for path in files.iterdir()) == before


def test_references_taken_for_each_other_are_named(
    files: Path, spans: dict[str, str], cardbox: Callable
) -> None:
    options = spans | {"--distance": "2", "--output": f"{files / 'new.yaml'}"}
    options["--front"], options["--side"] = spans["--side"], spans["--front"]
    done = cardbox("initialize", files / "session", *(f"{n}={text}" for n, text in options.items()))
    expected = "references 'front' and 'side' look swapped; capture both again"
    done.assert_refused("initialize", expected)
    assert not (files / "new.yaml").exists()


def test_a_missing_output_folder_is_told_before_the_recording_is_read(
    tmp_path: Path, spans: dict[str, str], cardbox: Callable
) -> None:
    unread = tmp_path / "unread.mcap"
    unread.touch()
    options = spans | {"--distance": "2", "--output": f"{tmp_path / 'none' / 'body.yaml'}"}
    done = cardbox("initialize", unread, *(f"{n}={text}" for n, text in options.items()))
    done.assert_refused("initialize", "No such file or directory; choose a folder")


def test_one_camera_needs_the_distance(
    tmp_path: Path, spans: dict[str, str], cardbox: Callable
) -> None:
    unread = tmp_path / "unread.mcap"
    unread.touch()
    options = spans | {"--output": f"{tmp_path / 'body.yaml'}", "--cameras": "left"}
    done = cardbox("initialize", unread, *(f"{n}={text}" for n, text in options.items()))
    expected = "unread.mcap needs --distance M or --depth TOPIC or two --cameras ("
    done.assert_refused("initialize", expected)
    del options["--background"]
    done = cardbox("initialize", unread, *(f"{n}={text}" for n, text in options.items()))
    done.assert_refused("initialize", "unread.mcap needs --background T0:T1 or", "and --distance M")


def test_somebody_is_tracked_without_reference_postures(
    cardbox: Callable[..., Any], files: Path, off_m: Callable, tmp_path: Path
) -> None:
    model, table = tmp_path / "me.yaml", tmp_path / "me.csv"
    done = cardbox("body", "--stature", 1.72, "--distance", 2, "--output", model)
    assert done.code == 0, done.err
    assert "not measured" in done.out
    assert load_body_model(model).source == "proportions"
    given = ("--background", "0:3.9", "--start", 15.6, "--csv", table)
    done = cardbox("track", files / "session", "--model", model, *given)
    assert done.code == 0, done.err
    assert "me.yaml: sizes from the proportions" in done.out
    errors_m = np.linalg.norm(off_m(table, files / "session"), axis=2)
    assert len(errors_m) == 35
    assert errors_m.mean() < 0.08 and errors_m.mean(axis=1).max() < 0.12


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--stature", 180), "stature is 180 m; expected 1.1 to 2.2 m (is it given in centimetres"),
        (("--stature", 1.8, "--distance", 0.1), "distance_m is 0.1 m"),
        (("--stature", 1.8, "--shoulder-breadth", 38), "shoulder_breadth is 38 m"),
    ],
)
def test_impossible_numbers_are_refused(
    cardbox: Callable[..., Any], tmp_path: Path, words: tuple[object, ...], text: str
) -> None:
    done = cardbox("body", *words, "--output", tmp_path / "me.yaml")
    done.assert_refused("body", text)
    assert not (tmp_path / "me.yaml").exists()


def test_a_model_that_exists_is_kept_without_force(
    cardbox: Callable[..., Any], tmp_path: Path
) -> None:
    model = tmp_path / "me.yaml"
    words = ("body", "--stature", 1.8, "--output", model)
    assert cardbox(*words).code == 0
    written = model.read_bytes()
    cardbox(*words[:2], 1.7, *words[3:]).assert_refused("body", "me.yaml exists")
    assert model.read_bytes() == written
    assert cardbox(*words, "--force").code == 0


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cameras") / "session"
    synthesize_session(folder, "bow", form=SessionFormat(5.0, cameras=2))
    return folder


def words(options: dict[str, str]) -> list[str]:
    return [f"{name}={value}" for name, value in options.items()]


def test_a_synthetic_recording_is_measured_and_tracked(
    session: Path, tmp_path: Path, off_m: Callable, cardbox: Callable
) -> None:
    model, table = tmp_path / "person.yaml", tmp_path / "angles.csv"
    cameras = ("--cameras", "cam0", "cam1", f"--extrinsics={session / 'extrinsics.yaml'}")
    done = cardbox("initialize", session, *cameras, *words(SPANS), f"--output={model}")
    assert done.code == 0, done.err
    # The second camera measured it.
    assert load_body_model(model).placement.distance_m == pytest.approx(2.0, abs=0.1)
    done = cardbox(
        *("track", session, *cameras, "--background=0:3.9", f"--model={model}"),
        *("--start=15.6", f"--csv={table}"),
    )
    assert done.code == 0, done.err
    assert "extrinsics" not in done.err
    errors_m = np.linalg.norm(off_m(table, session), axis=2)
    assert len(errors_m) > 30
    assert errors_m.mean() < 0.06


def test_depth_images_measure_how_far_away_the_person_is(
    session: Path, tmp_path: Path, cardbox: Callable
) -> None:
    recording, model = tmp_path / "ranged", tmp_path / "person.yaml"
    # Chest and face of somebody whose hips are 2 m away.
    depth = np.full((240, 320), 1900, np.uint16)
    with BagReader(session) as old, BagWriter(recording) as new:
        for message in old.messages():
            new.write_raw(message.topic, message.msgtype, message.raw, message.time_ns)
        for image in old.images(old.image_topic("cam0")):
            new.write_image("/cam0/depth", image.stamp_ns, "cam0", depth, "16UC1")
    given = ("--cameras", "cam0", "--depth=/cam0/depth", *words(SPANS), f"--output={model}")
    done = cardbox("initialize", recording, *given)
    assert done.code == 0, done.err
    assert load_body_model(model).placement.distance_m == pytest.approx(2.0, abs=0.06)
    empty = words(SPANS | {"--arms": "0:0.05"})
    done = cardbox("initialize", recording, *given[:3], *empty, f"--output={tmp_path / 'no.yaml'}")
    done.assert_refused("initialize", "reference 'arms'")


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        (("--cameras", "cam0"), "expected two to 4 different namespaces"),
        (("--cameras", "cam0", "cam0"), "the cameras are cam0, cam0; expected two to 4"),
        (("--motion=9:3",), "--motion: expected T0:T1"),
        (("--distance=0",), "distance_m is 0 m; expected 0.3 to 20 m"),
        (("--output=FOLDER/extrinsics.yaml",), "extrinsics.yaml: it is read, as"),
    ],
)
def test_mistakes_of_calibrate_extrinsics(
    session: Path, tmp_path: Path, cardbox: Callable, changed: tuple[str, ...], expected: str
) -> None:
    output = tmp_path / "extrinsics.yaml"
    options = words(SPANS | {"--distance": "2", "--motion": "15:20", "--output": f"{output}"})
    given = ("--cameras", "cam0", "cam1", *options)
    changes = [word.replace("FOLDER", str(session)) for word in changed]
    done = cardbox("calibrate-extrinsics", session, *given, *changes)
    done.assert_refused("calibrate-extrinsics", expected)
    assert not output.exists()
