"""Pixels of the working image go back to the camera's own image."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Calibration, unrectified

K = np.array([(500.0, 0.0, 320.0), (0.0, 510.0, 240.0), (0.0, 0.0, 1.0)])
SIZE = (320, 240)
LENSES = {
    "plumb_bob": [-0.2, 0.05, 0.001, 0.002, 0.0],
    "rational_polynomial": [0.1, 0.02, 0.001, 0.001, 0.0, 0.05, 0.01, 0.0],
    "equidistant": [0.02, -0.01, 0.003, -0.001],
}


@pytest.mark.parametrize("roll_rad", [0.0, 0.1])
@pytest.mark.parametrize("model", LENSES)
def test_it_is_the_inverse_of_rectifying(model: str, roll_rad: float) -> None:
    calibration = Calibration(640, 480, K, np.array(LENSES[model]), model, roll_rad=roll_rad)
    px = np.random.default_rng(0).uniform((0, 0), SIZE, (50, 2))
    back = unrectified(calibration, px, *SIZE)
    # The lens moves some pixels far, and the inverse of the lens is found by iteration.
    assert np.abs(back - 2.0 * px).max() > 5.0
    np.testing.assert_allclose(calibration.rectified(back, *SIZE), px, atol=0.01)


def test_without_distortion_only_the_size_changes() -> None:
    calibration = Calibration(640, 480, K, np.zeros(5))
    corners = np.array([(0.0, 0.0), (319.0, 239.0)])
    expected = [(0.5, 0.5), (638.5, 478.5)]
    np.testing.assert_allclose(unrectified(calibration, corners, *SIZE), expected, atol=1e-9)
