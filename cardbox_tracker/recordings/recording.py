"""A recording of one camera or several: their extrinsics, and their images side by side."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cardbox_tracker.errors import CameraError, CardboxError
from cardbox_tracker.estimation.cost.view import OtherCamera
from cardbox_tracker.estimation.observation import Observation
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.depth_images import depth_images
from cardbox_tracker.recordings.depth_silhouettes import DepthSilhouetteSource, Within
from cardbox_tracker.recordings.silhouettes import RecordedFrame, SilhouetteSource, TimeSpan
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


class FrameSet(NamedTuple):
    """What all cameras saw at one time.

    Attributes:
        stamp_ns: of the first camera's image; of the earliest one if that is missing.
        time_s: the same in seconds from the bag's start.
        frames: of each camera, the first camera's first; None of one that has none for this time.
        first: of the first camera, black where it has none.
        depth_m: (H, W) of the first camera, metres; None without one for this time.
    """

    stamp_ns: int
    time_s: float
    frames: tuple[RecordedFrame | None, ...]
    first: RecordedFrame
    depth_m: DepthImage | None = None

    @property
    def observations(self) -> list[Observation]:
        """What a tracker takes of them, an empty observation of a camera without an image."""
        seen = [
            Observation()
            if frame is None
            else Observation(frame.silhouette, frame.image, stamp_ns=frame.stamp_ns)
            for frame in self.frames
        ]
        seen[0] = replace(seen[0], depth_m=self.depth_m, stamp_ns=self.stamp_ns)
        return seen


class Recording:
    """The cameras of an open recording, after learning each one's background.

    Attributes:
        names: namespaces of the cameras, the first camera's first; empty of the only one.
        sources: silhouettes of each camera.
        others: the further cameras, as a tracker takes them.
        measures_depth: whether there are depth images, or stereo, beside the silhouettes.
    """

    def __init__(
        self,
        names: Sequence[str],
        sources: Sequence[SilhouetteSource],
        extrinsics: Sequence[Extrinsics] = (),
        depth: str | None = None,
    ) -> None:
        """Take the cameras together; :func:`open_recording` opens them.

        Args:
            names: namespaces of the cameras, the first camera's first.
            sources: of each camera.
            extrinsics: where each further camera stands.
            depth: topic of depth images of the first camera's optical frame and proportions, or
                ``stereo``: from the first two cameras, a rectified pair.

        Raises:
            BagError: several streams are to be read side by side, and the first camera has fewer
                than two images.
            CameraError: the first two cameras are no rectified pair, but are to measure depth.
        """
        self.names, self.sources = tuple(names), tuple(sources)
        self.others = [
            OtherCamera(source.camera, there)
            for source, there in zip(self.sources[1:], extrinsics, strict=True)
        ]
        self.measures_depth = depth is not None
        # Then the depth images that are asked for are read already.
        self._cuts_by_depth = depth is not None and depth == self.first.depth_topic
        self._depth = None if self._cuts_by_depth else depth
        self._stereo = stereo_of(self.first.camera, self.others) if depth == STEREO else None
        is_alone = len(self.sources) == 1 and self._depth is None
        self._tolerance_ns = 0 if is_alone else self.first.period_ns() // 2

    @property
    def first(self) -> SilhouetteSource:
        """The first camera: results are in its frame."""
        return self.sources[0]

    def frames(self, start_s: float = 0.0) -> Iterator[FrameSet]:
        """Yield what the cameras saw from ``start_s`` on, every image of every camera once."""
        # A set at the start is not to lose an image that is a little earlier.
        early_s = max(0.0, start_s - self._tolerance_ns / 1e9)
        streams = [source.frames(early_s) for source in self.sources]
        depths = self._depths()
        depth = next(depths, None)
        black = np.zeros((self.first.camera.height, self.first.camera.width), np.uint8)
        for frames in side_by_side(streams, lambda frame: frame.stamp_ns, self._tolerance_ns):
            lead = next(frame for frame in frames if frame is not None)
            while depth is not None and depth[0] < lead.stamp_ns - self._tolerance_ns:
                depth = next(depths, None)
            if lead.time_s < start_s:
                continue
            there = None
            if self._cuts_by_depth and frames[0] is not None:
                there = frames[0].depth_m
            elif depth is not None and depth[0] <= lead.stamp_ns + self._tolerance_ns:
                there = depth[1]
            elif self._stereo is not None and None not in frames[:2]:
                there = self._stereo(*(f.image for f in frames[:2] if f and f.image is not None))
            stamp_ns, time_s, *_ = lead
            first = frames[0] or RecordedFrame(stamp_ns, time_s, black, black)
            yield FrameSet(stamp_ns, time_s, frames, first, there)

    def _depths(self) -> Iterator[tuple[int, DepthImage]]:
        """Yield stamp and depth of each depth image, at the size of the first camera."""
        if self._depth is None or self._depth == STEREO:
            return iter(())
        return depth_images(self.first.path, self._depth, self.first.camera)


@contextmanager
def open_recording(
    path: str | os.PathLike[str],
    background: TimeSpan | Within,
    cameras: Sequence[str] = (),
    extrinsics: Path | None = None,
    depth: str | None = None,
) -> Iterator[Recording]:
    """Open a recording, find the extrinsics of its cameras and learn their backgrounds.

    Args:
        path: a recording as :class:`BagReader` takes it.
        background: when nobody is in any image; with one camera also what cuts out the person in
            depth images instead.
        cameras: namespaces, the first camera's first; without any, the recording has only one.
        extrinsics: a file, see :func:`load_extrinsics`.
        depth: see :class:`Recording`.

    Raises:
        BagError: the recording cannot be read, or lacks a camera.
        CameraError: extrinsics are missing or disagree, or a camera is not calibrated.
        CardboxError: there are too many cameras, or one twice.
    """
    names = camera_names(cameras)
    if depth is not None and not cameras:
        raise CardboxError("--depth needs --cameras: the camera whose depth it is, first")
    if isinstance(background, Within) and len(names) > 1:
        raise CardboxError(
            "depth images cut out the person for one camera only; several need a background"
        )
    with ExitStack() as stack:
        # One reader for each camera: they are read side by side.
        bags = [stack.enter_context(BagReader(path)) for _ in names or ("",)]
        found = extrinsics_of(bags[0], names, extrinsics)
        sources = [
            DepthSilhouetteSource(bag, background, name)
            if isinstance(background, Within)
            else SilhouetteSource(bag, background, camera=name)
            for bag, name in zip(bags, names or (None,), strict=True)
        ]
        yield Recording(names or ("",), sources, found, depth)


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
