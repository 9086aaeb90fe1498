"""The memory for received images is limited, and only silhouettes are kept."""

from __future__ import annotations

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from cardbox_tracker.common.errors import EncodingError
from cardbox_tracker.ros.messages.conversions import image_message
from cardbox_tracker.ros.nodes.camera_inputs import ImagePairing
from cardbox_tracker.ros.nodes.input_stream import MOST_BYTES, RecentImages
from cardbox_tracker.ros.nodes.reference_capture import ReferenceCapture


def message(number: int, size: int = 4) -> Image:
    header = Header(stamp=Time(sec=number))
    return image_message(header, np.zeros((size, size), np.uint8), "mono8")


def kept_bytes(images: RecentImages) -> int:
    return sum(len(image.data) for image in images)


@pytest.mark.promise("No input fills memory, disk or log, or holds up a program")
def test_huge_silhouettes_and_images_do_not_pile_up() -> None:
    references = ReferenceCapture("silhouette")
    pairing = ImagePairing(lambda *_: None)
    huge = message(1, 3464)  # 12 MB
    for _ in range(40):
        references.add(huge)
        references.add_image(huge, 0)
        pairing.add_image(huge, 0)
    for images in (references._recent, references._recent_images, pairing._images):
        assert 0 < kept_bytes(images) <= MOST_BYTES


def test_as_many_as_a_capture_combines_are_kept_of_usual_size() -> None:
    references = ReferenceCapture("silhouette")
    for number in range(40):
        references.add(message(number, 640))
    assert [image.header.stamp.sec for image in references._recent] == list(range(35, 40))


def test_what_is_no_silhouette_is_not_kept() -> None:
    references = ReferenceCapture("silhouette")
    with pytest.raises(EncodingError):
        references.add(Image(height=4, width=4, step=4, encoding="rgb8", data=bytes(16)))
    with pytest.raises(EncodingError):
        references.add(Image(height=4000, width=4000, step=4000, encoding="mono8", data=bytes(9)))
    assert not len(references._recent)


def test_the_latest_is_kept_even_if_it_is_larger_than_all() -> None:
    images = RecentImages(3, most_bytes=10)
    for number in range(5):
        images.append(message(number))
    assert [image.header.stamp.sec for image in images] == [4]
    small = RecentImages(3, most_bytes=40)
    for number in range(5):
        small.append(message(number))
    assert [image.header.stamp.sec for image in small] == [3, 4]
