"""A person of boxes moves before a simulated camera, and the tracker follows."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from cardbox_tracker.vision.camera import Camera
from learning import recording
from learning.bodies.rigged import RiggedBody
from learning.motions.motion import Motion
from learning.motions.reference import reference_pose
from learning.motions.rotations import about_axis
from learning.recording import simulate
from learning.room import Viewpoint
from learning.samples import Samples
from learning.segments import SEGMENTS
from learning.silhouette_faults import Faults

FPS = 15.0
VIEWPOINT = Viewpoint(
    Camera(320, 240, 300.0, 300.0, 159.5, 119.5, pitch_rad=0.1), np.array([2.4, 0.05, 1.3])
)
LEFT_ARM = [SEGMENTS.index(f"left_{part}") for part in ("upper_arm", "forearm", "hand")]


def raising(images: int = 15) -> Motion:
    """Somebody whose left arm rises sideways, from 20 to 80 degrees."""
    turns, place = reference_pose("front")
    frames = np.tile(turns, (images, 1, 1, 1))
    for frame, angle in zip(frames, np.radians(np.linspace(0.0, 60.0, images)), strict=True):
        frame[LEFT_ARM] = about_axis(0, angle) @ frame[LEFT_ARM]
    places = np.tile(place, (images, 1)).astype(np.float32)
    return Motion("raising", "test", FPS, frames.astype(np.float32), places)


@pytest.fixture
def plain(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Without chance but for the tracker's: one camera, clean silhouettes and nothing else."""
    for name, value in {
        "RATES": (FPS,),
        "_STANDING_S": 0.4,
        "_WAY_S": 0.2,
        "_WITHOUT_DISTANCE": 0.0,
        **dict.fromkeys(("_IMAGES", "_DEPTH"), 0.0),
        **dict.fromkeys(("_TOLD_DISTANCE", "_TOLD_STATURE", "_TOLD_PITCH_RAD"), 0.0),
        "draw_viewpoint": lambda *_: VIEWPOINT,
        "draw_faults": lambda _: Faults(),
    }.items():
        monkeypatch.setattr(recording, name, value)
    return monkeypatch


def simulated(body: RiggedBody, seed: int = 0, **given: bool) -> Samples:
    found = simulate(body, raising(), np.random.default_rng(seed), **given)
    assert found is not None
    return found


@pytest.mark.usefixtures("plain")
def test_the_truth_is_the_bodys_and_the_results_are_near(boxes: RiggedBody) -> None:
    found = simulated(boxes, is_measured=False)
    # Standing for 6 images, 3 on the way, and 15 of the motion.
    numbers = np.rint((found.stamps_ns - recording.START_NS) * FPS / 1e9).astype(int)
    assert 20 <= len(numbers) <= 24 and numbers[-1] == 23
    motion = raising()
    for number, true_m in zip(numbers, found.true_m, strict=True):
        if number < 6:
            pose = reference_pose("front")
        elif number >= 9:
            pose = motion.turns[number - 9], motion.places[number - 9]
        else:
            continue
        expected = VIEWPOINT.optical(boxes.posed(*pose).keypoints)
        assert np.allclose(true_m, expected, atol=1e-5)
    assert found.torso_rad == pytest.approx(0.0, abs=1e-5)
    off_m = np.linalg.norm(found.found_m - found.true_m, axis=2)
    assert off_m.mean() < 0.15
    # Nothing corrects, but the joints' limits and the smoothing act.
    assert np.linalg.norm(found.result_m - found.found_m, axis=2).mean() < 0.05


@pytest.mark.usefixtures("plain")
def test_arrays_belong_together_and_the_origin_tells_the_sources(boxes: RiggedBody) -> None:
    found = simulated(boxes, is_measured=False)
    origin = found.origin
    assert (origin.family, origin.body) == ("test", "boxes")
    assert (origin.source, origin.motion, origin.fps) == ("test", "raising", FPS)
    assert not any((origin.is_measured, origin.has_images, origin.has_points, origin.has_depth))
    count = len(found.stamps_ns)
    for one in fields(Samples)[1:]:
        array = getattr(found, one.name)
        assert one.name == "pitch_rad" or len(array) == count, one.name
        assert np.isfinite(array).all(), one.name
    assert found.found_m.shape == found.result_m.shape == found.true_m.shape == (count, 6, 3)
    assert found.states.shape == found.stddevs.shape == (count, 14)
    assert found.pitch_rad == pytest.approx(0.1)


def test_a_measured_person_with_images_points_and_depth(
    plain: pytest.MonkeyPatch, boxes: RiggedBody
) -> None:
    for name in ("_IMAGES", "_DEPTH"):
        plain.setattr(recording, name, 1.0)
    origin = simulated(boxes, is_measured=True, points=1.0).origin
    assert all((origin.is_measured, origin.has_images, origin.has_points, origin.has_depth))


def test_the_same_seed_gives_the_same_samples(
    monkeypatch: pytest.MonkeyPatch, boxes: RiggedBody
) -> None:
    """With everything that is left to chance, at the lowest rate."""
    monkeypatch.setattr(recording, "RATES", (FPS,))
    monkeypatch.setattr(recording, "_STANDING_S", 0.3)
    one, other = (simulated(boxes, seed=4) for _ in "ab")
    assert one.origin == other.origin
    for name in ("features", "found_m", "evidence", "states", "true_m", "stamps_ns"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


@pytest.mark.usefixtures("plain")
def test_the_corrector_takes_part_if_asked_for(boxes: RiggedBody) -> None:
    found = simulated(boxes, is_measured=False, is_corrected=True)
    assert np.linalg.norm(found.result_m - found.found_m, axis=2).max() > 0.001


def test_nobody_who_is_seldom_seen(plain: pytest.MonkeyPatch, boxes: RiggedBody) -> None:
    plain.setattr(recording, "draw_faults", lambda _: Faults(missing=1.0))
    rng = np.random.default_rng(0)
    assert simulate(boxes, raising(), rng, is_measured=False) is None


@pytest.mark.parametrize("rpy", [(0.0, 0.0, 0.5), (0.2, 0.0, 0.0), (0.0, 0.3, 0.0), (0.1, 0.2, 1)])
def test_roll_pitch_and_yaw_of_a_turned_body(boxes: RiggedBody, rpy: tuple[float, ...]) -> None:
    roll, pitch, yaw = (about_axis(axis, angle) for axis, angle in enumerate(rpy))
    turns = np.tile(yaw @ pitch @ roll, (len(SEGMENTS), 1, 1))
    posed = boxes.posed(turns, np.array([0.2, 0.1, 1.0]))
    assert recording._torso_rad(boxes, posed) == pytest.approx(rpy, abs=1e-5)


def test_raised_shoulders_do_not_turn_the_torso(boxes: RiggedBody) -> None:
    posed = boxes.posed(*reference_pose("arms"))
    assert recording._torso_rad(boxes, posed) == pytest.approx(0.0, abs=1e-5)


def test_noise_of_depth_images_grows_with_the_square_of_the_depth() -> None:
    depth_m = np.full((100, 200), np.inf)
    depth_m[:, :60], depth_m[:, 60:120] = 1.0, 3.0
    rendering = recording.Rendering(depth_m, np.zeros((100, 200, 3), np.uint8))
    found = recording._depth_image(rendering, np.random.default_rng(0))
    assert found.dtype == np.float32 and (found[:, 120:] == 0.0).all()
    assert found[:, :60].mean() == pytest.approx(1.0, abs=1e-3)
    near, far = found[:, :60].std(), found[:, 60:120].std()
    assert near == pytest.approx(0.004, rel=0.1) and far == pytest.approx(9 * near, rel=0.1)
