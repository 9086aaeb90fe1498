"""Write rosbag2 recordings (mcap or sqlite3) atomically, without a ROS installation."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import (
    Connection,
    Nodetype,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import BagError, CardboxError
from cardbox_tracker.common.files import claimed_name, room_for

STORAGES = {"mcap": StoragePlugin.MCAP, "sqlite3": StoragePlugin.SQLITE3}

_FOREVER = QosTime(2**31 - 1, 2**32 - 1)
_LATCHED = Qos(
    QosHistory.KEEP_LAST,
    1,
    QosReliability.RELIABLE,
    QosDurability.TRANSIENT_LOCAL,
    _FOREVER,
    _FOREVER,
    QosLiveliness.AUTOMATIC,
    _FOREVER,
    False,
)


class BagWriter:
    """Context of a new recording, whose folder appears when the context ends without an error.

    Attributes:
        folder: temporary one of the recording; a file put here appears in the final folder.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        storage: str = "mcap",
        overwrite: bool = False,
        compress: bool = False,
        latched: Sequence[str] = (),
    ) -> None:
        """Prepare a new folder ``path``, with ``storage`` ``mcap`` or ``sqlite3``.

        With ``overwrite`` it replaces a recording, but nothing else; ``compress`` packs the chunks
        of an mcap file with zstd; ``latched`` topics are transient local. Raises BagError if the
        storage is unknown, or ``path`` exists and may not be replaced.
        """
        self.path = Path(os.path.realpath(path)) if os.path.islink(path) else Path(path)
        if storage not in STORAGES:
            raise BagError(f"storage '{storage}' is unknown; expected {' or '.join(STORAGES)}")
        is_free = not self.path.exists() or (self.path.is_dir() and not any(self.path.iterdir()))
        is_recording = (self.path / "metadata.yaml").exists()
        if not is_free and not (overwrite and is_recording):
            what = "is a recording" if is_recording else "is not a recording"
            raise BagError(
                f"{self.path} exists and {what}; choose another name, or remove it first"
            )
        self._storage = STORAGES[storage]
        self._store = get_typestore(Stores.ROS2_JAZZY)
        self._compress = compress and storage == "mcap"
        self._latched = frozenset(latched)
        self._connections: dict[str, Connection] = {}

    def __enter__(self) -> BagWriter:
        """Open a temporary folder beside the target; raise BagError if it cannot be written."""
        self._resources = ExitStack()
        try:
            self._folder = self._resources.enter_context(claimed_name(self.path, is_folder=True))
        except CardboxError as error:
            raise BagError(str(error)) from None
        self.folder = self._folder / self.path.name
        self._writer = Writer(self.folder, version=9, storage_plugin=self._storage)
        if self._compress:
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        self._writer.open()
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: Any) -> None:
        """Move the recording to its place, or remove it after an error."""
        with self._resources, room_for(self.path):
            self._writer.__exit__(kind, *error)
            if kind is None:
                if self.path.exists():
                    # The temporary folder is removed with the replaced recording in it.
                    os.replace(self.path, self._folder / "replaced recording")
                os.replace(self.folder, self.path)

    def knows(self, kind: str) -> bool:
        """Return whether a message type is part of ROS 2."""
        return kind in self._store.types

    def new(self, kind: str, **values: Any) -> Any:
        """Return a message of a type such as ``std_msgs/msg/String``; what is not given is zero."""
        fields = self._store.fielddefs[kind][1]
        zeros = {name: self._zero(type_) for name, type_ in fields if name not in values}
        return self._store.types[kind](**zeros, **values)

    def _zero(self, type_: Any) -> Any:
        """Return the zero of the type of a field, as rosbags describes it."""
        node, of = type_
        if node is Nodetype.NAME:
            return self.new(of)
        if node is Nodetype.BASE:
            return "" if of[0] == "string" else 0
        # Only numbers are arrays of a fixed length here.
        (inner, name), count = of
        is_number = inner is Nodetype.BASE and name[0] != "string"
        return np.zeros(count * (node is Nodetype.ARRAY), name[0]) if is_number else []

    def write(self, topic: str, message: Any, stamp_ns: int) -> None:
        """Write a message made with :meth:`new`."""
        name = message.__msgtype__
        self.write_raw(topic, name, self._store.serialize_cdr(message, name), stamp_ns)

    def write_raw(self, topic: str, msgtype: str, raw: bytes | memoryview, stamp_ns: int) -> None:
        """Write the CDR bytes of a message; raise CardboxError if the disk is full."""
        connection = self._connections.get(topic)
        if connection is None:
            profiles = [_LATCHED] if topic in self._latched else []
            connection = self._writer.add_connection(
                topic, msgtype, typestore=self._store, offered_qos_profiles=profiles
            )
            self._connections[topic] = connection
        with room_for(self.path):
            self._writer.write(connection, stamp_ns, raw)

    def write_stamped(
        self, topic: str, kind: str, stamp_ns: int, frame_id: str, **values: Any
    ) -> None:
        """Write a message of :meth:`new` with a header."""
        self.write(
            topic, self.new(kind, header=self.header(stamp_ns, frame_id), **values), stamp_ns
        )

    def header(self, stamp_ns: int, frame_id: str) -> Any:
        """Return a std_msgs/Header."""
        stamp = self.new(
            "builtin_interfaces/msg/Time", sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9
        )
        return self.new("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)

    def write_image(
        self, topic: str, stamp_ns: int, frame_id: str, array: NDArray[Any], encoding: str
    ) -> None:
        """Write pixels (H, W) or (H, W, channels) as an Image of that encoding."""
        array = np.ascontiguousarray(array)
        self.write_stamped(
            *(topic, "sensor_msgs/msg/Image", stamp_ns, frame_id),
            height=array.shape[0],
            width=array.shape[1],
            encoding=encoding,
            step=array.nbytes // array.shape[0],
            data=array.view(np.uint8).ravel(),
        )

    def write_compressed(self, topic: str, stamp_ns: int, frame_id: str, data: bytes) -> None:
        """Write JPEG bytes as a CompressedImage."""
        pixels, kind = np.frombuffer(data, np.uint8), "sensor_msgs/msg/CompressedImage"
        self.write_stamped(topic, kind, stamp_ns, frame_id, format="jpeg", data=pixels)

    def write_camera_info(self, topic: str, stamp_ns: int, frame_id: str, camera: Camera) -> None:
        """Write an ideal camera as a CameraInfo without distortion."""
        k = camera.k.ravel()
        self.write_stamped(
            *(topic, "sensor_msgs/msg/CameraInfo", stamp_ns, frame_id),
            height=camera.height,
            width=camera.width,
            distortion_model="plumb_bob",
            d=np.zeros(5),
            k=k,
            r=np.eye(3).ravel(),
            p=np.insert(k, (3, 6, 9), 0.0),
        )

    def write_joint_state(
        self,
        topic: str,
        stamp_ns: int,
        frame_id: str,
        names: Sequence[str],
        positions: NDArray[np.float64],
        velocities: NDArray[np.float64] | None = None,
    ) -> None:
        """Write joint positions, rad and metres, and velocities, rad/s and m/s, if known."""
        self.write_stamped(
            *(topic, "sensor_msgs/msg/JointState", stamp_ns, frame_id),
            name=list(names),
            position=np.asarray(positions, np.float64),
            velocity=np.zeros(0) if velocities is None else np.asarray(velocities, np.float64),
        )

    def write_string(self, topic: str, stamp_ns: int, text: str) -> None:
        """Write a std_msgs/String."""
        self.write(topic, self.new("std_msgs/msg/String", data=text), stamp_ns)
