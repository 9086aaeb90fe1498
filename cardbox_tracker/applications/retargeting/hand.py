"""Retargeting of the hand's position by inverse kinematics.

The vector from shoulder to hand, divided by the arm's length, is the same for the robot as for the
person (in the torso frame). The library pink solves the inverse kinematics as quadratic programs
with the joint limits as constraints; pink and pinocchio are optional dependencies.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.robot import Robot
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.posture import LEFT_ARM, RIGHT_ARM
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import arm_directions, rotation_x, rotation_y, rotation_z

_ARM_JOINTS = ("shoulder_abduction", "shoulder_flexion", "elbow_abduction", "elbow_flexion")
_STEPS, _CLOSE_M = 12, 1e-3
# Redundant joints are pulled to the middle of their range, so that the elbow does not drift.
_REST_COST = 1e-2
_LM_DAMPING, _DAMPING = 1e-3, 1e-6
_SHORTEST_M, _LONGEST_M = 0.01, 100.0


def hand_of(body: BodyModel, posture: FloatArray, side: str) -> FloatArray:
    """Return the vector (3,) from shoulder to hand in the torso frame, in arm lengths."""
    sign = 1.0 if side == "left" else -1.0
    upper, fore = arm_directions(posture[LEFT_ARM if side == "left" else RIGHT_ARM], sign)
    parts = body_parts(body.sizes)
    lengths = parts.upper_arm.height_m, parts.forearm.height_m
    hand: FloatArray = (lengths[0] * upper + lengths[1] * fore) / sum(lengths)
    return hand


class HandFollower:
    """A :class:`~.retargeter.Method` by which the robot's hand follows the person's hand.

    Attributes:
        sources: the four joints of the person's arm.
        joints: the robot's joints between its root and its hand.
        reach_m: length of the robot's stretched arm from its second joint, the shoulder, to the
            hand.
    """

    def __init__(self, robot: Robot, config: RetargetConfig, hand_link: str = "") -> None:
        """Prepare.

        Args:
            robot: the robot arm.
            config: side of the person, mounting and reach of the robot.
            hand_link: link of the robot's hand; if empty, the link with the longest joint chain.

        Raises:
            CardboxError: the libraries are not installed, the robot has no such link, or the
                link's chain has fewer than two joints or an impossible length.
        """
        pin, self._pink = _libraries()
        self.sources = tuple(f"{config.side}_{name}" for name in _ARM_JOINTS)
        self._side = config.side
        hand_link = hand_link or robot.last_link
        self.joints = robot.chain(hand_link)
        if len(self.joints) < 2:
            raise CardboxError(
                f"{hand_link} of the robot has {len(self.joints)} joints before it; expected at "
                "least 2, and 6 for every position and direction"
            )
        model = _model(pin, robot.urdf, self.joints)
        # Index of each of our joints in the library's configuration vector.
        order = [model.joints[model.getJointId(name)].idx_q for name in self.joints]
        self._order = np.array(order)
        self._configuration = self._pink.Configuration(
            model, model.createData(), pin.neutral(model)
        )
        self._hand, self._frame = hand_link, self._configuration.get_transform_frame_to_world
        self._task = self._pink.tasks.FrameTask(
            hand_link, position_cost=1.0, orientation_cost=0.0, lm_damping=_LM_DAMPING
        )
        rest = self._pink.tasks.PostureTask(cost=_REST_COST)
        rest.set_target(0.5 * (model.lowerPositionLimit + model.upperPositionLimit))
        self._tasks = [self._task, rest]
        self._limits = [self._pink.limits.ConfigurationLimit(model)]
        self._goal: Any = pin.SE3.Identity()
        shoulder = model.getJointId(self.joints[1])
        self._shoulder_m = np.array(self._configuration.data.oMi[shoulder].translation)
        self.reach_m = _length(model, self.joints[2:], hand_link)
        if not _SHORTEST_M <= self.reach_m <= _LONGEST_M:
            raise CardboxError(
                f"the robot's arm is {self.reach_m:g} m long from its second joint to {hand_link}; "
                f"expected {_SHORTEST_M:g} to {_LONGEST_M:g} m: a URDF has metres"
            )
        self._scale_m = config.reach * self.reach_m
        angles = np.radians([config.mount_roll_deg, config.mount_pitch_deg, config.mount_yaw_deg])
        self._mount = rotation_z(angles[2]) @ rotation_y(angles[1]) @ rotation_x(angles[0])

    def target(self, body: BodyModel, posture: FloatArray, now: FloatArray) -> FloatArray:
        """See :class:`~.retargeter.Method`."""
        share = self._mount.T @ hand_of(body, posture, self._side)
        self._goal.translation = self._shoulder_m + self._scale_m * share
        self._task.set_target(self._goal)
        self._configuration.update(self._spread(now))
        for _ in range(_STEPS):
            if np.linalg.norm(self._task.compute_error(self._configuration)[:3]) < _CLOSE_M:
                break
            try:
                velocity = self._pink.solve_ik(
                    self._configuration,
                    self._tasks,
                    1.0,
                    solver="daqp",
                    damping=_DAMPING,
                    limits=self._limits,
                    safety_break=False,
                )
            except self._pink.exceptions.PinkError:
                return np.full(len(self.joints), np.nan)
            self._configuration.integrate_inplace(velocity, 1.0)
        found: FloatArray = self._configuration.q[self._order]
        return found

    def hand_m(self, positions: FloatArray) -> FloatArray:
        """Return the robot's hand (3,), metres in its root frame, at joint positions (n,)."""
        self._configuration.update(self._spread(positions))
        return np.array(self._frame(self._hand).translation)

    def _spread(self, positions: FloatArray) -> FloatArray:
        q = np.zeros(len(self._order))
        q[self._order] = positions
        return q


def _length(model: Any, joints: tuple[str, ...], hand_link: str) -> float:
    """Return the length of the joint chain from the robot's shoulder to its hand, metres."""
    steps = [model.jointPlacements[model.getJointId(name)].translation for name in joints]
    steps.append(model.frames[model.getFrameId(hand_link)].placement.translation)
    return float(sum(np.linalg.norm(step) for step in steps))


def _model(pin: Any, urdf: str, joints: tuple[str, ...]) -> Any:
    """Return the dynamic model in which only ``joints`` move."""
    try:
        whole = pin.buildModelFromXML(urdf)
        fixed = [whole.getJointId(name) for name in whole.names[1:] if name not in joints]
        return pin.buildReducedModel(whole, fixed, pin.neutral(whole))
    except (RuntimeError, ValueError) as error:
        raise CardboxError(f"pinocchio cannot use the robot's URDF: {error}") from None


def _libraries() -> tuple[Any, Any]:
    try:
        import daqp  # noqa: F401
        import pink
        import pink.exceptions
        import pink.limits
        import pink.tasks
        import pinocchio
    except ImportError as error:
        raise CardboxError(
            f"inverse kinematics needs the libraries pin, pin-pink and daqp ({error}); install "
            "them with pip install '.[retarget]' in the checkout, or give a joint map (--map, "
            "joint_map_file), which needs none of them"
        ) from None
    return pinocchio, pink
