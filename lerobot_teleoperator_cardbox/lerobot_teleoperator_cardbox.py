"""A LeRobot teleoperator that reads the joints which ``cardbox retarget --stream`` sends.

lerobot-teleoperate --robot.type=so101_follower --robot.port=/dev/ttyACM0 \
    --teleop.type=cardbox --teleop.address=tcp://127.0.0.1:5557
"""

from __future__ import annotations

import json
import logging
import math
import time
from dataclasses import dataclass, field
from typing import Any

import zmq
from lerobot.teleoperators.config import TeleoperatorConfig
from lerobot.teleoperators.teleoperator import Teleoperator

_LOG = logging.getLogger(__name__)


@TeleoperatorConfig.register_subclass("cardbox")
@dataclass(kw_only=True)
class CardboxTeleoperatorConfig(TeleoperatorConfig):
    """What is read, and in which units the robot takes it.

    Attributes:
        address: that of ``cardbox retarget --stream``, or of the node's ``stream_address``.
        joints: joints of the robot, in the names of the URDF given to ``retarget``.
        percent: those of them that LeRobot gives from 0 to 100 of their range, as grippers.
        use_degrees: as of the robot; otherwise other joints are -100 to 100 of their range.
        wait_s: longest time until the first command.
        stale_s: after this time without a command, a warning says that the robot holds.
    """

    address: str = "tcp://127.0.0.1:5557"
    joints: list[str] = field(
        default_factory=lambda: [
            *("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"),
            "gripper",
        ]
    )
    percent: list[str] = field(default_factory=lambda: ["gripper"])
    use_degrees: bool = True
    wait_s: float = 10.0
    stale_s: float = 0.5


class CardboxTeleoperator(Teleoperator):
    """Returns the newest command at once; without new ones the robot holds the last.

    What is no command, is not finite or is beyond the joint's limits is refused, with a warning.
    """

    config_class = CardboxTeleoperatorConfig
    name = "cardbox"

    def __init__(self, config: CardboxTeleoperatorConfig) -> None:
        """Prepare; :meth:`connect` begins."""
        super().__init__(config)
        self.config = config
        self._context: zmq.Context | None = None
        self._socket: zmq.Socket | None = None
        self._action: dict[str, float] = {}
        self._heard_s, self._is_stale, self._has_refused = 0.0, False, False

    @property
    def action_features(self) -> dict[str, type]:
        """Names and types of what :meth:`get_action` returns."""
        return {f"{joint}.pos": float for joint in self.config.joints}

    @property
    def feedback_features(self) -> dict[str, type]:
        """Nothing is sent back."""
        return {}

    @property
    def is_connected(self) -> bool:
        """Whether a command has come since :meth:`connect`."""
        return self._socket is not None

    @property
    def is_calibrated(self) -> bool:
        """There is nothing to calibrate."""
        return True

    def connect(self, calibrate: bool = True) -> None:
        """Wait for the first command.

        Raises:
            ConnectionError: none came within ``wait_s``, or it is connected already.
            ValueError: the commands lack a joint.
        """
        if self.is_connected:
            raise ConnectionError(f"{self} is connected already")
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.SUB)
        self._socket.linger = 0
        # Only the newest command counts.
        self._socket.conflate = True
        self._socket.subscribe(b"")
        try:
            self._socket.connect(self.config.address)
            until_s = time.monotonic() + self.config.wait_s
            while not self._action:
                left_ms = round(1000 * (until_s - time.monotonic()))
                if left_ms < 0 or not self._socket.poll(left_ms):
                    raise ConnectionError(
                        f"no command came on {self.config.address} within {self.config.wait_s:g} "
                        "s; start 'cardbox retarget ... --stream' or the node, and enable the robot"
                    )
                self._read()
        except Exception:
            self.disconnect()
            raise

    def calibrate(self) -> None:
        """Do nothing."""

    def configure(self) -> None:
        """Do nothing."""

    def get_action(self) -> dict[str, float]:
        """Return the newest positions, by ``JOINT.pos``; this never waits.

        Raises:
            ConnectionError: it is not connected.
        """
        if self._socket is None:
            raise ConnectionError(f"{self} is not connected; call connect()")
        if self._socket.poll(0):
            self._read()
        is_stale = time.monotonic() - self._heard_s > self.config.stale_s
        if is_stale and not self._is_stale:
            _LOG.warning("%s: no new command for %g s; the robot holds", self, self.config.stale_s)
        self._is_stale = is_stale
        return dict(self._action)

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Do nothing."""

    def disconnect(self) -> None:
        """Free the connection."""
        if self._socket is not None and self._context is not None:
            self._socket.close()
            self._context.term()
        self._socket = self._context = None
        self._action = {}

    def _read(self) -> None:
        """Take a packet if it is a command; raise ValueError if the first one lacks a joint."""
        assert self._socket is not None
        packet, is_first = self._socket.recv(zmq.NOBLOCK), not self._action
        try:
            content = json.loads(packet)
            columns = (content[name] for name in ("positions", "lower", "upper"))
            found = dict(zip(content["names"], zip(*columns, strict=True), strict=True))
            missing = [joint for joint in self.config.joints if joint not in found]
            if not missing:
                self._action = {
                    f"{joint}.pos": self._converted(joint, *found[joint])
                    for joint in self.config.joints
                }
                self._heard_s = time.monotonic()
                return
            why = (
                f"the commands have no joint {', '.join(missing)}, only {', '.join(found)}; give "
                "--teleop.joints in the names of the robot's URDF"
            )
        except (ArithmeticError, LookupError, RecursionError, TypeError, ValueError) as error:
            why, is_first = f"not a command of cardbox retarget: {error}", False
        if is_first:
            raise ValueError(why)
        if not self._has_refused:
            _LOG.warning("%s: a packet on %s is refused: %s", self, self.config.address, why)
        self._has_refused = True

    def _converted(self, joint: str, position: float, lower: float, upper: float) -> float:
        # Numbers of a packet are rounded.
        if not (math.isfinite(upper - lower) and lower - 1e-5 <= position <= upper + 1e-5):
            raise ValueError(f"{joint} is at {position}, beyond {lower} to {upper}")
        position = min(max(position, lower), upper)
        share = 100.0 * (position - lower) / (upper - lower)
        if joint in self.config.percent:
            return share
        return math.degrees(position) if self.config.use_degrees else 2.0 * share - 100.0
