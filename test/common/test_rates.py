"""Velocities and accelerations of functions of moving values."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.common.rates import carried


def polar(values: np.ndarray) -> np.ndarray:
    """Return x and y of radius and angle, and the angle, which jumps at half a turn."""
    radius, angle = values.T
    turned = (angle + np.pi) % (2.0 * np.pi) - np.pi
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), turned], axis=1)


def test_a_point_on_a_circle_is_accelerated_to_its_middle() -> None:
    # 3 rad/s at a radius of 2 m: 6 m/s along, 18 m/s² inwards.
    values = np.array([[2.0, 0.0], [2.0, np.pi / 2]])
    rates = np.zeros((4, 2, 2))
    rates[0, :, 1] = 3.0
    velocity, _, acceleration, _ = carried(polar, values, rates)
    np.testing.assert_allclose(velocity[:, :2], [[0.0, 6.0], [-6.0, 0.0]], atol=2e-3)
    np.testing.assert_allclose(acceleration[:, :2], [[-18.0, 0.0], [0.0, -18.0]], atol=2e-3)


def test_deviations_are_propagated_by_the_slopes() -> None:
    # dy is cos(angle) of a deviation along the radius, and the radius of one of the angle.
    rates = np.zeros((4, 1, 2))
    rates[1, 0], rates[3, 0] = (0.3, 0.2), (3.0, 2.0)
    _, velocity, _, acceleration = carried(polar, np.array([[2.0, 0.0]]), rates)
    np.testing.assert_allclose(velocity, [[0.3, 0.4, 0.2]], rtol=1e-3)
    np.testing.assert_allclose(acceleration, [[3.0, 4.0, 2.0]], rtol=1e-3)


def test_an_angle_that_jumps_by_a_turn_goes_on() -> None:
    rates = np.zeros((4, 1, 2))
    rates[0, 0, 1] = 5.0
    are_angles = np.array([False, False, True])
    found = carried(polar, np.array([[1.0, np.pi - 1e-3]]), rates, are_angles)
    np.testing.assert_allclose(found[[0, 2], 0, 2], [5.0, 0.0], atol=1e-6)
