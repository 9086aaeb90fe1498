"""Message types of a recording's topics, which are untrusted input."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sensor_msgs.msg import Image

from cardbox_tracker.common.errors import BagError
from cardbox_tracker.ros.messages.types import message_class, message_classes


def test_an_installed_type_is_found() -> None:
    assert message_class("/image_raw", "sensor_msgs/msg/Image") is Image


KINDS = {"/tf_static": "no_such_msgs/msg/TF", "/odd": "Image", "/image": "sensor_msgs/msg/Image"}


def test_topics_without_a_class_are_left_out_and_said() -> None:
    said: list[str] = []
    assert message_classes(KINDS, [], said.append) == {"/image": Image}
    assert len(said) == 2
    assert "/tf_static" in said[0] and "no_such_msgs/msg/TF" in said[0]
    assert "'no_such_msgs' (ros-jazzy-no-such-msgs)" in said[0]
    assert message_classes({}, [], said.append) == {}


@pytest.mark.parametrize("chosen", [["/image", "/tf_static"], []])
def test_what_was_chosen_has_to_have_one_and_so_has_some_topic(chosen: list[str]) -> None:
    kinds = KINDS if chosen else {"/tf_static": KINDS["/tf_static"]}
    with pytest.raises(BagError, match=r"/tf_static .*no_such_msgs/msg/TF"):
        message_classes(kinds, chosen, lambda text: None)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("sensor_msgs/msg/Nothing", "install .*'sensor_msgs'"),
        ("no_such_msgs/msg/Image", "no_such_msgs/msg/Image.*installed"),
        ("Image", "sensor_msgs/msg/Image"),
        ("sensor_msgs/Image", "expected"),
        ("os.path/msg/Image", "expected"),
        ("sensor_msgs/msg/__doc__", "expected"),
        ("x" * 100_000, "expected"),
    ],
)
def test_a_type_that_is_none_is_refused(kind: str, words: str) -> None:
    with pytest.raises(BagError, match=words) as refused:
        message_class("/image_raw", kind)
    assert len(str(refused.value)) < 400


@given(st.text(max_size=30), st.text(max_size=30))
def test_any_type_is_refused_in_words_unless_it_is_installed(topic: str, kind: str) -> None:
    try:
        found = message_class(topic, kind)
    except BagError:
        return
    # Hypothesis also uses texts from the source code, which has real types.
    assert kind.endswith(f"_msgs/msg/{found.__name__}")
