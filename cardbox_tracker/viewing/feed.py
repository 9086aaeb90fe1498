"""Results as they come, from a bag or from running nodes, into a :class:`~.scene.Scene`."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.model_file import loads_body_model
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.evaluation.truth import TrueFrame
from cardbox_tracker.outputs import JointValues
from cardbox_tracker.viewing.scene import Scene

# Where a robot stands: beside the person, about as far from the camera, and facing it.
ROBOT_PLACE_M = (2.0, 0.9, 0.0)


class Feed:
    """Takes one result after the other, each with the stamp of its image, ns."""

    def __init__(self, scene: Scene, truth: Mapping[int, TrueFrame] | None = None) -> None:
        """Begin; ``truth`` has the true frames by stamp, if they are known."""
        self._scene, self._truth = scene, truth or {}
        self._joints: tuple[int, JointValues] | None = None

    def model(self, text: str, source: str) -> None:
        """Take a body model as YAML; ``source`` names it in errors."""
        self._scene.person(loads_body_model(text, source=source))

    def joints(self, stamp_ns: int, joints: JointValues) -> None:
        """Take the joints of the person."""
        self._joints = stamp_ns, joints
        self._scene.at(stamp_ns)
        self._scene.joints(joints)

    def deviations(self, stamp_ns: int, deviations: JointValues) -> None:
        """Take their standard deviations, which come after them."""
        if self._joints is not None and self._joints[0] == stamp_ns:
            self._scene.at(stamp_ns)
            self._scene.uncertain_joints(self._joints[1], deviations)

    def keypoints(self, stamp_ns: int, points_m: FloatArray) -> None:
        """Take shoulder, elbow and hand of both arms, (6, 3); any other number is passed over."""
        if points_m.shape != (6, 3) or not np.isfinite(points_m).all():
            return
        frame = self._truth.get(stamp_ns)
        self._scene.at(stamp_ns)
        self._scene.keypoints(points_m, None if frame is None else frame.keypoints_m)

    def image(self, stamp_ns: int, bgr: NDArray[np.uint8]) -> None:
        """Take the image with the model over it, (H, W, 3)."""
        self._scene.at(stamp_ns)
        self._scene.image(bgr)

    def state(self, stamp_ns: int, text: str) -> None:
        """Take the tracking state."""
        self._scene.at(stamp_ns)
        self._scene.state(text)

    def robot(self, name: str, urdf: str) -> None:
        """Take a further robot, which stands beside the person."""
        self._scene.robot(name, urdf, ROBOT_PLACE_M)

    def robot_joints(self, stamp_ns: int, name: str, joints: JointValues) -> None:
        """Move it."""
        self._scene.at(stamp_ns)
        self._scene.move(name, joints)
