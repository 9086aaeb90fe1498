"""Logs results, from bags or from a running tracker, as entities of a Rerun recording."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.viewing.viewer import rerun
from cardbox_tracker.camera.camera import level_to_optical
from cardbox_tracker.camera.encodings import SentImage, decode_bgr
from cardbox_tracker.common.errors import BagError, CardboxError, cut, reason_of
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import loads_body_model
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import HAND_NAMES, UNITS, Group, KeypointState, names_of
from cardbox_tracker.person.urdf import ROOT_LINK, urdf_from_body
from cardbox_tracker.recordings.bag_reader import BagReader, stamp_ns_of
from cardbox_tracker.recordings.outputs import JointValues, joints_of
from cardbox_tracker.recordings.result_reader import MODEL, namespace_of, points_of
from cardbox_tracker.recordings.truth import TrueFrame, beside_shoulders

Rgb = tuple[int, int, int]

_IMAGE, _JOINTS, _ERROR, _STATE = _FLAT = ("image", "joints", "error", "state")
_ROOT_FRAME = f"person/{ROOT_LINK}"
# Entity below a plot that contains the uncertainty of its joints.
_SPREAD = "within_two_deviations"
_GROUPS: dict[str, tuple[str, ...]] = {
    "left_arm": names_of(Group.ARM, side="left"),
    "right_arm": names_of(Group.ARM, side="right"),
    "torso": names_of(Group.TORSO)[1:],
    "head": names_of(Group.NECK),
    "place": ("torso_y", *names_of(Group.PLACE)),
    "shoulders": names_of(Group.CLAVICLE),
    "left_leg": names_of(Group.LEG, side="left"),
    "right_leg": names_of(Group.LEG, side="right"),
    "hands": HAND_NAMES,
}
"""Joints by plot: angles in degrees, place and rise of the shoulders in metres."""
# Interval, degrees and metres, at which that of a joint ends: a wider one tells nothing, and would
# leave no room for the curve.
_WIDEST = {"deg": 60.0, "m": 0.5}

# The viewpoint is beside the camera and looks at a person two metres before it.
_EYE_M, _TARGET_M = (0.1, -1.1, 0.5), (2.0, 0.35, -0.1)
# A robot stands beside the person, at about the same distance, and faces the camera.
_ROBOT_PLACE_M, _HALF_TURN = (2.0, 0.9, 0.0), (0.0, 0.0, 1.0, 0.0)

_COLOURS: list[tuple[int, ...]] = [(66, 133, 244), (219, 68, 55), (15, 157, 88), (171, 71, 188)]
_MEASURED_RGB, _TRUE_RGB = (255, 140, 0), (0, 200, 83)
_STATE_RGB: dict[str, Rgb] = {
    KeypointState.UNCERTAIN: (255, 230, 0),
    KeypointState.LOST: (255, 60, 60),
    KeypointState.HIDDEN: (160, 160, 160),
}
# Standard deviations of an interval with 90 % of the errors.
_DEVIATIONS = 2.0
_ARMS = ((0, 1, 2), (3, 4, 5))
_RADIUS_M = 0.018
# Letters have visible fringes at lower qualities.
_JPEG_QUALITY = 92


def layout(has_truth: bool = False, is_live: bool = False) -> Any:
    """Return the blueprint of the views; raise CardboxError if rerun-sdk is not installed."""
    views = rerun().blueprint
    # The heights of plots with joints, errors and states.
    error, shares = ([_plot(_ERROR, "error [cm]")], [2]) if has_truth else ([], [])
    plots = [
        _plot(f"{_JOINTS}/{name}", f"{name.replace('_', ' ')} [{_unit_of(name)}]")
        for name in _GROUPS
    ]
    states = views.TextLogView(origin="/", contents=[f"+ /{_STATE}"], name="state")
    right = views.Vertical(
        *plots[:2], views.Tabs(*plots[2:]), *error, states, row_shares=[3, 3, 3, *shares, 2]
    )
    return views.Blueprint(
        views.Horizontal(
            views.Vertical(
                views.Spatial2DView(origin=_IMAGE, name="image"),
                views.Spatial3DView(
                    origin="/",
                    contents=["+ /**", *(f"- /{name}/**" for name in _FLAT)],
                    name="measured body",
                    spatial_information=views.SpatialInformation(target_frame=_ROOT_FRAME),
                    eye_controls=views.EyeControls3D(
                        position=_EYE_M, look_target=_TARGET_M, eye_up=(0.0, 0.0, 1.0)
                    ),
                ),
            ),
            right,
        ),
        views.TimePanel(
            timeline="time", state="collapsed", play_state="following" if is_live else "playing"
        ),
        collapse_panels=True,
    )


def _plot(entity: str, title: str) -> Any:
    views = rerun().blueprint
    legend = views.PlotLegend(corner=views.Corner2D.RightTop)
    return views.TimeSeriesView(origin=entity, name=title, plot_legend=legend)


class Scene:
    """Logs results to a Rerun stream, each with the stamp of its image, ns."""

    def __init__(self, stream: Any, truth: Mapping[int, TrueFrame] | None = None) -> None:
        """Start an empty scene in a rerun.RecordingStream; ``truth`` has true frames by stamp."""
        self._rr = rerun()
        self._stream = stream
        self._first_ns: int | None = None
        self._truth = truth or {}
        self._state = ""
        self._styled: set[str] = set()
        self._trees: dict[str, dict[str, Any]] = {}
        self._body: BodyModel | None = None
        self._has_hands = False
        # Joints and states of keypoints wait for what has the same stamp.
        self._joints: tuple[int, JointValues] | None = None
        self._states: tuple[int, Sequence[str]] | None = None

    def model(self, text: str, source: str) -> None:
        """Show the person of a body model, YAML, from now on; CardboxError names ``source``."""
        body = loads_body_model(text, source=source)
        if body != self._body:
            self._body = body
            self._describe()

    def _describe(self) -> None:
        assert self._body is not None
        self._robot("person", urdf_from_body(self._body, hands=self._has_hands))

    def robot(self, name: str, urdf: str) -> None:
        """Show a robot beside the person, facing the camera, or raise CardboxError."""
        root = self._robot(name, urdf)
        put = self._rr.Transform3D(
            translation=_ROBOT_PLACE_M,
            quaternion=self._rr.Quaternion(xyzw=_HALF_TURN),
            parent_frame=_ROOT_FRAME,
            child_frame=f"{name}/{root}",
        )
        self._log(f"{name}/place", put, static=True)

    def image(self, stamp_ns: int, bgr: NDArray[np.uint8]) -> None:
        """Show an image (H, W, 3)."""
        self._at(stamp_ns)
        shown = self._rr.Image(bgr, color_model="BGR")
        self._log(_IMAGE, shown.compress(jpeg_quality=_JPEG_QUALITY))

    def state(self, stamp_ns: int, text: str) -> None:
        """Log the tracking state if it has changed."""
        self._at(stamp_ns)
        if text != self._state:
            self._log(_STATE, self._rr.TextLog(text))
        self._state = text

    def joints(self, stamp_ns: int, joints: JointValues) -> None:
        """Move the person, and plot the joints, rad and metres."""
        self._joints = stamp_ns, joints
        has_hands = HAND_NAMES[0] in joints.names
        if has_hands != self._has_hands and self._body is not None:
            self._has_hands = has_hands
            self._describe()
        self.robot_joints(stamp_ns, "person", joints)
        for name, value in _shown(joints).items():
            group, number = _plot_of(name)
            self._plot(f"{_JOINTS}/{group}/{name}", name, value, number, 2.0)

    def deviations(self, stamp_ns: int, deviations: JointValues) -> None:
        """Plot the standard deviations of the joints, which follow the joints."""
        if self._joints is None or self._joints[0] != stamp_ns:
            return
        self._at(stamp_ns)
        spread = _shown(deviations)
        for name, value in _shown(self._joints[1]).items():
            group, number = _plot_of(name)
            width = min(_DEVIATIONS * spread.get(name, 0.0), _WIDEST[_unit_of(group)])
            for which, reach in (("low", value - width), ("high", value + width)):
                entity = f"{_JOINTS}/{group}/{_SPREAD}/{name}/{which}"
                self._plot(entity, f"{name} {which}", reach, number, 0.5)

    def robot_joints(self, stamp_ns: int, robot: str, joints: JointValues) -> None:
        """Move a robot that was shown before; unknown joints are ignored."""
        self._at(stamp_ns)
        known = self._trees.get(robot, {})
        for name, value in zip(joints.names, joints.values.tolist(), strict=True):
            if name in known:
                turned = known[name].compute_transform(value, clamp=False)
                self._log(f"{robot}/joints/{name}", turned)

    def keypoint_states(self, stamp_ns: int, states: Sequence[str]) -> None:
        """Take the states of the six keypoints, which precede the keypoints."""
        self._states = stamp_ns, states

    def keypoints(self, stamp_ns: int, points_m: FloatArray) -> None:
        """Show keypoints (6, 3), m in the optical frame, coloured by state; plot the errors."""
        if points_m.shape != (6, 3) or not np.isfinite(points_m).all():
            return
        self._at(stamp_ns)
        is_known = self._states is not None and self._states[0] == stamp_ns
        states = self._states[1] if self._states is not None and is_known else ()
        joints = [_STATE_RGB.get(state, _MEASURED_RGB) for state in states]
        self._arms("keypoints", points_m, _MEASURED_RGB, joints)
        frame = self._truth.get(stamp_ns)
        if frame is None:
            return
        self._arms("truth", frame.keypoints_m, _TRUE_RGB)
        errors = errors_cm(points_m, frame.keypoints_m)
        for number, (name, value) in enumerate(errors.items()):
            self._plot(f"{_ERROR}/{name}", name, value, number, 2.0)

    def _at(self, stamp_ns: int) -> None:
        if self._first_ns is None:
            self._first_ns = stamp_ns
        self._stream.set_time("time", duration=(stamp_ns - self._first_ns) / 1e9)
        self._stream.set_time("stamp", timestamp=np.datetime64(stamp_ns, "ns"))

    def _robot(self, name: str, urdf: str) -> str:
        """Log geometry and joints below ``name`` and return the root link."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"{name}.urdf"
            path.write_text(urdf, encoding="utf-8")
            try:
                tree = self._rr.urdf.UrdfTree.from_file_path(
                    path,
                    entity_path_prefix=name,
                    frame_prefix=f"{name}/",
                    static_transform_entity_path=f"{name}/links",
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

    def _arms(
        self, entity: str, points_m: FloatArray, rgb: Rgb, joint_rgb: Sequence[Rgb] = ()
    ) -> None:
        if self._body is None:
            return  # the camera's pitch is still unknown
        tilt = self._body.camera_pose
        points = level_points(points_m, tilt.pitch_rad, tilt.roll_rad)
        strips = [points[list(arm)] for arm in _ARMS]
        bones = self._rr.LineStrips3D(strips, colors=[rgb] * len(strips), radii=_RADIUS_M / 3)
        joints = self._rr.Points3D(points, colors=list(joint_rgb) or rgb, radii=_RADIUS_M)
        for name, shown in (("arms", bones), ("joints", joints)):
            self._once(f"{entity}/{name}", self._rr.CoordinateFrame(_ROOT_FRAME))
            self._log(f"{entity}/{name}", shown)

    def _plot(self, entity: str, name: str, value: float, colour: int, width: float) -> None:
        rgb = _COLOURS[colour % len(_COLOURS)]
        self._once(entity, self._rr.SeriesLines(colors=rgb, names=name, widths=width))
        self._log(entity, self._rr.Scalars(value))

    def _once(self, entity: str, what: Any) -> None:
        if entity not in self._styled:
            self._log(entity, what, static=True)
        self._styled.add(entity)

    def _log(self, entity: str, what: Any, static: bool = False) -> None:
        self._stream.log(entity, what, static=static)


def _shown(joints: JointValues) -> Mapping[str, float]:
    """Return angles in degrees, and lengths in metres, by name."""
    return {
        name: value if UNITS.get(name) == "m" else float(np.degrees(value))
        for name, value in zip(joints.names, joints.values.tolist(), strict=True)
    }


def errors_cm(points_m: FloatArray, truth_m: FloatArray) -> dict[str, float]:
    """Return mean errors, cm, of keypoints (6, 3): with and without the error of the shoulders."""
    difference = 100 * (points_m - truth_m)
    return {
        "absolute": float(np.linalg.norm(difference, axis=1).mean()),
        "aligned": float(np.linalg.norm(beside_shoulders(difference), axis=1).mean()),
    }


def level_points(points_m: FloatArray, pitch_rad: float, roll_rad: float = 0.0) -> FloatArray:
    """Return optical points (n, 3), m, in the level frame of the root: X ahead, Y left, Z up.

    The camera looks down by ``pitch_rad`` and is turned by ``roll_rad``.
    """
    return np.asarray(points_m @ level_to_optical(pitch_rad, roll_rad) * (-1.0, -1.0, 1.0))


def _unit_of(group: str) -> str:
    return "m" if group in ("place", "shoulders") else "deg"


def _plot_of(joint: str) -> tuple[str, int]:
    """Return the plot of a joint, and the joint's index in it."""
    for group, joints in _GROUPS.items():
        if joint in joints:
            return group, joints.index(joint)
    return "other", 0


_ROBOT_TOPIC, _JOINTS_TOPIC = "/robot_description", "/joint_states"


def show_results(
    path: Path, scene: Scene, progress: Callable[[float], None], person: int | None = None
) -> int:
    """Show a bag; return the number of images with joints, or raise BagError without any."""
    count = 0
    with BagReader(path) as bag:
        space = namespace_of(bag, person)
        handlers = _handlers(bag, scene, space)
        total_s = max(bag.duration_s, 1e-9)
        for message in bag.messages([topic for topic in bag.topics if topic in handlers]):
            content = bag.deserialize(message)
            try:
                handlers[message.topic](message.time_ns, content)
            except (AttributeError, TypeError, ValueError) as error:
                # A recording contains the definitions of its types.
                raise BagError(
                    f"{message.topic} of {bag.path} has a malformed message: "
                    f"{reason_of(error)}; record it again"
                ) from None
            count += message.topic == space + _JOINTS_TOPIC
            progress((message.time_ns - bag.start_ns) / 1e9 / total_s)
    return count


Handler = Callable[[int, Any], None]
"""Callback that receives the time of a message, ns, and the message."""


def handlers_of(scene: Scene, source: str) -> dict[str, Handler]:
    """Return the handlers of the tracker's topics below its namespace; ``source`` names it."""
    return {
        MODEL: lambda _, m: scene.model(str(m.data), f"{MODEL} of {source}"),
        "/tracking_state": lambda time_ns, m: scene.state(time_ns, str(m.data)),
        _JOINTS_TOPIC: lambda _, m: scene.joints(stamp_ns_of(m), joints_of(m)),
        "/joint_states_stddev": lambda _, m: scene.deviations(stamp_ns_of(m), joints_of(m)),
        "/keypoint_states": lambda _, m: scene.keypoint_states(
            stamp_ns_of(m), [str(one.message) for one in m.status]
        ),
        "/keypoints": lambda _, m: scene.keypoints(stamp_ns_of(m), points_of(m)),
        "/overlay": lambda _, m: scene.image(stamp_ns_of(m), decode_bgr(SentImage.of(m))),
    }


def _handlers(bag: BagReader, scene: Scene, space: str) -> dict[str, Handler]:
    """Return the handlers of the topics of the tracker in ``space``, and of robots in others."""
    own = handlers_of(scene, str(bag.path))
    handlers = {space + topic: handler for topic, handler in own.items()}
    for topic in bag.topics:
        is_person = topic.removesuffix(_ROBOT_TOPIC) + MODEL in bag.topics
        if topic.endswith(_ROBOT_TOPIC) and not is_person and topic != space + _ROBOT_TOPIC:
            robot = topic.removesuffix(_ROBOT_TOPIC)
            name = robot.strip("/").replace("/", "_") or "robot"
            handlers[topic] = lambda _, m, name=name: scene.robot(name, str(m.data))  # type: ignore[misc]
            handlers[robot + _JOINTS_TOPIC] = lambda _, m, name=name: scene.robot_joints(  # type: ignore[misc]
                stamp_ns_of(m), name, joints_of(m)
            )
    return handlers
