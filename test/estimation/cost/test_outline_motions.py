"""Rigid motions of the segments, and the normal equations of points that move with them."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import N_STATE, reference_posture
from cardbox_tracker.estimation.cost.outline_distances import HALF_PX
from cardbox_tracker.estimation.cost.outline_fit_kernels import INFORMATION, add_equations
from cardbox_tracker.estimation.cost.outline_points import POINTS
from cardbox_tracker.estimation.cost.view import OtherCamera, View
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.extrinsics import Extrinsics

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5).with_pitch(0.15)
BODY = BodyModel.of(distance_m=2.3, hip_height_m=-0.45, camera_pitch_rad=0.15)
COST = WholeBodyCost(BODY, CAMERA, WholeBodyCostConfig())
ARMS = np.append(reference_posture("arms"), [0.0, 0.0])
# Values that move shoulder, elbow and hand, in the order of a state without the torso's.
_MOVES = {0: (0, 1, 2), 1: (0, 1, 2), 2: (1, 2), 3: (1, 2)}


def difference(function, state: np.ndarray, value: int, step: float = 1e-5) -> np.ndarray:
    ends = []
    for sign in (1.0, -1.0):
        moved = state.copy()
        moved[value] += sign * step
        ends.append(function(moved))
    return (ends[0] - ends[1]) / (2.0 * step)


def aside() -> View:
    c, s = np.cos(0.9), np.sin(0.9)
    turn = np.array([(c, 0.0, s), (0.0, 1.0, 0.0), (-s, 0.0, c)])
    return View.of(BODY, CAMERA, OtherCamera(CAMERA, Extrinsics(turn, [-1.8, 0.1, 1.0])))


@pytest.mark.parametrize("slope", [(0.06, 0.0), (0.0, 0.06), (0.03, -0.05)])
@pytest.mark.parametrize("camera", ["first", "aside"])
def test_the_equations_are_those_of_numerical_derivatives(
    slope: tuple[float, float], camera: str
) -> None:
    """In a linear field, where the interpolation is exact."""
    turned, moved, cost, pinhole = np.eye(N_STATE), np.zeros(N_STATE), COST, CAMERA
    if camera == "aside":
        view = aside()
        turned, moved, pinhole = view.turned, view.moved, view.camera
        cost = WholeBodyCost(view.body, pinhole, WholeBodyCostConfig())
    v, u = np.indices((240, 320))
    constant = -slope[0] * 160 - slope[1] * 120
    field = np.asarray(slope[0] * u + slope[1] * v + constant, np.float32)
    lens = np.array([pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy])
    seen = turned, moved, lens, field, np.array([3.0, 316.0, 3.0, 200.0])
    state = ARMS.copy()
    state[:4] = 0.02, 0.1, 0.2, 0.3
    matrix, right, costs = np.zeros((N_STATE, N_STATE)), np.zeros(N_STATE), np.zeros(1)
    edges, points = np.empty((POINTS, 2), np.int64), np.empty((POINTS, 2))
    n = add_equations(state, seen, cost.body, (matrix, right, costs), (edges, points))
    assert n > 60
    (patch, corner), (share, length) = edges[:n].T, points[:n].T

    def distances(at: np.ndarray) -> np.ndarray:
        corners = pinhole.project(cost.corners(at @ turned + moved))
        begin, end = corners[patch, corner], corners[patch, (corner + 1) % 4]
        return (begin + share[:, None] * (end - begin)) @ slope + constant

    now = distances(state)
    jacobian = np.array([difference(distances, state, value) for value in range(N_STATE)])
    outlying = 1.0 + (now / HALF_PX) ** 2
    weights = INFORMATION * length / outlying**2
    expected = np.tril((weights * jacobian) @ jacobian.T)
    # The outline of a round part differs from a rigid motion along itself.
    assert np.linalg.norm(np.tril(matrix) - expected) < 0.02 * np.linalg.norm(expected)
    towards = (weights * jacobian) @ now
    assert np.linalg.norm(right - towards) < 0.03 * np.linalg.norm(towards)
    assert costs[0] == pytest.approx((INFORMATION * length * now**2 / outlying).sum(), rel=1e-4)
