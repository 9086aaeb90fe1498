"""The cardbox command as a user types it, and good and bad files to give to it."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.applications.simulation.session import SessionFormat, synthesize_session
from cardbox_tracker.commands.main import main
from cardbox_tracker.measuring import first_sight
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.truth import load_ground_truth


@dataclass(frozen=True)
class Done:
    """A finished command: its exit code and what it printed."""

    code: int
    out: str
    err: str

    def assert_refused(self, command: str, *expected: str) -> None:
        """The last line of stderr names the command and the mistake; stdout is empty."""
        assert self.code != 0
        assert "Traceback" not in self.err
        assert self.out == ""
        # Progress bars end without a line feed where they were interrupted.
        last = self.err.rstrip("\n").replace("\r", "\n").splitlines()[-1]
        assert f"cardbox {command}: " in last
        for part in expected:
            assert part in last


@pytest.fixture
def cardbox(capsys: pytest.CaptureFixture[str]) -> Callable[..., Done]:
    """Run cardbox with the words given, also where argparse ends it."""

    def run(*words: object) -> Done:
        try:
            code: object = main([str(word) for word in words])
        except SystemExit as end:
            code = end.code
        assert isinstance(code, int)
        return Done(code, *capsys.readouterr())

    return run


@pytest.fixture
def quick_sight(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests of what does not depend on how well a person is fitted whom nobody measured."""
    monkeypatch.setattr(first_sight, "_ROUNDS", 1)
    monkeypatch.setattr(first_sight, "_DISTANCES_M", np.array([1.5]))


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of good files and bad ones."""
    folder = tmp_path_factory.mktemp("cardbox")
    synthesize_session(folder / "session", "bow", form=SessionFormat(4.0, 160, 120))
    save_body_model(BodyModel.of(hip_height_m=-0.51), folder / "person.yaml")
    text = (folder / "person.yaml").read_text()
    (folder / "text.txt").write_text("no recording, no model\n")
    (folder / "binary.yaml").write_bytes(bytes(range(256)))
    (folder / "list.yaml").write_text("- 1\n- 2\n")
    (folder / "negative.yaml").write_text(_with_value(text, "head_width", "-0.17"))
    (folder / "centimetres.yaml").write_text(_with_value(text, "head_width", "17"))
    (folder / "lacking.yaml").write_text(
        "\n".join(line for line in text.splitlines() if "head_width" not in line)
    )
    (folder / "empty folder").mkdir()
    with BagWriter(folder / "no images") as bag:
        bag.write_string("chatter", 1, "hello")
    with BagWriter(folder / "no camera_info") as bag:
        bag.write_image("/image_raw", 1, "camera", np.zeros((12, 16), np.uint8), "mono8")
    whole = next((folder / "session").glob("*.mcap")).read_bytes()
    (folder / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    return folder


def _with_value(text: str, key: str, value: str) -> str:
    lines = [
        f"{line.split(':')[0]}: {value}" if line.strip().startswith(f"{key}:") else line
        for line in text.splitlines()
    ]
    assert lines != text.splitlines()
    return "\n".join(lines)


@pytest.fixture(scope="session")
def off_m() -> Callable[[Path, Path], np.ndarray]:
    """Return a function: keypoints of each row of a table less those of a session, (n, 6, 3)."""

    def read(table: Path, session: Path) -> np.ndarray:
        truth, differences = load_ground_truth(session / "ground_truth.json"), []
        with table.open(encoding="utf-8") as file:
            for row in csv.DictReader(file):
                places = [float(row[f"{name}_{axis}"]) for name in KEYPOINT_NAMES for axis in "xyz"]
                stamp_ns = truth.start_ns + round(1e9 * float(row["time_s"]))
                true_m = truth.frames[stamp_ns].keypoints_m
                differences.append(np.reshape(places, (6, 3)) - true_m)
        return np.array(differences)

    return read


@pytest.fixture(scope="session")
def spans() -> dict[str, str]:
    """Return the time options of 'cardbox initialize' that are right for the session of files."""
    return {"--background": "0:3.9", "--front": "6.6:8", "--side": "9.6:11", "--arms": "12.6:14"}
