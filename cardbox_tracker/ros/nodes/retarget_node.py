"""The node ``retarget`` turns the tracker's postures into commands for a robot arm."""

from __future__ import annotations

import time
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from builtin_interfaces.msg import Duration
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.retargeter import MOVING, Command, make_retargeter
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import user_path
from cardbox_tracker.common.settings import settings_of
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import loads_body_model
from cardbox_tracker.recordings.outputs import open_hands_from
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.messages.results import joint_values_of, posture_and_neck_of
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.command_line import plain_command_line
from cardbox_tracker.ros.runtime.node import CardboxNode, run_node
from cardbox_tracker.ros.runtime.parameter_fields import AT_START, NodeParameters, parameter
from cardbox_tracker.ros.runtime.parameters import LiveParameters
from cardbox_tracker.tracking.estimate import TRACKING

_DOES = "Move a robot arm as the tracked person moves theirs, within its limits."
_CHECK_S = 0.1


@dataclass(frozen=True)
class RetargetParameters(NodeParameters, RetargetConfig):
    """Move a robot arm as the tracked person moves theirs."""

    # They cannot change while a robot moves.
    effects = MappingProxyType(dict.fromkeys(settings_of(RetargetConfig), AT_START))

    robot_file: str = parameter("", "URDF of the robot; has to be given", effect=AT_START)
    joint_map_file: str = parameter(
        "",
        "map of joints, as in config/example_joint_map.yaml; empty: the robot's hand follows the "
        "person's hand by inverse kinematics",
        effect=AT_START,
    )
    hand_link: str = parameter(
        "", "the robot's hand; empty: the link with the most joints before it", effect=AT_START
    )
    timeout_s: float = parameter(
        0.5,
        "dead-man: the robot stands still after this time without a posture",
        unit="s",
        limits=(0.05, 10.0),
        effect=AT_START,
    )


class RetargetNode(CardboxNode):
    """Commands a robot, which stands still while the posture is uncertain."""

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
        robot, self._retargeter = make_retargeter(
            user_path(settings.robot_file), joint_map, settings.hand_link, settings
        )
        self._timeout_s = settings.timeout_s
        self._body: BodyModel | None = None
        self._state, self._status = "", ""
        self._joints, self._open = JointState(), JointState()
        self._heard_ns, self._stamp_ns = _now_ns(), 0
        self._trajectory = self.advertise(JointTrajectory, "retarget/joint_trajectory", qos.RESULT)
        self._commands = self.advertise(Float64MultiArray, "retarget/commands", qos.RESULT)
        self._robot_joints = self.advertise(JointState, "retarget/joint_states", qos.RESULT)
        self._says = self.advertise(String, "retarget/status", qos.LATCHED)
        description = self.advertise(String, "retarget/robot_description", qos.LATCHED)
        description.publish(String(data=robot.urdf))
        self._joints_topic = self.resolve("joint_states")
        self.subscribe(String, "body_model", self._on_model, qos.LATCHED)
        self.subscribe(String, "tracking_state", self._on_state, qos.RESULT)
        self.subscribe(JointState, "joint_states", self._on_joints, qos.RESULT)
        self.subscribe(JointState, "hands", self._on_hands, qos.RESULT)
        self.subscribe(JointState, "joint_states_stddev", self._on_stddev, qos.RESULT)
        self.create_timer(_CHECK_S, self._check)
        self.create_timer(1.0 / settings.rate_hz, self._stream)
        self.diagnostics.source = f"postures on {self._joints_topic}"
        self.diagnostics.wait_for(f"postures on {self._joints_topic} (is the tracker running?)")

    def _on_model(self, message: String, _: int) -> None:
        self._body = loads_body_model(message.data, source=self.resolve("body_model"))

    def _on_state(self, message: String, _: int) -> None:
        # The state comes before the joints of its image, or without joints.
        self._state = message.data
        if message.data != TRACKING:
            self._hold(message.data)

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
        self._heard_ns, self._stamp_ns = _now_ns(), stamp_ns
        posture, stddev = posture_and_neck_of(self._joints), posture_and_neck_of(message)
        hands = None
        if self._open.header.stamp == message.header.stamp:
            hands = open_hands_from(joint_values_of(self._open))
        command = self._retargeter.update(
            stamp_ns, self._state, self._body, posture, stddev, self._heard_ns, hands
        )
        self._send(command)
        if self._body is None:
            self.diagnostics.wait_for(
                f"the body model on {self.resolve('body_model')}; the node initializer sends it "
                "when it starts with its parameter model_file, or after it has measured the person"
            )
            return
        self.diagnostics.working(sent_ns)

    def _check(self) -> None:
        if _now_ns() > self._heard_ns + self._timeout_s * 1e9:
            self._hold(f"no posture for {self._timeout_s:g} s")

    def _hold(self, reason: str) -> None:
        """Let the robot stand still where it is, and say so once."""
        command = self._retargeter.hold(reason, _now_ns())
        if command.status != self._status:
            self._send(command)

    def _send(self, command: Command) -> None:
        """Send the goal of an image, and once that the robot stands still."""
        nanoseconds = round(command.duration_s * 1e9)
        duration = Duration(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        # A velocity at the end would be refused by joint_trajectory_controller.
        point = JointTrajectoryPoint(positions=command.positions.tolist(), time_from_start=duration)
        # A trajectory without a stamp begins at once; the stamp of the image has passed.
        names = list(self._retargeter.joints)
        self._trajectory.publish(JointTrajectory(joint_names=names, points=[point]))
        if command.status != self._status:
            self._status = command.status
            self._says.publish(String(data=command.status))
        if not command.is_moving:
            self._send_moment()

    def _stream(self) -> None:
        if self._status == MOVING:
            self._send_moment()

    def _send_moment(self) -> None:
        """Send where the robot is on its way, and how fast."""
        now_ns = _now_ns()
        positions, velocities = (part.tolist() for part in self._retargeter.at(now_ns))
        header = Header()
        if self._stamp_ns:
            # The recording's time goes on from the image.
            stamp = Time(nanoseconds=self._stamp_ns + now_ns - self._heard_ns)
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
