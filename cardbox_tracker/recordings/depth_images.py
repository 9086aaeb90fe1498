"""Depth images of a recording."""

from __future__ import annotations

import os
from collections.abc import Iterator

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.depth_image import DepthImage, at_size, depth_from_image
from cardbox_tracker.common.errors import BagError
from cardbox_tracker.recordings.bag_reader import IMAGE_TYPES, BagReader


def depth_images(
    path: str | os.PathLike[str], topic: str, camera: Camera
) -> Iterator[tuple[int, DepthImage]]:
    """Yield stamp, ns, and depth (H, W), metres, of each depth image, at the size of ``camera``.

    Raises:
        BagError: the recording cannot be read, lacks the topic, or has other messages on it.
        EncodingError: the encoding of an image is not one of depth.
    """
    with BagReader(path) as bag:
        kind = bag.topics.get(topic, IMAGE_TYPES[0])
        if kind not in IMAGE_TYPES:
            raise BagError(
                f"{topic} has messages of {kind}; expected depth images: "
                f"{' or '.join(IMAGE_TYPES)} (compressedDepth)"
            )
        for stamp_ns, _, image in bag.stamped(topic):
            yield stamp_ns, at_size(depth_from_image(image), camera.width, camera.height)
