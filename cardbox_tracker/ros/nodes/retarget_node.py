"""The node ``retarget`` turns the tracker's postures into commands for a robot arm."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64MultiArray, Header, String
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.retargeter import Command, make_retargeter
from cardbox_tracker.applications.retargeting.supervisor import Supervisor
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import user_path
from cardbox_tracker.common.settings import settings_of
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import loads_body_model
from cardbox_tracker.recordings.outputs import chances_of, open_hands_from
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.messages.results import joint_values_of, posture_and_neck_of
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.command_line import plain_command_line
from cardbox_tracker.ros.runtime.node import CardboxNode, run_node
from cardbox_tracker.ros.runtime.parameter_fields import AT_START, NodeParameters, parameter
from cardbox_tracker.ros.runtime.parameters import LiveParameters
from cardbox_tracker.tracking.estimate import TRACKING, UNCERTAIN

_DOES = "Move a robot arm as the tracked person moves theirs, within its limits."


@dataclass(frozen=True)
class RetargetParameters(NodeParameters, RetargetConfig):
    """Move a robot arm as the tracked person moves theirs."""

    # They cannot change while a robot moves.
    effects = MappingProxyType(dict.fromkeys(settings_of(RetargetConfig), AT_START))

    robot_file: str = parameter("", "URDF of the robot; has to be given", effect=AT_START)
    joint_map_file: str = parameter(
        "",
        "map of joints, as in config/example_joint_map.yaml; empty: the robot's arm is found and "
        "points as the person's",
        effect=AT_START,
    )
    timeout_s: float = parameter(
        0.5,
        "dead-man: the robot stops after this time without a posture, or without its joint states",
        unit="s",
        limits=(0.05, 10.0),
        effect=AT_START,
    )


class RetargetNode(CardboxNode):
    """Commands a robot while it is enabled and the posture is sure."""

    def __init__(self, **options: Any) -> None:
        """Read the robot and subscribe to what the tracker publishes.

        Raises:
            CardboxError: no robot is given, or the parameters do not fit it.
        """
        super().__init__("retarget", **options)
        settings = LiveParameters(self, RetargetParameters).value
        if not settings.robot_file:
            raise CardboxError("retarget needs a robot: give the parameter robot_file, a URDF")
        joint_map = user_path(settings.joint_map_file) if settings.joint_map_file else None
        robot, self._retargeter, table = make_retargeter(
            user_path(settings.robot_file), joint_map, settings
        )
        if table:
            self.get_logger().info(f"the robot's joints\n{table}")
        self._supervisor = Supervisor(self._retargeter, settings, settings.timeout_s)
        self._body: BodyModel | None = None
        self._state, self._status = "", ""
        self._joints, self._open, self._points = JointState(), JointState(), DiagnosticArray()
        self._arrived_ns, self._stamp_ns = _now_ns(), 0
        self._trajectory = self.advertise(JointTrajectory, "retarget/joint_trajectory", qos.RESULT)
        self._commands = self.advertise(Float64MultiArray, "retarget/commands", qos.RESULT)
        self._robot_joints = self.advertise(JointState, "retarget/joint_states", qos.RESULT)
        self._says = self.advertise(String, "retarget/status", qos.LATCHED)
        description = self.advertise(String, "retarget/robot_description", qos.LATCHED)
        description.publish(String(data=robot.urdf))
        self._joints_topic = self.resolve("joint_states")
        self.subscribe(String, "body_model", self._on_model, qos.LATCHED)
        self.subscribe(String, "tracking_state", self._on_state, qos.RESULT)
        self.subscribe(DiagnosticArray, "keypoint_states", self._on_points, qos.RESULT)
        self.subscribe(JointState, "joint_states", self._on_joints, qos.RESULT)
        self.subscribe(JointState, "hands", self._on_hands, qos.RESULT)
        self.subscribe(JointState, "joint_states_stddev", self._on_stddev, qos.RESULT)
        self.subscribe(JointState, "retarget/robot_joint_states", self._on_robot, qos.RESULT)
        self.subscribe(Bool, "retarget/grip", self._on_grip, qos.RESULT)
        self.create_service(SetBool, "retarget/enable", self._on_enable, qos_profile=qos.SERVICE)
        self.create_timer(1.0 / settings.rate_hz, self._stream)
        self.diagnostics.source = f"postures on {self._joints_topic}"
        self.diagnostics.wait_for(f"postures on {self._joints_topic} (is the tracker running?)")
        self._say()

    def _on_model(self, message: String, _: int) -> None:
        self._body = loads_body_model(message.data, source=self.resolve("body_model"))

    def _on_state(self, message: String, _: int) -> None:
        # The state comes before the joints of its image, or without joints.
        self._state = message.data
        if message.data not in (TRACKING, UNCERTAIN):
            now_ns, state = _now_ns(), message.data
            hold = partial(self._retargeter.update, self._stamp_ns, state, now_ns=now_ns)
            self._send(self._supervisor.follow(hold, state, now_ns))

    def _on_points(self, message: DiagnosticArray, _: int) -> None:
        self._points = message

    def _on_robot(self, message: JointState, _: int) -> None:
        """Take where the robot is, if the message has all of its joints."""
        found = dict(zip(message.name, message.position, strict=False))
        positions = np.array([found.get(name, np.nan) for name in self._retargeter.joints])
        if np.isfinite(positions).all():
            self._supervisor.robot_at(positions, _now_ns())

    def _on_grip(self, message: Bool, _: int) -> None:
        self._supervisor.enable(message.data, _now_ns(), is_grip=True)
        self._say()

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._supervisor.enable(request.data, _now_ns())
        self._say()
        response.success, response.message = True, self._supervisor.status
        return response

    def _on_joints(self, message: JointState, _: int) -> None:
        self._joints = message

    def _on_hands(self, message: JointState, _: int) -> None:
        self._open = message

    def _on_stddev(self, message: JointState, sent_ns: int) -> None:
        """Command the robot; the deviations come after the joints, with the same stamp."""
        if self._joints.header.stamp != message.header.stamp:
            return
        stamp_ns = conversions.stamp_ns(message.header.stamp)
        if not self.diagnostics.input.add(stamp_ns).is_usable:
            return
        # Stamps may run faster than the robot's own time, which its speed is about.
        self._arrived_ns, self._stamp_ns = _now_ns(), stamp_ns
        posture, stddev = posture_and_neck_of(self._joints), posture_and_neck_of(message)
        hands = None
        if self._open.header.stamp == message.header.stamp:
            hands = open_hands_from(joint_values_of(self._open))
        keypoints = None
        if self._points.header.stamp == message.header.stamp:
            keypoints = chances_of(self._points)
        update = partial(
            self._retargeter.update,
            *(stamp_ns, self._state, self._body, posture, stddev, self._arrived_ns, hands),
            keypoints,
        )
        self._send(self._supervisor.follow(update, self._state, self._arrived_ns))
        if self._body is None:
            self.diagnostics.wait_for(
                f"the body model on {self.resolve('body_model')}; the node initializer sends it "
                "when it starts with its parameter model_file, or after it has measured the person"
            )
            return
        self.diagnostics.working(sent_ns)

    def _send(self, command: Command | None) -> None:
        """Send the goal of an image, if it may be sent, and what the robot does."""
        if command is not None:
            nanoseconds = round(command.duration_s * 1e9)
            duration = Duration(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
            # A velocity at the end would be refused by joint_trajectory_controller.
            point = JointTrajectoryPoint(
                positions=command.positions.tolist(), time_from_start=duration
            )
            # A trajectory without a stamp begins at once; the stamp of the image has passed.
            names = list(self._retargeter.joints)
            self._trajectory.publish(JointTrajectory(joint_names=names, points=[point]))
        self._say()

    def _say(self) -> None:
        if self._supervisor.status != self._status:
            self._status = self._supervisor.status
            self._says.publish(String(data=self._status))

    def _stream(self) -> None:
        """Send where the robot is on its way, and how fast, while it may move."""
        now_ns = _now_ns()
        self._send(self._supervisor.tick(now_ns))
        moment = self._supervisor.moment(now_ns)
        if moment is None:
            return
        positions, velocities = (part.tolist() for part in moment)
        header = Header()
        if self._stamp_ns:
            # The recording's time goes on from the image.
            stamp = Time(nanoseconds=self._stamp_ns + now_ns - self._arrived_ns)
            header.stamp = stamp.to_msg()
        self._commands.publish(Float64MultiArray(data=positions))
        names = list(self._retargeter.joints)
        self._robot_joints.publish(
            JointState(header=header, name=names, position=positions, velocity=velocities)
        )


def _now_ns() -> int:
    """Return the time of the robot's clock, ns."""
    return round(time.monotonic() * 1e9)


def main(args: list[str] | None = None) -> int:
    """Run the node; the exit code is 0 unless it could not start."""
    return run_node(RetargetNode, plain_command_line("retarget", _DOES, RetargetParameters, args))
