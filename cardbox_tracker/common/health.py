"""Watches over inputs and results: what is measured, its limits, and the words of the remark.

A :class:`Watch` is a row; a :class:`Verdict` judges its measure, the median of the latest samples.
What holds beyond ``limit`` goes on until ``clear``, so that a measure about the limit does not
switch to and fro. Who measures feeds samples and asks for the verdict and the remark.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from statistics import median
from typing import NamedTuple


class Watch(NamedTuple):
    """One fault: its measure and limits."""

    name: str  #: a few words for the kind of the remark
    measure: str  #: what is measured, with its unit
    limit: float  #: value beyond which the watch holds
    why: str  #: where the limit comes from
    words: str = ""  #: remark, with ``value`` and ``limit`` and what :meth:`Verdict.remark` gets
    clear: float | None = None  #: value to which it has to return; None for the limit
    is_low: bool = False  #: whether values below the limit are the fault
    window: int | None = 1  #: samples of which the median counts; None for all
    least: int = 1  #: fewest samples for a verdict

    def is_beyond(self, value: float, holds: bool = False) -> bool:
        """Return whether a value is a fault; ``holds`` says that the one before was."""
        limit = self.clear if holds and self.clear is not None else self.limit
        return bool(value < limit if self.is_low else value > limit)

    def remark(self, value: float, **values: object) -> str:
        """Return the words on a value that is a fault, with further values; else nothing."""
        if not self.is_beyond(value):
            return ""
        return self.words.format(value=value, limit=self.limit, **values)


class Verdict:
    """What a watch says of the samples so far.

    Attributes:
        holds: whether the fault is there.
        value: the measure that was judged last; 0 before.
        medians: median of each part of the samples; empty before there are enough.
        samples: the latest ones.
    """

    def __init__(self, watch: Watch, of: Callable[..., float] = float) -> None:
        """Begin without samples; ``of`` returns the measure of the medians of their parts."""
        self.watch, self._of = watch, of
        self.forget()

    def forget(self) -> None:
        """Begin again without samples."""
        self.holds, self.value, self.medians = False, 0.0, list[float]()
        self.samples = deque[tuple[float, ...]](maxlen=self.watch.window)

    def see(self, *sample: float) -> bool:
        """Take a sample, of one part or several; return whether the fault is there."""
        self.samples.append(sample)
        if len(self.samples) >= self.watch.least:
            self.medians = [median(part) for part in zip(*self.samples, strict=True)]
            self.value = self._of(*self.medians)
            self.holds = self.watch.is_beyond(self.value, self.holds)
        return self.holds

    def count(self, is_so: bool) -> bool:
        """Take whether something is so again: the measure is how often it was in a row."""
        return self.see(self.value + 1 if is_so else 0)

    def remark(self, **values: object) -> str:
        """Return the remark with these values; empty if nothing is wrong."""
        if not self.holds:
            return ""
        return self.watch.words.format(value=self.value, limit=self.watch.limit, **values)


# Cameras that contradict each other, and what they show.

FROZEN = Watch(
    "frozen",
    "change of another camera's silhouette since an image was new, share of its area",
    0.08,
    "who stands sways by less, and a repeated image of them does no harm",
    "{name} shows the same image again and again while the others go on: {count} of its images are "
    "not used. Is its driver or its connection stuck?",
)
FROZEN_FOR_LONG = Watch(
    "frozen for long",
    "repetitions of an image in a row",
    14,
    "one second at 15 Hz, after which any change of the others counts",
)
FULL = Watch(
    "full",
    "share of the image that the silhouette fills",
    0.8,
    "no person fills so much",
    "the silhouette of {name} fills {count} of its images, which are of no use without points of a "
    "detector. Has the light changed, or is the camera covered?",
)
TURNED = Watch(
    "turned",
    "angle between the directions that somebody faces in two cameras, degrees",
    50.0,
    "right cameras differ by up to 34 degrees, mirrored ones by 60 and more",
    "{name} shows the person facing another way than the first camera: {count} of its images are "
    "not used. Is one of them mirrored?",
    window=15,
    least=6,
)
INVERTED = Watch(
    "inverted",
    "angle between both cameras' tangent planes, which the inverse pose explains, degrees",
    0.3,
    "right poses have at most 0.7 degrees, which their inverse does not explain",
    "the extrinsics of {name} seem to be inverted, or the images of the two cameras exchanged: "
    "head and hands differ by {value:.1f} degrees in height, and the inverse pose fits the "
    "silhouettes. The pose must transform points from the first camera's frame into that of "
    "{name}; check its direction and the topics' order",
    window=15,
    least=6,
)
CONTRADICTED = Watch(
    "contradicted",
    "angle between both cameras' tangent planes, degrees",
    2.5,
    "right poses have at most 0.7 degrees (docs/research.md#several-cameras)",
    "the extrinsics of {name} contradict the silhouettes: head and hands differ by {value:.1f} "
    "degrees in height. Were the images of two cameras exchanged, or was a camera moved? Check the "
    "topics' order, or calibrate the cameras again",
    window=15,
    least=6,
)
EXTRINSICS = Watch(
    "extrinsics",
    "pitch and yaw of a camera against its extrinsics, degrees",
    0.85,
    "docs/research.md#several-cameras has detection rates",
    "the extrinsics of {name} seem to be wrong by {shown} degrees: the silhouettes of the cameras "
    "contradict each other. Was a camera moved? Calibrate them again. A wrong distance of the "
    "person has the same effect",
    window=3,
)
EXTRINSICS_UNMEASURED = EXTRINSICS._replace(
    name="extrinsics by somebody who is not measured",
    limit=6.0,
    why="wrong sizes turn the estimate by up to 3.7 degrees",
)
HEIGHT = Watch(
    "height",
    "angle between both cameras' tangent planes of somebody who is not measured, degrees",
    1.0,
    "wrong sizes do not change it; right poses have at most 0.7 degrees",
    "the extrinsics of {name} seem to be wrong: head and hands differ by {value:.1f} degrees in "
    "height between the cameras. Was a camera moved? Calibrate them again",
)
ROLLED = Watch(
    "rolled",
    "roll of a camera against its extrinsics, degrees",
    1.5,
    "docs/research.md#several-cameras has detection rates",
    "{name} seems to be turned about its own axis by {shown} degrees against its extrinsics: head "
    "and hands have other heights than in the first camera. Was a camera moved? Calibrate them "
    "again",
    window=3,
)
OTHER_VIEW = Watch(
    "depth",
    "how much oftener the depth grows than shrinks across the outline, % of the pixels",
    25.0,
    "depth of the same view has 50 and more, also from a pair of cameras",
    "the depth images show another view than the silhouettes, so they are not used: at the "
    "person's outline the depth grows outwards only {value:.0f} % oftener than it shrinks, "
    "expected at least {limit:.0f} %. Give depth that is registered to the first camera (often "
    ".../aligned_depth_to_color/image_raw) and of the same time; wrong silhouettes have the same "
    "effect",
    clear=35.0,
    is_low=True,
    window=15,
    least=6,
)

# The person.

DISTANCE = Watch(
    "distance",
    "difference of the distances of two sources, standard deviations",
    1.95,
    "5 % of the differences of right sources are larger",
    "by the {scale} the person is {shown_m:.1f} m away, by the {other} {other_m:.1f} m: one of "
    "them or the field of view is wrong, so the place is uncertain",
    clear=1.0,
    window=None,
    least=5,
)
BACK = Watch(
    "back",
    "share of hair where the face was, beyond the usual one",
    0.25,
    "docs/research.md#deviations-and-loss",
    clear=0.15,
)
OTHER_CLOTHES = Watch(
    "other person",
    "images in a row with the colours of somebody else",
    2,
    "what is held before the trunk is seen for a shorter time",
)

# Streams of images and other messages.

UNSTAMPED = Watch(
    "stamps that are zero",
    "images without a stamp among the latest",
    0,
    "every image has one",
    "the images have no stamp (it is zero), so they are used in the order of arrival and losses "
    "are not seen; set header.stamp in the camera's driver",
)
REPEATED = Watch(
    "stamps that repeat",
    "repeated stamps among the latest, but for one, share",
    0.1,
    "a single one is no fault",
    "{count} of the latest {of} images repeat the stamp of the one before and are left out; does "
    "the driver send them twice, or are there two publishers?",
)
FOREIGN = Watch(
    "stamps of two clocks",
    "images of another clock among the latest",
    0,
    "a camera has one clock",
    "the stamps jump to and fro between two times, and images of one of them are left out; "
    "expected one camera with one clock: see 'ros2 topic info --verbose'",
)
LATE = Watch(
    "stamps that are late",
    "overtaken images among the latest, but for one, share",
    0.1,
    "a single one is no fault",
    "{count} of the latest {of} images have stamps that go back by less than a second and are left "
    "out; are images sent twice, or is a recording played in a loop?",
)
RESTARTED = Watch(
    "stamps that go back",
    "new starts of the stamps among the latest",
    2,
    "a source may be started again",
    "the stamps of the latest {of} images went back {count} times by more than a second, and "
    "tracking started again each time; is the clock of the camera's computer being set, or a "
    "recording played in a loop?",
)
BURSTS = Watch(
    "bursts",
    "bursts of images within 10 s",
    2,
    "a single delay is no fault",
    "the images arrive in bursts, one every {period_s:.1f} s, so results come late and most images "
    "are left out: the driver or the network holds them back; connect the camera by cable, switch "
    "the power saving of Wi-Fi off, or let the driver send each image at once",
)
AHEAD = Watch(
    "stamps ahead",
    "stamps ahead of this computer's clock, s",
    1.0,
    "clocks that are synchronized differ by milliseconds",
    "the stamps are {value:.1f} s ahead of this computer's clock, so whoever looks up TF at them "
    "waits: synchronize the clocks of the camera's computer and of this one, for example with "
    "chrony",
)
CLOCK = Watch(
    "clock",
    "difference of the stamps of images that arrive together, s",
    0.1,
    "of one clock, images from different computers or of depth may arrive this much later",
    "the stamps on {topic} and {first} are {value:.2f} s apart in images that arrive together, so "
    "images of different moments are paired, or none; {remedy}",
    window=60,
    least=10,
)
STUCK = Watch(
    "stamps",
    "messages in a row whose stamps do not go on",
    10,
    "less than a second at 15 Hz is no fault",
    "the stamps of the last {value:.0f} messages on {topic} stand still or go back, so they are "
    "not used; is that camera's driver stuck?",
)
SILENT = Watch(
    "silence",
    "time without a message of a camera, s",
    2.0,
    "the slowest cameras send one a second",
    "nothing has come on {topic} for {value:.0f} s; tracking goes on without it. Are that camera "
    "and its background node running?",
)
CEASED = Watch(
    "ceased",
    "time without input of a node, s",
    2.0,
    "the slowest cameras send one a second",
    "{source}, which have ceased {value:.0f} s ago: {why}",
)
NO_POINTS = Watch(
    "silence",
    "time without points of a detector, s",
    3.0,
    "a detector that starts or is busy needs some",
    "nothing has come on {topic} for {value:.0f} s; tracking goes on without points. Is the "
    "detector running?",
)
OTHER_TIME = Watch(
    "clock",
    "sets of points in a row that are of another time than the silhouettes",
    4,
    "single ones come late",
    "the points on {topic} are {apart_s:.1f} s {than} than the silhouettes, so they are not used; "
    "expected at most {most_s:g} s: the stamp must be that of the image, and clocks of several "
    "computers synchronized",
)
BESIDE = Watch(
    "place",
    "images in a row whose points lie beside the silhouette",
    10,
    "a fast hand may lie beside it in some",
    "the points of the last {value:.0f} images are not used: {reason}",
)
SLOW = Watch(
    "slow",
    "latency, periods of the images",
    1.0,
    "the next image waits",
    "results come {latency_ms:.0f} ms after their images, which come every {period_ms:.0f} ms, so "
    "images are left out; {remedy}",
    window=120,
    least=30,
)
LOST = Watch(
    "loss",
    "share of the images that are lost on the way",
    0.1,
    "tracking goes on well with less",
    "{percent:.0f} % of the images on {topic} ({kilobytes} kB each) are lost on the way: start all "
    "nodes with FASTRTPS_DEFAULT_PROFILES_FILE set to this package's "
    "config/fastdds_large_images.xml, or use smaller, grey or compressed images",
)

# Light.

DARK = Watch(
    "exposure",
    "brightness below which 95 % of the pixels are, grey levels",
    24,
    "noise in the dark",
    "the image is dark: 95 % of its pixels are below {limit} of 255. Switch a light on, take the "
    "cover off the lens, or set a longer exposure or more gain",
    is_low=True,
)
WHITE = Watch(
    "exposure",
    "brightness above which 95 % of the pixels are, grey levels",
    249,
    "pixels that are saturated",
    "the image is overexposed: 95 % of its pixels are white. Set a shorter exposure or less gain",
)
DRIFT = Watch(
    "brightness",
    "median change of the brightness of the scene, grey levels",
    12.0,
    "well above the noise of a median over the image",
    "the whole scene changed its brightness: switch the camera's automatic exposure and white "
    "balance off (v4l2-ctl -c auto_exposure=1,white_balance_automatic=0), then call "
    "background/learn with nobody in view",
)
COVERED = DRIFT._replace(
    measure="share of the image that is foreground",
    limit=0.6,
    why="a person who is wholly in view covers less",
)
NEAR = COVERED._replace(
    name="depth",
    words="most of the image is nearer than within_m, {within_m:g} m: choose it between the person "
    "and the wall, and let nothing else stand before it",
)
