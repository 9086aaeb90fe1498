"""Checks that bags of results are of the same images, by stamps and pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.recordings.bag_reader import BagReader, stamp_ns_of
from cardbox_tracker.recordings.result_reader import namespace_of

OVERLAY = "/overlay"
"""Topic with the image of each result, below the namespace of the tracker."""
_JOINTS = "/joint_states"

# Overlays of one image differ where the models differ, and noise makes other images differ nearly
# everywhere. Conversion to grey rounds.
_LEAST_EQUAL, _ROUNDING = 0.4, 1


def image_stamps(path: Path) -> list[int]:
    """Return the stamps of the images in a bag of results, ns, ascending.

    Without overlays these are the images with joints.

    Raises:
        BagError: the bag cannot be read, or has no results of the tracker.
    """
    with BagReader(path) as bag:
        space = namespace_of(bag)
        if space + OVERLAY in bag.topics:
            return sorted({image.stamp_ns for image in bag.images(space + OVERLAY)})
        topics = [topic for topic in (space + _JOINTS,) if topic in bag.topics]
        return sorted({stamp_ns_of(bag.deserialize(one)) for one in bag.messages(topics)})


def check_same_images(first: Path, second: Path) -> int:
    """Check that the images of one bag of results are among those of the other.

    Returns:
        Stamp of the earliest image of both, ns.

    Raises:
        CardboxError: they have other stamps or other pictures, or a bag cannot be read.
    """
    stamps = {path: image_stamps(path) for path in (first, second)}
    few, many = sorted(stamps, key=lambda path: len(stamps[path]))
    shared = sorted(set(stamps[few]) & set(stamps[many]))
    others = len(stamps[few]) - len(shared)
    remedy = "; give two results of the same recording"
    if not shared:
        raise CardboxError(f"{first} and {second} have no image in common{remedy}")
    if others:
        raise CardboxError(
            f"{others} of the {len(stamps[few])} images of {few} are not among those of {many}"
            + remedy
        )
    asked = [shared[0], shared[len(shared) // 2], shared[-1]]
    pictures = zip(_overlays(first, asked), _overlays(second, asked), strict=False)
    equal = [_share_of_equal_pixels(one, other) for one, other in pictures]
    if equal and max(equal) < _LEAST_EQUAL:
        raise CardboxError(
            f"the images of {first} and {second} have the same stamps but other pictures{remedy}"
        )
    return min(stamps[first][0], stamps[second][0])


def _overlays(path: Path, stamps_ns: Sequence[int]) -> list[NDArray[np.uint8]]:
    """Return the overlays (H, W, 3) of some images; none if the bag has none."""
    with BagReader(path) as bag:
        topic = namespace_of(bag) + OVERLAY
        if topic not in bag.topics:
            return []
        found = {
            image.stamp_ns: image.as_sent
            for image in bag.images(topic)
            if image.stamp_ns in stamps_ns
        }
    return [found[stamp] for stamp in sorted(found)]


def _share_of_equal_pixels(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> float:
    """Return the share of pixels that are alike in the size of the smaller picture, 0 to 1.

    Pictures whose sizes have no whole ratio cannot be compared by pixels and count as alike.
    """
    small, large = sorted((_grey(one), _grey(other)), key=lambda picture: picture.size)
    steps = np.divide(large.shape, small.shape)
    if steps[0] != steps[1] or steps[0] % 1:
        is_same_shape = abs(steps[0] / steps[1] - 1.0) < 0.02
        return 1.0 if is_same_shape else 0.0
    step = int(steps[0])
    # An enlarged overlay repeats the pixels of the picture.
    difference = small - large[::step, ::step]
    return float((np.abs(difference) <= _ROUNDING).mean())


def _grey(picture: NDArray[np.uint8]) -> NDArray[np.int16]:
    grey = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    return np.asarray(grey, np.int16)
