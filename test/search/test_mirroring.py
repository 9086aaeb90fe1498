"""States that look alike in the image."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_STATE, PITCH, ROLL, TORSO_X, TORSO_Y, YAW
from cardbox_tracker.search.arm_search import ARM_LIMITS
from cardbox_tracker.search.mirroring import turned_states

BODY = BodyModel.of()
SWAPPED = [3, 4, 5, 0, 1, 2]


@given(arrays(np.float64, N_STATE, elements=st.floats(-0.4, 0.4)), st.sampled_from([1.0, -1.0]))
def test_who_faces_the_other_way_has_the_joints_in_the_same_places(
    state: np.ndarray, way: float
) -> None:
    # Elbows bend forwards only, and what was forwards is backwards afterwards.
    state[[7, 11]] = 0.0
    state[[4, 8]] = np.abs(state[[4, 8]])
    (turned,) = turned_states(state[None], way * np.pi, ARM_LIMITS)
    assert turned[YAW] == state[YAW] + way * np.pi
    assert turned[[TORSO_X, TORSO_Y]].tolist() == state[[TORSO_X, TORSO_Y]].tolist()
    before, after = (pose(BODY, one).keypoints_m for one in (state, turned))
    np.testing.assert_allclose(after[SWAPPED], before, atol=1e-9)
    (back,) = turned_states(turned[None], -way * np.pi, ARM_LIMITS)
    np.testing.assert_allclose(back, state, atol=1e-9)


def test_a_bow_to_the_camera_is_a_lean_away_by_hand() -> None:
    state = np.zeros(N_STATE)
    state[PITCH], state[ROLL], state[4] = 0.3, 0.1, 0.5
    (turned,) = turned_states(state[None], np.pi, ARM_LIMITS)
    expected = np.zeros(N_STATE)
    # The left arm that was raised is the right one.
    expected[PITCH], expected[ROLL], expected[YAW], expected[8] = -0.3, -0.1, np.pi, 0.5
    np.testing.assert_allclose(turned, expected, atol=1e-12)
