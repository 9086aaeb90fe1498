"""Decides when commands may be sent to a robot; pure, without clocks or ROS."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum

from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.retargeter import Command, Moment, Retargeter
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.tracking.estimate import LOST, NO_PERSON

DEAD_MAN_NS = 300_000_000


class Phase(Enum):
    """What may be sent: nothing unless ``FOLLOWING`` or ``STOPPING``."""

    DISABLED = "disabled"
    READY = "ready"
    FOLLOWING = "following"
    STOPPING = "stopping"


class Supervisor:
    """A state machine between a retargeter and a robot.

    ``DISABLED`` becomes ``READY`` when the robot is enabled, ``READY`` becomes ``FOLLOWING`` with
    the first sure posture if the robot's own positions are known, and begins there. ``FOLLOWING``
    holds where postures are unsure or missing. It becomes ``STOPPING`` when the robot is no longer
    enabled or no longer tells its positions, and, once it stands still, ``DISABLED`` or ``READY``.

    All times are of one clock that never runs backwards, ns.

    Attributes:
        phase: the state.
    """

    def __init__(self, retargeter: Retargeter, config: RetargetConfig, timeout_s: float) -> None:
        """Begin ``DISABLED``; with ``config.start``, the robot need not tell its positions.

        After ``timeout_s`` without a posture, or without the robot's positions, it stops.
        """
        self.phase = Phase.DISABLED
        self._retargeter, self._config = retargeter, config
        self._timeout_ns = round(timeout_s * 1e9)
        self._is_wanted = False
        self._gripped_ns: int | None = None
        self._robot: tuple[int, FloatArray] | None = None
        self._heard_ns = self._stopped_ns = 0
        self._reason = ""

    @property
    def status(self) -> str:
        """The phase, with the reason if the robot stands still: for people."""
        if self.phase is Phase.DISABLED:
            return "disabled" + (f": {self._reason}" if self._reason else "")
        if self.phase is Phase.READY:
            return f"ready: {self._reason or 'no posture yet'}"
        return self._reason or ("moving" if self.phase is Phase.FOLLOWING else "stopping")

    def enable(self, is_wanted: bool, now_ns: int, is_grip: bool = False) -> None:
        """Enable the robot or stop it; with ``is_grip``, for 0.3 s only."""
        self._gripped_ns = now_ns if is_wanted and is_grip else None
        if is_wanted != self._is_wanted:
            self._is_wanted = is_wanted
            self._reason = ""
            if is_wanted and self.phase is Phase.DISABLED:
                self.phase = Phase.READY
            elif not is_wanted:
                self._stop("", now_ns)

    def robot_at(self, positions: FloatArray, now_ns: int) -> None:
        """Take where the robot is, (n,), rad or m."""
        self._robot = now_ns, positions

    def follow(self, update: Callable[[], Command], state: str, now_ns: int) -> Command | None:
        """Take an image's posture; return the command to send, or None if none may be sent."""
        self.tick(now_ns)
        self._heard_ns = now_ns
        if self.phase is Phase.READY:
            if not self._is_robot_known(now_ns):
                self._reason = "the robot's joint states are not known"
                return None
            if self._robot is not None and not self._config.start:
                self._retargeter.begin(self._robot[1])
        elif self.phase is not Phase.FOLLOWING:
            return None
        command = update()
        self._reason = "" if command.is_moving else command.status
        if self.phase is Phase.READY:
            if not command.is_moving:
                return None
            self.phase = Phase.FOLLOWING
        elif self._config.enable_after_lost and state in (LOST, NO_PERSON):
            self._is_wanted = False
            self._stop(state.replace("_", " "), now_ns)
        return command

    def tick(self, now_ns: int) -> Command | None:
        """Look at the time; return the command to stop if it is to be sent now."""
        if self._gripped_ns is not None and now_ns - self._gripped_ns > DEAD_MAN_NS:
            self._gripped_ns, self._is_wanted = None, False
            return self._stop("not gripped", now_ns)
        if self.phase is Phase.STOPPING and now_ns > self._stopped_ns:
            self.phase = Phase.READY if self._is_wanted else Phase.DISABLED
        if self.phase is not Phase.FOLLOWING:
            return None
        if not self._is_robot_known(now_ns):
            return self._stop("the robot's joint states have stopped", now_ns)
        if now_ns - self._heard_ns > self._timeout_ns and not self._reason.startswith(
            "frozen: no p"
        ):
            command = self._retargeter.hold(f"no posture for {self._timeout_ns / 1e9:g} s", now_ns)
            self._reason = command.status
            return command
        return None

    def moment(self, now_ns: int) -> Moment | None:
        """Return positions and velocities to send now, or None if none may be sent."""
        if self.phase not in (Phase.FOLLOWING, Phase.STOPPING):
            return None
        return self._retargeter.at(now_ns)

    def _stop(self, reason: str, now_ns: int) -> Command | None:
        self._reason = reason
        if self.phase is Phase.FOLLOWING:
            self.phase = Phase.STOPPING
            self._stopped_ns = now_ns + self._retargeter.settles_ns
            return self._retargeter.hold(reason or "disabled", now_ns)
        if self.phase is Phase.READY:
            self.phase = Phase.READY if self._is_wanted else Phase.DISABLED
        return None

    def _is_robot_known(self, now_ns: int) -> bool:
        if self._config.start:
            return True
        return self._robot is not None and now_ns - self._robot[0] <= self._timeout_ns
