"""What is tracked, decided from the options: a frozen request, or one error.

The error names all that are missing or contradict each other. Nothing below this folder knows
options, only the request and its parts.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from cardbox_tracker.camera.pairing import camera_names
from cardbox_tracker.commands.request import AUTO, RecordingOptions, Request, TrackingOptions
from cardbox_tracker.common.errors import CardboxError, quoted
from cardbox_tracker.common.extensions import DETECTORS, extensions, loaded
from cardbox_tracker.common.settings import NoEffectError, nested
from cardbox_tracker.detectors.detector import MEDIAPIPE, Detector
from cardbox_tracker.detectors.model_files import installed_hands
from cardbox_tracker.detectors.own_network import OwnModel
from cardbox_tracker.detectors.person_choice import PersonChoice
from cardbox_tracker.detectors.point_table import PointTable
from cardbox_tracker.measuring.scene import Scene, load_scene
from cardbox_tracker.measuring.scene_camera import in_scene
from cardbox_tracker.person.model import MEASURED, PLACE, BodyModel, body_from_proportions
from cardbox_tracker.person.model_file import load_body_model
from cardbox_tracker.person.proportions import USUAL_STATURE_M
from cardbox_tracker.recordings.given_camera import FOV_HINT, GivenCamera
from cardbox_tracker.recordings.open_images import check_exists, is_bag, is_film, tells_lens
from cardbox_tracker.recordings.other_silhouettes import PersonInView, Within
from cardbox_tracker.recordings.recording import STEREO, FurtherFilm, RecordingRequest, Segmentation
from cardbox_tracker.recordings.silhouettes import TimeSpan
from cardbox_tracker.search.config import PRESETS, TrackerConfig, read_settings
from cardbox_tracker.tracking.session import MOST_PEOPLE
from cardbox_tracker.tracking.smoother import LAG_S, OF_RECORDINGS, Smoothing

S = TypeVar("S")
T = TypeVar("T")

_EFFORT = "whole_body.effort"
# Options of which one alone may be given, and why.
_EXCLUDE = (
    ("--scene", "--model", "have the camera's pitch"),
    ("--fov", "--calibration", "describe the lens"),
    ("--fov", "--webcam", "describe the lens"),
    ("--webcam", "--calibration", "describe the lens"),
    ("--detector", "--detector-class", "name a detector"),
    ("--stature", "--model", "say who is tracked"),
)


@dataclass(frozen=True)
class PersonRequest:
    """The person to track."""

    body: BodyModel  #: the person; the mean sizes of people of the given stature without ``model``
    model: Path | None  #: the file of a measured person; None if only the stature is given
    start_s: float  #: seconds from the recording's start at which tracking starts
    is_pitch_given: bool  #: whether ``body`` has the camera's pitch; else it is to be found
    end_s: float = math.inf  #: the same at which it ends; inf for the end of the recording
    #: number of people to track, 0 for all who come; None for one without a number
    people: int | None = None
    others: tuple[BodyModel, ...] = ()  #: the bodies of the second and further people
    scene: Scene | None = None  #: a scene with these people, whose camera nothing else tells
    number: int = 1  #: whose results commands use that use those of one
    choice: PersonChoice | None = None  #: who alone is tracked of all who come
    statures_m: tuple[float, ...] = ()  #: the statures that are given, by number

    @property
    def stature_m(self) -> float | None:
        """The stature that is given, of the first person; None without one."""
        return self.statures_m[0] if self.statures_m else None


class TrackFiles(NamedTuple):
    """Files to write; None for one that is not wanted."""

    #: one row for each image, see :func:`~.recordings.result_table.result_table`
    table: Path | None = None
    video: Path | None = None  #: overlay video, at the rate and the resolution of the recording
    bag: Path | None = None  #: folder of a bag with the topics of the tracker
    body: Path | None = None  #: the body that was tracked
    scene: Path | None = None  #: camera, floor and people (:mod:`~cardbox_tracker.measuring.scene`)
    hides_heads: bool = False  #: whether heads are hidden in pictures of people


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
    smoothing: Smoothing = OF_RECORDINGS  #: how the results are smoothed over time
    files: TrackFiles = TrackFiles()  #: results to write
    force: bool = False  #: whether an existing bag is replaced

    @property
    def has(self) -> dict[str, bool]:
        """What the results have, for :func:`~.recordings.result_table.units`."""
        return {
            "has_points": self.recording.points is not None,
            "has_people": self.person.people is not None,
            "has_hands": self.hands is not None,
            "is_smoothed": self.smoothing.lag_s > 0.0,
            "has_rates": self.smoothing.has_rates,
        }


class Problems:
    """What is wrong with options, collected for one error; values of wrong ones do not matter."""

    def __init__(self, recording: Path, faults: Iterable[str] = ()) -> None:
        self._recording = recording
        self._missing: dict[str, str] = {}
        self._faults = list(faults)

    def miss(self, option: str, hint: str = "") -> None:
        """Note that an ``option`` is missing; ``hint`` helps to choose its value."""
        self._missing[option] = hint

    def add(self, *faults: str) -> None:
        """Note faults."""
        self._faults += faults

    def exclude(self, asked: RecordingOptions) -> None:
        """Note options that exclude each other."""
        given = asked.given()
        for one, other, why in _EXCLUDE:
            if one in given and other in given:
                self.add(f"{one} and {other} both {why}: leave one of them out")

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
            hints = "; ".join(filter(None, self._missing.values()))
            faults.insert(0, f"{self._recording} needs {needed}{f' ({hints})' if hints else ''}")
        if faults:
            raise CardboxError("; also, ".join(faults))


def recording_request(
    asked: RecordingOptions, problems: Problems, people: int | None = None
) -> RecordingRequest:
    """Return the recording that is asked for; note what is wrong.

    ``people`` is the number of people to track, 0 for all who come; None for one without a number.
    """
    problems.caught(lambda: check_exists(asked.recording), None)
    problems.exclude(asked)
    camera = _camera(asked, problems)
    points: Detector | PointTable | None = None
    if asked.detector is not None or asked.detector_class is not None:
        points = problems.caught(lambda: points_named(asked.detector, asked.detector_class), None)
    silhouettes = _silhouettes(asked, points, problems)
    has_detector = points is not None or isinstance(silhouettes, Detector)
    problems.add(*_person_faults(asked.person, people, has_detector))
    if isinstance(asked.person, PersonChoice):
        people = 0
    names: tuple[str, ...] = ()
    names = problems.caught(lambda: tuple(camera_names(asked.cameras)), names)
    request = RecordingRequest(
        asked.recording,
        _seeing(silhouettes, people),
        names,
        asked.extrinsics,
        asked.depth,
        _seeing(points, people),
        camera,
        _further(asked, camera, problems),
        asked.statures_m if isinstance(asked, TrackingOptions) else (),
    )
    problems.add(*request.faults())
    if asked.extrinsics is not None and len(names) < 2 and not request.films:
        problems.add("--extrinsics has no effect with one camera: name several with --cameras")
    return request


def _films(asked: RecordingOptions) -> tuple[Path, ...]:
    """Return the further films, which only a Request has."""
    return asked.films if isinstance(asked, Request) else ()


def _further(
    asked: RecordingOptions, camera: GivenCamera, problems: Problems
) -> tuple[FurtherFilm, ...]:
    """Return the further films that are asked for, each with its camera and offset."""
    if not isinstance(asked, Request):
        return ()
    count = len(asked.films)
    fovs_deg = asked.fovs_deg[1:] if len(asked.fovs_deg) > 1 else (camera.fov_deg,) * count
    offsets_s: tuple[float | None, ...] = asked.offset_s or (None,) * count
    if len(offsets_s) != count:
        problems.add(f"--offset has {len(offsets_s)} values: give one for each film but the first")
    found = tuple(
        FurtherFilm(path, replace(camera, fov_deg=fov_deg), offset_s)
        for path, fov_deg, offset_s in zip(asked.films, fovs_deg, offsets_s, strict=False)
    )
    for film in found:
        problems.caught(partial(check_exists, film.path), None)
        problems.caught(film.camera.check, None)
    return found


def _person_faults(person: object, people: int | None, has_detector: bool) -> Iterator[str]:
    if person is None:
        return
    if isinstance(person, int) != (people is not None):
        yield (
            "--person K is the number of one of several people, whom only --people tracks; without "
            "--people give left, right, largest or X,Y"
        )
    elif people is None and not has_detector:
        yield "--person needs a detector that finds people: give --detector mediapipe"


def _seeing(source: Any, people: int | None) -> Any:
    """Return a source of silhouettes or points that finds several people if they are asked for."""
    if people is not None and isinstance(source, Detector | PointTable):
        return source._replace(people=people or MOST_PEOPLE)
    return source


def inputs_of(asked: RecordingOptions) -> tuple[Path, ...]:
    """Return the files and folders that the options of a recording or of tracking name."""
    names = "recording", "extrinsics", "calibration", "detector", "model", "scene", "settings"
    given = (*(getattr(asked, name, None) for name in names), *_films(asked))
    # A detector may also be a word, which names no file, or an object.
    return tuple(Path(path) for path in given if path and isinstance(path, str | Path))


def tracking_request(asked: TrackingOptions, faults: Iterable[str] = ()) -> TrackingRequest:
    """Return what is tracked; CardboxError has all that is wrong, beside known ``faults``."""
    problems = Problems(asked.recording, faults)
    scene = None
    if asked.scene is not None:
        scene = problems.caught(partial(load_scene, asked.scene), None)
    given_deg = asked.fov_deg
    if scene is not None:
        asked = _with_camera(asked, scene)
    people = 0 if asked.people == AUTO else asked.people
    assert not isinstance(people, str)
    recording = recording_request(asked, problems, people)
    if scene is not None and asked.fov_deg != given_deg:
        fov = scene.camera.fov_rad
        recording = replace(recording, camera=recording.camera.seeing(fov.mean, fov.stddev))
    person = _person(asked, people, problems, scene)
    problems.add(*_tracking_faults(asked, people, isinstance(recording.points, Detector)))
    preset = PRESETS[asked.preset]()
    config = problems.caught(lambda: _config(asked, preset), preset)
    hands = problems.caught(installed_hands, None) if asked.hands else None
    problems.check()
    of = recording, person, asked.preset, config, asked.seed, inputs_of(asked), hands
    # The paper's filter is what the paper says.
    lag_s = 0.0 if asked.causal or asked.preset == "paper" else LAG_S
    smoothing = Smoothing(lag_s, has_rates=asked.rates, longest_gap_s=asked.fill_gaps_s or 0.0)
    return TrackingRequest(*of, smoothing)


def _tracking_faults(
    asked: TrackingOptions, people: int | None, has_detector: bool
) -> Iterator[str]:
    is_more = len(asked.cameras) > 1 or asked.depth is not None or bool(_films(asked))
    if is_more and not PRESETS[asked.preset]().has_several_views:
        yield (
            f"--preset {asked.preset} uses the silhouette of one camera; give --preset default "
            "with several cameras or with --depth"
        )
    if asked.causal or asked.preset == "paper":
        why = "--causal" if asked.causal else f"--preset {asked.preset}"
        for flag in sorted({"--rates", "--fill-gaps"} & asked.given().keys()):
            yield f"{flag} comes from the smoothing, which {why} leaves out: give one of them"
    if asked.hands and not has_detector:
        yield "--hands needs the detector's wrists and knuckles: give --detector mediapipe"
    count = len(asked.statures_m)
    if people is None:
        if count > 1:
            yield "--stature has several values: give one, or --people"
        return
    if asked.depth is not None:
        yield "--people tracks without --depth: leave it out"
    if asked.preset != "default":
        yield f"--people needs the preset default, not {asked.preset}"
    if asked.model is not None:
        yield "--people takes the stature of each person: give --stature, not --model"
    if 0 < people < count:
        yield f"--stature has {count} values for --people {people}: leave some out"
    if 0 < people < asked.number:
        yield f"--person {asked.number} is none of {people} people"


def _camera(asked: RecordingOptions, problems: Problems) -> GivenCamera:
    roll_deg = asked.camera_roll_deg
    roll_rad = None if roll_deg is None else math.radians(roll_deg)
    if len(asked.fovs_deg) not in (0, 1, 1 + len(_films(asked))):
        problems.add(f"--fov has {len(asked.fovs_deg)} values: give one, or one for each film")
    fov_deg = asked.fovs_deg[0] if asked.fovs_deg else None
    given = fov_deg, asked.calibration, roll_rad, asked.fps, asked.mirrored, asked.webcam
    camera = GivenCamera(*given)
    if not (camera.is_calibrated or _is_guessed(asked) or tells_lens(asked.recording)):
        hint = f"--fov is across the width of the image: {FOV_HINT}"
        problems.miss("--fov DEG or --calibration FILE", hint)
    else:
        problems.caught(camera.check, None)
    return camera


def _is_guessed(asked: RecordingOptions) -> bool:
    """Whether lens and stature that nothing tells are guessed, since a detector sees the person."""
    has_detector = asked.detector is not None or asked.detector_class is not None
    return has_detector and is_film(asked.recording)


def _silhouettes(
    asked: RecordingOptions, points: Detector | PointTable | None, problems: Problems
) -> Segmentation:
    """Return the source of the silhouettes that is given, or that fits the recording."""
    chosen = asked.silhouettes
    is_given = asked.background is not None or asked.within_m is not None
    if chosen is None and not is_given:
        if isinstance(points, Detector) or asked.detector == MEDIAPIPE:
            chosen = "detector"
        elif not is_bag(asked.recording):
            chosen = "person_in_view"
    if chosen not in ("detector", "person_in_view"):
        return _by_scene(asked, problems)
    if is_given:
        problems.add(
            f"--silhouettes {chosen} takes the place of --background and --within: leave them out"
        )
    if chosen == "person_in_view":
        return PersonInView()
    if isinstance(points, Detector):
        return points
    return problems.caught(Detector.installed, PersonInView())


def _by_scene(asked: RecordingOptions, problems: Problems) -> Segmentation:
    """Return the span of the empty scene, or the limit of the depth."""
    background, within_m, depth = asked.background, asked.within_m, asked.depth
    if within_m is not None:
        if background is not None or asked.silhouettes is not None:
            other = "--background" if asked.silhouettes is None else "--silhouettes background"
            problems.add(f"{other} and --within exclude each other: leave one of them out")
        elif depth in (None, STEREO):
            problems.add("--within needs the topic of depth images: give --depth TOPIC")
        else:
            return Within(depth, within_m)
    elif background is not None:
        return TimeSpan(*background)
    else:
        problems.miss(
            "--background T0:T1 or --within M or --silhouettes detector|person_in_view",
            "nobody is in view from T0 to T1, seconds; all that is nearer than M metres in the "
            "images of --depth is the person",
        )
    return PersonInView()


def points_named(given: object, class_name: str | None = None) -> Detector | PointTable:
    """Return the source of 2D points.

    ``given`` is a detector's name, a path, or one's own detector or its class; ``class_name``
    imports such a class, as ``MODULE:CLASS``.
    """
    if class_name is not None:
        if os.getcwd() not in sys.path:
            # Last, so that nothing there takes the place of an installed module.
            sys.path.append(os.getcwd())
        own = loaded(EntryPoint("--detector-class", class_name, DETECTORS))
        return Detector(OwnModel.of(own, class_name))
    if isinstance(given, Detector):
        return given
    if not isinstance(given, str | Path):
        return Detector(OwnModel.of(given, f"the detector {type(given).__name__}"))
    if given == MEDIAPIPE:
        return Detector.installed()
    added = extensions(DETECTORS, (MEDIAPIPE,))
    if given in added:
        return Detector(OwnModel.of(loaded(added[str(given)]), f"the detector {given}"))
    path = Path(given)
    if not path.exists():
        raise CardboxError(
            f"--detector is {quoted(str(given))}; expected {', '.join((MEDIAPIPE, *added))}, or "
            "points in a table, in a file of COCO, or in a folder of OpenPose (docs/detectors.md)"
        )
    return PointTable(path)


def _with_camera(asked: TrackingOptions, scene: Scene) -> TrackingOptions:
    """Return the options with what the scene says of a film's camera where they say nothing."""
    found, camera = dict[str, float](), scene.camera
    if is_film(asked.recording) and not {"--fov", "--calibration", "--webcam"} & {*asked.given()}:
        found["fov_deg"] = math.degrees(camera.fov_rad.mean)
    if asked.camera_roll_deg is None and camera.roll_rad.mean:
        found["camera_roll_deg"] = math.degrees(camera.roll_rad.mean)
    return replace(asked, **found)  # type: ignore[arg-type]


def _person(
    asked: TrackingOptions, people: int | None, problems: Problems, scene: Scene | None
) -> PersonRequest:
    statures_m, pitch_deg = asked.statures_m, asked.camera_pitch_deg
    is_of_scene = scene is not None and bool(scene.people) and not statures_m
    if scene is not None and is_of_scene:
        bodies = [replace(one, is_distance_found=one.source != MEASURED) for one in scene.people]
    else:
        bodies = _bodies(asked, problems)
    if scene is not None and pitch_deg is None:
        # Degrees have not the same digits as the radians of the people of the scene.
        known_rad = [one.camera_pose.pitch_rad for one in bodies]
        bodies = [in_scene(one, scene.camera) for one in bodies]
        bodies = [
            one.with_values(camera_pitch_rad=before_rad)
            if math.isclose(before_rad, one.camera_pose.pitch_rad, rel_tol=1e-12)
            else one
            for one, before_rad in zip(bodies, known_rad, strict=True)
        ]
    elif is_of_scene and pitch_deg is not None:
        moved = {"camera_pitch_rad": math.radians(pitch_deg), "unknown": PLACE}
        bodies = [one.with_values(**moved) for one in bodies]
    start_s, end_s = asked.start_s or 0.0, math.inf if asked.end_s is None else asked.end_s
    if end_s <= start_s:
        problems.add(f"--end {end_s:g} is not after --start {start_s:g}: give a later second")
    return PersonRequest(
        bodies[0],
        asked.scene if is_of_scene else asked.model,
        start_s,
        is_pitch_given=asked.model is not None or pitch_deg is not None or scene is not None,
        end_s=end_s,
        people=people,
        others=tuple(bodies[1:]),
        number=asked.number,
        statures_m=statures_m,
        scene=scene if is_of_scene and pitch_deg is None else None,
        choice=asked.person if isinstance(asked.person, PersonChoice) else None,
    )


def _bodies(asked: TrackingOptions, problems: Problems) -> list[BodyModel]:
    """Return the measured person, or people of the given statures."""
    statures_m, pitch_deg = asked.statures_m, asked.camera_pitch_deg
    if asked.model is not None:
        return [BodyModel() if statures_m else _measured(asked, asked.model, problems)]
    if not statures_m and not _is_guessed(asked):
        problems.miss("--stature M or --model FILE")
        return [BodyModel()]
    pitch_rad = math.radians(pitch_deg or 0.0)
    return problems.caught(
        lambda: [
            body_from_proportions(one, asked.distance_m, camera_pitch_rad=pitch_rad)
            for one in statures_m or (USUAL_STATURE_M,)
        ],
        [BodyModel()],
    )


def _measured(asked: TrackingOptions, model: Path, problems: Problems) -> BodyModel:
    for flag in sorted({"--distance", "--camera-pitch-deg"} & asked.given().keys()):
        problems.add(f"{flag} has no effect with --model, which contains it")
    body = problems.caught(lambda: load_body_model(model), BodyModel())
    if asked.start_s is None and body.source == MEASURED:
        problems.miss("--start T", "a measured person stands as for --front at T")
    return body


def _config(asked: TrackingOptions, preset: TrackerConfig) -> TrackerConfig:
    config = preset if asked.depth is None else preset.with_depth()
    if asked.settings is not None:
        config = read_settings(asked.settings, config)
    given = dict(asked.set or {})
    if asked.effort is not None:
        given[_EFFORT] = asked.effort
    try:
        return config.changed(nested(given))
    except NoEffectError as error:
        instead = "--effort" if error.instead == _EFFORT else f"--set {error.instead}=VALUE"
        name = error.name if error.name in (asked.set or {}) else "--effort"
        raise CardboxError(f"{name} has no effect {error.where}; use {instead}") from None
    except ValueError as error:
        raise CardboxError(str(error).replace(_EFFORT, "--effort")) from None
