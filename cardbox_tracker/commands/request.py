"""The options of ``cardbox track`` and its relatives, read once into a frozen request.

One error names all that are missing or contradict each other. Nothing below this folder knows
options, only the request and its parts.
"""

from __future__ import annotations

import argparse
import copy
import math
import os
import shlex
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import EntryPoint
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import Any, NamedTuple, NoReturn, TypeVar

from cardbox_tracker.camera.pairing import camera_names
from cardbox_tracker.commands.arguments import (
    add_camera_pitch,
    add_preset,
    add_seed,
    between,
    parsed,
    span,
    time,
)
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.extensions import DETECTORS, extensions, loaded
from cardbox_tracker.common.files import foreign, read_regular
from cardbox_tracker.common.settings import NoEffectError, nested, settings_of
from cardbox_tracker.detectors.detector import MEDIAPIPE, Detector
from cardbox_tracker.detectors.model_files import installed_hands
from cardbox_tracker.detectors.own_network import OwnModel
from cardbox_tracker.detectors.person_choice import PersonChoice
from cardbox_tracker.detectors.point_table import PointTable
from cardbox_tracker.measuring.scene import Scene, load_scene
from cardbox_tracker.person.model import MEASURED, BodyModel, body_from_proportions
from cardbox_tracker.person.model_file import load_body_model
from cardbox_tracker.person.proportions import USUAL_STATURE_M
from cardbox_tracker.recordings.given_camera import FOV_HINT, GivenCamera
from cardbox_tracker.recordings.open_images import check_exists, is_bag, is_film, tells_lens
from cardbox_tracker.recordings.other_silhouettes import PersonInView, Within
from cardbox_tracker.recordings.recording import STEREO, RecordingRequest, Segmentation
from cardbox_tracker.recordings.silhouettes import TimeSpan
from cardbox_tracker.search.config import PRESETS, TrackerConfig, read_settings
from cardbox_tracker.search.whole_body_config import WholeBodyConfig
from cardbox_tracker.tracking.session import MOST_PEOPLE

S = TypeVar("S")
T = TypeVar("T")

OPTIONS_ENDING = ".options"
"""Ending of the files beside the recordings of a folder that have options for them."""

_MOST_ROLL_DEG, _MOST_FPS = 180.0, 1000.0
_MOST_BYTES = 64 * 1024
_EFFORT = "whole_body.effort"
# An option of a file takes the place of these, which do not go with it.
_REPLACED = MappingProxyType(
    {
        "model": ("stature", "distance", "camera_pitch_deg"),
        "stature": ("model",),
        "background": ("within", "silhouettes"),
        "within": ("background", "silhouettes"),
        "silhouettes": ("background", "within"),
        "fov": ("calibration",),
        "calibration": ("fov",),
    }
)


@dataclass(frozen=True)
class PersonRequest:
    """The person to track."""

    body: BodyModel  #: the person; the mean sizes of people of the given stature without ``model``
    model: Path | None  #: the file of a measured person; None if only the stature is given
    start_s: float  #: seconds from the recording's start at which tracking starts
    is_pitch_given: bool  #: whether ``body`` has the camera's pitch; else it is to be found
    #: the stature that is given, of the first person; None with ``model``
    stature_m: float | None = None
    end_s: float = math.inf  #: the same at which it ends; inf for the end of the recording
    #: number of people to track, 0 for all who come; None for one without a number
    people: int | None = None
    others: tuple[BodyModel, ...] = ()  #: the bodies of the second and further people
    number: int = 1  #: whose results commands use that use those of one
    statures_m: tuple[float, ...] = ()  #: the statures that are given, by number


TABLES = ("csv", "parquet")
FORMATS = (*TABLES, "mp4", "bag")
"""Results of a recording: a table in one of two formats, a video, a bag."""


class TrackFiles(NamedTuple):
    """Files to write; None for one that is not wanted."""

    #: one row for each image, see :func:`~.recordings.result_table.result_table`
    table: Path | None = None
    video: Path | None = None  #: overlay video, at the rate and the resolution of the recording
    bag: Path | None = None  #: folder of a bag with the topics of the tracker
    body: Path | None = None  #: the body that was tracked
    scene: Path | None = None  #: camera, floor and people (:mod:`~cardbox_tracker.measuring.scene`)


@dataclass(frozen=True)
class TrackingRequest:
    """A recording to track."""

    recording: RecordingRequest  #: what is read
    person: PersonRequest  #: who is tracked
    preset: str  #: name of the settings that ``config`` changes
    config: TrackerConfig  #: settings of the tracker
    seed: int  #: random seed of the filters
    inputs: tuple[Path, ...]  #: files and folders that are read, which no result may replace
    #: network file that finds the points of hands; None if they are not measured
    hands: Path | None = None
    files: TrackFiles = TrackFiles()  #: results to write
    force: bool = False  #: whether an existing bag is replaced


class ClassName(str):
    """Module and name of a class, ``MODULE:CLASS``, which only a command line may give."""


class Problems:
    """What is wrong with options, collected for one error; values of wrong ones do not matter."""

    def __init__(self, recording: Path, faults: Iterable[str] = ()) -> None:
        self._recording = recording
        self._missing: list[str] = []
        self._hints: list[str] = []
        self._faults = list(faults)

    def miss(self, option: str, hint: str = "") -> None:
        """Note that an ``option`` is missing; ``hint`` helps to choose its value."""
        self._missing.append(option)
        if hint:
            self._hints.append(hint)

    def add(self, fault: str) -> None:
        """Note a fault."""
        self._faults.append(fault)

    def caught(self, function: Callable[[], T], otherwise: S) -> T | S:
        """Return the result of a function; note its CardboxError and return ``otherwise``."""
        try:
            return function()
        except CardboxError as error:
            self.add(str(error))
            return otherwise

    def check(self) -> None:
        """Raise CardboxError if there was a problem."""
        faults = list(dict.fromkeys(self._faults))
        if self._missing:
            *most, last = self._missing
            needed = f"{', '.join(most)}, and {last}" if most else last
            hints = f" ({'; '.join(self._hints)})" if self._hints else ""
            faults.insert(0, f"{self._recording} needs {needed}{hints}")
        if faults:
            raise CardboxError("; also, ".join(faults))


def add_recording(parser: argparse.ArgumentParser, required: bool = True) -> None:
    """Add the options for a recording of any kind, read by :func:`recording_request`."""
    add = parser.add_argument
    add(
        "recording",
        type=Path,
        nargs=None if required else "?",
        metavar="RECORDING",
        help="rosbag2 folder or file, video, or folder of JPEG or PNG images",
    )
    add("--background", type=span, metavar="T0:T1", help="seconds during which nobody is in view")
    add(
        "--cameras",
        nargs="+",
        default=[],
        metavar="NAMESPACE",
        help="cameras of the recording that see the person, such as cam0 cam1, the one that the "
        "person faced first; with one name, that camera alone",
    )
    add(
        "--extrinsics",
        type=Path,
        metavar="FILE",
        help="where further cameras stand, from Kalibr (YAML) or aniposelib (TOML), if the "
        "recording does not tell",
    )
    add(
        "--depth",
        metavar="TOPIC",
        help="depth images of the same view as the first of --cameras; 'stereo' measures depth in "
        "the first two of them, a rectified pair, left first",
    )
    add(
        "--within",
        type=float,
        metavar="M",
        help="in place of --background: all that is nearer in the images of --depth, metres, is "
        "the person",
    )
    add(
        "--silhouettes",
        choices=("background", "detector", "person_in_view"),
        help="what tells the person from the scene: the empty scene of --background; the mask of a "
        "person detector, the default with --detector mediapipe; or a scene that is learned around "
        "the person, who must step aside at some time, the default for other films",
    )
    detector = parser.add_mutually_exclusive_group()
    detector.add_argument(
        "--detector",
        metavar="mediapipe|FILE|FOLDER",
        help="also use 2D points of the person's joints: those of MediaPipe's networks ('cardbox "
        "detector --install'), or those that any detector has written: a table FILE.csv, FILE.json "
        "of COCO, or a folder of OpenPose's files (docs/detectors.md)",
    )
    detector.add_argument(
        "--detector-class",
        dest="detector",
        type=ClassName,
        metavar="MODULE:CLASS",
        help="the same of a class of your own with a function detect(image) (docs/extending.md)",
    )
    add(
        "--person",
        type=_person_choice,
        metavar="left|right|largest|X,Y|K",
        help="with --detector mediapipe: whom of several people to follow: the left or right one "
        "in the image, the largest, or the one at column X and row Y. With --people: the number of "
        "the one whose results are used, if not all are",
    )
    add(
        "--fov",
        type=float,
        metavar="DEG",
        help="field of view across the width of the image as it is shown: webcams 60 to 78, phones "
        "60 to 75 held sideways and 36 to 46 upright. Without it, what a phone wrote into the "
        "file, or else, with --detector, 65 degrees along the longer side",
    )
    add(
        "--calibration",
        type=Path,
        metavar="FILE",
        help="in place of --fov: file of camera_calibration, OpenCV's FileStorage or Kalibr",
    )
    add(
        "--camera-roll-deg",
        type=between(-_MOST_ROLL_DEG, _MOST_ROLL_DEG),
        metavar="R",
        help="how far the camera is turned clockwise, seen from behind it, 180 if its top is "
        "below; images are turned back",
    )
    add(
        "--mirrored",
        action="store_true",
        help="the images are mirrored, as some programs do with those of a front camera; they are "
        "turned back",
    )
    add(
        "--fps",
        type=between(0.0, _MOST_FPS),
        metavar="HZ",
        help="images a second of a folder of images (default: 30), or of a video in slow motion",
    )


def add_tracking(parser: argparse.ArgumentParser, needs_recording: bool = True) -> None:
    """Add the options for recording, person and settings, read by :func:`tracking_request`."""
    add_recording(parser, needs_recording)
    add = parser.add_argument
    add(
        "--model",
        type=Path,
        metavar="MODEL.yaml",
        help="the person, from 'cardbox initialize', the node initializer, or 'cardbox body'",
    )
    add(
        "--stature",
        type=parsed(_statures, "metres, or those of each person as in 1.75,1.62"),
        metavar="M[,M...]",
        help="in place of --model: height of the person, metres, crown to floor; sizes are the "
        "mean ones of people of that stature. With --people, one for each of them in turn, or one "
        "for all. Of films with --detector, the mean stature of adults is taken without both",
    )
    add(
        "--scene",
        type=Path,
        metavar="OUT.scene.yaml",
        help="camera, and without --stature and --model also people, of another recording of the "
        "same camera, as 'cardbox track' wrote them beside its table",
    )
    add(
        "--people",
        type=_count,
        metavar="N|auto",
        help="track N people, or all who come (up to 6); they are numbered as "
        "they come, and from left to right if they come together",
    )
    add(
        "--distance",
        type=float,
        metavar="M",
        help="with --stature: from the camera to the person, metres along the floor; without it, "
        "it is found from the first images",
    )
    add_camera_pitch(parser, "with --stature, found from the person who stands upright at --start")
    add(
        "--start",
        type=time,
        metavar="T",
        help="second at which the person stands as for --front; tracking starts there. With "
        "--stature, or a body that was not measured, any posture will do (default: 0)",
    )
    add("--end", type=time, metavar="T", help="second at which tracking ends (default: the last)")
    add_preset(parser)
    effort = settings_of(WholeBodyConfig)["effort"]
    add(
        "--effort",
        type=float,
        metavar="X",
        help=f"{effort.description}; {effort.range_text}; for the preset default",
    )
    add(
        "--set",
        action="append",
        type=parsed(_setting, "NAME=VALUE, such as lost_frames=10"),
        metavar="NAME=VALUE",
        help="another setting of the tracker by its name in docs/parameters.md, such as "
        "lost_frames=10; may be given several times",
    )
    add(
        "--settings",
        type=Path,
        metavar="FILE.yaml",
        help="file of such settings; --set and --effort take precedence over it",
    )
    add_seed(parser, "the filters")


def _statures(text: str) -> tuple[float, ...]:
    return tuple(map(float, text.split(",")))


def _count(text: str) -> int:
    if text == "auto":
        return 0
    expected = f"auto or a number from 1 to {MOST_PEOPLE}"
    return parsed(int, expected, lambda count: 1 <= count <= MOST_PEOPLE)(text)


def _person_choice(text: str) -> PersonChoice | int:
    if text.isdecimal() and int(text) > 0:
        return int(text)

    try:
        return PersonChoice.parse(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _setting(text: str) -> tuple[str, bool | int | float | str]:
    """Parse ``NAME=VALUE``; a value is true or false, a number, or a text."""
    name, _, value = text.partition("=")
    if not name or "=" not in text:
        raise ValueError
    if value in ("true", "false"):
        return name, value == "true"
    for kind in (int, float):
        with suppress(ValueError):
            return name, kind(value)
    return name, value


def recording_request(options: argparse.Namespace, problems: Problems) -> RecordingRequest:
    """Return what the options of :func:`add_recording` ask for; note what is wrong with them."""
    path, depth = options.recording, options.depth
    problems.caught(lambda: check_exists(path), None)
    camera = _camera(options, problems)
    points: Detector | PointTable | None = None
    if options.detector is not None:
        points = problems.caught(lambda: points_named(options.detector), None)
    silhouettes = _silhouettes(options, points, problems)
    people = getattr(options, "people", None)
    if isinstance(options.person, int) != (people is not None) and options.person is not None:
        problems.add(
            "--person K is the number of one of several people, whom only --people tracks; without "
            "--people give left, right, largest or X,Y"
        )
    elif options.person is not None and people is None:
        if not any(isinstance(one, Detector) for one in (silhouettes, points)):
            problems.add("--person needs a detector that finds people: give --detector mediapipe")
        if isinstance(silhouettes, Detector):
            silhouettes = silhouettes._replace(person=options.person)
        if isinstance(points, Detector):
            points = points._replace(person=options.person)
    if people is not None:
        if isinstance(silhouettes, Detector):
            silhouettes = silhouettes._replace(people=people or MOST_PEOPLE)
        if points is not None:
            points = points._replace(people=people or MOST_PEOPLE)
    names: tuple[str, ...] = ()
    names = problems.caught(lambda: tuple(camera_names(options.cameras)), names)
    given = path, silhouettes, names, options.extrinsics, depth, points, camera
    request = RecordingRequest(*given)
    for fault in request.faults():
        problems.add(fault)
    if options.extrinsics is not None and len(names) < 2:
        problems.add("--extrinsics has no effect with one camera: name several with --cameras")
    return request


def inputs_of(options: argparse.Namespace) -> tuple[Path, ...]:
    """Return the files and folders that the options of a recording or of tracking name."""
    names = "recording", "extrinsics", "calibration", "detector", "model", "scene", "settings"
    given = (getattr(options, name, None) for name in names)
    # A detector may also be a word, which names no file, or an object.
    return tuple(Path(path) for path in given if path and isinstance(path, str | Path))


def tracking_request(options: argparse.Namespace, faults: Iterable[str] = ()) -> TrackingRequest:
    """Return what the options of :func:`add_tracking` ask for."""
    problems = Problems(options.recording, faults)
    scene = None
    if options.scene is not None:
        if options.model is not None:
            problems.add("--scene and --model both have the camera's pitch: leave one of them out")
        scene = problems.caught(lambda: load_scene(options.scene), None)
    if scene is not None:
        options = _with_camera(options, scene)
    recording = recording_request(options, problems)
    person = _person(options, problems, scene)
    preset = PRESETS[options.preset]()
    is_more = len(options.cameras) > 1 or options.depth is not None
    if is_more and not preset.has_several_views:
        problems.add(
            f"--preset {options.preset} uses the silhouette of one camera; give --preset default "
            "with several cameras or with --depth"
        )
    if options.people is not None and options.depth is not None:
        problems.add("--people tracks without --depth: leave it out")
    if options.people is not None and options.preset != "default":
        problems.add(f"--people needs the preset default, not {options.preset}")
    config = problems.caught(lambda: _config(options, preset), preset)
    has_detector = isinstance(recording.points, Detector)
    hands = None
    if getattr(options, "hands", False):
        if not has_detector:
            problems.add(
                "--hands needs the detector's wrists and knuckles: give --detector mediapipe"
            )
        hands = problems.caught(installed_hands, None)
    problems.check()
    return TrackingRequest(
        recording, person, options.preset, config, options.seed, inputs_of(options), hands
    )


def _camera(options: argparse.Namespace, problems: Problems) -> GivenCamera:
    roll_deg = options.camera_roll_deg
    roll_rad = None if roll_deg is None else math.radians(roll_deg)
    camera = GivenCamera(options.fov, options.calibration, roll_rad, options.fps, options.mirrored)
    if None not in (options.fov, options.calibration):
        problems.add("--fov and --calibration both describe the lens: leave one of them out")
    elif not (camera.is_calibrated or _is_guessed(options) or tells_lens(options.recording)):
        hint = f"--fov is across the width of the image: {FOV_HINT}"
        problems.miss("--fov DEG or --calibration FILE", hint)
    else:
        problems.caught(camera.check, None)
    return camera


def _is_guessed(options: argparse.Namespace) -> bool:
    """Whether lens and stature that nothing tells are guessed, since a detector sees the person."""
    return options.detector is not None and is_film(options.recording)


def _silhouettes(
    options: argparse.Namespace, points: Detector | PointTable | None, problems: Problems
) -> Segmentation:
    """Return the source of the silhouettes that is given, or that fits the recording."""
    chosen, within = options.silhouettes, options.within
    background: TimeSpan | None = options.background
    is_given = background is not None or within is not None
    has_masks = isinstance(points, Detector)
    if chosen is None and not is_given and (has_masks or options.detector == MEDIAPIPE):
        chosen = "detector"
    elif chosen is None and not is_given and not is_bag(options.recording):
        chosen = "person_in_view"
    if chosen in ("detector", "person_in_view"):
        if is_given:
            problems.add(
                f"--silhouettes {chosen} takes the place of --background and --within: leave them "
                "out"
            )
        if chosen == "detector":
            found = points if isinstance(points, Detector) else None
            return found or problems.caught(Detector.installed, PersonInView())
    elif not is_given:
        problems.miss(
            "--background T0:T1 or --within M or --silhouettes detector|person_in_view",
            "nobody is in view from T0 to T1, seconds; all that is nearer than M metres in the "
            "images of --depth is the person",
        )
    elif within is not None and (background is not None or chosen is not None):
        other = "--background" if chosen is None else "--silhouettes background"
        problems.add(f"{other} and --within exclude each other: leave one of them out")
    elif background is not None:
        return background
    elif options.depth in (None, STEREO):
        problems.add("--within needs the topic of depth images: give --depth TOPIC")
    else:
        return Within(options.depth, within)
    return PersonInView()


def points_named(given: object) -> Detector | PointTable:
    """Return the source of 2D points: a detector's name, a path, a class, or one's own detector."""
    if not isinstance(given, str | Path):
        return Detector(OwnModel.of(given, f"the detector {type(given).__name__}"))
    if given == MEDIAPIPE:
        return Detector.installed()
    added = extensions(DETECTORS, (MEDIAPIPE,))
    if isinstance(given, ClassName):
        if os.getcwd() not in sys.path:
            # Last, so that nothing there takes the place of an installed module.
            sys.path.append(os.getcwd())
        own = loaded(EntryPoint("--detector-class", given, DETECTORS))
        return Detector(OwnModel.of(own, given))
    if given in added:
        return Detector(OwnModel.of(loaded(added[str(given)]), f"the detector {given}"))
    path = Path(given)
    if not path.exists():
        raise CardboxError(
            f"--detector is {str(given)!r}; expected {', '.join((MEDIAPIPE, *added))}, or points "
            "in a table, in a file of COCO, or in a folder of OpenPose (docs/detectors.md)"
        )
    return PointTable(path)


def _with_camera(options: argparse.Namespace, scene: Scene) -> argparse.Namespace:
    """Return the options with what the scene says of a film's camera where they say nothing."""
    found, camera = copy.copy(options), scene.camera
    if is_film(options.recording) and options.fov is None and options.calibration is None:
        found.fov = math.degrees(camera.fov_rad.mean)
    if options.camera_roll_deg is None and camera.roll_rad.mean:
        found.camera_roll_deg = math.degrees(camera.roll_rad.mean)
    return found


def _person(
    options: argparse.Namespace, problems: Problems, scene: Scene | None = None
) -> PersonRequest:
    pitch_deg, body = options.camera_pitch_deg, BodyModel()
    others: list[BodyModel] = []
    if options.people is None and options.stature is not None and len(options.stature) > 1:
        problems.add("--stature has several values: give one, or --people")
    count = len(options.stature or ())
    if options.people and count > options.people:
        problems.add(f"--stature has {count} values for --people {options.people}: leave some out")
    if options.people is not None and options.model is not None:
        problems.add("--people takes the stature of each person: give --stature, not --model")
    is_of_scene = scene is not None and bool(scene.people) and options.stature is None
    if scene is not None and is_of_scene:
        # They may stand elsewhere now.
        unknown = "distance_m", "hip_height_m"
        body, *others = (one.with_values(unknown=unknown) for one in scene.people)
    elif options.model is None and options.stature is None and not _is_guessed(options):
        problems.miss("--stature M or --model FILE")
    elif None not in (options.model, options.stature):
        problems.add("--stature and --model both say who is tracked: leave one of them out")
    elif options.model is None:
        pitch_rad = math.radians(pitch_deg or 0.0)
        statures = options.stature or [USUAL_STATURE_M]
        body, *others = problems.caught(
            lambda: [
                body_from_proportions(one, options.distance, camera_pitch_rad=pitch_rad)
                for one in statures
            ],
            [body],
        )
    else:
        for flag, value in (("--distance", options.distance), ("--camera-pitch-deg", pitch_deg)):
            if value is not None:
                problems.add(f"{flag} has no effect with --model, which contains it")
        body = problems.caught(lambda: load_body_model(options.model), body)
        if options.start is None and body.source == MEASURED:
            problems.miss("--start T", "a measured person stands as for --front at T")
    is_pitch_given = options.model is not None or pitch_deg is not None or scene is not None
    if scene is not None and pitch_deg is None:
        pitch = scene.camera.pitch_rad
        tilt = {"camera_pitch_rad": pitch.mean, "pitch_stddev_rad": pitch.stddev}
        body, *others = (one.with_values(**tilt) for one in (body, *others))
    start_s, end_s = options.start or 0.0, math.inf if options.end is None else options.end
    if end_s <= start_s:
        problems.add(f"--end {end_s:g} is not after --start {start_s:g}: give a later second")
    number = options.person if isinstance(options.person, int) else 1
    if options.people and number > options.people:
        problems.add(f"--person {number} is none of {options.people} people")
    stature_m = None if options.stature is None else options.stature[0]
    several = options.people, tuple(others), number, tuple(options.stature or ())
    source = options.scene if is_of_scene else options.model
    return PersonRequest(body, source, start_s, is_pitch_given, stature_m, end_s, *several)


def _config(options: argparse.Namespace, preset: TrackerConfig) -> TrackerConfig:
    config = preset if options.depth is None else preset.with_depth()
    if options.settings is not None:
        config = read_settings(options.settings, config)
    given = dict(options.set or ())
    if options.effort is not None:
        given[_EFFORT] = options.effort
    try:
        return config.changed(nested(given))
    except NoEffectError as error:
        instead = "--effort" if error.instead == _EFFORT else f"--set {error.instead}=VALUE"
        name = error.name if error.name in dict(options.set or ()) else "--effort"
        raise CardboxError(f"{name} has no effect {error.where}; use {instead}") from None
    except ValueError as error:
        raise CardboxError(str(error).replace(_EFFORT, "--effort")) from None


def with_own_options(options: argparse.Namespace, folder: Path, name: str) -> argparse.Namespace:
    """Return the options of one recording of ``folder``.

    The file ``NAME.options`` beside a recording, or beside a folder of recordings, has options as
    they are typed. They change those of the command line, and inner files those of outer ones.
    Paths in a file begin at the folder of the file.
    """
    found = copy.copy(options)
    for part in reversed([PurePosixPath(name), *PurePosixPath(name).parents][:-1]):
        path = folder / f"{part}{OPTIONS_ENDING}"
        if not path.exists():
            continue
        given = _read_options(path)
        for option in given:
            vars(found).update(dict.fromkeys(_REPLACED.get(option, ())))
        if "set" in given:
            given["set"] = [*(found.set or []), *given["set"]]
        vars(found).update(given)
    return found


def _read_options(path: Path) -> dict[str, Any]:
    """Return the values of the options in a file, by their names in a namespace."""
    expected = "options of 'cardbox track' in UTF-8 as they are typed, such as --stature 1.75"
    with foreign(path, CardboxError, expected):
        words = shlex.split(read_regular(path, _MOST_BYTES).decode(), comments=True)

    class Parser(argparse.ArgumentParser):
        def error(self, message: str) -> NoReturn:
            raise CardboxError(f"{path}: {message}; give options of 'cardbox track'")

    parser = Parser(add_help=False, allow_abbrev=False)
    add_tracking(parser, needs_recording=False)
    values = argparse.Namespace(**dict.fromkeys(vars(parser.parse_args([]))))
    parser.parse_args(words, values)
    given = {name: value for name, value in vars(values).items() if value is not None}
    other = given.pop("recording", None)
    if other is not None:
        parser.error(f"unrecognized arguments: {other}")
    if isinstance(given.get("detector"), ClassName):
        parser.error("--detector-class would run code that data name; give it on the command line")
    for name, value in given.items():
        if isinstance(value, Path):
            given[name] = path.parent / value
        elif name == "detector" and (path.parent / value).exists():
            given[name] = str(path.parent / value)
    return given
