"""Names of a recording's image and calibration topics, as the launch files take them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.recordings.bag_reader import BagReader

_COMPRESSED = "/compressed"


def find_topics(bag: str, wanted: Iterable[str], cameras: Sequence[str] = ()) -> dict[str, str]:
    """Return the topics of a bag as values of the launch arguments of the same names.

    Args:
        bag: rosbag2 folder or file.
        wanted: ``image``, which includes ``image_transport``, and ``camera_info``.
        cameras: namespaces of several cameras; the names are then relative to each namespace.

    Raises:
        CardboxError: the bag cannot be read, does not have exactly one topic of each kind, or the
            cameras differ.
    """
    with BagReader(bag) as reader:
        images = reader.image_topics
        if len(images) > 1 and not cameras:
            raise CardboxError(
                f"{bag} has images on {', '.join(images)}; choose one with the launch arguments "
                'image and camera_info, or several cameras with cameras:="[NAMESPACE, NAMESPACE]"'
            )
        found = [_topics_of(reader, wanted, camera) for camera in cameras or ("",)]
    if any(one != found[0] for one in found):
        each = "; ".join(f"{name}: {one}" for name, one in zip(cameras, found, strict=True))
        raise CardboxError(f"the cameras of {bag} have different topics, expected the same: {each}")
    return found[0]


def _topics_of(reader: BagReader, wanted: Iterable[str], camera: str) -> dict[str, str]:
    """Return the topics of one camera; if ``camera`` is empty, those of the only camera."""
    folder = f"/{camera}/" if camera else ""
    found = {}
    if "image" in wanted:
        topic = reader.image_topic(camera or None).removeprefix(folder)
        found["image"] = topic.removesuffix(_COMPRESSED)
        found["image_transport"] = "compressed" if topic.endswith(_COMPRESSED) else "raw"
    if "camera_info" in wanted:
        found["camera_info"] = reader.camera_info_topic(camera or None).removeprefix(folder)
    return found
