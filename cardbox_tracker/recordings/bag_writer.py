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
from cardbox_tracker.common.files import claimed_name

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
    """Context of a new recording, whose folder appears when the context ends without an error."""

    def __init__(
        self,
        path: str | os.PathLike[str],
        storage: str = "mcap",
        overwrite: bool = False,
        compress: bool = False,
        latched: Sequence[str] = (),
    ) -> None:
        """Check the folder's name.

        Args:
            path: folder to make.
            storage: ``mcap`` or ``sqlite3``.
            overwrite: replace an existing recording of that name, but nothing else.
            compress: compress the chunks of an mcap file with zstd, which all its readers support.
            latched: topics that 'ros2 bag play' offers as transient local.

        Raises:
            BagError: the storage is unknown, or ``path`` exists and may not be replaced.
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
        """Open a temporary folder beside the target.

        Raises:
            BagError: the target's folder cannot be written.
        """
        self._resources = ExitStack()
        try:
            claim = claimed_name(self.path, is_folder=True)
            self._folder = self._resources.enter_context(claim)
        except CardboxError as error:
            raise BagError(str(error)) from None
        self._writer = Writer(
            self._folder / self.path.name, version=9, storage_plugin=self._storage
        )
        if self._compress:
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        self._writer.open()
        return self

    @property
    def folder(self) -> Path:
        """Temporary folder of the recording; a file put here appears in the final folder."""
        return self._folder / self.path.name

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Move the recording to its place, or remove it after an error."""
        with self._resources:
            self._writer.close()
            if kind is None:
                if self.path.exists():
                    # The temporary folder is removed with the replaced recording in it.
                    os.replace(self.path, self._folder / "replaced recording")
                os.replace(self.folder, self.path)

    def type(self, name: str) -> Any:
        """Return the message class of ``name``, such as ``std_msgs/msg/String``."""
        return self._store.types[name]

    def write(self, topic: str, message: Any, stamp_ns: int) -> None:
        """Write a message made with :meth:`type`."""
        name = message.__msgtype__
        self.write_raw(topic, name, self._store.serialize_cdr(message, name), stamp_ns)

    def write_raw(self, topic: str, msgtype: str, raw: bytes | memoryview, stamp_ns: int) -> None:
        """Write the CDR bytes of a message."""
        connection = self._connections.get(topic)
        if connection is None:
            profiles = [_LATCHED] if topic in self._latched else []
            connection = self._writer.add_connection(
                topic, msgtype, typestore=self._store, offered_qos_profiles=profiles
            )
            self._connections[topic] = connection
        self._writer.write(connection, stamp_ns, raw)

    def header(self, stamp_ns: int, frame_id: str) -> Any:
        """Return a std_msgs/Header."""
        time = self.type("builtin_interfaces/msg/Time")
        stamp = time(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)
        return self.type("std_msgs/msg/Header")(stamp=stamp, frame_id=frame_id)

    def write_image(
        self, topic: str, stamp_ns: int, frame_id: str, array: NDArray[Any], encoding: str
    ) -> None:
        """Write pixels (H, W) or (H, W, channels) as an Image of that encoding."""
        array = np.ascontiguousarray(array)
        message = self.type("sensor_msgs/msg/Image")(
            header=self.header(stamp_ns, frame_id),
            height=array.shape[0],
            width=array.shape[1],
            encoding=encoding,
            is_bigendian=0,
            step=array.nbytes // array.shape[0],
            data=array.view(np.uint8).ravel(),
        )
        self.write(topic, message, stamp_ns)

    def write_compressed(self, topic: str, stamp_ns: int, frame_id: str, data: bytes) -> None:
        """Write JPEG bytes as a CompressedImage."""
        message = self.type("sensor_msgs/msg/CompressedImage")(
            header=self.header(stamp_ns, frame_id),
            format="jpeg",
            data=np.frombuffer(data, np.uint8),
        )
        self.write(topic, message, stamp_ns)

    def write_camera_info(self, topic: str, stamp_ns: int, frame_id: str, camera: Camera) -> None:
        """Write an ideal camera as a CameraInfo without distortion."""
        k = np.array([camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1], np.float64)
        roi = self.type("sensor_msgs/msg/RegionOfInterest")(
            x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
        )
        message = self.type("sensor_msgs/msg/CameraInfo")(
            header=self.header(stamp_ns, frame_id),
            height=camera.height,
            width=camera.width,
            distortion_model="plumb_bob",
            d=np.zeros(5),
            k=k,
            r=np.eye(3).ravel(),
            p=np.insert(k, (3, 6, 9), 0.0),
            binning_x=0,
            binning_y=0,
            roi=roi,
        )
        self.write(topic, message, stamp_ns)

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
        message = self.type("sensor_msgs/msg/JointState")(
            header=self.header(stamp_ns, frame_id),
            name=list(names),
            position=np.asarray(positions, np.float64),
            velocity=np.zeros(0) if velocities is None else np.asarray(velocities, np.float64),
            effort=np.zeros(0),
        )
        self.write(topic, message, stamp_ns)

    def write_pose_array(
        self, topic: str, stamp_ns: int, frame_id: str, points_m: NDArray[np.float64]
    ) -> None:
        """Write points (n, 3), metres, as poses without rotation."""
        point = self.type("geometry_msgs/msg/Point")
        pose = self.type("geometry_msgs/msg/Pose")
        still = self.type("geometry_msgs/msg/Quaternion")(x=0.0, y=0.0, z=0.0, w=1.0)
        poses = [
            pose(position=point(x=float(x), y=float(y), z=float(z)), orientation=still)
            for x, y, z in points_m
        ]
        message = self.type("geometry_msgs/msg/PoseArray")(
            header=self.header(stamp_ns, frame_id), poses=poses
        )
        self.write(topic, message, stamp_ns)

    def write_string(self, topic: str, stamp_ns: int, text: str) -> None:
        """Write a std_msgs/String."""
        self.write(topic, self.type("std_msgs/msg/String")(data=text), stamp_ns)
