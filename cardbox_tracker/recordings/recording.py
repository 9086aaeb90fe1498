"""A recording of one or several cameras: extrinsics and synchronized images."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import compress
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.depth_image import DepthImage
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.extrinsics_files import (
    extrinsics_between,
    load_extrinsics,
    transforms_of,
)
from cardbox_tracker.camera.pairing import MOST_CAMERAS, camera_names, side_by_side
from cardbox_tracker.camera.stereo import StereoDepth, stereo_of_pair
from cardbox_tracker.camera.view import OtherCamera
from cardbox_tracker.common.errors import BagError, CameraError, CardboxError
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.point_table import PointTable
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.films import PlacedFilm, placed_films
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.open_images import ImageRecording, is_bag, is_film, open_images
from cardbox_tracker.recordings.other_silhouettes import (
    DepthSilhouetteSource,
    DetectorSilhouetteSource,
    PersonInView,
    PersonInViewSource,
    Within,
    depth_images,
)
from cardbox_tracker.recordings.silhouettes import RecordedFrame, SilhouetteSource, TimeSpan
from cardbox_tracker.recordings.turned_back import Turned
from cardbox_tracker.tracking.observation import Observation

STEREO = "stereo"
"""Given in place of a depth topic: stereo depth of the first two cameras, a rectified pair."""
Segmentation = TimeSpan | Within | Detector | PersonInView
"""Source of the silhouettes: a span without a person in any image, a depth limit, a detector whose
masks they are, or the scene learned around the person."""
_STATIC_TOPIC = "/tf_static"


def observation_of(frame: RecordedFrame) -> Observation:
    """Return what a session takes of a frame, but for depth."""
    return Observation(
        frame.silhouette,
        frame.image,
        stamp_ns=frame.stamp_ns,
        points=frame.points,
        people=frame.people,
        covered=frame.covered,
        is_cut=frame.is_cut,
    )


class FrameSet(NamedTuple):
    """Frames of all cameras at one time."""

    stamp_ns: int  #: stamp of the first camera's image, or of the earliest image without it
    time_s: float  #: the same time in seconds from the bag's start
    #: one frame for each camera, the first camera's first; None if it has no image.
    frames: tuple[RecordedFrame | None, ...]
    first: RecordedFrame  #: frame of the first camera, black without an image
    #: depth (H, W) in the first camera, metres; None without a depth image.
    depth_m: DepthImage | None = None
    #: returns the first camera's image at the resolution of the recording.
    picture: Callable[[], NDArray[np.uint8]] | None = None

    @property
    def observations(self) -> list[Observation]:
        """Observations for a session; that of a camera without an image is empty."""
        seen = [Observation() if one is None else observation_of(one) for one in self.frames]
        more = {"depth_m": self.depth_m, "stamp_ns": self.stamp_ns, "picture": self.picture}
        seen[0] = seen[0].having(**more)
        return seen


class Recording:
    """The cameras of an open recording, each with its silhouettes.

    Attributes:
        names: namespaces of the cameras, the first camera's first; a single camera has "".
        sources: silhouettes of each camera.
        first: the first camera, in whose frame the results are.
        others: the further cameras with their poses.
        measures_depth: True if there is depth from depth images or stereo.
        films: the further films beside the first one, if each camera made a film of its own; those
            that are not usable have no source.
    """

    def __init__(
        self,
        names: Sequence[str],
        sources: Sequence[SilhouetteSource],
        extrinsics: Sequence[Extrinsics] = (),
        depth: str | None = None,
        films: Sequence[PlacedFilm] = (),
    ) -> None:
        """Combine the cameras of a :class:`RecordingRequest`, the first one first.

        ``extrinsics`` are of the further cameras. ``depth`` is a topic of depth images with the
        optical frame and aspect ratio of the first camera, or ``stereo`` for depth from the first
        two. ``films`` are the further ones if each source is a film. Raises BagError if there are
        several streams, but fewer than two images, and CameraError if ``depth`` is ``stereo`` and
        they are no rectified pair.
        """
        self.names, self.sources, self.first = tuple(names), tuple(sources), sources[0]
        self.others = [
            OtherCamera(source.camera, there)
            for source, there in zip(self.sources[1:], extrinsics, strict=True)
        ]
        self.measures_depth, self.films = depth is not None, tuple(films)
        self._used = [film for film in films if film.is_usable]
        for source in self.sources:
            topics = {one.topic for one in self.sources} | {depth, source.depth_topic}
            source.used_beside = {topic for topic in topics if topic is not None}
        # The silhouettes' source already reads these depth images.
        self._cuts_by_depth = depth is not None and depth == self.first.depth_topic
        self._depth = None if self._cuts_by_depth else depth
        self._stereo: StereoDepth | None = None
        if depth == STEREO:
            if not self.others:
                raise CameraError(
                    "depth from stereo needs two cameras: give both to --cameras, left first"
                )
            other = self.others[0]
            self._stereo = stereo_of_pair(self.first.camera, other.camera, other.extrinsics)
        is_alone = len(self.sources) == 1 and self._depth is None
        self._tolerance_ns = 0 if is_alone else self.first.period_ns() // 2

    def frames(self, start_s: float = 0.0, end_s: float = math.inf) -> Iterator[FrameSet]:
        """Yield synchronized frames from ``start_s`` to ``end_s``; each image is in one set."""
        # Images slightly before the start can belong to the first set.
        early_s = max(0.0, start_s - self._tolerance_ns / 1e9)
        late_s = end_s + self._tolerance_ns / 1e9
        streams = [source.frames(early_s, late_s) for source in self.sources]
        if self.films:
            # What the detector found was kept of whole films.
            others = zip(self._used, self.sources[1:], strict=True)
            streams = [self.first.frames(), *(film.frames(source) for film, source in others)]
        depths: Iterator[tuple[int, DepthImage]] = iter(())
        if self._depth is not None and self._depth != STEREO:
            depths = depth_images(self.first.path, self._depth, self.first.camera)
        depth = next(depths, None)
        black = np.zeros((self.first.camera.height, self.first.camera.width), np.uint8)
        for frames in side_by_side(streams, lambda frame: frame.stamp_ns, self._tolerance_ns):
            if self.films and frames[0] is None:
                continue
            lead = next(frame for frame in frames if frame is not None)
            while depth is not None and depth[0] < lead.stamp_ns - self._tolerance_ns:
                depth = next(depths, None)
            if lead.time_s < start_s:
                continue
            if lead.time_s > end_s:
                break
            there = None
            if self._cuts_by_depth and frames[0] is not None:
                there = frames[0].depth_m
            elif depth is not None and depth[0] <= lead.stamp_ns + self._tolerance_ns:
                there = depth[1]
            elif self._stereo is not None and None not in frames[:2]:
                there = self._stereo(*(frame.image for frame in frames[:2] if frame))
            stamp_ns, time_s, *_ = lead
            first = frames[0] or RecordedFrame(stamp_ns, time_s, black, black)
            picture = partial(self.first.full_picture, first)
            yield FrameSet(stamp_ns, time_s, frames, first, there, picture)


class FurtherFilm(NamedTuple):
    """A film of the same people by another camera."""

    path: Path  #: video, or folder of images
    camera: GivenCamera  #: what the film itself does not say about its camera
    offset_s: float | None = None  #: when it begins, s of the first film; None to find it


@dataclass(frozen=True)
class RecordingRequest:
    """A recording to read."""

    path: Path  #: bag, video, or folder of images
    silhouettes: Segmentation  #: what tells the person from the scene
    #: namespaces, the first camera's first; empty if the recording has one camera
    cameras: Sequence[str] = ()
    extrinsics: Path | None = None  #: file of :func:`.load_extrinsics`, of further cameras
    depth: str | None = None  #: topic of depth images, or ``stereo``; None without depth
    points: Detector | PointTable | None = None  #: source of the person's 2D points, if any
    camera: GivenCamera = GivenCamera()  #: what the recording itself does not say about its camera
    films: tuple[FurtherFilm, ...] = ()  #: further films of the same people
    statures_m: tuple[float, ...] = ()  #: those of the people, if known, for the poses of films
    turned: Turned | None = None  #: how its camera turns; None for one that stands still

    @property
    def detector(self) -> Detector | None:
        """The detector among the sources of silhouettes and points; None without one."""
        sources = self.silhouettes, self.points
        return next((source for source in sources if isinstance(source, Detector)), None)

    @property
    def shows_turns(self) -> bool:
        """Whether a detector alone tells of one camera where people are, wherever it looks."""
        is_detected = isinstance(self.silhouettes, Detector)
        is_alone = len(self.cameras) < 2 and self.depth is None
        return is_detected and is_alone and not isinstance(self.points, PointTable)

    @contextmanager
    def open(self) -> Iterator[Recording]:
        """Open it, find the extrinsics of its cameras and learn their backgrounds.

        Raises BagError if it cannot be read or lacks a camera; CameraError if extrinsics are
        missing or disagree, or a camera is not calibrated; CardboxError for what does not go
        together.
        """
        names = camera_names(self.cameras)
        for fault in self.faults():
            raise CardboxError(fault)
        with ExitStack() as stack:
            if self.films:
                yield self._of_films(stack)
                return
            # A reader has one position, and the cameras are read in parallel.
            bags = [open_images(self.path, self.camera) for _ in names or ("",)]
            if self.turned is not None:
                bags = [self.turned.back(bag) for bag in bags]
            for bag in bags:
                stack.enter_context(bag)
            found = _extrinsics_of(bags[0], names, self.extrinsics)
            sources = [
                _source(bag, self.silhouettes, name, self.points)
                for bag, name in zip(bags, names or (None,), strict=True)
            ]
            yield Recording(names or ("",), sources, found, self.depth)

    @property
    def names(self) -> list[str]:
        """Names of several films: those of their files, with a number if two are the same."""
        stems = [path.stem for path in (self.path, *(film.path for film in self.films))]
        return [
            stem if stems.count(stem) == 1 else f"{stem}_{number}"
            for number, stem in enumerate(stems, 1)
        ]

    def _of_films(self, stack: ExitStack) -> Recording:
        """Return the open recording of several films."""
        names = self.names
        of_file = {} if self.extrinsics is None else load_extrinsics(self.extrinsics, names)
        given = FurtherFilm(self.path, self.camera), *self.films
        films = [open_images(film.path, film.camera) for film in given]
        for film in films:
            stack.enter_context(film)
        sources = [_source(film, self.silhouettes, None, self.points) for film in films]
        offsets_s = [film.offset_s for film in self.films]
        placed = placed_films(names, sources, offsets_s, of_file, self.statures_m)
        sources = [sources[0], *compress(sources[1:], (film.is_usable for film in placed))]
        used = [film for film in placed if film.is_usable]
        poses = [film.camera.extrinsics for film in used]
        return Recording([names[0], *(film.name for film in used)], sources, poses, films=placed)

    def faults(self) -> Iterator[str]:
        """Yield what does not go together."""
        if self.films:
            yield from self._faults_of_films()
        camera, is_cut = self.camera, isinstance(self.silhouettes, Within)
        if self.depth is not None and not self.cameras:
            yield "--depth needs --cameras: the camera whose depth it is, first"
        if is_cut and len(self.cameras) > 1:
            yield (
                "depth images can cut out the person for one camera only; several cameras need "
                "--background"
            )
        is_turned = camera.roll_rad or camera.is_mirrored
        if is_turned and (self.depth is not None or is_cut):
            yield (
                "depth images are not turned: leave --camera-roll-deg and --mirrored out, or "
                "--depth"
            )
        if len(self.cameras) > 1 and (camera.is_calibrated or is_turned or camera.fps):
            yield (
                "--fov, --calibration, --camera-roll-deg, --mirrored and --fps describe one "
                "camera; the recording of several cameras needs a CameraInfo of each"
            )
        if (self.depth is not None or is_cut) and not is_bag(Path(self.path)):
            yield f"depth images are read from a rosbag2, which {self.path} is not"

    def _faults_of_films(self) -> Iterator[str]:
        paths = [self.path, *(film.path for film in self.films)]
        if others := [str(path) for path in paths if path.exists() and not is_film(path)]:
            yield (
                f"{', '.join(others)} is no film: several recordings are videos or folders of "
                "images, one of each camera"
            )
        if len(paths) > MOST_CAMERAS:
            yield f"there are {len(paths)} films; expected at most {MOST_CAMERAS}"
        if len({path.resolve() for path in paths}) < len(paths):
            yield "a film is given twice: give that of each camera once"
        if self.cameras:
            yield "--cameras names cameras of one bag; leave it out with several films"
        if self.camera.roll_rad:
            yield "--camera-roll-deg is of one camera; leave it out with several films"
        if not isinstance(self.points, Detector):
            yield (
                "several films are synchronized by the points of people: give --detector mediapipe"
            )


def _source(
    bag: ImageRecording,
    background: Segmentation,
    camera: str | None,
    points: Detector | PointTable | None,
) -> SilhouetteSource:
    if isinstance(background, Within):
        return DepthSilhouetteSource(bag, background, camera, points)
    if isinstance(background, Detector):
        return DetectorSilhouetteSource(bag, background, camera, points)
    if isinstance(background, PersonInView):
        return PersonInViewSource(bag, camera, points)
    return SilhouetteSource(bag, background, camera=camera, points=points)


def _extrinsics_of(
    bag: ImageRecording, cameras: Sequence[str], file: Path | None
) -> list[Extrinsics]:
    """Return the pose of each further camera relative to the first one.

    The sources are the projection matrices of a rectified pair, ``/tf_static``, and ``file``.
    Raises BagError if a camera has no CameraInfo, and CameraError if no source has the pose, or
    sources disagree.
    """
    if len(cameras) < 2:
        return []
    if not isinstance(bag, BagReader):
        raise BagError(f"{bag.path} is of one camera; omit --cameras, or give a rosbag2 of several")
    infos = [bag.camera_info(camera) for camera in cameras]
    messages = bag.messages([_STATIC_TOPIC]) if _STATIC_TOPIC in bag.topics else ()
    transforms = [one for message in messages for one in transforms_of(bag.deserialize(message))]
    of_file = load_extrinsics(file, cameras) if file is not None else {}
    return extrinsics_between(infos, cameras, transforms, of_file)
