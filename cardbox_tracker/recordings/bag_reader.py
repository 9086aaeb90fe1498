"""Read rosbag2 recordings (mcap or sqlite3) without a ROS installation."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import islice
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.interfaces import Connection
from rosbags.typesys import Stores, get_typestore

from cardbox_tracker.camera.calibration_watch import CalibrationWatch
from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.camera.camera_info import calibration_from_info, is_other_lens
from cardbox_tracker.camera.encodings import Levels, SentImage, decode_as_sent, decode_compressed
from cardbox_tracker.camera.frames import OneFrame
from cardbox_tracker.camera.stamps import RecordedStamps, StampOrder
from cardbox_tracker.camera.zoom import ZoomWitness
from cardbox_tracker.common.errors import BagError, CameraError, EncodingError, reason_of
from cardbox_tracker.recordings.bag_files import (
    check_parts,
    check_recording,
    limit_decompression,
    paths_to_open,
    read_other_channels,
)
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.image_recording import RecordedImage

IMAGE_TYPES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
CAMERA_INFO_TYPE = "sensor_msgs/msg/CameraInfo"
# Transports of image_transport with images, the preferred one first.
_TRANSPORTS = ("compressed", "zstd", "compressedDepth")
# Ends of the types of other transports, whose messages are no whole images.
_PACKETS = ("Packet", "CompressedVideo")
# Usual image topics in a camera's namespace.
_IMAGE_NAMES = ("image_raw", "image_raw/compressed", "image_rect", "image_rect_color", "image")
_LEFT_OUT = MappingProxyType(
    {
        StampOrder.LATE: "of an earlier time",
        StampOrder.REPEATED: "of the one before",
        StampOrder.FOREIGN: "of another clock",
    }
)
# Images among which a second camera on a topic is found before a calibration is chosen.
_TURNS = 8
_MOST_PERIOD_NS = 2_000_000_000
# Images before and after a change of the calibration are compared over this time.
_AROUND_NS = 2_000_000_000
_REPAIR = "'ros2 bag reindex' remakes lost metadata, 'mcap recover' a file that was cut off"


REPAIR_ROS1 = "let its name end in '.bag', and close it with 'rosbag reindex' of ROS 1"
"""What to do with a bag of ROS 1 whose recorder was killed, for texts."""


class BagMessage(NamedTuple):
    """One message: its topic, recording time, type, and CDR bytes."""

    topic: str
    time_ns: int
    msgtype: str
    raw: bytes


class BagReader:
    """Context of an open recording; methods raise BagError if it, or a topic, cannot be read."""

    def __init__(self, path: str | os.PathLike[str], camera: GivenCamera | None = None) -> None:
        """Store the path: folder of a rosbag2 recording, or its .mcap or .db3 file.

        The properties of ``camera`` replace those of the recording's only camera.
        """
        self.path = Path(path)
        self._given = camera or GivenCamera()
        self._reader: AnyReader | None = None
        self._stamps: dict[str, RecordedStamps] = {}
        self._levels: dict[str, Levels] = {}
        self._frames: dict[str, OneFrame] = {}
        self._skipped: dict[str, str] = {}
        self._infos: dict[str | None, tuple[Any, Calibration]] = {}

    def __enter__(self) -> BagReader:
        path = self.path
        if not path.exists():
            raise BagError(f"there is no recording {path}; give a rosbag2 folder or file")
        if not path.is_dir() and not path.is_file():
            raise BagError(f"{path} is a pipe or a device; give a rosbag2 folder or file")
        paths = [path]
        if path.is_dir():
            is_inside = not (path / "metadata.yaml").exists() and (path / "bag").is_dir()
            paths = paths_to_open(path / "bag" if is_inside else path)
            if not paths:
                raise BagError(
                    f"{path} is not a rosbag2 recording (it has no metadata.yaml); give the folder "
                    "that 'ros2 bag record' or 'cardbox synthesize' made; 'ros2 bag reindex' "
                    "remakes lost metadata"
                )
        for part in paths:
            check_recording(part)
        limit_decompression()
        read_other_channels()
        try:
            store = get_typestore(Stores.ROS2_JAZZY)
            self._reader = AnyReader(paths, default_typestore=store)
            self._reader.open()
            check_parts(self.path, self._reader.readers)
        except BagError:
            self.__exit__()
            raise
        except Exception as error:
            # rosbags does not catch the errors of its parsers, which can be of any type.
            self.__exit__()
            of_ros1 = self.path.suffix == ".bag"
            kind = "ROS 1 bag" if of_ros1 else "rosbag2 recording (mcap or sqlite3)"
            raise BagError(
                f"cannot read the recording {self.path}: {reason_of(error)}; give a {kind} that "
                f"was closed properly: {REPAIR_ROS1 if of_ros1 else _REPAIR}"
            ) from None
        if self._reader.message_count == 0:
            self.__exit__()
            raise BagError(f"the recording {self.path} has no messages; record it again")
        return self

    def __exit__(self, *_: object) -> None:
        if self._reader is not None:
            with suppress(AnyReaderError, AssertionError):
                self._reader.close()
            self._reader = None

    @property
    def _open(self) -> AnyReader:
        if self._reader is None:
            raise BagError(f"the recording {self.path} is not open; use it in a 'with' statement")
        return self._reader

    @property
    def _connections(self) -> list[Connection]:
        """Connections whose messages can be read; JSON, for example, cannot."""
        return [one for one in self._open.connections if not _unread_format(one)]

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
        return {c.topic: c.msgtype for c in self._connections}

    def count(self, topics: Sequence[str] | None = None) -> int:
        """Return the number of messages on ``topics``, or on all topics."""
        return sum(c.msgcount for c in self._connections if topics is None or c.topic in topics)

    def image_topic(self, camera: str | None = None) -> str:
        """Return the only image topic in the namespace ``camera``, or in the recording.

        Of the transports of one camera, the first that has messages is taken.
        """
        return self._only(IMAGE_TYPES, "image", camera)

    @property
    def image_topics(self) -> list[str]:
        """Image topics, one for each camera."""
        return chosen_transports(
            {name: self.count([name]) for name, kind in self.topics.items() if kind in IMAGE_TYPES}
        )

    def camera_info_topic(self, camera: str | None = None) -> str:
        """Return the camera_info topic that belongs to the images."""
        found = [name for name, kind in self.topics.items() if kind == CAMERA_INFO_TYPE]
        folder = self.image_topic(camera).removesuffix("/compressed").rpartition("/")[0]
        beside = [name for name in found if name.rpartition("/")[0] == folder]
        if len(beside) == 1:
            return beside[0]
        return self._only((CAMERA_INFO_TYPE,), "CameraInfo", camera)

    def _only(self, types: tuple[str, ...], what: str, camera: str | None = None) -> str:
        folder = "" if camera is None else f"/{camera}/".replace("//", "/")
        names = self.image_topics if types == IMAGE_TYPES else self.topics
        found = sorted(
            name for name in names if self.topics[name] in types and name.startswith(folder)
        )
        inside = {f"{name.removesuffix('/compressed').rpartition('/')[0]}/" for name in found}
        if len(found) > 1 and (camera is not None or len(inside) == 1):
            # Depth and further images of the same camera can have topics in this namespace.
            start = folder or min(inside)
            usual = [name for name in found if name.removeprefix(start) in _IMAGE_NAMES]
            found = usual[:1] or found
        if len(found) != 1:
            where = f" below {folder}" if folder else ""
            advice = "" if folder or not found else "; choose one with --cameras NAMESPACE"
            packets = [n for n, kind in self.topics.items() if kind.endswith(_PACKETS)]
            if not found and packets and types == IMAGE_TYPES:
                advice = (
                    f". {', '.join(sorted(packets))} has packets of a video, which are not read: "
                    "let 'ros2 run image_transport republish' make images of them, and record those"
                )
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
        """Yield the messages of ``topics``, or of all topics, in the order of recording."""
        missing = sorted(set(topics or ()) - set(self.topics))
        if missing:
            raise BagError(f"{self.path} has no topic {', '.join(missing)}; it has {self._list()}")
        chosen = [c for c in self._connections if topics is None or c.topic in topics]
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
            f"the recording {self.path} is damaged: {reason_of(error)}; record it again, "
            f"or {_REPAIR}"
        )

    def _list(self) -> str:
        return ", ".join(f"{n} ({t})" for n, t in sorted(self.topics.items())) or "no topics"

    def stamped(self, topic: str) -> Iterator[tuple[int, BagMessage, Any]]:
        """Yield stamp, ns, and decoded message of a topic; see :class:`.RecordedStamps`."""
        stamps, before = RecordedStamps(), self._stamps.get(topic)
        for message in self.messages([topic]):
            decoded = self.deserialize(message)
            try:
                sent_ns = stamp_ns_of(decoded)
                if stamps.statistics.received == 0 == sent_ns and self._begins_at_0(topic):
                    sent_ns = 1
                stamp_ns = stamps.add(sent_ns, message.time_ns)
            except (AttributeError, TypeError, ValueError) as error:
                # The message type is defined by the recording and may lack fields.
                raise self._damaged(error) from None
            # What was read furthest counts for the remarks.
            if before is None or stamps.statistics.received >= before.statistics.received:
                self._stamps[topic] = stamps
            if stamp_ns is not None:
                yield stamp_ns, message, decoded

    def _begins_at_0(self, topic: str) -> bool:
        """Return whether the clock of the camera begins at 0, so that the first stamp is one."""
        stamps_ns = [
            stamp_ns_of(self.deserialize(message)) for message in islice(self.messages([topic]), 2)
        ]
        return len(stamps_ns) == 2 and 0 < stamps_ns[1] < _MOST_PERIOD_NS

    def images(self, topic: str | None = None) -> Iterator[RecordedImage]:
        """Yield the images of ``topic``, or of the only image topic, in order, of one camera."""
        topic = topic or self.image_topic()
        frames, held = self._frames.get(topic, OneFrame()), None
        # The next image shows whether a camera takes turns with another.
        for image in self._all_images(topic):
            is_taken = frames.takes(image.frame_id)
            if frames.others:
                self._frames[topic] = frames
            if held is not None and held.frame_id.lstrip("/") not in frames.others:
                yield held
            held = image if is_taken else None
        if held is not None:
            yield held

    def _all_images(self, topic: str) -> Iterator[RecordedImage]:
        levels = self._levels.setdefault(topic, Levels())
        for stamp_ns, message, image in self.stamped(topic):
            try:
                frame_id, decode = str(image.header.frame_id), _decoder(image, levels)
                found = RecordedImage(stamp_ns, frame_id, message.time_ns, decode)
            except (AttributeError, TypeError, ValueError) as error:
                raise self._damaged(error) from None
            yield found

    def camera_info(self, camera: str | None = None) -> Any:
        """Return the first CameraInfo with a calibration; see :meth:`calibration`."""
        return self._info(camera)[0]

    def _info(self, camera: str | None) -> tuple[Any, Calibration]:
        """Return the first CameraInfo of a calibrated camera, and its calibration.

        All after it are compared with it once, for the remarks.
        """
        if camera in self._infos:
            return self._infos[camera]
        topic, fault = self.camera_info_topic(camera), None
        # Reads on until cameras that take turns are told apart.
        next(islice(self.images(self.image_topic(camera)), _TURNS, None), None)
        others = self._frames.get(self.image_topic(camera), OneFrame()).others
        watch = CalibrationWatch(topic, self.image_topic(camera))
        messages = (
            one for one in self.messages([topic]) if not others or self._frame_of(one) not in others
        )
        for number, message in enumerate(messages):
            info = self.deserialize(message)
            try:
                watch.see(info)
                changed = (m for m in messages if is_other_lens(self.deserialize(m), info))
                other = next(changed, None)
            except CameraError as error:
                fault = fault or error
                continue
            except (AttributeError, ArithmeticError, TypeError, ValueError) as error:
                raise self._damaged(error) from None
            assert watch.current is not None
            if number:
                self._skipped[topic] = (
                    f"the first {number} messages on {topic} are left out, because they have no "
                    f"calibration: {fault}"
                )
            if watch.doubt:
                self._skipped[f"{topic} doubt"] = watch.doubt
            if other is not None:
                is_wrong = self._is_contradicted(camera, other, watch.current)
                self._skipped[f"{topic} changes"] = (
                    f"the calibration on {topic} changes at "
                    f"{(other.time_ns - self.start_ns) / 1e9:.1f} s, "
                ) + (
                    "but the images do not, so it is wrong from there on and the first one is used "
                    "for all images: if that one is wrong, give --calibration FILE or --fov DEG"
                    if is_wrong
                    else "as by a zoom. The first one is used for all images, so results from "
                    "there on are wrong: track what comes before with --end, and record the rest "
                    "apart"
                )
            self._infos[camera] = info, watch.current
            return self._infos[camera]
        if fault is not None:
            raise fault
        raise BagError(f"{self.path} has no message on {topic}; record it with the images")

    def _frame_of(self, message: BagMessage) -> str:
        header = getattr(self.deserialize(message), "header", None)
        return str(getattr(header, "frame_id", "")).lstrip("/")

    def _is_contradicted(self, camera: str | None, other: BagMessage, old: Calibration) -> bool:
        """Return whether the images do not change as the calibration does with ``other``."""
        witness, looked, is_marked = ZoomWitness(), 0, False
        topic, info_topic = self.image_topic(camera), other.topic
        with suppress(CameraError, EncodingError):
            new = calibration_from_info(self.deserialize(other), topic, info_topic)
            for image in self.images(topic):
                since_ns = image.time_ns - other.time_ns
                if since_ns > _AROUND_NS:
                    break
                if since_ns < -_AROUND_NS:
                    continue
                if since_ns >= 0 and not is_marked:
                    is_marked = True
                    witness.mark()
                witness.look(image.as_sent)
                looked += 1
                if looked == 1:
                    witness.remember()
            return witness.contradicts(old, new)
        return False

    def calibration(self, camera: str | None = None) -> Calibration:
        """Return the given calibration, or that in the first CameraInfo that has one.

        Raises BagError without a CameraInfo, and CameraError, with both topics, if the camera is
        not calibrated or its images have another shape.
        """
        topic = self.image_topic(camera)
        if self._given.is_calibrated:
            return self._given_calibration(camera)
        if CAMERA_INFO_TYPE not in self.topics.values():
            raise BagError(
                f"{self.path} has 0 CameraInfo topics; expected one for {topic}."
                " Record it with the images, or give --fov DEG or --calibration FILE"
            )
        found = self._info(camera)[1]
        for image in self.images(topic):
            with suppress(EncodingError):
                height, width = image.as_sent.shape[:2]
                found.check_shape(width, height, topic, self.camera_info_topic(camera))
                break
        return self._given.rolled(found)

    def _given_calibration(self, camera: str | None) -> Calibration:
        topic = self.image_topic(camera)
        for image in self.images(topic):
            with suppress(EncodingError):
                height, width = image.as_sent.shape[:2]
                return self._given.calibrated(self.path, width, height, image.frame_id)
        raise BagError(f"{self.path} has no image on {topic} that can be decoded; record it again")

    def left_out(self, topic: str, used: Collection[str] = ()) -> list[str]:
        """Return the images that were not used, with the reasons, and other image topics."""
        counts = self._stamps[topic].statistics.counts if topic in self._stamps else {}
        found = [
            f"{count} with the stamp {_LEFT_OUT[order]}"
            for order, count in counts.items()
            if count and not order.is_usable
        ]
        others = sorted(n for n, kind in self.topics.items() if kind in IMAGE_TYPES and n != topic)
        others = [name for name in others if name not in used]
        frames = sorted(self._frames[topic].others) if topic in self._frames else []
        found += [f"the images of the frame {frame}" for frame in frames]
        return found + [f"the images on {name}" for name in others]

    @property
    def remarks(self) -> list[str]:
        """Remarks on what was replaced or left out."""
        found = [*self._skipped.values()]
        if self._given.is_calibrated and CAMERA_INFO_TYPE in self.topics.values():
            found.append(
                "the given calibration or field of view replaces the recording's CameraInfo"
            )
        found += [
            f"{one.topic} is left out: its messages are {_unread_format(one)}, not CDR"
            for one in self._open.connections
            if _unread_format(one)
        ]
        found += [frames.remark(topic) for topic, frames in self._frames.items()]
        for topic, levels in self._levels.items():
            found += [f"{topic}: {levels.text}"] if levels.text else []
        for topic, stamps in self._stamps.items():
            found += [f"{topic}: {text}" for text in stamps.remarks()]
        return found


def chosen_transports(messages: Mapping[str, int]) -> list[str]:
    """Return one topic for each camera, the raw one or a transport, by numbers of messages."""
    groups: dict[str, list[str]] = {}
    for topic in sorted(messages):
        base, _, last = topic.rpartition("/")
        is_transport = base in messages or last in _TRANSPORTS
        groups.setdefault(base if is_transport else topic, []).append(topic)
    order = ("", *_TRANSPORTS)

    def rank(base: str, topic: str) -> tuple[bool, int, str]:
        kind = topic.removeprefix(base).strip("/")
        return not messages[topic], order.index(kind) if kind in order else len(order), topic

    return sorted(min(topics, key=partial(rank, base)) for base, topics in sorted(groups.items()))


def stamp_ns_of(message: Any) -> int:
    """Return the stamp of a message's header, ns."""
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _decoder(image: Any, levels: Levels) -> Callable[[], NDArray[np.uint8]]:
    if hasattr(image, "encoding"):
        return partial(decode_as_sent, SentImage.of(image), levels=levels)
    return partial(
        decode_compressed, image.data, levels=levels, kind=str(getattr(image, "format", ""))
    )


def _unread_format(connection: Connection) -> str:
    """Return the format of messages that cannot be read; empty if they can."""
    if connection.msgtype == "__schemaless__":
        return "without a schema"
    written = getattr(connection.ext, "serialization_format", "cdr")
    return "" if written == "cdr" else str(written)
