"""Decides when commands may be sent to a robot; pure, without clocks or ROS."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum

import numpy as np

from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.retargeter import Command, Moment, Retargeter
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.tracking.estimate import LOST, NO_PERSON

DEAD_MAN_NS = 300_000_000
# A held robot is released at this share of the limits of following errors.
_RELEASED = 0.5


class Phase(Enum):
    """What may be sent: nothing unless ``FOLLOWING`` or ``HOLDING``, or on the way to a stop."""

    DISABLED = "disabled"
    READY = "ready"
    FOLLOWING = "following"
    HOLDING = "holding"
    FAULTED = "faulted"


_MOVING = Phase.FOLLOWING, Phase.HOLDING


class Supervisor:
    """A state machine between a retargeter and a robot.

    ``DISABLED`` becomes ``READY`` when the robot is enabled, ``READY`` becomes ``FOLLOWING`` with
    the first sure posture if the robot's own positions are known, and begins there. ``FOLLOWING``
    becomes ``HOLDING`` where postures are unsure or missing, or the robot is not where it was sent,
    and goes on by itself. After a loss, of the person, of postures or of the robot's positions, it
    is ``FAULTED`` until it is enabled anew. Wherever it stops, it decelerates.

    All times are of one clock that never runs backwards, ns. The motion has its own: it goes on
    with the other, by no more than a period of the rate from a :meth:`moment` to the next one.

    Attributes:
        phase: the state.
    """

    def __init__(self, retargeter: Retargeter, config: RetargetConfig, timeout_s: float) -> None:
        """Begin ``DISABLED``; with ``config.start``, the robot need not tell its positions.

        After ``timeout_s`` without a person, a posture, or the robot's positions, these are lost.
        """
        self.phase = Phase.DISABLED
        self._retargeter, self._config = retargeter, config
        self._timeout_ns = round(timeout_s * 1e9)
        self._period_ns = round(1e9 / config.rate_hz)
        self._gripped_ns: int | None = None
        self._robot: tuple[int, FloatArray] | None = None
        self._sent: Moment | None = None
        self._is_off = False
        self._seen_ns = self._sent_ns = self._motion_ns = self._stopped_ns = 0
        self._state = self._reason = ""

    @property
    def status(self) -> str:
        """The phase, with the reason if the robot stands still: for people."""
        reason = self._reason or ("no posture yet" if self.phase is Phase.READY else "")
        return self.phase.value + (f": {reason}" if reason else "")

    @property
    def _is_wanted(self) -> bool:
        return self.phase not in (Phase.DISABLED, Phase.FAULTED)

    def enable(self, is_wanted: bool, now_ns: int, is_grip: bool = False) -> None:
        """Enable the robot or stop it; with ``is_grip``, for 0.3 s only.

        A grip that is held since before a fault enables nothing; it has to be released first.
        """
        is_held = is_grip and self._gripped_ns is not None
        if is_grip or is_wanted:
            self._gripped_ns = now_ns if is_wanted and is_grip else None
        if is_wanted == self._is_wanted or (is_wanted and is_held):
            return
        if is_wanted:
            self.phase, self._reason = Phase.READY, ""
        else:
            self._stop(Phase.DISABLED, "", now_ns)

    def robot_at(self, positions: FloatArray, now_ns: int) -> None:
        """Take where the robot is, (n,), rad or m."""
        self._robot = now_ns, positions
        if self._sent is None or self.phase not in _MOVING:
            return
        off, joint = self._off(positions, self._sent)
        if off > 1.0:
            self._is_off, self.phase = True, Phase.HOLDING
            self._reason = f"{joint} is not where it was sent"
            self._near(positions, now_ns)
        elif self._is_off and off <= _RELEASED:
            self._is_off = False
            self._retargeter.hold("", self._clock_ns(now_ns))

    def follow(self, update: Callable[[int], Command], state: str, now_ns: int) -> Command | None:
        """Take an image's posture; return the command to send, or None if none may be sent.

        ``update`` returns the command at a time of the motion's clock, ns.
        """
        self._state = state
        if state not in (LOST, NO_PERSON):
            self._seen_ns = now_ns
        command = self.tick(now_ns)
        clock_ns = self._clock_ns(now_ns)
        if self.phase is Phase.READY:
            # A robot that could not follow begins elsewhere than where it was sent to stop, so a
            # moment without a command tells both apart.
            is_stopped = clock_ns > self._stopped_ns + self._period_ns
            if not is_stopped or not self._begins(now_ns):
                return command
        elif self.phase not in _MOVING:
            return command
        if self._is_off and self._robot is not None:
            return self._near(self._robot[1], now_ns)
        command = update(clock_ns)
        self._reason = "" if command.is_moving else command.reason
        if command.is_moving or self.phase is not Phase.READY:
            self.phase = Phase.FOLLOWING if command.is_moving else Phase.HOLDING
            return command
        return None

    def tick(self, now_ns: int) -> Command | None:
        """Look at the time; return the command to stop if it is to be sent now."""
        if self._gripped_ns is not None and now_ns - self._gripped_ns > DEAD_MAN_NS:
            self._gripped_ns = None
            if self._is_wanted:
                return self._stop(Phase.DISABLED, "not gripped", now_ns)
        if self.phase not in _MOVING:
            return None
        again = self._config.enable_after_lost
        if not self._is_robot_known(now_ns):
            phase = Phase.FAULTED if again else Phase.READY
            return self._stop(phase, "the robot's joint states have stopped", now_ns)
        if now_ns - self._seen_ns > self._timeout_ns:
            reason = f"no posture for {self._timeout_ns / 1e9:g} s"
            if self._state in (LOST, NO_PERSON):
                reason = self._state.replace("_", " ")
            if again:
                return self._stop(Phase.FAULTED, reason, now_ns)
            if (self.phase, self._reason) != (Phase.HOLDING, reason) and not self._is_off:
                return self._stop(Phase.HOLDING, reason, now_ns)
        return None

    def moment(self, now_ns: int) -> Moment | None:
        """Return positions and velocities to send now, or None if none may be sent."""
        before_ns, self._motion_ns = self._motion_ns, self._clock_ns(now_ns)
        # A tick that was late is made up for by the next one, which comes as much earlier.
        late_ns = now_ns - self._sent_ns - (self._motion_ns - before_ns)
        self._sent_ns = now_ns - min(max(late_ns, 0), self._period_ns)
        is_sent = self.phase in _MOVING or self._motion_ns <= self._stopped_ns
        self._sent = self._retargeter.at(self._motion_ns) if is_sent else None
        return self._sent

    def _clock_ns(self, now_ns: int) -> int:
        """Return the time of the motion, whose commands go on from the last one that was sent."""
        return self._motion_ns + min(max(now_ns - self._sent_ns, 0), self._period_ns)

    def _begins(self, now_ns: int) -> bool:
        """Return whether the robot can begin where it is, and let it begin there."""
        self._reason = ""
        if self._config.start:
            return True
        if not self._is_robot_known(now_ns) or self._robot is None:
            self._reason = "the robot's joint states are not known"
            return False
        self._retargeter.begin(self._robot[1])
        off, joint = self._off(self._robot[1], self._retargeter.at(self._clock_ns(now_ns)))
        if off > 1.0:
            self._reason = f"{joint} is beyond its limits"
        return not self._reason

    def _off(self, positions: FloatArray, sent: Moment) -> tuple[float, str]:
        """Return the largest following error, as a share of its limit, and its joint."""
        off = np.abs(positions - sent.positions) / self._retargeter.tolerance
        return float(off.max()), self._retargeter.joints[int(off.argmax())]

    def _near(self, positions: FloatArray, now_ns: int) -> Command:
        """Hold near the robot, which is not where it was sent."""
        return self._retargeter.hold_near(positions, self._reason, self._clock_ns(now_ns))

    def _stop(self, phase: Phase, reason: str, now_ns: int) -> Command | None:
        """Let the robot decelerate if it moves, and stay in a phase."""
        was_sent = self.phase in _MOVING
        self.phase, self._reason, self._is_off = phase, reason, False
        if not was_sent:
            return None
        clock_ns = self._clock_ns(now_ns)
        # The last command is about where it stands still.
        self._stopped_ns = clock_ns + self._retargeter.settles_ns + self._period_ns // 2
        return self._retargeter.hold(reason or "disabled", clock_ns)

    def _is_robot_known(self, now_ns: int) -> bool:
        if self._config.start:
            return True
        return self._robot is not None and now_ns - self._robot[0] <= self._timeout_ns
