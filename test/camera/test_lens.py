"""Any name and number of distortion coefficients that drivers send."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.common.errors import CameraError

K = np.array([(165.0, 0.0, 79.5), (0.0, 165.0, 59.5), (0.0, 0.0, 1.0)])
# k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tx ty
LENS = (-0.03, 0.035, -1e-3, 2e-3, -0.012, 0.02, 0.01, 0.005, 1e-3, 2e-3, 1e-3, 1e-3, 0.01, 0.02)
PX = np.array([(3.0, 5.0), (80.0, 60.0), (150.0, 17.0), (12.0, 110.0)])


def calibration(model: str, distortion: list[float]) -> Calibration:
    return Calibration(160, 120, K, np.array(distortion), model)


@given(
    model=st.sampled_from(["plumb_bob", "rational_polynomial", "radtan", "", "Brown-Conrady"]),
    used=st.integers(0, 14),
    zeros=st.integers(0, 6),
)
def test_opencvs_coefficients_may_be_as_many_as_a_driver_likes(
    model: str, used: int, zeros: int
) -> None:
    """Those that are left out or zero at the end make no difference."""
    given_lens = [*LENS[:used], *[0.0] * zeros]
    whole = np.array([*LENS[:used], *[0.0] * (14 - used)])
    expected = cv2.undistortPoints(PX[:, None], K, whole, P=K).reshape(-1, 2)
    bent = calibration(model, given_lens)
    if used == len(given_lens) == 3:
        with pytest.raises(CameraError, match="3 coefficients; expected 4 or 5"):
            bent.rectifier(160, 120)
        return
    np.testing.assert_allclose(bent.rectified(PX, 160, 120), expected, atol=1e-6)
    assert (bent.rectifier(160, 120) is None) == (used == 0)
    assert len(bent.distortion) in (5, 8, 12, 14)
    assert (bent.distortion_model == "plumb_bob") == (used <= 5)


@given(
    model=st.sampled_from(["equidistant", "fisheye", "Kannala_Brandt4"]),
    used=st.integers(0, 4),
    zeros=st.integers(0, 8),
)
def test_a_fisheye_needs_four(model: str, used: int, zeros: int) -> None:
    whole = np.array([*(0.01, 0.002, -0.001, 0.001)[:used], *[0.0] * (4 - used)])
    bent = calibration(model, [*whole[:used], *[0.0] * zeros])
    assert bent.distortion_model == "equidistant"
    np.testing.assert_array_equal(bent.distortion, whole)
    if used:
        expected = cv2.fisheye.undistortPoints(PX[:, None], K, whole, P=K).reshape(-1, 2)
        np.testing.assert_allclose(bent.rectified(PX, 160, 120), expected, atol=1e-6)


@pytest.mark.parametrize(
    ("model", "count", "expected"),
    [("plumb_bob", 15, "4 or 5"), ("rational_polynomial", 20, "8, 12"), ("fisheye", 5, "4")],
)
def test_more_coefficients_than_a_model_has_are_refused(
    model: str, count: int, expected: str
) -> None:
    with pytest.raises(CameraError, match=f"{count} coefficients; expected .*{expected}"):
        calibration(model, [0.01] * count).rectifier(160, 120)


@pytest.mark.parametrize("model", ["fov", "omnidirectional"])
def test_an_unknown_model_is_named_unless_it_does_nothing(model: str) -> None:
    assert calibration(model, [0.0] * 4).rectifier(160, 120) is None
    with pytest.raises(CameraError, match=f"'{model}' is unknown"):
        calibration(model, [0.1] * 4).rectifier(160, 120)


@pytest.mark.parametrize(("given_id", "frame_id"), [("/left", "left"), ("left", "left")])
def test_a_frame_has_no_leading_slash(given_id: str, frame_id: str) -> None:
    assert Calibration(160, 120, K, np.zeros(5), frame_id=given_id).frame_id == frame_id
    assert Calibration(160, 120, K, np.zeros(5), frame_id="").frame_id == "camera_optical_frame"
