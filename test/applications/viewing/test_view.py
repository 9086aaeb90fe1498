"""'cardbox view' of a bag of results: what its file has is read back with the library."""

from __future__ import annotations

import re
import socket
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np
import pytest

from cardbox_tracker.applications.drawing.overlay import draw_sharp_overlay
from cardbox_tracker.applications.simulation.motions import wave
from cardbox_tracker.applications.simulation.session import SessionFormat, synthesize_session
from cardbox_tracker.applications.viewing import viewer
from cardbox_tracker.applications.viewing.viewer import web_page
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.commands.main import main
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.person.urdf import urdf_from_body
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.result_bag import result_bag
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.tracking.estimate import LOST, TRACKING, Estimate
from cardbox_tracker.tracking.tracker import Tracker

BODY = BodyModel.of(hip_height_m=-0.51)
CAMERA = Camera(64, 48, 66.0, 66.0, 31.5, 23.5)
IMAGES = 5


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """A bag as of 'cardbox track --bag'; the person is lost in the last image."""
    path, tracker = tmp_path / "results", Tracker(BODY, CAMERA)
    noise = np.random.default_rng(0).integers(0, 256, (IMAGES + 1, 48, 64), np.uint8)
    with result_bag(path, "camera", draw=draw_sharp_overlay) as bag:
        for i in range(IMAGES + 1):
            posture = wave(i / 5.0)
            points = CAMERA.reference_to_optical(pose(BODY.rigid, posture).keypoints_m)
            estimate = Estimate(TRACKING, posture, np.full(12, 0.1), points, 10, 0.9)
            frame = RecordedFrame(i * 10**8, i / 10, noise[i], noise[i])
            bag(frame, estimate if i < IMAGES else Estimate(LOST), tracker)
    return path


def view(*words: object) -> int:
    return main(["view", *map(str, words)])


def rows_of(path: Path) -> Counter[str]:
    """Rows of every entity in a file, static ones left out."""
    chunk = pytest.importorskip("rerun.chunk", reason="rerun-sdk is not installed")
    rows: Counter[str] = Counter()
    for one in chunk.RrdReader(path).stream():
        rows[str(one.entity_path).strip("/")] += 0 if one.is_static else one.num_rows
    return rows


def test_every_image_is_in_the_file(results: Path, tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    assert view(results, "--save", tmp_path / "view.rrd") == 0
    rows = rows_of(tmp_path / "view.rrd")
    assert rows["image"] == IMAGES + 1
    assert rows["state"] == 2  # tracking, then lost
    assert rows["keypoints/joints"] == IMAGES
    for joint in ("left_elbow_flexion", "right_shoulder_abduction"):
        assert rows[f"person/joints/{joint}"] == IMAGES
        arm = joint.split("_")[0]
        assert rows[f"joints/{arm}_arm/{joint}"] == IMAGES
        for side in ("low", "high"):
            spread = f"joints/{arm}_arm/within_two_deviations/{joint}/{side}"
            assert rows[spread] == IMAGES
    assert rows["joints/place/torso_y"] == IMAGES
    # The body's boxes are there, once and for all.
    assert any("left_forearm" in entity for entity in rows)
    assert not any(entity.startswith("error") for entity in rows)


def test_the_truth_of_other_images_is_refused_or_ignored(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    synthesize_session(tmp_path / "other", "bow", form=SessionFormat(2.0, 64, 48))
    truth = tmp_path / "other" / "ground_truth.json"
    assert view(results, "--truth", truth, "--save", tmp_path / "v.rrd") == 1
    assert "has no true frame for an image of" in capsys.readouterr().err
    # Nobody gave the one that lies beside the results.
    truth.rename(tmp_path / "ground_truth.json")
    assert view(results, "--save", tmp_path / "v.rrd") == 0
    assert not any(entity.startswith("error") for entity in rows_of(tmp_path / "v.rrd"))


def titles(part: Any) -> list[str]:
    """Return the titles of all views of a blueprint."""
    container = pytest.importorskip("rerun.blueprint").Container

    if isinstance(part, container):
        return [title for inner in part.contents for title in titles(inner)]
    return [part.name]


@pytest.mark.parametrize("has_truth", [False, True])
def test_the_view_of_errors_is_there_only_with_a_truth(has_truth: bool) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    from cardbox_tracker.applications.viewing.scene import layout

    found = titles(layout(has_truth=has_truth).root_container)
    assert ("error [cm]" in found) == has_truth
    assert {"image", "measured body", "left arm [deg]", "state"} <= set(found)


def test_recordings_play_from_the_start_and_nodes_are_followed() -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    from cardbox_tracker.applications.viewing.scene import layout

    assert layout().time_panel.play_state == "playing"
    assert layout(is_live=True).time_panel.play_state == "following"


def test_a_robot_of_its_own_namespace_is_shown(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    names = ("torso_yaw", "elbow")
    with BagWriter(tmp_path / "bag", "mcap") as bag:
        save_body_model(BODY, tmp_path / "person.yaml")
        bag.write_string("/body_model", 1, (tmp_path / "person.yaml").read_text())
        bag.write_string("/arm/robot_description", 1, urdf_from_body(BODY))
        for i in range(1, 4):
            bag.write_joint_state("/arm/joint_states", i, "", names, np.array([0.1, 0.2]))
    assert view(tmp_path / "bag", "--save", tmp_path / "v.rrd") == 0
    rows = rows_of(tmp_path / "v.rrd")
    assert rows["arm/joints/torso_yaw"] == 3
    assert "arm/joints/elbow" not in rows


def test_errors_are_those_of_the_keypoints() -> None:
    scene = pytest.importorskip("cardbox_tracker.applications.viewing.scene")
    truth = CAMERA.reference_to_optical(pose(BODY.rigid, reference_posture("front")).keypoints_m)
    moved = truth + np.array([0.0, 0.0, 0.1])
    assert scene.errors_cm(moved, truth) == pytest.approx({"absolute": 10.0, "aligned": 0.0})
    moved[2, 1] += 0.06
    assert scene.errors_cm(moved, truth)["aligned"] == pytest.approx(1.0)


@pytest.mark.parametrize("pitch_rad", [0.0, 0.3])
def test_points_stand_where_the_urdf_has_the_person(pitch_rad: float) -> None:
    scene = pytest.importorskip("cardbox_tracker.applications.viewing.scene")
    body = BODY.with_values(camera_pitch_rad=pitch_rad)
    camera = CAMERA.with_pitch(pitch_rad)
    reference = pose(body.rigid, reference_posture("front")).keypoints_m
    level = scene.level_points(camera.reference_to_optical(reference), pitch_rad)
    # The reference frame faces the camera; the root of the URDF looks the same way as it.
    np.testing.assert_allclose(level, reference * (-1.0, -1.0, 1.0), atol=1e-12)


Refusal = tuple[tuple[str, ...], str]
REFUSALS: list[Refusal] = [
    ((), "expected either BAG or --live"),
    (("BAG", "--live"), "expected either BAG or --live"),
    (("FOLDER",), "is no bag; give one that 'cardbox track --bag' has written"),
    (("BAG", "--save", "FOLDER/missing/v.rrd"), "No such file or directory"),
]


@pytest.mark.parametrize(("words", "expected"), REFUSALS)
def test_mistakes_are_told(
    results: Path, words: tuple[str, ...], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [w.replace("BAG", str(results)).replace("FOLDER", str(results.parent)) for w in words]
    assert view(*given) == 1
    assert expected in capsys.readouterr().err


def test_errors_are_plotted_where_the_truth_is_given(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    session, out, found = tmp_path / "session", tmp_path / "v.rrd", tmp_path / "found"
    synthesize_session(session, "bow", form=SessionFormat(4.0, 160, 120))
    save_body_model(BODY, tmp_path / "person.yaml")
    assert view(session, "--save", out) == 1
    assert "make them with 'cardbox track" in capsys.readouterr().err
    assert not out.exists()
    words = "--background", "0:3.9", "--start", "22", "--model", tmp_path / "person.yaml"
    words = *words, "--csv", tmp_path / "found.csv", "--bag", found
    assert main(["track", *map(str, (session, *words))]) == 0
    assert view(found, "--truth", session / "ground_truth.json", "--save", out) == 0
    rows = rows_of(out)
    assert rows["image"] >= rows["keypoints/joints"] > 0
    assert rows["error/absolute"] == rows["truth/joints"] == rows["keypoints/joints"]


def test_without_a_display_the_other_ways_are_named(
    results: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    monkeypatch.setattr("cardbox_tracker.applications.viewing.viewer._has_display", lambda: False)
    assert view(results) == 1
    assert "--save FILE.rrd" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("nope",), r"there is no recording nope"),
        (("--web", "n\udcffpe"), r"there is no recording n\Wudcffpe"),
        (("BAG", "--truth", "nope.json"), r"nope\.json"),
    ],
)
def test_a_missing_file_is_named_before_a_missing_library(
    results: Path,
    words: tuple[str, ...],
    expected: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert view(*(word.replace("BAG", str(results)) for word in words)) == 1
    said = capsys.readouterr().err
    assert re.search(expected, said) and "rerun" not in said


def test_without_the_library_its_extra_is_named(
    results: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert view(results, "--save", results.parent / "v.rrd") == 1
    assert "pip install 'cardbox_tracker[view]'" in capsys.readouterr().err
    assert not (results.parent / "v.rrd").exists()


SERVER = """
import sys
from http.server import BaseHTTPRequestHandler
from socketserver import TCPServer

class Files(BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_response(200 if self.path == "/viewer.js" else 404)
        self.send_header("Content-Type", "text/javascript")
        self.end_headers()
        self.wfile.write(b"1 + 1")
        if self.path == "/end":
            sys.exit()

    def do_POST(self):
        asked = self.rfile.read(int(self.headers["Content-Length"]))
        self.send_response(200)
        self.send_header("Content-Type", self.headers["Content-Type"])
        self.end_headers()
        self.wfile.write(asked)

words = sys.argv[1:]
port = words[words.index("--web-viewer-port" if "--serve-web" in words else "--port") + 1]
TCPServer((words[words.index("--bind") + 1], int(port)), Files).serve_forever()
"""
PROGRAM = (sys.executable, "-c", SERVER)


def test_files_are_passed_on_with_a_policy() -> None:
    with web_page(PROGRAM, 1, port=0) as address:
        with urlopen(f"{address}/viewer.js") as answer:
            assert answer.read() == b"1 + 1"
            assert answer.headers["Content-Type"] == "text/javascript"
            allowed = answer.headers["Content-Security-Policy"]
        with pytest.raises(HTTPError, match="404"):
            urlopen(f"{address}/other")
        with pytest.raises(HTTPError, match="404"):
            urlopen(f"{address}/end")
        with socket.create_connection(("127.0.0.1", int(address.rpartition(":")[2]))) as raw:
            raw.sendall(b"GET /\xc3\xa4 HTTP/1.0\r\nHost: localhost\r\n\r\n")
            assert b" 502 " in raw.recv(100)
        with pytest.raises(HTTPError, match="502"):
            urlopen(f"{address}/viewer.js")
    hosts = {word for word in allowed.replace(";", "").split() if "//" in word}
    assert not hosts
    assert "*" not in allowed.split()


@pytest.fixture
def window(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """The port of a window's data."""
    begun: list[Any] = []

    def popen(*words: Any, **options: Any) -> Any:
        begun.append(real(*words, **options))
        return begun[-1]

    real = viewer.Popen
    monkeypatch.setattr(viewer, "Popen", popen)
    monkeypatch.setattr(viewer, "rerun_program", lambda: PROGRAM)
    yield viewer._window()
    begun[0].kill()
    begun[0].wait()


@pytest.mark.parametrize("data", [None, b"which images?"])
@pytest.mark.parametrize(
    ("headers", "allowed"),
    [
        ({"Host": "localhost:1"}, True),
        ({"Host": "127.0.0.1", "Origin": "http://localhost:9090"}, True),
        ({"Host": "evil.example:9090"}, False),
        ({"Host": "localhost", "Origin": "http://evil.example"}, False),
        ({"Host": ""}, False),
        ({"Host": "["}, False),
    ],
)
def test_files_and_data_are_for_the_page_of_this_computer(
    headers: dict[str, str], allowed: bool, data: bytes | None, window: int
) -> None:
    with web_page(PROGRAM, window, port=0) as address:
        kind = {"Content-Type": "application/grpc-web+proto"}
        request = Request(f"{address}/viewer.js", data, {**headers, **kind})
        if not allowed:
            with pytest.raises(HTTPError, match="403"):
                urlopen(request)
            return
        with urlopen(request) as answer:
            assert answer.read() == (data or b"1 + 1")
            assert data is None or answer.headers["Content-Type"] == kind["Content-Type"]


def test_the_data_of_a_window_are_where_no_other_page_finds_them(window: int) -> None:
    for host, is_there in ((viewer._HIDDEN, True), ("127.0.0.1", False), ("127.0.0.2", False)):
        with socket.socket() as one:
            assert (one.connect_ex((host, window)) == 0) == is_there


def test_reruns_own_server_listens_to_this_computer_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    ports: list[int] = []

    def free_port() -> int:
        ports.append(real())
        return ports[-1]

    real = viewer._free_port
    monkeypatch.setattr(viewer, "_free_port", free_port)
    with web_page(viewer.rerun_program(), 1, port=0) as address:
        assert b"<html" in urlopen(address).read().lower()
        # To other addresses of this computer, a server of 0.0.0.0 would answer.
        known = ("127.0.0.2", int(address.rpartition(":")[2])), *(("127.0.0.1", p) for p in ports)
        for place in known:
            with socket.socket() as one:
                assert one.connect_ex(place) != 0


def test_a_port_in_use_is_an_error() -> None:
    with web_page(PROGRAM, 1, port=0) as address:
        port = int(address.rpartition(":")[2])
        with (
            pytest.raises(OSError, match=f"port {port} is in use; end"),
            web_page(PROGRAM, 1, port=port),
        ):
            pass
