"""Several cameras of one recording: their extrinsics, and their frames side by side."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

import numpy as np

from cardbox_tracker.errors import BagError, CameraError, CardboxError
from cardbox_tracker.estimation.cost.view import OtherCamera
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.depth_images import depth_images
from cardbox_tracker.recordings.depth_silhouettes import DepthSilhouetteSource, Within
from cardbox_tracker.recordings.silhouettes import Frame, SilhouetteSource, TimeSpan
from cardbox_tracker.vision.background import BackgroundConfig
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.depth_image import DepthImage
from cardbox_tracker.vision.extrinsics import Extrinsics
from cardbox_tracker.vision.extrinsics_files import load_extrinsics
from cardbox_tracker.vision.extrinsics_sources import (
    FrameTransform,
    extrinsics_between,
    transforms_of,
)
from cardbox_tracker.vision.pairing import camera_names, side_by_side
from cardbox_tracker.vision.stereo import StereoDepth, stereo_of_pair

STEREO = "stereo"
"""In place of a topic: the depth is measured in the rectified pair of the first two cameras."""
_STATIC_TOPIC = "/tf_static"
# Images of the first camera of which the period is taken.
_PERIOD_IMAGES = 60


class FrameSet(NamedTuple):
    """What all cameras saw at one time.

    Attributes:
        stamp_ns: of the first camera's image; of the earliest one if that is missing.
        time_s: the same in seconds from the bag's start.
        frames: of each camera, the first camera's first; None of one that has none for this time.
        depth_m: (H, W) of the first camera, metres; None without one for this time.
    """

    stamp_ns: int
    time_s: float
    frames: tuple[Frame | None, ...]
    depth_m: DepthImage | None = None


class CameraSources:
    """Context of the cameras of one recording, after learning each one's background.

    Attributes:
        sources: of each camera, the first camera's first.
        others: the further cameras, as a tracker takes them.
        tolerance_ns: images whose stamps are this near to each other belong together.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        cameras: Sequence[str],
        background: TimeSpan | Within,
        extrinsics: Path | None = None,
        depth: str | None = None,
        config: BackgroundConfig | None = None,
    ) -> None:
        """Name the recording; it is opened on entry.

        Args:
            path: a recording as :class:`BagReader` takes it.
            cameras: namespaces, the first camera first.
            background: when nobody is in any image; with one camera also what cuts out the person
                in depth images instead.
            extrinsics: a file, see :func:`load_extrinsics`.
            depth: topic of depth images of the first camera's optical frame and proportions, or
                ``stereo``: from the first two cameras, a rectified pair.
            config: settings of the background models.

        Raises:
            CardboxError: there are too many cameras, or one twice.
        """
        self.cameras = camera_names(cameras)
        if isinstance(background, Within) and len(self.cameras) > 1:
            raise CardboxError(
                "depth images cut out the person for one camera only; several need a background"
            )
        self._path, self._file, self._depth = path, extrinsics, depth
        self._background, self._config = background, config
        # Then the depth images that are asked for are read already.
        self._cuts_by_depth = isinstance(background, Within) and background.topic == depth
        self._stack = ExitStack()
        self.sources: list[SilhouetteSource] = []
        self.others: list[OtherCamera] = []

    def __enter__(self) -> CameraSources:
        """Open the recording, find the extrinsics and learn the backgrounds.

        Raises:
            BagError: the recording cannot be read, or lacks a camera.
            CameraError: extrinsics are missing or disagree, or a camera is not calibrated.
        """
        with ExitStack() as stack:
            # One reader for each camera: they are read side by side.
            bags = [stack.enter_context(BagReader(self._path)) for _ in self.cameras]
            self.bag = bags[0]
            found = extrinsics_of(bags[0], self.cameras, self._file)
            self.sources = [
                _source(bag, self._background, camera, self._config)
                for bag, camera in zip(bags, self.cameras, strict=True)
            ]
            self.tolerance_ns = self._period_ns() // 2
            self.others = [
                OtherCamera(source.camera, extrinsics)
                for source, extrinsics in zip(self.sources[1:], found, strict=True)
            ]
            self._stereo = None
            if self._depth == STEREO:
                self._stereo = stereo_of(self.first.camera, self.others)
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the recording."""
        self._stack.close()

    @property
    def first(self) -> SilhouetteSource:
        """The first camera: results are in its frame."""
        return self.sources[0]

    def frames(self, start_s: float = 0.0) -> Iterator[FrameSet]:
        """Yield what the cameras saw from ``start_s`` on, every image of every camera once."""
        # A set at the start is not to lose an image that is a little earlier.
        early_s = max(0.0, start_s - self.tolerance_ns / 1e9)
        streams = [source.frames(early_s) for source in self.sources]
        depths = self._depths()
        depth = next(depths, None)
        for frames in side_by_side(streams, lambda frame: frame.stamp_ns, self.tolerance_ns):
            lead = next(frame for frame in frames if frame is not None)
            while depth is not None and depth[0] < lead.stamp_ns - self.tolerance_ns:
                depth = next(depths, None)
            if lead.time_s < start_s:
                continue
            there = None
            if self._cuts_by_depth and frames[0] is not None:
                there = frames[0].depth_m
            elif depth is not None and depth[0] <= lead.stamp_ns + self.tolerance_ns:
                there = depth[1]
            elif self._stereo is not None and None not in frames[:2]:
                there = self._stereo(*(f.image for f in frames[:2] if f and f.image is not None))
            yield FrameSet(lead.stamp_ns, lead.time_s, frames, there)

    def _depths(self) -> Iterator[tuple[int, DepthImage]]:
        """Yield stamp and depth of each depth image, at the size of the first camera."""
        if self._depth is None or self._depth == STEREO or self._cuts_by_depth:
            return iter(())
        return depth_images(self._path, self._depth, self.first.camera)

    def _period_ns(self) -> int:
        """Median distance of the first camera's stamps."""
        stamps = []
        for image in self.bag.images(self.bag.image_topic(self.cameras[0])):
            stamps.append(image.stamp_ns)
            if len(stamps) == _PERIOD_IMAGES:
                break
        if len(stamps) < 2:
            raise BagError(f"{self._path} has fewer than two images of {self.cameras[0]}")
        return int(np.median(np.diff(stamps)))


@contextmanager
def open_recording(
    path: str | os.PathLike[str],
    background: TimeSpan | Within,
    cameras: Sequence[str] = (),
    extrinsics: Path | None = None,
    depth: str | None = None,
) -> Iterator[SilhouetteSource | CameraSources]:
    """Open a recording and learn its background: of its only camera, of one, or of several.

    Raises:
        CardboxError: as :class:`CameraSources` and :class:`SilhouetteSource`.
    """
    if depth is not None and not cameras:
        raise CardboxError("--depth needs --cameras: the camera whose depth it is, first")
    if len(cameras) > 1 or depth is not None:
        with CameraSources(path, cameras, background, extrinsics, depth) as sources:
            yield sources
    else:
        with BagReader(path) as bag:
            yield _source(bag, background, next(iter(cameras), None))


def _source(
    bag: BagReader,
    background: TimeSpan | Within,
    camera: str | None,
    config: BackgroundConfig | None = None,
) -> SilhouetteSource:
    if isinstance(background, Within):
        return DepthSilhouetteSource(bag, background, camera=camera)
    return SilhouetteSource(bag, background, config, camera=camera)


def stereo_of(left: Camera, others: Sequence[OtherCamera]) -> StereoDepth:
    """Return what measures depth in the rectified pair of ``left`` and the first of ``others``.

    Raises:
        CameraError: they are no rectified pair with the left camera first.
    """
    if not others:
        raise CameraError("depth from stereo needs two cameras: give both to --cameras, left first")
    return stereo_of_pair(left, others[0].camera, others[0].extrinsics)


def extrinsics_of(bag: BagReader, cameras: Sequence[str], file: Path | None) -> list[Extrinsics]:
    """Return where each further camera stands against the first one.

    From the projection matrices of a rectified pair, ``/tf_static``, and ``file``.

    Raises:
        BagError: a camera has no CameraInfo.
        CameraError: nothing says it, sources disagree, or the file is none.
    """
    if len(cameras) < 2:
        return []
    infos = [bag.camera_info(camera) for camera in cameras]
    transforms = _static_transforms(bag)
    of_file = load_extrinsics(file, cameras) if file is not None else {}
    return extrinsics_between(infos, cameras, transforms, of_file)


def _static_transforms(bag: BagReader) -> list[FrameTransform]:
    if _STATIC_TOPIC not in bag.topics:
        return []
    return [
        transform
        for message in bag.messages([_STATIC_TOPIC])
        for transform in transforms_of(bag.deserialize(message))
    ]
