"""Timelines of synthetic sessions."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from cardbox_tracker.applications.simulation.motions import MOTIONS, smooth, timeline
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.cardbox import LEFT_ARM_PATCHES, RIGHT_ARM_PATCHES, cardbox_patches
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import JOINT_LIMITS, reference_posture

BODY = BodyModel()
STEP_S = 1 / 60


def postures(motion: str, side_turn: str = "left") -> NDArray[np.float64]:
    """Postures (n, 12) of the whole session, ``STEP_S`` apart."""
    return np.array(
        [
            segment.pose(t)
            for segment in timeline(motion, side_turn)
            if segment.pose is not None
            for t in np.arange(0.0, segment.end_s - segment.start_s - 1e-9, STEP_S)
        ]
    )


@pytest.mark.parametrize("motion", ["wave", "bend", "bow", "all"])
def test_a_session_is_told_without_gaps(motion: str) -> None:
    segments = timeline(motion)
    assert segments[0].start_s == 0.0
    assert all(a.end_s == b.start_s for a, b in itertools.pairwise(segments))
    names = [segment.name for segment in segments]
    assert names[0] == "empty"
    assert segments[0].pose is None
    order = [names.index(name) for name in ("front", "side", "arms")]
    assert order == sorted(order)
    assert [n for n in names if n in MOTIONS] == (list(MOTIONS) if motion == "all" else [motion])


@pytest.mark.parametrize("side_turn", ["left", "right"])
@pytest.mark.parametrize("name", ["front", "side", "arms"])
def test_a_reference_is_held_for_two_seconds(name: str, side_turn: str) -> None:
    (segment,) = (s for s in timeline("wave", side_turn) if s.name == name)
    assert segment.end_s - segment.start_s == 2.0
    assert segment.pose is not None
    for t in (0.0, 0.7, 2.0):
        np.testing.assert_allclose(segment.pose(t), reference_posture(name, side_turn))


@pytest.mark.parametrize("motion", ["wave", "bend", "bow"])
def test_a_motion_stays_within_the_joint_limits(motion: str) -> None:
    """The tracker looks for nothing beyond them; only the side reference turns further."""
    duration_s, posture_at = MOTIONS[motion]
    path = np.array([posture_at(t) for t in np.arange(0.0, duration_s, STEP_S)])
    assert np.all((path >= JOINT_LIMITS[:, 0]) & (path <= JOINT_LIMITS[:, 1]))


@pytest.mark.parametrize("motion", ["wave", "bend", "bow"])
def test_joints_move_smoothly(motion: str) -> None:
    path = postures(motion)
    speed = np.diff(path, axis=0) / STEP_S
    # Nothing is faster than a brisk turn of 90 degrees in a second, and speed has no jumps.
    assert np.abs(speed).max() < 3.5
    assert np.abs(np.diff(speed, axis=0)).max() / STEP_S < 15.0


@pytest.mark.parametrize("motion", ["wave", "bend", "bow"])
def test_arms_stay_beside_the_torso(motion: str) -> None:
    """No hand or elbow comes before the chest, where a silhouette would not show it."""
    _, posture_at = MOTIONS[motion]
    path = np.array([posture_at(t) for t in np.arange(0.0, MOTIONS[motion][0], 0.1)])
    patches = cardbox_patches(BODY, path)
    sagittal_half = BODY.size("torso_top_width") / 2
    for patch_range, side in ((LEFT_ARM_PATCHES, 1.0), (RIGHT_ARM_PATCHES, -1.0)):
        middle = patches[:, patch_range].mean(axis=(1, 2))
        hip = np.array([-BODY.placement.distance_m, 0.0, BODY.placement.hip_height_m])
        # In the torso's frame the middle of the arm is further aside than the torso is wide.
        rotation = pose(BODY.rigid, path).torso_rotation
        local = np.einsum("nji,nj->ni", rotation, middle - hip)
        assert np.all(side * local[:, 1] > sagittal_half)


def test_what_each_motion_is() -> None:
    wave, bend, bow = (
        np.degrees([MOTIONS[name][1](t) for t in np.arange(0.0, MOTIONS[name][0], 0.05)])
        for name in ("wave", "bend", "bow")
    )
    assert wave[:, [4, 8]].max(axis=0).min() > 70  # both arms up
    assert np.ptp(wave[80:120, 6]) > 30  # forearm to and fro
    assert bend[:, 1].max() > 15
    assert bend[:, 1].min() < -15
    assert 30 <= bow[:, 2].max() <= 40
    for path in (wave, bend, bow):
        np.testing.assert_allclose(path[0], np.degrees(reference_posture("front")), atol=1e-9)


def test_a_smooth_step_starts_and_ends_at_rest() -> None:
    t = np.linspace(-0.5, 1.5, 401)
    step = np.array([smooth(x) for x in t])
    assert (step[0], step[-1], smooth(0.5)) == (0.0, 1.0, 0.5)
    assert np.all(np.diff(step) >= 0)
    assert abs(smooth(0.01)) < 2e-5


def test_an_unknown_motion_is_refused_with_the_known_ones() -> None:
    with pytest.raises(CardboxError, match=r"'dance'.*wave, bend, bow or all"):
        timeline("dance")
