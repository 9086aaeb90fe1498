"""The options of ``cardbox track`` and its relatives, as fields from which they are generated.

A :class:`Request` of them is what Python asks for. Files of options have the same.
"""

from __future__ import annotations

import argparse
import os
import shlex
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import MISSING, dataclass, fields, replace
from math import isfinite
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import Any, Literal, NoReturn, TypeVar

from cardbox_tracker.commands.arguments import (
    Options,
    add_options,
    at_least,
    between,
    choice,
    one_of,
    option,
    parsed,
    span,
    time,
    whole,
)
from cardbox_tracker.common.errors import CardboxError, quoted
from cardbox_tracker.common.files import foreign, read_regular
from cardbox_tracker.common.settings import settings_of
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.own_network import FindsPeople
from cardbox_tracker.detectors.person_choice import PersonChoice
from cardbox_tracker.search.config import PRESETS
from cardbox_tracker.search.whole_body_config import WholeBodyConfig
from cardbox_tracker.tracking.session import MOST_PEOPLE

R = TypeVar("R", bound="Request")
Setting = bool | int | float | str
TABLES = ("csv", "parquet")
FORMATS = (*TABLES, "mp4", "bag")
"""Results of a recording: a table in one of two formats, a video, a bag."""
AUTO = "auto"
"""Given in place of a number of people: all who come."""
OPTIONS_ENDING = ".options"
"""Ending of the files beside the recordings of a folder that have options for them."""

# Images of so many seconds are kept until their gap is filled.
_MOST_GAP_S = 2.0
_MOST_ROLL_DEG, _MOST_FPS = 180.0, 1000.0
_MOST_BYTES = 64 * 1024
# An option of a file takes the place of these, which do not go with it.
_REPLACED = MappingProxyType(
    {
        "model": ("stature_m", "distance_m", "camera_pitch_deg"),
        "stature_m": ("model",),
        "background": ("within_m", "silhouettes"),
        "within_m": ("background", "silhouettes"),
        "silhouettes": ("background", "within_m"),
        "detector": ("detector_class",),
        "fov_deg": ("calibration", "webcam"),
        "calibration": ("fov_deg", "webcam"),
        "webcam": ("fov_deg", "calibration"),
    }
)


def _cameras(given: str | Iterable[str]) -> tuple[str, ...]:
    names = (given,) if isinstance(given, str) else map(str, given)
    return tuple(name for each in names for name in each.split(","))


def _detector(given: Any) -> Any:
    return os.fspath(given) if isinstance(given, os.PathLike) else given


def _person_choice(given: Any) -> PersonChoice | int:
    if isinstance(given, PersonChoice):
        return given
    text = ",".join(map(str, given)) if isinstance(given, tuple | list) else str(given)
    if text.isdecimal() and int(text) > 0:
        return int(text)
    try:
        return PersonChoice.parse(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _numbers(given: Any) -> tuple[float, ...]:
    parts = given.split(",") if isinstance(given, str) else given
    found = tuple(map(float, parts if isinstance(parts, Iterable) else (parts,)))
    if not all(map(isfinite, found)):
        raise ValueError
    return found


def _fovs(given: Any) -> float | tuple[float, ...]:
    found = _numbers(given)
    return found[0] if len(found) == 1 else found


def _films(given: Any) -> tuple[Path, ...]:
    return tuple(map(Path, (given,) if isinstance(given, str | os.PathLike) else given))


def _people(given: Any) -> int | str:
    if given == AUTO:
        return AUTO
    expected = f"{AUTO} or a number from 1 to {MOST_PEOPLE}"
    return parsed(whole, expected, lambda count: 1 <= count <= MOST_PEOPLE)(given)


def _setting(text: str) -> tuple[str, Setting]:
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


_EFFORT = settings_of(WholeBodyConfig)["effort"]
_NAMED = "NAME=VALUE, such as lost_frames=10"


@dataclass(frozen=True)
class RecordingOptions(Options):
    """A recording of any kind, and how it is read.

    Attributes:
        recording: rosbag2 folder or file, video, or folder of JPEG or PNG images
        background: seconds during which nobody is in view
        cameras: cameras of the recording that see the person, such as cam0 cam1, the one that the
            person faced first; with one name, that camera alone
        extrinsics: where further cameras stand, from Kalibr (YAML), aniposelib (TOML) or OpenCV's
            stereoCalibrate (FileStorage), if the recording does not tell
        depth: depth images of the same view as the first of --cameras; 'stereo' measures depth in
            the first two of them, a rectified pair, left first
        within_m: in place of --background: all that is nearer in the images of --depth, metres, is
            the person
        silhouettes: what tells the person from the scene: the empty scene of --background; the mask
            of a person detector, the default with --detector mediapipe; or a scene that is learned
            around the person, who must step aside at some time, the default for other films
        detector: also use 2D points of the person's joints: those of MediaPipe's networks ('cardbox
            detector --install'), or those that any detector has written: a table FILE.csv,
            FILE.json of COCO, or a folder of OpenPose's files (docs/detectors.md)
        detector_class: the same of a class of your own with a function detect(image)
            (docs/extending.md)
        person: with --detector: whom of several people to follow: the left or right one in the
            first image that shows two, the largest there, or the one who is first at column X and
            row Y; with @T, such as left@12.5, from second T on. With --people: the number of the
            one whose results are used, if not all are
        fov_deg: field of view across the width of the image as it is shown: webcams 60 to 78,
            phones 60 to 75 held sideways and 36 to 46 upright. Without it, what a phone wrote into
            the file, or else, with --detector, 65 degrees along the longer side. Of several films,
            one value for all, or one each
        calibration: in place of --fov: file of camera_calibration, OpenCV's FileStorage or Kalibr
        webcam: in place of --fov: name of a usual webcam, such as C920, with its field of view
        camera_roll_deg: how far the camera is turned clockwise, seen from behind it, 180 if its top
            is below; images are turned back
        mirrored: the images are mirrored, as some programs do with those of a front camera; they
            are turned back
        fps: images a second of a folder of images (default: 30), or of a video in slow motion
    """

    recording: Path = option("RECORDING", default=MISSING)
    background: tuple[float, float] | None = option("T0:T1", span)
    cameras: tuple[str, ...] = option(
        "NAMESPACE", parsed(_cameras, "names of cameras"), default=(), type=str, nargs="+"
    )
    extrinsics: Path | None = option("FILE")
    depth: str | None = option("TOPIC")
    within_m: float | None = option("M", flag="--within")
    silhouettes: str | None = choice(("background", "detector", "person_in_view"))
    #: also a :class:`~cardbox_tracker.Detector`, or an object with ``detect(image)``, or its class
    detector: str | Detector | FindsPeople | type[FindsPeople] | None = option(
        "mediapipe|FILE|FOLDER", _detector
    )
    detector_class: str | None = option("MODULE:CLASS")
    person: str | tuple[float, float] | int | PersonChoice | None = option(
        "left|right|largest|X,Y[@T]|K", _person_choice
    )
    fov_deg: float | tuple[float, ...] | None = option(
        "DEG[,DEG...]",
        parsed(_fovs, "degrees, or those of each film as in 60,43"),
        flag="--fov",
    )
    calibration: Path | None = option("FILE")
    webcam: str | None = option("NAME")
    camera_roll_deg: float | None = option("R", between(-_MOST_ROLL_DEG, _MOST_ROLL_DEG))
    mirrored: bool = option(default=False)
    fps: float | None = option("HZ", between(0.0, _MOST_FPS))

    @property
    def fovs_deg(self) -> tuple[float, ...]:
        """The fields of view that are given, in the order of the films."""
        return () if self.fov_deg is None else _numbers(self.fov_deg)


@dataclass(frozen=True)
class TrackingOptions(RecordingOptions):
    """A recording, the person in it, and the settings of the tracker.

    Attributes:
        model: the person, from 'cardbox initialize', the node initializer, or 'cardbox body'
        stature_m: in place of --model: height of the person, metres, crown to floor; sizes are the
            mean ones of people of that stature. With --people, one for each of them in turn, or one
            for all. Of films with --detector, the mean stature of adults is taken without both
        scene: camera, and without --stature and --model also people, of another recording of the
            same camera, as 'cardbox track' wrote them beside its table
        people: track N people, or all who come (up to 6); they are numbered as they come, and from
            left to right if they come together
        distance_m: with --stature: from the camera to the person, metres along the floor; without
            it, it is found from the first images. With --detector it takes the place of --fov
        camera_pitch_deg: positive when the camera looks down (default: with --stature, found from
            the person who stands upright at --start)
        start_s: second at which the person stands as for --front; tracking starts there. With
            --stature, or a body that was not measured, any posture will do (default: 0)
        end_s: second at which tracking ends (default: the last)
        preset: tracker settings: paper is Table I of the paper, default tracks best
        set: another setting of the tracker by its name in docs/parameters.md, such as
            lost_frames=10; may be given several times
        settings: file of such settings; --set and --effort take precedence over it
        seed: random seed of the filters
        hands: with --detector mediapipe: also tell open from closed hands, and measure palms and
            wrists, in further columns and in the video (docs/results.md)
        causal: take for each image only those before it, as live; without it, also those after it,
            which takes out the shaking
        fill_gaps_s: give images without a posture the motion between those around them, which are
            at most so many seconds apart; their state is 'filled' (default: none)
        rates: also measure velocities and accelerations, with deviations, in further columns
            (docs/results.md)
    """

    model: Path | None = option("MODEL.yaml")
    stature_m: float | tuple[float, ...] | None = option(
        "M[,M...]",
        parsed(_numbers, "metres, or those of each person as in 1.75,1.62"),
        flag="--stature",
    )
    scene: Path | None = option("OUT.scene.yaml")
    people: int | Literal["auto"] | None = option("N|auto", _people)
    distance_m: float | None = option("M", flag="--distance")
    camera_pitch_deg: float | None = option("P")
    start_s: float | None = option("T", time, flag="--start")
    end_s: float | None = option("T", time, flag="--end")
    preset: str = choice(PRESETS, default="default")
    effort: float | None = option(
        "X", help=f"{_EFFORT.description}; {_EFFORT.range_text}; for the preset default"
    )
    set: Mapping[str, Setting] | None = option(
        "NAME=VALUE", parsed(dict, _NAMED), type=parsed(_setting, _NAMED), action="append"
    )
    settings: Path | None = option("FILE.yaml")
    seed: int = option(read=at_least(0), default=0)
    hands: bool = option(default=False)
    causal: bool = option(default=False)
    fill_gaps_s: float | None = option("S", between(0.0, _MOST_GAP_S), flag="--fill-gaps")
    rates: bool = option(default=False)

    @property
    def statures_m(self) -> tuple[float, ...]:
        """The statures that are given, by the numbers of the people."""
        return () if self.stature_m is None else _numbers(self.stature_m)

    @property
    def number(self) -> int:
        """The number of the person whose results are used."""
        return self.person if isinstance(self.person, int) else 1


def _formats(given: str | Iterable[str]) -> tuple[str, ...]:
    from cardbox_tracker.applications.exporting.formats import formats

    names = tuple(dict.fromkeys(given.split(",") if isinstance(given, str) else given))
    if unknown := [name for name in names if name not in formats()]:
        raise argparse.ArgumentTypeError(
            f"expected formats of {', '.join(formats())}, such as trc,bvh: {quoted(unknown[0])}"
        )
    return names


@dataclass(frozen=True)
class Request(TrackingOptions):
    """What :func:`cardbox_tracker.track` tracks, and the files that it writes.

    The fields are the options of ``cardbox track``. Raises CardboxError if a value is wrong.

    Attributes:
        films: further films of the same people, one of each camera, with --detector: when they
            begin, and where the cameras stand, is found from the people (docs/two-cameras.md)
        offset_s: when each further film begins, seconds from the beginning of the first one;
            negative if it begins before (default: found)
        shots: track each shot of a film with cuts as a film of its own, with its own camera and
            files: OUT.csv, OUT.shot_2.csv and so on
        csv: table to write, one row per image (docs/results.md); by default it has the name of the
            recording and is in the current folder. OUT.body.yaml beside it is the body that was
            used
        bag: also write the topics of the tracker
        video: also write an overlay video
        blur: hide the heads of who is tracked, and all faces that the detector shows, in the
            pictures of --video, --report and --bag
        json: also write what is printed at the end: what was tracked, used, left out and assumed
        export: also write the table in formats of 'cardbox export' beside it, such as trc,bvh
        plot: also draw a figure (PNG or PDF) of the skeleton at some moments, over the angles with
            bands of one standard deviation
        report: also write a page with the overlay video (OUT.overlay.mp4 without --video), the
            skeleton from aside, the angles and the times to look at
        force: replace results that exist; without it, refuse
    """

    films: tuple[Path, ...] = option(
        "FILM", parsed(_films, "paths of films"), default=(), flag="films", type=str, nargs="*"
    )
    offset_s: tuple[float, ...] | None = option(
        "S[,S...]",
        flag="--offset",
        read=parsed(_numbers, "seconds, or those of each further film as in 0.4,-1.2"),
    )
    shots: bool = option(default=False)
    csv: Path | None = option("OUT.csv|OUT.parquet")
    bag: Path | None = option("OUT")
    video: Path | None = option("OUT.mp4")
    blur: bool = option(default=False)
    json: Path | None = option("OUT.json")
    export: str | tuple[str, ...] | None = option("FORMAT[,...]", _formats)
    plot: Path | None = option("OUT.png|OUT.pdf")
    report: Path | None = option("OUT.html")
    force: bool = option(default=False)


@dataclass(frozen=True)
class TrackArguments(Request):
    """The arguments of ``cardbox track``: a recording, or a folder of them.

    Attributes:
        output: folder of the results; by default FOLDER_tracked in the current folder. A recording
            that is finished there with the same inputs and settings is not tracked again
        formats: results of each recording; csv by default
        jobs: recordings that are tracked at a time, each on one core; one per core by default
        scheduler: in place of --jobs: track on the workers of this Dask cluster, such as
            tcp://HOST:8786
    """

    group = "a folder of recordings (docs/many-recordings.md)"
    output: Path | None = option("DIR")
    formats: tuple[str, ...] | None = option(
        f"{{{','.join(FORMATS)}}}", tuple, type=one_of(FORMATS), nargs="+"
    )
    jobs: int | None = option("N", at_least(1))
    scheduler: str | None = option("ADDRESS")


def with_own_options(asked: R, folder: Path, name: str) -> R:
    """Return the request for one recording of ``folder``.

    The file ``NAME.options`` beside a recording, or beside a folder of recordings, has options as
    they are typed. They change those of the command line, and inner files those of outer ones.
    Paths in a file begin at the folder of the file.
    """
    for part in reversed([PurePosixPath(name), *PurePosixPath(name).parents][:-1]):
        file = folder / f"{part}{OPTIONS_ENDING}"
        if not file.exists():
            continue
        given = _read_options(file)
        other = {name: None for one in given for name in _REPLACED.get(one, ())}
        if "set" in given:
            given["set"] = {**(asked.set or {}), **dict(given["set"])}
        asked = replace(asked, **{**other, **given})
    return asked


def _read_options(file: Path) -> dict[str, Any]:
    """Return the values of the options in a file, by the names of the fields."""
    expected = "options of 'cardbox track' in UTF-8 as they are typed, such as --stature 1.75"
    with foreign(file, CardboxError, expected):
        words = shlex.split(read_regular(file, _MOST_BYTES).decode(), comments=True)

    class Parser(argparse.ArgumentParser):
        def error(self, message: str) -> NoReturn:
            raise CardboxError(f"{file}: {message}; give options of 'cardbox track'")

    parser = Parser(add_help=False, allow_abbrev=False)
    names = [entry.name for entry in fields(TrackingOptions)][1:]
    add_options(parser, TrackingOptions, *names)
    # Only what is given gets a value.
    values = parser.parse_args(words, argparse.Namespace(**dict.fromkeys(names)))
    given = {name: value for name, value in vars(values).items() if value is not None}
    if "detector_class" in given:
        parser.error("--detector-class would run code that data name; give it on the command line")
    for name, value in given.items():
        if isinstance(value, Path):
            given[name] = file.parent / value
        elif name == "detector" and (file.parent / value).exists():
            given[name] = str(file.parent / value)
    return given
