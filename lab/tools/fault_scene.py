"""A person whose posture is known at every moment, and streams of their images with faults."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.simulation.motions import wave
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture

S = 1_000_000_000
PERIOD_S = 1.0 / 15.0
START_NS = 1_000 * S
# Lengths of a run: before, during and after a fault.
BEFORE_S, FAULT_S, AFTER_S = 2.0, 3.0, 2.0
RESUME_S = 1.0
"""After a fault the posture is that of the person within this time, by the stamps."""

# Every start reaches these bounds; a tracker that follows something else is far beyond them.
LARGEST_ERROR_M, LEAST_IOU = 0.20, 0.7

PERSON, EMPTY, GARBAGE = "person", "empty", "garbage"


@dataclass(frozen=True)
class Sent:
    """One image.

    Attributes:
        stamp_ns: stamp of the message.
        at_s: time of the person's posture.
        shows: ``PERSON``, ``EMPTY`` or ``GARBAGE``.
        by: number of the publisher.
        wait_s: pause before it is sent.
    """

    stamp_ns: int
    at_s: float
    shows: str = PERSON
    by: int = 0
    wait_s: float = PERIOD_S


@dataclass(frozen=True)
class Found:
    """Result of the tracker for one image: posture (12,) and place (2,), or None."""

    stamp_ns: int
    posture: NDArray[np.float64] | None
    place_m: NDArray[np.float64] | None = None


class Person:
    """A drawn room with a person who waves for ever."""

    def __init__(self, width: int = 320) -> None:
        """Draw images ``width`` px wide."""
        self.body = BodyModel.of(distance_m=2.3, hip_height_m=-0.45, lateral_m=0.05)
        scale = width / 320
        focal_px, center = 300.0 * scale, (width / 2 - 0.5, width * 3 / 8 - 0.5)
        self.camera = Camera(width, width * 3 // 4, focal_px, focal_px, *center)
        self._rng = np.random.default_rng(1)

    def posture(self, at_s: float) -> NDArray[np.float64]:
        """Return the posture (12,) at a time; the person stands still for the first second."""
        inner = (at_s - 1.0) % 8.0
        posture = wave(1.0 + inner) if at_s >= 1.0 else reference_posture("front")
        if 1.0 <= at_s < 2.0:
            posture = reference_posture("front") + (at_s - 1.0) * (
                posture - reference_posture("front")
            )
        posture[0] = self.body.placement.lateral_m
        return posture

    def silhouette(self, at_s: float) -> NDArray[np.uint8]:
        """Return the true silhouette (H, W), 0 or 255."""
        return render(cardbox_patches(self.body, self.posture(at_s)), self.camera)

    def image(self, sent: Sent) -> NDArray[np.uint8]:
        """Return the noisy image (H, W)."""
        shape = (self.camera.height, self.camera.width)
        if sent.shows == GARBAGE:
            return self._rng.integers(0, 255, shape, dtype=np.uint8)
        person = self.silhouette(sent.at_s) > 0 if sent.shows == PERSON else np.zeros(shape, bool)
        pixels = np.where(person, 190.0, 90.0) + self._rng.normal(0, 2, shape)
        return np.clip(pixels, 0, 255).astype(np.uint8)

    def error_m(self, found: Found, at_s: float) -> float:
        """Return the mean distance of shoulders, elbows and hands from the truth, metres."""
        if found.posture is None:
            return float("inf")
        truth = pose(self.body.rigid, self.posture(at_s)).keypoints_m
        return float(np.linalg.norm(self._keypoints(found) - truth, axis=1).mean())

    def iou(self, found: Found, at_s: float) -> float:
        """Return the overlap of the found posture's outline with the true silhouette, 0 to 1."""
        if found.posture is None:
            return 0.0
        model = render(cardbox_patches(self._placed(found), found.posture), self.camera) > 0
        truth = self.silhouette(at_s) > 0
        return float(np.count_nonzero(model & truth) / np.count_nonzero(model | truth))

    def _keypoints(self, found: Found) -> NDArray[np.float64]:
        assert found.posture is not None
        return pose(self._placed(found).rigid, found.posture).keypoints_m

    def _placed(self, found: Found) -> BodyModel:
        if found.place_m is None:
            return self.body
        place = self.body.placement
        x_m, z_m = found.place_m.tolist()
        return self.body.with_values(
            distance_m=place.distance_m - x_m, hip_height_m=place.hip_height_m + z_m
        )


def even(from_s: float, to_s: float, period_s: float = PERIOD_S) -> list[Sent]:
    """Return the images of an undisturbed camera."""
    count = round((to_s - from_s) / period_s)
    times = [from_s + i * period_s for i in range(count)]
    return [Sent(START_NS + round(at_s * S), at_s, wait_s=period_s) for at_s in times]


Fault = Callable[[list[Sent], np.random.Generator], list[Sent]]
"""Replaces the undisturbed images during a fault by those that are sent."""


def shifted(images: Iterable[Sent], by_s: float) -> list[Sent]:
    """Return the images with other stamps."""
    return [replace(sent, stamp_ns=sent.stamp_ns + round(by_s * S)) for sent in images]


def _lost(images: list[Sent], rng: np.random.Generator) -> list[Sent]:
    return [sent for sent in images if rng.random() > 0.3]


def _flood(images: list[Sent], _: np.random.Generator) -> list[Sent]:
    return even(images[0].at_s, images[-1].at_s + PERIOD_S, 1.0 / 200.0)


def _two(images: list[Sent], _: np.random.Generator) -> list[Sent]:
    others = shifted([replace(s, shows=EMPTY, by=1, wait_s=0.0) for s in images], -3600.0)
    return [sent for pair in zip(images, others, strict=True) for sent in pair]


def _two_of_one_clock(images: list[Sent], _: np.random.Generator) -> list[Sent]:
    others = shifted([replace(s, shows=EMPTY, by=1, wait_s=0.0) for s in images], 0.01)
    return [sent for pair in zip(images, others, strict=True) for sent in pair]


def _twice(images: list[Sent], _: np.random.Generator) -> list[Sent]:
    return [sent for image in images for sent in (image, replace(image, wait_s=0.0))]


def _reordered(images: list[Sent], rng: np.random.Generator) -> list[Sent]:
    order = np.argsort(np.arange(len(images)) + rng.uniform(0, 3, len(images)))
    return [images[i] for i in order]


def _jumping(images: list[Sent], _: np.random.Generator) -> list[Sent]:
    third = len(images) // 3
    return [
        *shifted(images[:third], 3600.0),
        *shifted(images[third : 2 * third], -3600.0),
        *images[2 * third :],
    ]


FAULTS: Mapping[str, Fault] = MappingProxyType(
    {
        "camera away for 5 s": lambda images, _: [replace(images[-1], wait_s=5.0)],
        "30 % of the images lost": _lost,
        "200 images a second": _flood,
        "a second publisher, empty room, another clock": _two,
        "a second publisher, empty room, the same clock": _two_of_one_clock,
        "each image twice": _twice,
        "images overtake each other": _reordered,
        "the clock jumps by an hour, ahead and back": _jumping,
        "stamps that are zero": lambda images, _: [replace(s, stamp_ns=0) for s in images],
        "noise instead of images": lambda images, _: [replace(s, shows=GARBAGE) for s in images],
        "nobody in view": lambda images, _: [replace(s, shows=EMPTY) for s in images],
    }
)
"""Faults of the stream of images by name."""


def run_of(
    fault: Fault, seed: int = 0, from_s: float = 0.0
) -> tuple[list[Sent], list[Sent], list[Sent]]:
    """Return the images sent before, during and after a fault, beginning at ``from_s``."""
    begin = from_s + BEFORE_S
    end = begin + FAULT_S
    during = fault(even(begin, end), np.random.default_rng(seed))
    away_s = max((sent.wait_s for sent in during), default=0.0)
    if away_s > 1.0:
        # Time passes, and the person moves on, while nothing is sent.
        end = begin + away_s
        during = []
    after = even(end, end + AFTER_S)
    if not during:
        after[0] = replace(after[0], wait_s=away_s)
    return even(from_s, begin), during, after


@dataclass(frozen=True)
class Verdict:
    """Outcome of a fault.

    Attributes:
        fault: its name.
        resumed_s: time from the first good image to the first one from which on all postures are
            right; infinite if there is none.
        error_before_m: mean error of the keypoints in the second before the fault.
        error_after_m: the same in the last second.
        iou_after: mean overlap in the last second.
        unseen: postures published for a stamp that was never sent, or twice for one.
    """

    fault: str
    resumed_s: float
    error_before_m: float
    error_after_m: float
    iou_after: float
    unseen: int

    @property
    def is_good(self) -> bool:
        """Whether the promise was kept."""
        return self.resumed_s <= RESUME_S and self.iou_after >= LEAST_IOU and not self.unseen


def judge(
    fault: str, person: Person, sent: tuple[list[Sent], ...], found: Iterable[Found]
) -> Verdict:
    """Compare the results with the truth; ``sent`` is before, during and after."""
    before, _, after = sent
    answers: dict[int, Found] = {}
    known = {image.stamp_ns for part in sent for image in part}
    unseen = 0
    for one in found:
        if one.posture is None:
            continue
        unseen += one.stamp_ns not in known or (one.stamp_ns in answers and one.stamp_ns != 0)
        answers[one.stamp_ns] = one
    rows = [(image.at_s, answers[i]) for image in after if (i := image.stamp_ns) in answers]
    wrong = [at_s for at_s, one in rows if person.error_m(one, at_s) > LARGEST_ERROR_M]
    first_s = after[0].at_s
    right = [at_s for at_s, _ in rows if not wrong or at_s > wrong[-1]]
    last = [(at_s, one) for at_s, one in rows if at_s > after[-1].at_s - 1.0]
    calm = [
        person.error_m(answers[image.stamp_ns], image.at_s)
        for image in before
        if image.stamp_ns in answers and image.at_s > before[-1].at_s - 1.0
    ]
    return Verdict(
        fault,
        right[0] - first_s if right else float("inf"),
        float(np.mean(calm)) if calm else float("inf"),
        float(np.mean([person.error_m(one, at_s) for at_s, one in last])) if last else float("inf"),
        float(np.mean([person.iou(one, at_s) for at_s, one in last])) if last else 0.0,
        unseen,
    )
