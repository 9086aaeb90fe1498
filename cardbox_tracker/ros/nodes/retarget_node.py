"""The node ``retarget`` turns the tracker's postures into commands for a robot arm."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64MultiArray, Header, String
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.retargeter import Command, make_retargeter
from cardbox_tracker.applications.retargeting.supervisor import DEAD_MAN_NS, Supervisor
from cardbox_tracker.applications.teleoperation.sending import ZmqSender, joints_packet
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import user_path
from cardbox_tracker.common.settings import settings_of
from cardbox_tracker.person.skeleton import HAND_OPEN_NAMES, POSTURE_GROUPS, Group, rows_of
from cardbox_tracker.recordings.outputs import joints_of
from cardbox_tracker.ros.messages.results import state_of
from cardbox_tracker.ros.nodes.posture_input import PostureInput, Tracked
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.command_line import node_main
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.ros.runtime.parameter_fields import AT_START, NodeParameters, at_start
from cardbox_tracker.ros.runtime.parameters import LiveParameters


@dataclass(frozen=True)
class RetargetParameters(NodeParameters, RetargetConfig):
    """Move a robot arm as the tracked person moves theirs, within its limits."""

    # They cannot change while a robot moves.
    effects = MappingProxyType(dict.fromkeys(settings_of(RetargetConfig), AT_START))

    robot_file: str = at_start("", "URDF of the robot; has to be given")
    joint_map_file: str = at_start(
        "",
        "map of joints, as in config/example_joint_map.yaml; empty: the robot's arm is found and "
        "points as the person's",
    )
    stream_address: str = at_start(
        "",
        "ZMQ address on which the commands are published, too, as tcp://127.0.0.1:5557, for "
        "LeRobot; empty: none",
    )
    timeout_s: float = at_start(
        0.5,
        "dead-man: the robot stops after this time without a posture, or without its joint states",
        unit="s",
        limits=(0.05, 10.0),
    )


class RetargetNode(CardboxNode):
    """Commands a robot while it is enabled and the posture is sure."""

    def __init__(self, **options: Any) -> None:
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
        self._status = ""
        # How far stamps are ahead of the clock: that of the image, and the last one sent.
        self._ahead_ns = 0
        self._sent_ahead_ns: int | None = None
        address = settings.stream_address
        self._sender = ZmqSender(address) if address else None
        for remark in self._sender.remarks if self._sender else ():
            self.get_logger().warning(remark)
        self._trajectory = self.advertise(JointTrajectory, "retarget/joint_trajectory", qos.RESULT)
        self._commands = self.advertise(Float64MultiArray, "retarget/commands", qos.RESULT)
        self._robot_joints = self.advertise(JointState, "retarget/joint_states", qos.RESULT)
        self._says = self.advertise(String, "retarget/status", qos.LATCHED)
        description = self.advertise(String, "retarget/robot_description", qos.LATCHED)
        description.publish(String(data=robot.urdf))
        self._input = PostureInput(self, self._follow)
        self.subscribe(JointState, "retarget/robot_joint_states", self._on_robot, qos.LATEST)
        self.subscribe(Bool, "retarget/grip", self._on_grip, qos.LATEST)
        self.create_service(SetBool, "retarget/enable", self._on_enable, qos_profile=qos.SERVICE)
        self.create_timer(1.0 / settings.rate_hz, self._stream)
        self._say()

    def _on_robot(self, message: JointState, _: int) -> None:
        """Take where the robot is, if the message has all of its joints."""
        found = dict(zip(message.name, message.position, strict=False))
        positions = np.array([found.get(name, np.nan) for name in self._retargeter.joints])
        if np.isfinite(positions).all():
            self._supervisor.robot_at(positions, _now_ns())

    def _on_grip(self, message: Bool, sent_ns: int) -> None:
        age_ns = max(time.time_ns() - sent_ns, 0)
        if message.data and age_ns > DEAD_MAN_NS:
            self.diagnostics.warn(
                f"a grip on {self.resolve('retarget/grip')} came more than "
                f"{DEAD_MAN_NS / 1e9:g} s after it was sent and is not used: the network is slow, "
                "or set the clocks of both computers alike"
            )
            return
        self._supervisor.enable(message.data, _now_ns() - age_ns, is_grip=True)
        self._say()

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._supervisor.enable(request.data, _now_ns())
        self._say()
        response.success, response.message = True, self._supervisor.status
        return response

    def _follow(self, image: Tracked) -> None:
        # Stamps may run faster than the robot's own time, which its speed is about.
        now_ns = _now_ns()
        posture = stddev = hands = None
        if image.joints is not None:
            self._ahead_ns = image.stamp_ns - now_ns
            rows = rows_of(*POSTURE_GROUPS, Group.NECK)
            posture, stddev = state_of(image.joints, image.stddev)[:, rows]
        if image.hands is not None:
            hands = joints_of(image.hands).of(HAND_OPEN_NAMES)
        update = partial(
            self._retargeter.update,
            *(image.stamp_ns, image.state, image.body, posture, stddev),
            hands=hands,
            keypoints=image.keypoints,
        )
        command = self._supervisor.follow(update, image.state, now_ns)
        self._send(command)
        if command is not None and image.joints is not None:
            self.diagnostics.made("command", image.stamp_ns)

    def _send(self, command: Command | None) -> None:
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
            self._sent_ahead_ns = None
            return
        # The recording's time goes on from the image, and never back.
        ahead_ns = self._ahead_ns
        if self._sent_ahead_ns is not None:
            ahead_ns = max(ahead_ns, self._sent_ahead_ns)
        self._sent_ahead_ns, stamp_ns = ahead_ns, now_ns + ahead_ns
        names = list(self._retargeter.joints)
        if self._sender is not None:
            lower, upper, _ = self._retargeter.limits
            found = joints_packet(stamp_ns, names, moment.positions, lower, upper)
            self._sender.send(found)
        positions, velocities = (part.tolist() for part in moment)
        header = Header()
        header.stamp = Time(nanoseconds=stamp_ns).to_msg()
        self._commands.publish(Float64MultiArray(data=positions))
        self._robot_joints.publish(
            JointState(header=header, name=names, position=positions, velocity=velocities)
        )

    def close(self) -> None:
        """Free the address of the stream."""
        if self._sender is not None:
            self._sender.close()


def _now_ns() -> int:
    return round(time.monotonic() * 1e9)


main = node_main("retarget", RetargetNode, RetargetParameters)
