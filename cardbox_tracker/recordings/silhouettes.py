"""Silhouettes of a recording, cut out against its own empty scene."""

from __future__ import annotations

import math
import pickle
import weakref
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import islice, takewhile
from tempfile import TemporaryFile
from typing import BinaryIO, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import OPTICAL_FRAME, WORKING_SIZE, Calibration, Rectifier
from cardbox_tracker.camera.depth_image import DepthImage
from cardbox_tracker.common.beside import results_ahead
from cardbox_tracker.common.errors import BagError, CameraError, CardboxError, EncodingError, quoted
from cardbox_tracker.detectors.detector import Detector, KeptDetections
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.detectors.point_table import GivenPoints, Image, PointTable
from cardbox_tracker.detectors.pose_network import Detection, image_points
from cardbox_tracker.recordings.cuts import Turns, with_cuts
from cardbox_tracker.recordings.image_recording import RecordedImage
from cardbox_tracker.recordings.open_images import ImageRecording
from cardbox_tracker.recordings.turned_back import TurnedBack
from cardbox_tracker.segmentation.background_config import BackgroundConfig
from cardbox_tracker.segmentation.learning import Learning
from cardbox_tracker.segmentation.silhouettes import SilhouettePipeline

_PERIOD_IMAGES = 60
# A stamp that differs from the recording time by more comes from another clock.
_OTHER_CLOCK_NS = 1_000_000_000
# Width of the border of what a turned image shows, share of the longer side.
_BORDER = 0.02
# Spans are often rounded up by less.
_SHORT_S = 1.0
# Bytes of the file of kept images: about two minutes and a half of a film. Some computers have
# temporary files in memory.
_MOST_KEPT = 1024**3


class TimeSpan(NamedTuple):
    """Seconds from the recording's start, both ends included."""

    start_s: float
    end_s: float

    @classmethod
    def parse(cls, text: str) -> TimeSpan:
        """Read ``T0:T1``; raise ValueError if the text does not have this form."""
        start, colon, end = text.partition(":")
        try:
            span = cls(float(start), float(end))
        except ValueError:
            colon = ""
        if not colon or not 0 <= span.start_s < span.end_s:
            raise ValueError(
                f"expected T0:T1 in seconds with T0 before T1, such as 0:4, got {quoted(text)}"
            )
        return span

    def contains(self, time_s: float) -> bool:
        """Return whether ``time_s`` lies in the span."""
        return self.start_s <= time_s <= self.end_s

    def __str__(self) -> str:
        """Return the span as ``T0:T1``."""
        return f"{self.start_s:g}:{self.end_s:g}"


class PreparedImage(NamedTuple):
    """One image of a recording, ready to be segmented."""

    stamp_ns: int  #: stamp of the image
    time_s: float  #: seconds from the recording's start
    #: (H, W, 3) bgr, or (H, W) grey, undistorted, at the working resolution.
    image: NDArray[np.uint8]
    recorded: RecordedImage  #: the image as it was recorded
    number: int = 0  #: number of the image in the recording, counted from 0
    found: Sequence[Detection] = ()  #: whom the detector finds in the image
    is_cut: bool = False  #: whether the film is cut before the image


FindPoints = Callable[[PreparedImage, NDArray[np.uint8]], ImagePoints | None]
"""Takes an image and the silhouette in it; returns the points of the person."""


class RecordedFrame(NamedTuple):
    """One image of a recording and the silhouette in it."""

    stamp_ns: int  #: stamp of the image
    time_s: float  #: seconds from the recording's start
    #: (H, W, 3) bgr, or (H, W) grey, undistorted, at the working resolution
    image: NDArray[np.uint8]
    silhouette: NDArray[np.uint8]  #: (H, W) uint8, 0 or 255
    #: (H, W), metres, from which the silhouette was cut out; None without depth.
    depth_m: DepthImage | None = None
    #: joints of the person in the image, from a detector; None without one.
    points: ImagePoints | None = None
    recorded: RecordedImage | None = None  #: the image as it was recorded; None if it was not kept
    #: joints of each person, from a detector of several; None without one.
    people: tuple[ImagePoints, ...] | None = None
    is_cut: bool = False  #: whether the film is cut before the image
    #: (H, W), 255 where the camera did not look, 0 elsewhere; None of one that stands still.
    covered: NDArray[np.uint8] | None = None

    @property
    def everyone(self) -> tuple[ImagePoints, ...]:
        """The joints of all whom a detector shows."""
        return (self.people or ()) + (() if self.points is None else (self.points,))


def _not_kept() -> NDArray[np.uint8]:
    raise RuntimeError("the recorded image is not kept; set has_pictures")


class SilhouetteSource:
    """One camera of a recording: its silhouettes, at the working resolution.

    Attributes:
        path: the recording.
        start_ns: start time of the recording.
        topic: name of the images.
        frame_id: name of the camera's optical frame.
        camera: camera of the frames at the working resolution.
        depth_topic: topic of the depth images that cut out the silhouettes; None if a background
            model does.
        has_points: whether the frames can have points of the person.
        used_beside: topics of other images of the recording that are used, too.
        has_pictures: whether frames have the images as they were recorded; small images of the
            passes before serve without, since decoding takes longer.
    """

    depth_topic: str | None = None
    _background_s = 0.0
    used_beside: Collection[str] = ()
    has_pictures = True
    # Small images to a time, s, are in a file.
    _kept, _kept_s = 0, -math.inf
    _file: BinaryIO | None = None

    def __init__(
        self,
        bag: ImageRecording,
        background: TimeSpan,
        config: BackgroundConfig | None = None,
        size: tuple[int, int] = WORKING_SIZE,
        camera: str | None = None,
        points: Detector | PointTable | None = None,
    ) -> None:
        """Learn the empty scene from the first images of the span ``background``.

        It learns from at most ``config.learn_images`` images, like the background node. Images
        have about as many pixels as ``size`` (width, height) and keep their aspect; without
        ``camera``, its namespace, the recording has only one; ``points`` is the source of the
        person's points. Raises BagError if the span has too few images, CameraError if the camera
        is not calibrated, and CardboxError if ``points`` cannot be read.
        """
        self._open(bag, camera, config, size=size)
        self._find_points(points, camera)
        self._background_s = background.end_s
        is_readable = False
        for _, time_s, image, *_ in self.images():
            is_readable = True
            if time_s > background.end_s or self._pipeline.learning.has_enough():
                break
            if background.contains(time_s):
                self._pipeline.learning.add(image)
        count = self._pipeline.learning.count
        if not is_readable and self._broken:
            raise BagError(f"{self.path} has no image to learn from: {self._brokenness()}")
        if count < 2:
            raise BagError(
                f"{count} images lie in the background span {background} s of a recording of "
                f"{bag.duration_s:.1f} s; give a span in which the empty scene was recorded"
                + "".join(f" ({remark})" for remark in self.remarks)
            )
        self._pipeline.finish_learning()

    def _open(
        self,
        bag: ImageRecording,
        camera: str | None,
        config: BackgroundConfig | None = None,
        learning: type[Learning] = Learning,
        size: tuple[int, int] = WORKING_SIZE,
    ) -> None:
        self._bag: ImageRecording | TurnedBack = bag
        self.path, self.start_ns = bag.path, bag.start_ns
        self._broken: dict[int, str] = {}
        self._used = self._clock_ns = 0
        self.topic = bag.image_topic(camera)
        calibration = bag.calibration(camera)
        self._pipeline = SilhouettePipeline(calibration, size, config, learning)
        self.frame_id = calibration.frame_id
        if self.frame_id == OPTICAL_FRAME:
            # A CameraInfo without a name is of the images' frame.
            found = next((image.frame_id for image in bag.images(self.topic)), "")
            self.frame_id = found.lstrip("/") or OPTICAL_FRAME
        self.camera = self._pipeline.camera
        self._full: tuple[tuple[int, int] | None, Rectifier | None] = None, None

    def _find_points(self, points: Detector | PointTable | None, camera: str | None) -> None:
        self.has_points = points is not None
        self._finds_people = points is not None and points.people > 0
        self._detector = KeptDetections(points.start()) if isinstance(points, Detector) else None
        self._given: GivenPoints | None = None
        self._points: FindPoints = lambda prepared, silhouette: None
        if self._detector is not None:
            self._points = lambda prepared, _: next(map(image_points, prepared.found), None)
        elif isinstance(points, PointTable):
            calibration = self._pipeline.calibration
            given = points.read(camera, (calibration.width, calibration.height))
            size = self.camera.width, self.camera.height
            first_ns = next(self._bag.images(self.topic)).stamp_ns
            given.check_span(first_ns, first_ns + int(1e9 * self.duration_s))
            self._given = given = given.placed(calibration, size, self.period_ns() // 2)
            self._points = lambda prepared, silhouette: given.at(
                Image(prepared.stamp_ns, prepared.number, prepared.recorded.name), silhouette
            )

    @property
    def scale(self) -> tuple[float, float]:
        """Width and height of the frames in those of the camera's own images."""
        calibration = self._pipeline.calibration
        return self.camera.width / calibration.width, self.camera.height / calibration.height

    def _looked_at(self, prepared: PreparedImage, start_s: float = -math.inf) -> PreparedImage:
        """Return an image with whom the detector finds in it, if it is not before ``start_s``."""
        if self._detector is None or prepared.time_s < start_s:
            return prepared
        number, stamp_ns, image = prepared.number, prepared.stamp_ns, prepared.image
        detect = partial(self._detector, number, stamp_ns, is_cut=prepared.is_cut)
        if isinstance(self._bag, TurnedBack):
            return prepared._replace(found=self._bag.detected(detect, stamp_ns, image))
        return prepared._replace(found=detect(image))

    @property
    def calibration(self) -> Calibration:
        """The calibration of the recorded images."""
        return self._pipeline.calibration

    @property
    def points_fault(self) -> str:
        """Why the given points were used in no image that was read; empty if they were."""
        return "" if self._given is None else self._given.fault

    @property
    def duration_s(self) -> float:
        """Seconds from the first to the last message of the recording."""
        return self._bag.duration_s

    def frames(self, start_s: float = 0.0, end_s: float = float("inf")) -> Iterator[RecordedFrame]:
        """Yield every image from ``start_s`` to ``end_s`` in order."""
        # The background adapts from the first image on, so frames do not depend on the span.
        self._pipeline.restart()
        self._start_points(start_s, end_s)
        within: Iterator[PreparedImage] = takewhile(
            lambda one: one.time_s <= end_s, self.images(end_s)
        )
        if self._detector is not None:
            # It finds whoever is there meanwhile.
            within = results_ahead(partial(self._looked_at, start_s=start_s), within)
        for prepared in within:
            silhouette = self._silhouette(prepared)
            if prepared.time_s >= start_s:
                yield self._frame(prepared, silhouette)
        self._end_points()

    def _frame(
        self,
        prepared: PreparedImage,
        silhouette: NDArray[np.uint8],
        depth_m: DepthImage | None = None,
    ) -> RecordedFrame:
        stamp_ns, time_s, image, recorded, *_ = prepared
        shown = recorded if self.has_pictures else None
        frame = RecordedFrame(stamp_ns, time_s, image, silhouette, depth_m, recorded=shown)
        frame = frame._replace(is_cut=prepared.is_cut)
        people, points = None, None
        if self._finds_people:
            people = self._people(prepared)
        else:
            points = self._points(prepared, silhouette)
        if isinstance(self._bag, TurnedBack):
            unseen = self._pipeline.prepare(self._bag.unseen(stamp_ns))
            covered = np.where(unseen > 127, np.uint8(255), np.uint8(0))
            # Detectors guess what is outside of the image, and put some of it at the border.
            side = 2 * round(_BORDER * max(covered.shape)) + 1
            near = np.asarray(cv2.dilate(covered, np.ones((side, side), np.uint8)), np.uint8)
            people = None if people is None else tuple(one.beside(near) for one in people)
            points = None if points is None else points.beside(near)
            frame = frame._replace(covered=covered)
        return frame._replace(people=people, points=points)

    def _silhouette(self, prepared: PreparedImage) -> NDArray[np.uint8]:
        return self._pipeline.silhouette(prepared.image, prepared.stamp_ns)

    def _people(self, prepared: PreparedImage) -> tuple[ImagePoints, ...]:
        if self._given is not None:
            image = Image(prepared.stamp_ns, prepared.number, prepared.recorded.name)
            return tuple(self._given.all_in(image))
        return tuple(image_points(one) for one in prepared.found)

    def _start_points(self, start_s: float, end_s: float) -> None:
        if self._detector is not None:
            self._detector.start(start_s, end_s)
        if self._given is not None:
            self._given.restart()

    def _end_points(self) -> None:
        if self._detector is not None:
            self._detector.end()

    def held(self, span: TimeSpan, what: str) -> list[RecordedFrame]:
        """Return the frames of a span in which a posture is held.

        Raises CardboxError if no image lies in the span; the text names ``what``.
        """
        # Full images of a whole span would take hundreds of megabytes.
        found = [frame._replace(recorded=None) for frame in self.frames(*span)]
        if not found:
            raise CardboxError(
                f"no image lies in the {what} span {span} s of a recording of "
                f"{self._bag.duration_s:.1f} s; give seconds from its start"
            )
        return found

    def period_ns(self) -> int:
        """Return the median time between images, ns; raise BagError if there are fewer than two."""
        images = islice(self._bag.images(self.topic), _PERIOD_IMAGES)
        stamps_ns = [image.stamp_ns for image in images]
        if len(stamps_ns) < 2:
            raise BagError(f"{self.path} has fewer than two images on {self.topic}")
        return int(np.median(np.diff(stamps_ns)))

    def _brokenness(self) -> str:
        number, reason = next(iter(self._broken.items()))
        return (
            f"{len(self._broken)} images cannot be decoded and are skipped; the first one is "
            f"number {number}: {reason}"
        )

    @property
    def remarks(self) -> list[str]:
        """Warnings about the images read so far."""
        remarks = list(self._bag.remarks)
        if self._background_s > self._bag.duration_s + _SHORT_S:
            remarks.append(
                f"the background span ends at {self._background_s:g} s, after the recording of "
                f"{self._bag.duration_s:.1f} s; give a span of the empty scene"
            )
        if self._clock_ns:
            remarks.append(
                f"the images' stamps are {abs(self._clock_ns) / 1e9:.0f} s "
                f"{'behind' if self._clock_ns > 0 else 'ahead of'} the recording's clock; times "
                "in seconds count from the recording's start nevertheless"
            )
        if self._broken:
            remarks.append(self._brokenness())
        if self._detector is not None:
            detector = self._detector.detector
            if detector.missed:
                remarks.append(f"the detector finds nobody in {detector.missed} images")
            if detector.remark:
                remarks.append(detector.remark)
        if self._given is not None and self._given.remark:
            remarks.append(self._given.remark)
        return remarks

    @property
    def account(self) -> str:
        """What was read and used of this camera, and what was left out, with the reasons."""
        left_out = self._bag.left_out(self.topic, self.used_beside)
        if self._broken:
            left_out.append(f"{len(self._broken)} that cannot be read")
        reasons = f"; left out {', '.join(left_out)}" if left_out else "; nothing left out"
        return f"used {self._used} images of {self.topic} in {self.path}{reasons}"

    def full_picture(self, frame: RecordedFrame) -> NDArray[np.uint8]:
        """Return the picture of a frame, undistorted, at the resolution of the recording."""
        return frame.image if frame.recorded is None else self.undistorted(frame.recorded)

    def undistorted(self, recorded: RecordedImage) -> NDArray[np.uint8]:
        """Return an image, undistorted, at the resolution of the recording."""
        image = recorded.as_sent
        height, width = image.shape[:2]
        # The thread that draws calls this, too.
        size, rectifier = self._full
        if size != (width, height):
            calibration = self._pipeline.calibration
            rectifier = calibration.rectifier(*calibration.level_size(width, height))
            self._full = (width, height), rectifier
        return image if rectifier is None else rectifier(image)

    def keep_images(self) -> None:
        """Keep small images of the next pass in a file for passes without pictures."""
        if self._file is not None:
            return
        self._file = TemporaryFile()  # noqa: SIM115
        weakref.finalize(self, self._file.close)

    def images(self, end_s: float = math.inf) -> Iterator[PreparedImage]:
        """Yield every image that can be decoded; the next ones are, while the caller works.

        Kept images serve if there are all to ``end_s``; with pictures, these are decoded once more.
        """
        kept: Iterator[PreparedImage] = iter(())
        if self._file is not None and self._kept_s >= end_s:
            self._file.seek(0)
            kept = (pickle.load(self._file) for _ in range(self._kept))
        if not self.has_pictures and self._kept_s >= end_s:
            yield from kept
            return
        keeps = self._file is not None and self._kept == 0
        turns = Turns()
        shown = with_cuts(self._read(kept), lambda one: one.image, turns)
        for used, (found, is_cut) in enumerate(shown, 1):
            if turns.are_seen:
                raise BagError(
                    f"cameras take turns on {self.topic}: every second image shows another place; "
                    "give each camera a topic of its own"
                )
            # Of several passes, the longest counts.
            self._used = max(self._used, used)
            found = found._replace(is_cut=is_cut)
            keeps = keeps and self._keep(found)
            yield found
        self._kept_s = math.inf if keeps else self._kept_s

    def shots(self, start_s: float = 0.0, end_s: float = math.inf) -> list[TimeSpan]:
        """Return the spans from ``start_s`` to ``end_s`` between cuts, first and last images."""
        spans: list[TimeSpan] = []
        for one in takewhile(lambda one: one.time_s <= end_s, self.images(end_s)):
            if one.time_s >= start_s:
                first_s = one.time_s if one.is_cut or not spans else spans.pop().start_s
                spans.append(TimeSpan(first_s, one.time_s))
        return spans

    def _read(self, kept: Iterator[PreparedImage]) -> Iterator[PreparedImage]:
        taken = enumerate(self._bag.images(self.topic), 1)
        for number, image, prepared in results_ahead(partial(self._prepared, kept), taken):
            if number == 1:
                late_ns = image.time_ns - image.stamp_ns
                self._clock_ns = late_ns if abs(late_ns) > _OTHER_CLOCK_NS else 0
            if isinstance(prepared, str):
                self._broken[number] = prepared
                continue
            time_ns = image.stamp_ns + self._clock_ns - self.start_ns
            yield PreparedImage(image.stamp_ns, time_ns / 1e9, prepared, image, number - 1)

    def _keep(self, one: PreparedImage) -> bool:
        """Keep an image; return whether there is room for more."""
        small = replace(one.recorded, _decode=_not_kept)
        assert self._file is not None
        try:
            pickle.dump(one._replace(recorded=small), self._file)
        except OSError:
            return False
        self._kept, self._kept_s = self._kept + 1, one.time_s
        return self._file.tell() < _MOST_KEPT

    def _prepared(
        self, kept: Iterator[PreparedImage], taken: tuple[int, RecordedImage]
    ) -> tuple[int, RecordedImage, NDArray[np.uint8] | str]:
        """Return an image with its number, decoded once, and prepared, or why it cannot be.

        ``kept`` has those that were prepared in a pass before.
        """
        number, image = taken
        try:
            sent = image.as_sent
            height, width = sent.shape[:2]
            self._pipeline.calibration.check_shape(width, height, self.topic, "the first image")
            again = next(kept, None)
            is_same = again is not None and again.stamp_ns == image.stamp_ns
            prepared = again.image if again and is_same else self._pipeline.prepare(sent)
        except (CameraError, EncodingError) as error:
            return number, image, str(error)
        return number, replace(image, _decode=lambda: sent), prepared
