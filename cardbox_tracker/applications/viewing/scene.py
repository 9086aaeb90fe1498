"""Logs the results of each image as entities of a Rerun recording."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.viewing.layout import (
    ALONE,
    ERROR,
    IMAGE,
    JOINTS,
    ROOT_FRAME,
    SPREAD,
    STATE,
    Column,
    plot_of,
)
from cardbox_tracker.applications.viewing.library import rerun
from cardbox_tracker.body.keypoint_state import KeypointState
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.description.urdf import urdf_from_body
from cardbox_tracker.errors import CardboxError, cut
from cardbox_tracker.evaluation.metrics import beside_shoulders
from cardbox_tracker.outputs import JointValues

Rgb = tuple[int, int, int]

_COLOURS: list[tuple[int, ...]] = [(66, 133, 244), (219, 68, 55), (15, 157, 88), (171, 71, 188)]
_MEASURED_RGB, _TRUE_RGB = (255, 140, 0), (0, 200, 83)
_STATE_RGB: dict[str, Rgb] = {
    KeypointState.UNCERTAIN: (255, 230, 0),
    KeypointState.LOST: (255, 60, 60),
    KeypointState.HIDDEN: (160, 160, 160),
}
_SPREAD = 2.0
"""Standard deviations of an interval with 90 % of the errors."""
_HALF_TURN = (0.0, 0.0, 1.0, 0.0)
_ARMS = ((0, 1, 2), (3, 4, 5))
_RADIUS_M = 0.018
# Letters have visible fringes at lower qualities.
_JPEG_QUALITY = 92


class Scene:
    """Logs to a Rerun stream; :meth:`at` selects the image, and other calls may have any order."""

    def __init__(self, stream: Any, column: Column = ALONE, first_ns: int | None = None) -> None:
        """Start an empty scene.

        Args:
            stream: a rerun.RecordingStream.
            column: place of the result among those of the layout.
            first_ns: stamp from which the time line counts, ns; None for that of the first image.
        """
        self._rr = rerun()
        self._stream, self._column, self._first_ns = stream, column, first_ns
        self._state = ""
        self._styled: set[str] = set()
        self._trees: dict[str, dict[str, Any]] = {}
        self._pitch_rad: float | None = None
        self._body: BodyModel | None = None

    def at(self, stamp_ns: int) -> None:
        """Select the image that the following calls belong to, by its stamp, ns."""
        if self._first_ns is None:
            self._first_ns = stamp_ns
        self._stream.set_time("time", duration=(stamp_ns - self._first_ns) / 1e9)
        self._stream.set_time("stamp", timestamp=np.datetime64(stamp_ns, "ns"))

    def person(self, body: BodyModel) -> None:
        """Show ``body`` from now on."""
        if body == self._body:
            return
        self._body = body
        self._pitch_rad = body.camera_pose.pitch_rad
        self._robot("person", urdf_from_body(body))

    def robot(self, name: str, urdf: str, place_m: Sequence[float]) -> None:
        """Show a robot that faces the camera, with its root at ``place_m`` in the level frame."""
        root = self._robot(name, urdf)
        put = self._rr.Transform3D(
            translation=place_m,
            quaternion=self._rr.Quaternion(xyzw=_HALF_TURN),
            parent_frame=self._column.prefix + ROOT_FRAME,
            child_frame=f"{self._column.prefix}{name}/{root}",
        )
        self._log(f"{name}/place", put, static=True)

    def _robot(self, name: str, urdf: str) -> str:
        """Log geometry and joints below ``name`` and return the root link.

        Raises:
            CardboxError: the description cannot be read.
        """
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"{name}.urdf"
            path.write_text(urdf, encoding="utf-8")
            try:
                tree = self._rr.urdf.UrdfTree.from_file_path(
                    path,
                    entity_path_prefix=self._column.geometry(name),
                    frame_prefix=f"{self._column.prefix}{name}/",
                    static_transform_entity_path=f"{self._column.prefix}{name}/links",
                )
                tree.log_urdf_to_recording(self._stream)
            except Exception as error:
                # The library does not wrap the errors of its parsers.
                reason = cut(" ".join(str(error).split()))
                raise CardboxError(f"the viewer cannot show the robot {name}: {reason}") from None
        self._trees[name] = {
            joint.name: joint for joint in tree.joints() if joint.joint_type != "fixed"
        }
        return str(tree.root_link().name)

    def image(self, bgr: NDArray[np.uint8]) -> None:
        """Show an image (H, W, 3)."""
        shown = self._rr.Image(bgr, color_model="BGR")
        self._log(IMAGE, shown.compress(jpeg_quality=_JPEG_QUALITY))

    def state(self, text: str) -> None:
        """Log the tracking state if it has changed."""
        if text != self._state:
            self._log(STATE, self._rr.TextLog(self._column.named(text)))
        self._state = text

    def joints(self, joints: JointValues) -> None:
        """Move the person, and plot the joints, rad and metres."""
        self.move("person", joints)
        for name, value in _shown(joints).items():
            group, number = plot_of(name)
            self._plot(f"{JOINTS}/{group}/{name}", name, value, number, 2.0)

    def uncertain_joints(self, joints: JointValues, deviations: JointValues) -> None:
        """Plot the uncertainty of the joints; both mappings have the same names."""
        spread = _shown(deviations)
        for name, value in _shown(joints).items():
            group, number = plot_of(name)
            for which, off in (("low", -_SPREAD), ("high", _SPREAD)):
                reach = value + off * spread.get(name, 0.0)
                entity = f"{JOINTS}/{group}/{SPREAD}/{name}/{which}"
                self._plot(entity, f"{name} {which}", reach, number, 0.5)

    def move(self, robot: str, joints: JointValues) -> None:
        """Move ``person`` or a robot that was shown before; unknown joints are ignored."""
        known = self._trees.get(robot, {})
        for name, value in zip(joints.names, joints.values.tolist(), strict=True):
            if name in known:
                turned = known[name].compute_transform(value, clamp=False)
                self._log(f"{robot}/joints/{name}", turned)

    def keypoints(
        self,
        points_m: FloatArray,
        truth_m: FloatArray | None = None,
        states: Sequence[str] | None = None,
    ) -> None:
        """Show keypoints (6, 3), metres in the optical frame, and plot their errors.

        With ``states``, uncertain joints are yellow, lost ones red and hidden ones grey.
        """
        joints = [_STATE_RGB.get(state, _MEASURED_RGB) for state in states or ()]
        self._arms("keypoints", points_m, _MEASURED_RGB, joints)
        if truth_m is None:
            return
        self._arms("truth", truth_m, _TRUE_RGB)
        for number, (name, value) in enumerate(errors_cm(points_m, truth_m).items()):
            self._plot(f"{ERROR}/{name}", name, value, number, 2.0)

    def _arms(
        self, entity: str, points_m: FloatArray, rgb: Rgb, joint_rgb: Sequence[Rgb] = ()
    ) -> None:
        if self._pitch_rad is None:
            return  # the camera's pitch is still unknown
        points = level_points(points_m, self._pitch_rad)
        strips = [points[list(arm)] for arm in _ARMS]
        bones = self._rr.LineStrips3D(strips, colors=[rgb] * len(strips), radii=_RADIUS_M / 3)
        joints = self._rr.Points3D(points, colors=list(joint_rgb) or rgb, radii=_RADIUS_M)
        frame = self._column.prefix + ROOT_FRAME
        for name, shown in (("arms", bones), ("joints", joints)):
            self._once(f"{entity}/{name}", self._rr.CoordinateFrame(frame))
            self._log(f"{entity}/{name}", shown)

    def _plot(self, entity: str, name: str, value: float, colour: int, width: float) -> None:
        rgb = _COLOURS[colour % len(_COLOURS)]
        if self._column.is_pale:
            rgb = tuple((level + 255) // 2 for level in rgb)
        named = self._column.named(name)
        self._once(entity, self._rr.SeriesLines(colors=rgb, names=named, widths=width))
        self._log(entity, self._rr.Scalars(value))

    def _once(self, entity: str, what: Any) -> None:
        """Log a constant entity once."""
        if entity not in self._styled:
            self._log(entity, what, static=True)
        self._styled.add(entity)

    def _log(self, entity: str, what: Any, static: bool = False) -> None:
        self._stream.log(self._column.prefix + entity, what, static=static)


def _shown(joints: JointValues) -> Mapping[str, float]:
    """Return angles in degrees, and places in metres, by name."""
    place = ("torso_x", "torso_y", "torso_z")
    return {
        name: value if name in place else float(np.degrees(value))
        for name, value in zip(joints.names, joints.values.tolist(), strict=True)
    }


def errors_cm(points_m: FloatArray, truth_m: FloatArray) -> dict[str, float]:
    """Return mean errors, cm, of keypoints (6, 3): with and without the error of the shoulders."""
    difference = 100 * (points_m - truth_m)
    return {
        "absolute": float(np.linalg.norm(difference, axis=1).mean()),
        "aligned": float(np.linalg.norm(beside_shoulders(difference), axis=1).mean()),
    }


def level_points(points_m: FloatArray, pitch_rad: float) -> FloatArray:
    """Transform optical points (n, 3) to the level frame of the URDF's root: X ahead, Y left, Z up.

    Args:
        points_m: points in the optical frame, metres: x to the right, y down, z ahead.
        pitch_rad: downward pitch of the camera.
    """
    x, y, z = np.asarray(points_m).T
    c, s = np.cos(pitch_rad), np.sin(pitch_rad)
    return np.stack([c * z - s * y, -x, -s * z - c * y], axis=-1)
