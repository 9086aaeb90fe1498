"""'cardbox track' with --export, --plot and --report, and what it says where nothing is given."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import cv2
import numpy as np
import pytest
from matplotlib.figure import Figure

from cardbox_tracker.applications.demo.film import DemoFilm
from cardbox_tracker.applications.exporting.motion import Motion
from cardbox_tracker.applications.reporting.page import angles_of, page_figure, space_view
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.measuring.scene import Value
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.skeleton import JOINT_NAMES, PLACE_NAMES
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.recordings.result_table import POINT_COLUMNS, deviation_columns

VOID = {"meta", "img", "br"}


class Page(HTMLParser):
    """Attributes of a page by element; it fails on elements that are not closed in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture
def film(monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the demo's film, and install what was found in it as the detector."""
    demo = DemoFilm.load()
    monkeypatch.setattr(Detector, "installed", lambda: demo.detector)
    return demo.path


def test_a_bent_arm_has_its_angles_and_deviations() -> None:
    posture, stddev = np.zeros((2, 12)), np.zeros((2, 12))
    flexion = JOINT_NAMES.index("left_elbow_flexion")
    posture[:, flexion], stddev[:, flexion], posture[1] = np.pi / 2, 0.1, np.nan
    values = np.hstack([posture, stddev])
    numbers = dict(zip((*JOINT_NAMES, *deviation_columns(JOINT_NAMES)), values.T, strict=True))
    times = np.arange(2), np.arange(2.0), ("tracking", "lost")
    results = Results(Path("a.csv"), *times, numbers, {}, (None, None))
    angle, deviation = angles_of(results)["left_elbow_bend_deg"]
    np.testing.assert_allclose(angle, [90.0, np.nan], atol=1e-6)
    np.testing.assert_allclose(deviation, [np.degrees(0.1), np.nan])
    _, of_arm = angles_of(results)["left_arm_elevation_deg"]
    np.testing.assert_allclose(of_arm, [0.0, np.nan], atol=1e-6)


def test_one_command_writes_exports_plot_and_page(
    tmp_path: Path, film: Path, cardbox: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ("track", film, "--detector", "mediapipe", "--end", 1, "--csv", "her #1.csv")
    more = ("--export", "trc,bvh", "--plot", "her.png", "--report", "page/her #1\udcff.html")
    Path("page").mkdir()
    done = cardbox(*words, *more)
    assert done.code == 0, done.err
    assert Path("her #1.trc").read_text().startswith("PathFileType\t4")
    assert Path("her #1.bvh").read_text().startswith("HIERARCHY")
    assert cv2.imread("her.png").std() > 10.0
    for name in (
        "her #1.trc",
        "her #1.bvh",
        "her.png",
        r"page/her #1\udcff.html",
        r"page/her #1\udcff.overlay.mp4",
    ):
        assert f"wrote {name}" in done.out

    text = Path("page/her #1\udcff.html").read_text(encoding="utf-8")
    elements = Page(text).found
    (shown,) = (values["src"] for tag, values in elements if tag == "video")
    assert shown is not None
    overlay = Path("page") / unquote(shown, errors="surrogateescape")
    # OpenCV takes no such name.
    assert cv2.VideoCapture(str(overlay.rename("overlay.mp4"))).read()[0]
    pictures = [values["src"] for tag, values in elements if tag == "img"]
    assert len(pictures) == 2
    assert all(str(source).startswith("data:image/png;base64,iVBOR") for source in pictures)
    assert "field of view across the image" in text

    # Lens and stature are in one line, which says what is right all the same.
    (line,) = (line for line in done.err.splitlines() if "unknown" in line)
    for word in ("--stature M", "--fov DEG", "angles"):
        assert word in line
    assert not re.search("taken as that|nothing tells", done.err)


def seen_results() -> Results:
    rng = np.random.default_rng(0)
    names = (*JOINT_NAMES, *PLACE_NAMES, *deviation_columns(JOINT_NAMES), *POINT_COLUMNS)
    numbers = dict(zip(names, rng.uniform(0.1, 0.5, (len(names), 20)), strict=True))
    times = np.arange(20), np.arange(20.0), ("tracking",) * 20
    return Results(Path("a.csv"), *times, numbers, {}, (None,) * 20)


def test_a_figure_is_a_pdf_of_the_same_bytes_and_shows_the_skeleton() -> None:
    results = seen_results()
    first, again = (page_figure(results, ".pdf") for _ in range(2))
    assert first.startswith(b"%PDF") and first == again
    nobody = replace(results, state=("lost",) * 20)
    shown, empty = (page_figure(one, ".png") for one in (results, nobody))
    rows = [
        cv2.imdecode(np.frombuffer(one, np.uint8), cv2.IMREAD_COLOR).shape[0]
        for one in (shown, empty)
    ]
    assert rows[0] == rows[1] + 340


def test_the_picture_with_a_reference_says_how_far_that_is_and_why(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    titles: list[str] = []
    monkeypatch.setattr(Figure, "suptitle", lambda _, text, **__: titles.append(text))
    motion, body = Motion.of(seen_results()), BodyModel()
    pitch = Value(0.0, np.radians(5.0))
    space_view(motion, body, motion.keypoints_m - np.array([0.0, 0.06, 0.08]), pitch)
    space_view(motion, None, motion.keypoints_m + np.array([0.0, 0.0, 0.2]))
    space_view(motion, body)
    assert (
        "10 cm farther from the camera" in titles[0] and "pitch, here 0 +- 5 degrees" in titles[0]
    )
    assert "20 cm nearer to the camera" in titles[1] and "pitch" not in titles[1]
    assert "reference" not in titles[2]


BROWSER = next(filter(None, map(shutil.which, ("chromium", "google-chrome", "chrome"))), None)


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on the PATH")
def test_a_browser_runs_the_page_and_finds_its_film(
    tmp_path: Path, film: Path, cardbox: Callable
) -> None:
    page, table = tmp_path / "her.html", tmp_path / "her.csv"
    words = ("track", film, "--detector", "mediapipe", "--end", 0.2, "--csv", table)
    assert cardbox(*words, "--report", page).code == 0
    assert 'id="missing" hidden=""' in in_browser(page)
    (tmp_path / "her.overlay.mp4").unlink()
    assert 'id="missing">' in in_browser(page)


def in_browser(page: Path) -> str:
    """Return the page after its script ran."""
    flags = "--headless", "--no-sandbox", "--virtual-time-budget=3000", "--dump-dom"
    profile = f"--user-data-dir={page.parent / 'profile'}"
    words = [str(BROWSER), *flags, profile, page.as_uri()]
    return subprocess.run(words, capture_output=True, text=True, check=True, timeout=60).stdout


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--export", "trc,fbx"), "expected formats of trc, bvh, c3d, mot, sto, rates, isb"),
        (("--plot", "FOLDER/angles.jpg"), "its name must end in .png or .pdf"),
        (("--report", "FOLDER/page"), "its name must end in .html"),
        (("--report", "FOLDER/a.html", "--video", "FOLDER/a.avi"), "must end in .mp4"),
        (("--plot", "FOLDER/there.png"), "there.png exists"),
    ],
)
def test_mistakes(
    tmp_path: Path, film: Path, words: tuple[str, ...], expected: str, cardbox: Callable
) -> None:
    (tmp_path / "there.png").touch()
    given = (word.replace("FOLDER", str(tmp_path)) for word in words)
    table = () if "--csv" in words else ("--csv", tmp_path / "out.csv")
    done = cardbox("track", film, "--detector", "mediapipe", *table, *given)
    done.assert_refused("track", expected)
    assert [path.name for path in tmp_path.iterdir()] == ["there.png"]
