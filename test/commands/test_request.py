"""The request that the options make, how wrong ones are reported, and options in files."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace
from itertools import chain, combinations
from pathlib import Path

import cv2
import numpy as np
import pytest

from cardbox_tracker.commands import tracking_request as module
from cardbox_tracker.commands.main import build_parser
from cardbox_tracker.commands.request import Request, with_own_options
from cardbox_tracker.commands.tracking_request import TrackingRequest, tracking_request
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors import detector as detector_module
from cardbox_tracker.detectors.model_files import ModelFiles
from cardbox_tracker.detectors.person_choice import PersonChoice
from cardbox_tracker.detectors.point_table import PointTable
from cardbox_tracker.person.model import BodyModel, body_from_proportions
from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.other_silhouettes import PersonInView
from cardbox_tracker.recordings.silhouettes import TimeSpan
from cardbox_tracker.tracking.session import MOST_PEOPLE
from cardbox_tracker.tracking.smoother import OF_RECORDINGS


@pytest.fixture
def film(tmp_path: Path) -> Path:
    """A film, and beside it a bag (in name), a measured person and a table of points."""
    (tmp_path / "film.mp4").touch()
    (tmp_path / "bag.mcap").touch()
    (tmp_path / "points.csv").touch()
    save_body_model(BodyModel.of(hip_height_m=-0.51), tmp_path / "me.yaml")
    return tmp_path / "film.mp4"


def line(recording: object, *words: object) -> Request:
    return Request.of(build_parser(["track"]).parse_args(["track", *map(str, (recording, *words))]))


def asked(recording: object, *words: object) -> TrackingRequest:
    return tracking_request(line(recording, *words))


def refused(recording: object, *words: object) -> str:
    with pytest.raises(CardboxError) as caught:
        asked(recording, *words)
    return str(caught.value)


def test_a_request_has_what_the_options_ask_for(film: Path) -> None:
    folder = film.parent
    given = ("--model", folder / "me.yaml", "--start", 2, "--background", "0:1.5", "--fov", 60)
    more = ("--detector", folder / "points.csv", "--camera-roll-deg", 0, "--fps", 12)
    request = asked(film, *given, *more, "--effort", 2, "--seed", 7)
    recording, person = request.recording, request.person
    assert recording.path == film
    assert recording.silhouettes == TimeSpan(0.0, 1.5)
    assert recording.points == PointTable(folder / "points.csv")
    assert recording.detector is None
    assert recording.camera == GivenCamera(60.0, None, 0.0, 12.0)
    assert (person.model, person.start_s, person.is_pitch_given) == (folder / "me.yaml", 2, True)
    assert person.body.placement.hip_height_m == -0.51
    assert (request.config.whole_body.effort, request.seed) == (2.0, 7)
    assert set(request.inputs) == {film, folder / "me.yaml", folder / "points.csv"}
    with pytest.raises(FrozenInstanceError):
        request.seed = 8  # type: ignore[misc]


def test_python_asks_for_the_same_as_a_command_line(film: Path) -> None:
    words = ("--background=0:1.5", "--person=120,80.5", "--stature=1.8,1.6", "--people=auto")
    more = ("--cameras", "a", "b", "--set=lost_frames=9", "--set=relocalize=false", "--hands")
    asked = Request(
        film,
        background=(0, 1.5),
        person=(120, 80.5),
        stature_m=(1.8, 1.6),
        people="auto",
        cameras=("a", "b"),
        set={"lost_frames": 9, "relocalize": False},
        hands=True,
    )
    assert asked == line(film, *words, *more) == replace(asked)
    assert (
        asked == line(film, *words, "--cameras", "a,b", *more[3:]) == replace(asked, cameras="a,b")
    )
    assert isinstance(asked.background, TimeSpan) and asked.statures_m == (1.8, 1.6)


def test_a_stature_leaves_the_rest_to_be_found(film: Path) -> None:
    request = asked(film, "--stature", 1.8, "--fov", 60)
    assert isinstance(request.recording.silhouettes, PersonInView)
    assert request.recording.camera.roll_rad is None
    assert request.person.start_s == 0.0
    assert not request.person.is_pitch_given
    assert "distance_m" in request.person.body.unknown
    request = asked(film, "--stature", 1.8, "--fov", 60, "--camera-pitch-deg", 10)
    assert request.person.is_pitch_given
    assert request.person.body.camera_pose.pitch_rad == pytest.approx(np.radians(10.0))


def test_a_body_that_was_not_measured_needs_no_start(film: Path) -> None:
    """What 'cardbox track --stature' writes tracks the same recording again."""
    mean = film.parent / "mean.yaml"
    save_body_model(body_from_proportions(1.7, 2.0), mean)
    assert asked(film, "--fov", 60, "--model", mean).person.start_s == 0.0
    assert "--start T" in refused(film, "--fov", 60, "--model", film.parent / "me.yaml")


def test_tracking_ends_where_it_is_asked_to(film: Path) -> None:
    assert asked(film, "--fov", 60, "--stature", 1.7).person.end_s == np.inf
    assert asked(film, "--fov", 60, "--stature", 1.7, "--end", 3).person.end_s == 3.0
    words = ("--fov", 60, "--stature", 1.7, "--start", 5, "--end", 5)
    assert "--end 5 is not after --start 5" in refused(film, *words)


def test_a_person_is_chosen_among_all_whom_a_detector_finds(
    film: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(detector_module, "installed_models", lambda: ModelFiles(film, film))
    given = ("--fov", 60, "--stature", 1.7, "--person", "120,80.5")
    for words in (("mediapipe",), ("mediapipe", "--background", "0:1")):
        recording = asked(film, *given, "--detector", *words).recording
        found = recording.detector
        assert found is not None and found.people == MOST_PEOPLE
        assert recording.points == found
    assert "--person needs a detector" in refused(film, *given)
    request = asked(film, *given, "--detector", film.parent / "points.csv")
    assert request.recording.points == PointTable(film.parent / "points.csv", MOST_PEOPLE)
    assert request.person.choice == PersonChoice("place", (120.0, 80.5))
    # All that goes with one person goes with one who is chosen.
    me = ("--model", film.parent / "me.yaml", "--start", 1, "--preset", "paper")
    person = asked(film, *given[:2], *me, "--detector=mediapipe", "--person=left@2").person
    assert (person.people, person.choice) == (None, PersonChoice("left", time_s=2.0))


def test_people_are_numbered_from_1(film: Path) -> None:
    with pytest.raises(SystemExit):
        asked(film, "--fov", 60, "--stature", "1.8", "--people", "2", "--person", "0")


def test_several_people_have_a_body_each(film: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(detector_module, "installed_models", lambda: ModelFiles(film, film))
    given = ("--fov", 60, "--detector", "mediapipe")
    request = asked(film, *given, "--stature", "1.8,1.6", "--people", "2", "--person", "2")
    person = request.person
    assert (person.people, person.number, len(person.others)) == (2, 2, 1)
    assert person.body.size("torso_height") > person.others[0].size("torso_height")
    assert request.recording.points is not None and request.recording.points.people == 2
    everybody = asked(film, *given, "--stature", "1.8", "--people", "auto")
    assert everybody.person.people == 0 and not everybody.person.others
    assert everybody.recording.points is not None
    assert everybody.recording.points.people == MOST_PEOPLE
    alone = asked(film, *given, "--stature", "1.8")
    assert alone.person.people is None and alone.recording.points == alone.recording.silhouettes


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (("--stature", "1.8,1.6"), "--stature has several values: give one, or --people"),
        (("--stature", "1.8", "--person", "2"), "--person K is the number of one of several"),
        (("--stature", "1.8", "--people", "2", "--person", "left"), "--person K is the number"),
        (("--stature", "1.8", "--people", "2", "--person", "3"), "--person 3 is none of 2 people"),
        (("--stature", "1.8", "--people", "2", "--preset", "paper"), "needs the preset default"),
        (("--stature", "1.8,1.7,1.6", "--people", "2"), "--stature has 3 values for --people 2"),
        (("--stature", "1.8", "--extrinsics", "e.yaml"), "--extrinsics has no effect with one"),
        (("--stature", "1.8", "--fov", "0.7"), "0.7 degrees; expected 10 to 160 degrees"),
        (("--model", "me.yaml", "--people", "2"), "--people takes the stature of each person"),
    ],
)
def test_mistakes_with_several_people(words: tuple[str, ...], fault: str, film: Path) -> None:
    given = ("--fov", 60, "--detector", film.parent / "points.csv")
    assert fault in refused(film, *given, *words)


def test_hands_need_the_detector_and_its_file(film: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(detector_module, "installed_models", lambda: ModelFiles(film, film))
    monkeypatch.setattr(module, "installed_hands", lambda: film)
    given = ("--fov", 60, "--stature", 1.7)
    assert asked(film, *given, "--detector", "mediapipe", "--hands").hands == film
    assert asked(film, *given, "--detector", "mediapipe").hands is None
    points = "--detector", film.parent / "points.csv"
    for words in ((), points, ("--silhouettes", "detector")):
        assert "--hands needs the detector" in refused(film, *given, *words, "--hands")


def test_what_smoothing_gives_needs_it(film: Path) -> None:
    given = ("--fov", 60, "--stature", 1.7)
    wanted = asked(film, *given, "--rates", "--fill-gaps", 0.3).smoothing
    assert (wanted.has_rates, wanted.longest_gap_s) == (True, 0.3)
    assert asked(film, *given).smoothing == OF_RECORDINGS
    assert asked(film, *given, "--causal").smoothing.lag_s == 0.0
    for without in (("--causal",), ("--preset", "paper")):
        told = refused(film, *given, *without, "--rates", "--fill-gaps", 0.3)
        assert "--rates comes from the smoothing" in told
        assert "--fill-gaps comes from the smoothing" in told and without[-1] in told


NEEDED = {
    "--fov DEG or --calibration FILE": ("--fov", "60"),
    "--background T0:T1 or --within M": ("--background", "0:1"),
    "--stature M or --model FILE": ("--stature", "1.7"),
}
SUBSETS = list(chain.from_iterable(combinations(NEEDED, n) for n in range(len(NEEDED))))


@pytest.mark.parametrize("given", SUBSETS)
@pytest.mark.parametrize("name", ["film.mp4", "bag.mcap"])
def test_all_that_is_missing_is_named_at_once(
    name: str, given: tuple[str, ...], film: Path
) -> None:
    # Each kind of recording does without one of the options.
    unneeded = list(NEEDED)[0 if name == "bag.mcap" else 1]
    missing = [option for option in NEEDED if option not in (*given, unneeded)]
    words = [word for option in given for word in NEEDED[option]]
    if not missing:
        assert asked(film.with_name(name), *words).person.model is None
        return
    told = refused(film.with_name(name), *words)
    assert f"{name} needs {', and '.join(missing)}" in told.replace(
        " or --silhouettes detector|person_in_view", ""
    )
    assert not any(option in told for option in NEEDED if option not in missing)


def test_a_model_needs_the_start(film: Path) -> None:
    told = refused(film, "--model", film.with_name("me.yaml"))
    assert "film.mp4 needs --fov DEG or --calibration FILE, and --start T (" in told


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--fov=60", "--calibration=a.yaml"), ["--fov and --calibration both"]),
        (("--stature=1.7", "--model=a.yaml"), ["--stature and --model both", "needs --fov"]),
        (("--model=me.yaml", "--distance=2", "--camera-pitch-deg=3"), ["--distance", "--camera-p"]),
        (("--background=0:1", "--within=2"), ["--background and --within exclude"]),
        (("--silhouettes=background", "--within=2"), ["--silhouettes background and --within"]),
        (("--silhouettes=person_in_view", "--within=2"), ["takes the place of --background"]),
        (("--stature=300", "--distance=0", "--detector=x"), ["stature is 300", "'x'; expected"]),
        (("--depth=/d",), ["--depth needs --cameras", "read from a rosbag2, which"]),
        (("--cameras", "a", "b", "--fps=3"), ["describe one camera"]),
        (("--cameras", "a", "a", "--fov=0"), ["are a, a; expected", "field of view is 0"]),
        (("--preset=paper", "--cameras", "a", "b"), ["--preset paper uses"]),
        (("--effort=9", "--calibration=no.yaml"), ["--effort is 9", "no.yaml: No such file"]),
        (("--set", "foo=1", "--stature=9"), ["'foo' is no setting", "stature is 9 m"]),
    ],
)
def test_all_that_is_wrong_is_reported_at_once(
    words: tuple[str, ...], expected: list[str], film: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(film.parent)
    told = refused(film, *words)
    for part in expected:
        assert part in told
    assert told.count("; also, ") >= len(expected) - 1


def test_a_recording_that_is_none_is_reported_with_the_rest(tmp_path: Path) -> None:
    told = refused(tmp_path / "no.mp4")
    assert "no.mp4 needs --stature M" in told
    assert "there is no recording" in told


def test_films_are_known_by_their_content(tmp_path: Path) -> None:
    """Images are a film; a file of another kind is refused only when it is opened."""
    cv2.imwrite(str(tmp_path / "1.png"), np.zeros((8, 8), np.uint8))
    assert "--fov DEG" in refused(tmp_path, "--stature", 1.7)
    (tmp_path / "text.txt").touch()
    assert asked(tmp_path / "text.txt", "--stature", 1.7)


def test_settings_are_given_by_name(film: Path) -> None:
    given = ("--fov=60", "--stature=1.7")
    settings = film.with_name("settings.yaml")
    settings.write_text("lost_frames: 9\nlost_iou: 0.1\nwhole_body:\n  effort: 3\n")
    words = ("--set", "lost_frames=7", "--set", "lost_frames=8", "--set", "relocalize=false")
    config = asked(film, *given, *words, "--settings", settings, "--effort", 2).config
    assert (config.lost_frames, config.lost_iou) == (8, 0.1)
    assert (config.relocalize, config.whole_body.effort) == (False, 2.0)
    paper = ("--preset=paper", "--set", "torso.particles=50", "--set", "strategy=srs")
    config = asked(film, *given, *paper, "--set", "arm.sigma_gamma_px=1e3").config
    assert (config.torso.particles, config.strategy) == (50, "srs")
    assert config.arm.sigma_gamma_px == 1000.0


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("lost_frames=many",), "lost_frames is 'many'; expected a whole number"),
        (("lost_frames=0",), "lost_frames is 0; expected 1 to 1e+06"),
        (("torso.particles=100",), "torso.particles has no effect with the filter whole_body"),
        (("torso.particles=100",), "use --effort"),
        (("strategy=best",), "strategy is 'best'; expected one of"),
        (("whole_body=1", "--set", "whole_body.effort=2"), "whole_body is 1; expected names"),
        (("x", "--preset=paper"), "expected NAME=VALUE, such as lost_frames=10, got 'x'"),
        (("torso.particles=9999999999", "--preset=paper"), "expected 2 to 1e+06"),
        (("average=2", "--preset=paper", "--effort=1"), "--effort has no effect with the filter"),
        (("average=2", "--preset=paper", "--effort=1"), "use --set torso.particles=VALUE"),
    ],
)
def test_settings_that_are_wrong(
    words: tuple[str, ...], expected: str, film: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        told = refused(film, "--fov=60", "--stature=1.7", "--set", *words)
    except SystemExit:
        told = capsys.readouterr().err
    assert expected in told


def test_a_file_that_contradicts_itself_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.options").write_text("--stature 1.7 --model a.yaml --background 0:1")
    found = with_own_options(line("in", "--stature", 1.7), tmp_path, "a")
    with pytest.raises(CardboxError, match="--stature and --model both say who is tracked"):
        tracking_request(found)


def test_without_a_file_the_command_line_is_left(tmp_path: Path) -> None:
    given = line("in", "--stature", "1.7")
    assert with_own_options(given, tmp_path, "a/b") == given


def test_files_change_the_command_line_and_inner_ones_the_outer(tmp_path: Path) -> None:
    (tmp_path / "anna").mkdir()
    (tmp_path / "anna.options").write_text("--stature 1.64 --start 3 # Anna is always late\n")
    (tmp_path / "anna" / "wave.options").write_text("--start 5\n--background 0:2 --set average=2")
    (tmp_path / "wave.options").write_text("--start 9")
    words = ("--stature", "1.7", "--effort", "2", "--silhouettes", "person_in_view")
    given = line("in", *words, "--set", "lost_frames=9", "--set", "average=3")
    wave, bow = (with_own_options(given, tmp_path, f"anna/{name}") for name in ("wave", "bow"))
    assert (wave.stature_m, wave.start_s, wave.effort) == ((1.64,), 5.0, 2.0)
    assert (wave.background, wave.silhouettes) == (TimeSpan(0.0, 2.0), None)
    assert dict(wave.set) == {"lost_frames": 9, "average": 2}
    assert (bow.stature_m, bow.start_s, bow.background) == ((1.64,), 3.0, None)
    assert bow.silhouettes == "person_in_view"
    assert (given.stature_m, given.start_s) == ((1.7,), None)
    assert dict(given.set) == dict(bow.set) == {"lost_frames": 9, "average": 3}


def test_a_measured_person_takes_the_place_of_a_stature(tmp_path: Path) -> None:
    (tmp_path / "a.options").write_text("--model a.yaml --start 2 --detector points.csv")
    (tmp_path / "points.csv").touch()
    (tmp_path / "b.options").write_text("--detector mediapipe")
    given = line("in", "--stature", "1.7", "--distance", "2", "--camera-pitch-deg", "5")
    found = with_own_options(given, tmp_path, "a")
    assert (found.stature_m, found.distance_m, found.camera_pitch_deg) == (None, None, None)
    # A path begins at the folder of its file.
    assert found.model == tmp_path / "a.yaml"
    assert found.detector == str(tmp_path / "points.csv")
    assert with_own_options(given, tmp_path, "b").detector == "mediapipe"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("--efort 2", "unrecognized arguments: --efort"),
        ("--csv out.csv", "unrecognized arguments: --csv"),
        ("film.mp4", "unrecognized arguments: film.mp4"),
        ("--start soon", "got 'soon'"),
        ("--model 'a.yaml", "No closing quotation"),
    ],
)
def test_mistakes_name_the_file(tmp_path: Path, text: str, expected: str) -> None:
    (tmp_path / "a.options").write_text(text)
    with pytest.raises(CardboxError, match=expected) as caught:
        with_own_options(line("in"), tmp_path, "a")
    assert "a.options" in str(caught.value)
