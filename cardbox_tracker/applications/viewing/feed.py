"""Passes results from a bag or from running nodes to a :class:`~.scene.Scene`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.viewing.scene import Scene
from cardbox_tracker.body.model_file import loads_body_model
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.evaluation.truth import TrueFrame
from cardbox_tracker.outputs import JointValues

# A robot stands beside the person, at about the same distance, and faces the camera.
ROBOT_PLACE_M = (2.0, 0.9, 0.0)


class Feed:
    """Receives results one after another, each with the stamp of its image, ns."""

    def __init__(self, scene: Scene, truth: Mapping[int, TrueFrame] | None = None) -> None:
        """Start; ``truth`` has the true frames by stamp, if they are known."""
        self._scene, self._truth = scene, truth or {}
        self._joints: tuple[int, JointValues] | None = None
        self._states: tuple[int, Sequence[str]] | None = None

    def model(self, text: str, source: str) -> None:
        """Show a body model, YAML text; ``source`` names it in errors."""
        self._scene.person(loads_body_model(text, source=source))

    def joints(self, stamp_ns: int, joints: JointValues) -> None:
        """Show the joints of the person, rad and metres."""
        self._joints = stamp_ns, joints
        self._scene.at(stamp_ns)
        self._scene.joints(joints)

    def deviations(self, stamp_ns: int, deviations: JointValues) -> None:
        """Plot the standard deviations of the joints, which follow the joints."""
        if self._joints is not None and self._joints[0] == stamp_ns:
            self._scene.at(stamp_ns)
            self._scene.uncertain_joints(self._joints[1], deviations)

    def keypoint_states(self, stamp_ns: int, states: Sequence[str]) -> None:
        """Take the states of the six keypoints, which precede the keypoints."""
        self._states = stamp_ns, states

    def keypoints(self, stamp_ns: int, points_m: FloatArray) -> None:
        """Show shoulder, elbow and hand of both arms, (6, 3); other shapes are ignored."""
        if points_m.shape != (6, 3) or not np.isfinite(points_m).all():
            return
        frame = self._truth.get(stamp_ns)
        self._scene.at(stamp_ns)
        states = None
        if self._states is not None and self._states[0] == stamp_ns:
            states = self._states[1]
        self._scene.keypoints(points_m, None if frame is None else frame.keypoints_m, states)

    def image(self, stamp_ns: int, bgr: NDArray[np.uint8]) -> None:
        """Show the overlay, (H, W, 3)."""
        self._scene.at(stamp_ns)
        self._scene.image(bgr)

    def state(self, stamp_ns: int, text: str) -> None:
        """Show the tracking state."""
        self._scene.at(stamp_ns)
        self._scene.state(text)

    def robot(self, name: str, urdf: str) -> None:
        """Add a robot, which stands beside the person."""
        self._scene.robot(name, urdf, ROBOT_PLACE_M)

    def robot_joints(self, stamp_ns: int, name: str, joints: JointValues) -> None:
        """Move a robot."""
        self._scene.at(stamp_ns)
        self._scene.move(name, joints)
