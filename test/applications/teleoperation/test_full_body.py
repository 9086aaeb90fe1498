"""The 24 joints are where hand-computed postures have them, and say what is measured."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from cardbox_tracker.applications.teleoperation.full_body import NAMES, FullBodies, FullBody
from cardbox_tracker.person.model import body_from_proportions
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.proportions import ANKLE_SHARE, SHANK_SHARE, THIGH_SHARE, stature_of
from cardbox_tracker.person.skeleton import HAND_NAMES, JOINT_NAMES, LEG_NAMES, NECK_NAMES

BODY = body_from_proportions(1.75, 2.0)
PARTS = body_parts(BODY.sizes)
STATURE_M = stature_of(PARTS)
SURE = dict.fromkeys(JOINT_NAMES, 0.1)
LEGS = dict.fromkeys(LEG_NAMES, 0.1)


def updated(
    bodies: FullBodies,
    time_s: float = 0.0,
    state: str = "tracking",
    stddev: dict[str, float] = SURE,
    keypoints: dict[str, tuple[str, float]] | None = None,
    **angles_deg: float,
) -> FullBody:
    values = dict.fromkeys((*JOINT_NAMES, *stddev), 0.0)
    values |= {name: np.radians(value) for name, value in angles_deg.items()}
    stamp_ns = round(time_s * 1e9)
    found = bodies.update(stamp_ns, state, BODY, values, stddev, keypoints or {})
    assert found is not None
    return found


def at(body: FullBody, name: str) -> np.ndarray:
    return body.points_m[NAMES.index(name)]


def valid(body: FullBody) -> set[str]:
    return {name for name, is_valid in zip(NAMES, body.valid, strict=True) if is_valid}


def test_a_hanging_body_stands() -> None:
    body = updated(FullBodies(), torso_yaw=30)
    assert at(body, "pelvis") == pytest.approx(0.0)
    leg_m = (THIGH_SHARE + SHANK_SHARE) * STATURE_M
    assert at(body, "left_hip")[2] - at(body, "left_ankle")[2] == pytest.approx(leg_m)
    assert at(body, "left_ankle")[2] - at(body, "left_foot")[2] == pytest.approx(
        ANKLE_SHARE * STATURE_M
    )
    assert at(body, "left_foot")[0] > 0.05
    assert at(body, "left_shoulder")[1] == pytest.approx(PARTS.shoulder_aside_m)
    assert at(body, "right_shoulder")[1] == pytest.approx(-PARTS.shoulder_aside_m)
    down = at(body, "left_wrist") - at(body, "left_elbow")
    assert down == pytest.approx([0.0, 0.0, 0.73 * PARTS.forearm.bottom_m])
    assert body.yaw_rad == pytest.approx(np.radians(30))
    assert body.turns == pytest.approx(np.tile([1.0, 0.0, 0.0, 0.0], (24, 1)))
    # Nobody has seen the legs or the face.
    hidden = {f"{side}_{part}" for side in ("left", "right") for part in ("knee", "ankle", "foot")}
    assert valid(body) == set(NAMES) - hidden - {"head"}


def test_the_pelvis_stays_upright_and_the_arm_points() -> None:
    body = updated(FullBodies(), torso_pitch=90, right_shoulder_flexion=90)
    assert body.turns[0] == pytest.approx([1.0, 0.0, 0.0, 0.0])
    assert at(body, "neck")[0] == pytest.approx(PARTS.torso.top_m)
    # A torso that lies ahead turns an arm ahead downwards.
    arm = at(body, "right_elbow") - at(body, "right_shoulder")
    assert arm == pytest.approx([0.0, 0.0, PARTS.upper_arm.bottom_m])
    half = np.sqrt(0.5)
    assert body.turns[NAMES.index("spine3")] == pytest.approx([half, 0.0, half, 0.0])


def test_legs_that_are_seen_bend_and_then_stand_up_slowly() -> None:
    bodies = FullBodies()
    given_deg = {"left_hip_flexion": 90, "left_knee_flexion": 90}
    body = updated(bodies, 0.0, stddev=SURE | LEGS, **given_deg)
    knee, ankle = (at(body, f"left_{name}") for name in ("knee", "ankle"))
    assert knee - at(body, "left_hip") == pytest.approx([THIGH_SHARE * STATURE_M, 0.0, 0.0])
    assert ankle - knee == pytest.approx([0.0, 0.0, -SHANK_SHARE * STATURE_M])
    assert {"left_knee", "right_foot"} <= valid(body)
    body = updated(bodies, 0.5)
    angle = np.radians(90) - 0.5
    thigh = at(body, "left_knee") - at(body, "left_hip")
    assert thigh == pytest.approx(
        THIGH_SHARE * STATURE_M * np.array([np.sin(angle), 0.0, -np.cos(angle)])
    )
    assert "left_knee" not in valid(body)


def test_an_arm_that_is_not_tracked_keeps_its_angles() -> None:
    bodies = FullBodies()
    updated(bodies, left_shoulder_flexion=90)
    unsure = {"left_hand": ("uncertain", 0.6)}
    body = updated(bodies, 0.1, keypoints=unsure, left_elbow_flexion=90)
    assert not {"left_wrist", "left_hand"} & valid(body)
    assert {"left_elbow", "right_hand"} <= valid(body)
    # The upper arm hangs again, and the forearm stays in line with it.
    assert at(body, "left_hand") - at(body, "left_elbow") == pytest.approx(
        [0.0, 0.0, PARTS.forearm.bottom_m]
    )


def test_nothing_is_valid_without_a_person() -> None:
    bodies = FullBodies()
    assert bodies.update(0, "no_person", None, {}, {}, {}) is None
    before = updated(bodies, 0.1)
    lost = updated(bodies, 0.2, state="lost")
    assert not lost.valid.any() and lost.stamp_ns == 200_000_000
    assert (lost.points_m == before.points_m).all()
    assert not updated(bodies, 0.3, state="uncertain").valid.any()


def test_a_measured_hand_rolls_the_wrist() -> None:
    """A forearm ahead whose palm faces down is rolled by a quarter: inwards for either hand."""
    for side, sign in (("left", 1.0), ("right", -1.0)):
        names = HAND_NAMES[:3] if side == "left" else HAND_NAMES[3:]
        more = SURE | dict.fromkeys(names, 0.1)
        angles = {f"{side}_elbow_flexion": 90, names[0]: 90, names[1]: 30, names[2]: 10}
        body = updated(FullBodies(), stddev=more, **angles)
        wrist = body.wrists_rad[0 if side == "left" else 1]
        assert np.degrees(wrist) == pytest.approx([sign * 90, 10, -sign * 30], abs=1e-6), side
        bent = at(body, f"{side}_hand") - at(body, f"{side}_wrist")
        assert bent[2] < -0.03


def test_between_two_images_the_shorter_way_is_taken() -> None:
    bodies = FullBodies()
    before = updated(bodies, 0.0, torso_yaw=170)
    after = updated(bodies, 0.1, state="tracking", torso_yaw=-170)
    middle = before.until(after, 50_000_000)
    assert np.degrees(middle.yaw_rad) == pytest.approx(180)
    assert np.linalg.norm(middle.turns, axis=1) == pytest.approx(1.0)
    assert (before.until(after, 10**12).points_m == after.points_m).all()
    assert not before.until(after.invalid(10**8), 5 * 10**7).valid.any()


@hypothesis_settings(max_examples=30, deadline=None)
@given(
    st.lists(st.tuples(st.sampled_from(["tracking", "uncertain", "lost"]), st.data()), max_size=4)
)
def test_no_input_makes_a_value_that_is_not_finite(images: list[tuple[str, st.DataObject]]) -> None:
    bodies = FullBodies()
    number = st.one_of(st.floats(-4, 4), st.sampled_from([np.nan, np.inf]))
    names = (*JOINT_NAMES, *NECK_NAMES, *LEG_NAMES, *HAND_NAMES)
    for count, (state, data) in enumerate(images):
        values = {name: data.draw(number) for name in names}
        stddev = {name: data.draw(number) for name in data.draw(st.sets(st.sampled_from(names)))}
        body = bodies.update(count * 10**8, state, BODY, values, SURE | stddev, {})
        if body is not None:
            for part in (body.points_m, body.turns, body.wrists_rad, body.yaw_rad):
                assert np.isfinite(part).all()
