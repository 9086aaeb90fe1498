"""Cameras at the working resolution and their poses, from CameraInfo, /tf_static and a file.

Without the package tf2_msgs, ``/tf_static`` is not read, and the error texts say so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from sensor_msgs.msg import CameraInfo

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.extrinsics_files import (
    FrameTransform,
    extrinsics_between,
    load_extrinsics,
    transforms_of,
)
from cardbox_tracker.camera.view import OtherCamera
from cardbox_tracker.common.errors import CameraError
from cardbox_tracker.common.files import user_path
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.messages.types import optional_class
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode

_STATIC_TOPIC = "/tf_static"
# A robot has a few hundred frames; the limit protects the memory.
_MOST_TRANSFORMS = 1000
# Extrinsics that differ by less are regarded as equal.
_SAME_RAD, _SAME_M = 1e-5, 1e-5


def silhouettes_of(cameras: Sequence[str]) -> list[str]:
    """Return the topic of each camera's silhouettes; "" stands for the node's namespace."""
    return [f"{camera.rstrip('/')}/silhouette" if camera else "silhouette" for camera in cameras]


class CameraPoses:
    """The cameras of one person, the first one first.

    Attributes:
        names: their namespaces.
        others: the further cameras; empty until all cameras and poses are known.
        frame_id: the first camera's optical frame.
    """

    def __init__(
        self, node: CardboxNode, cameras: Sequence[str], file: str, changed: Callable[[], None]
    ) -> None:
        """Subscribe with ``node``; call ``changed`` when all are known or one has changed."""
        self.names = [camera.strip("/") for camera in cameras]
        self.others: list[OtherCamera] = []
        self._changed = changed
        self._cameras: list[Camera | None] = [None] * len(self.names)
        self._infos: list[CameraInfo | None] = [None] * len(self.names)
        self._transforms: dict[tuple[str, str], FrameTransform] = {}
        self._of_file = load_extrinsics(user_path(file), self.names) if file else {}
        self._problem = ""
        self._topics = [node.resolve(f"{topic}/camera_info") for topic in silhouettes_of(cameras)]
        for number, topic in enumerate(self._topics):
            node.subscribe(CameraInfo, topic, partial(self._on_info, number), qos.SILHOUETTE_INPUT)
        self._reads_transforms = True
        if len(self.names) > 1:
            kind = optional_class("tf2_msgs", "TFMessage")
            self._reads_transforms = kind is not None
            if kind is not None:
                node.subscribe(kind, _STATIC_TOPIC, self._on_transforms, qos.STATIC_TRANSFORMS)

    @property
    def first(self) -> Camera | None:
        """The first camera; None until all cameras and poses are known."""
        is_known = len(self.others) == len(self.names) - 1
        return self._cameras[0] if is_known else None

    @property
    def frame_id(self) -> str:
        """Name of the first camera's optical frame; empty before it is known."""
        return "" if self._infos[0] is None else str(self._infos[0].header.frame_id)

    @property
    def missing(self) -> list[str]:
        """Topics of CameraInfo on which nothing was received yet."""
        pairs = zip(self._topics, self._cameras, strict=True)
        return [topic for topic, camera in pairs if camera is None]

    def check(self) -> None:
        """Raise CameraError if all cameras are known, but not their poses."""
        if self._problem:
            raise CameraError(self._problem)

    def _on_info(self, number: int, message: CameraInfo, _: int) -> None:
        before = self._infos[number]
        if before is not None and conversions.is_same_info(before, message):
            return
        self._cameras[number] = conversions.camera_of(message)
        self._infos[number] = message
        self._find(is_new=True)

    def _on_transforms(self, message: Any, _: int) -> None:
        for transform in transforms_of(message):
            ends = transform.parent, transform.child
            if ends in self._transforms or len(self._transforms) < _MOST_TRANSFORMS:
                self._transforms[ends] = transform
        self._find(is_new=False)

    def _find(self, is_new: bool) -> None:
        """Find the poses of the cameras; ``is_new`` is True if a camera has changed."""
        if None in self._cameras:
            return
        try:
            found = self._extrinsics()
        except CameraError as error:
            self._problem, self.others = str(error), []
            self._changed()
            return
        self._problem = ""
        before = [other.extrinsics for other in self.others]
        if not is_new and len(before) == len(found) and all(map(_are_same, before, found)):
            return
        self.others = [
            OtherCamera(camera, extrinsics)
            for camera, extrinsics in zip(self._cameras[1:], found, strict=True)
            if camera is not None
        ]
        self._changed()

    def _extrinsics(self) -> list[Extrinsics]:
        transforms = list(self._transforms.values())
        try:
            return extrinsics_between(self._infos, self.names, transforms, self._of_file)
        except CameraError as error:
            if self._reads_transforms:
                raise
            raise CameraError(
                f"{error} ({_STATIC_TOPIC} is not read: the package tf2_msgs is not installed)"
            ) from None


def _are_same(one: Extrinsics, other: Extrinsics) -> bool:
    angle_rad, distance_m = one.difference(other)
    return angle_rad < _SAME_RAD and distance_m < _SAME_M
