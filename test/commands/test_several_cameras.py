"""Several cameras as a user types it: a synthetic recording is measured and tracked."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.body.model_file import load_body_model
from cardbox_tracker.body.skeleton import KEYPOINT_NAMES
from cardbox_tracker.evaluation.truth import load_ground_truth
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.simulation.session import SessionFormat, synthesize_session

SPANS = {
    "--background": "0:3.9",
    "--front": "6.8:8.2",
    "--side": "9.8:11.2",
    "--arms": "12.8:14.2",
}


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cameras") / "session"
    synthesize_session(folder, "bow", form=SessionFormat(5.0, cameras=2))
    return folder


def words(options: dict[str, str]) -> list[str]:
    return [f"{name}={value}" for name, value in options.items()]


def test_a_synthetic_recording_is_measured_and_tracked(
    session: Path, tmp_path: Path, cardbox: Callable
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
    truth = load_ground_truth(session / "ground_truth.json")
    errors = []
    with table.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            frame = truth.frames[int(row["stamp_ns"])]
            found = [[float(row[f"{name}_{axis}"]) for axis in "xyz"] for name in KEYPOINT_NAMES]
            errors.append(np.linalg.norm(np.array(found) - frame.keypoints_m, axis=1).mean())
    assert len(errors) > 30
    assert np.mean(errors) < 0.06


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
