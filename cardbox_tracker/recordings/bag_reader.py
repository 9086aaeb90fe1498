"""Read rosbag2 recordings (mcap or sqlite3) without a ROS installation."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.typesys import Stores, get_typestore

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.camera.camera_info import calibration_from_info
from cardbox_tracker.camera.encodings import (
    decode_as_sent,
    decode_compressed,
    image_parts,
)
from cardbox_tracker.common.errors import BagError, EncodingError, cut
from cardbox_tracker.recordings.bag_limits import check_recording, limit_decompression
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.image_recording import WORKING_SIZE, RecordedImage

IMAGE_TYPES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
CAMERA_INFO_TYPE = "sensor_msgs/msg/CameraInfo"
_REPAIR = "'ros2 bag reindex' remakes lost metadata, 'mcap recover' a file that was cut off"
FILE_ENDINGS = (".mcap", ".db3", ".bag")
"""Endings of a recording's files."""


class BagMessage(NamedTuple):
    """One message: its topic, recording time, type, and CDR bytes."""

    topic: str
    time_ns: int
    msgtype: str
    raw: bytes


class BagReader:
    """Context of an open recording.

    All methods raise BagError if the recording cannot be read or lacks the requested topic.
    """

    def __init__(self, path: str | os.PathLike[str], camera: GivenCamera | None = None) -> None:
        """Store the path; the recording is opened on entry.

        Args:
            path: folder of a rosbag2 recording, or its .mcap or .db3 file.
            camera: properties of the only camera that replace those of the recording.
        """
        self.path, self.working_size = Path(path), WORKING_SIZE
        self._given = camera or GivenCamera()
        self._reader: AnyReader | None = None

    def __enter__(self) -> BagReader:
        """Open the recording."""
        path = self.path
        if not path.exists():
            raise BagError(f"there is no recording {path}; give a rosbag2 folder or file")
        if not path.is_dir() and not path.is_file():
            raise BagError(f"{path} is a pipe or a device; give a rosbag2 folder or file")
        if path.is_dir() and not (path / "metadata.yaml").exists():
            files = [f for f in sorted(path.iterdir()) if f.suffix in FILE_ENDINGS]
            if (path / "bag" / "metadata.yaml").exists():
                path = path / "bag"
            elif len(files) == 1:
                path = files[0]
            else:
                raise BagError(
                    f"{path} is not a rosbag2 recording (it has no metadata.yaml); give the folder "
                    "that 'ros2 bag record' or 'cardbox synthesize' made"
                )
        check_recording(path)
        limit_decompression()
        try:
            store = get_typestore(Stores.ROS2_JAZZY)
            self._reader = AnyReader([path], default_typestore=store)
            self._reader.open()
        except Exception as error:
            # rosbags does not catch the errors of its parsers, which can be of any type.
            self._reader = None
            raise BagError(
                f"cannot read the recording {self.path}: {_reason(error)}; give a rosbag2 "
                f"recording (mcap or sqlite3) that was closed properly: {_REPAIR}"
            ) from None
        if self._reader.message_count == 0:
            self.__exit__()
            raise BagError(f"the recording {self.path} has no messages; record it again")
        return self

    def __exit__(self, *_: object) -> None:
        """Close the recording."""
        if self._reader is not None:
            with suppress(AnyReaderError):
                self._reader.close()
            self._reader = None

    @property
    def _open(self) -> AnyReader:
        if self._reader is None:
            raise BagError(f"the recording {self.path} is not open; use it in a 'with' statement")
        return self._reader

    @property
    def start_ns(self) -> int:
        """Time of the first message."""
        return int(self._open.start_time)

    @property
    def duration_s(self) -> float:
        """Seconds from the first to the last message."""
        # The duration of rosbags includes one nanosecond after the last message.
        return float(self._open.duration - 1) / 1e9

    @property
    def topics(self) -> dict[str, str]:
        """Message type of each topic."""
        return {c.topic: c.msgtype for c in self._open.connections}

    def count(self, topics: Sequence[str] | None = None) -> int:
        """Return the number of messages on ``topics``, or on all topics."""
        return sum(
            c.msgcount for c in self._open.connections if topics is None or c.topic in topics
        )

    def image_topic(self, camera: str | None = None) -> str:
        """Return the only image topic in the namespace ``camera``, or in the recording."""
        return self._only(IMAGE_TYPES, "image", camera)

    def camera_info_topic(self, camera: str | None = None) -> str:
        """Return the camera_info topic that belongs to the images."""
        found = [name for name, kind in self.topics.items() if kind == CAMERA_INFO_TYPE]
        folder = self.image_topic(camera).removesuffix("/compressed").rpartition("/")[0]
        beside = [name for name in found if name.rpartition("/")[0] == folder]
        if len(beside) == 1:
            return beside[0]
        return self._only((CAMERA_INFO_TYPE,), "CameraInfo", camera)

    def _only(self, types: tuple[str, ...], what: str, camera: str | None = None) -> str:
        folder = "" if camera is None else f"/{camera.strip('/')}/"
        found = sorted(
            name for name, kind in self.topics.items() if kind in types and name.startswith(folder)
        )
        if len(found) > 1 and camera is not None:
            # Depth and further images of the same camera can have topics in this namespace.
            found = [name for name in found if name in _image_names(folder)][:1] or found
        if len(found) != 1:
            where = f" below {folder}" if folder else ""
            advice = "" if folder or not found else "; choose one with --cameras NAMESPACE"
            if any(name.endswith("/tracking_state") for name in self.topics):
                advice = (
                    " camera. This seems to be a bag of results; give the recording from which it "
                    "was made"
                )
            raise BagError(
                f"{self.path} has {len(found)} {what} topics{where}; expected one{advice}. It has "
                f"{self._list()}"
            )
        return found[0]

    def messages(self, topics: Sequence[str] | None = None) -> Iterator[BagMessage]:
        """Yield the messages of ``topics``, or of all topics, in the order of recording.

        Raises:
            BagError: the recording lacks one of the topics, or is damaged.
        """
        missing = sorted(set(topics or ()) - set(self.topics))
        if missing:
            raise BagError(f"{self.path} has no topic {', '.join(missing)}; it has {self._list()}")
        chosen = [c for c in self._open.connections if topics is None or c.topic in topics]
        if not chosen:
            return
        try:
            for connection, time_ns, raw in self._open.messages(chosen):
                yield BagMessage(connection.topic, time_ns, connection.msgtype, bytes(raw))
        except Exception as error:
            # The parsers of rosbags can raise any type of error.
            raise self._damaged(error) from None

    def deserialize(self, message: BagMessage) -> Any:
        """Return the message as an object with the fields of its type."""
        try:
            return self._open.deserialize(message.raw, message.msgtype)
        except Exception as error:
            # The parsers of rosbags can raise any type of error.
            raise self._damaged(error) from None

    def _damaged(self, error: Exception) -> BagError:
        return BagError(
            f"the recording {self.path} is damaged: {_reason(error)}; record it again, or {_REPAIR}"
        )

    def _list(self) -> str:
        return ", ".join(f"{n} ({t})" for n, t in sorted(self.topics.items())) or "no topics"

    def images(self, topic: str | None = None) -> Iterator[RecordedImage]:
        """Yield the images of ``topic``, or of the only image topic, in order."""
        for message in self.messages([topic or self.image_topic()]):
            image = self.deserialize(message)
            try:
                frame_id, decode = str(image.header.frame_id), _decoder(image)
                found = RecordedImage(stamp_ns_of(image), frame_id, message.time_ns, decode)
            except (AttributeError, TypeError, ValueError) as error:
                # The message type is defined by the recording and may lack fields.
                raise self._damaged(error) from None
            yield found

    def camera_info(self, camera: str | None = None) -> Any:
        """Return the first CameraInfo in the namespace ``camera``, or in the recording.

        Raises:
            BagError: the recording has no CameraInfo.
        """
        topic = self.camera_info_topic(camera)
        for message in self.messages([topic]):
            return self.deserialize(message)
        raise BagError(f"{self.path} has no message on {topic}; record it with the images")

    def calibration(self, camera: str | None = None) -> Calibration:
        """Return the given calibration, or that in the message of :meth:`camera_info`.

        Raises:
            BagError: the recording has no CameraInfo.
            CameraError: the camera is not calibrated; the text names both topics.
        """
        if self._given.is_calibrated:
            return self._given_calibration(camera)
        if CAMERA_INFO_TYPE not in self.topics.values():
            raise BagError(
                f"{self.path} has 0 CameraInfo topics; expected one for {self.image_topic(camera)}."
                " Record it with the images, or give --fov DEG or --calibration FILE"
            )
        topics = self.image_topic(camera), self.camera_info_topic(camera)
        info = self.camera_info(camera)
        try:
            return self._given.rolled(calibration_from_info(info, *topics))
        except (AttributeError, ArithmeticError, TypeError, ValueError) as error:
            raise self._damaged(error) from None

    def _given_calibration(self, camera: str | None) -> Calibration:
        topic = self.image_topic(camera)
        for image in self.images(topic):
            with suppress(EncodingError):
                height, width = image.as_sent.shape[:2]
                return self._given.calibrated(self.path, width, height, image.frame_id)
        raise BagError(f"{self.path} has no image on {topic} that can be decoded; record it again")

    @property
    def remarks(self) -> list[str]:
        """A remark if a given calibration replaces a CameraInfo."""
        if self._given.is_calibrated and CAMERA_INFO_TYPE in self.topics.values():
            return ["the given calibration or field of view replaces the recording's CameraInfo"]
        return []


def _image_names(folder: str) -> tuple[str, ...]:
    """Return the usual image topics of a camera's namespace, the preferred one first."""
    raw = ("image_raw", "image_raw/compressed", "image_rect", "image_rect_color", "image")
    return tuple(folder + name for name in raw)


def _reason(error: Exception) -> str:
    return cut(str(error)) or type(error).__name__


def stamp_ns_of(message: Any) -> int:
    """Return the stamp of a message's header, ns."""
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _decoder(image: Any) -> Callable[[], NDArray[np.uint8]]:
    if hasattr(image, "encoding"):
        return partial(decode_as_sent, *image_parts(image))
    return partial(decode_compressed, image.data)
