"""One simulated recording: a random person moves before a random camera and is tracked."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.proportions import STATURE_LIMITS_M, body_from_proportions
from cardbox_tracker.body.skeleton import KEYPOINT_NAMES
from cardbox_tracker.detection.image_points import ImagePoints
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation.filtering.whole_body import WholeBodyFilter
from cardbox_tracker.estimation.initialization.config import InitializationConfig
from cardbox_tracker.estimation.initialization.measure import initialize_body
from cardbox_tracker.estimation.observation import Observation
from cardbox_tracker.estimation.tracker import Tracker
from learning.bodies.rigged import INDEX, Posed, RiggedBody
from learning.motions.motion import Motion
from learning.motions.reference import Pose, poses, reference_pose, way
from learning.recorder import Recorder, recording_config
from learning.rendering import Rendering, render
from learning.room import Room, Viewpoint, draw_viewpoint
from learning.samples import Image, Origin, Samples
from learning.silhouette_faults import Degrader, Faults, draw_faults
from learning.simulated_points import SimulatedDetector

FloatArray = NDArray[np.float64]

START_NS = 1_700_000_000_000_000_000
RATES = (15.0, 15.0, 20.0, 30.0, 30.0, 60.0)
"""Images per second, one of them for each recording."""

# Shares of the recordings with images and with depth images.
_IMAGES, _DEPTH = 0.7, 0.06
POINTS = 0.25
"""Share of the measured people with points of a detector."""
# Deviation of the logarithms of distance and stature as people state them, and of the pitch, rad.
_TOLD_DISTANCE, _TOLD_STATURE, _TOLD_PITCH_RAD = 0.04, 0.015, 0.01
# Share of the people whose distance nobody states.
_WITHOUT_DISTANCE = 0.2
# Images of the standing person before the motion, s, and of the way to its first pose.
_STANDING_S, _WAY_S = 1.0, 1.0
# Images of the references 'front' and 'arms' from which the colours are learned.
_REFERENCE_IMAGES = 5
_DEPTH_NOISE = 0.004


@dataclass(frozen=True)
class Scene:
    """Person, motion and camera of a recording."""

    body: RiggedBody
    motion: Motion
    viewpoint: Viewpoint
    room: Room

    def rendered(self, posed: Posed) -> Rendering:
        """Return the person's rendering."""
        optical_m = self.viewpoint.optical(posed.vertices)
        camera = self.viewpoint.camera
        return render(optical_m, self.body.faces, self.body.colours, camera, self.room.light)


def simulate(
    body: RiggedBody,
    motion: Motion,
    rng: np.random.Generator,
    is_measured: bool = True,
    is_corrected: bool = False,
    points: float = POINTS,
) -> Samples | None:
    """Render and track a motion; None if the person was seldom tracked.

    Args:
        body: the person.
        motion: what the person does.
        rng: source of the camera, the room, the faults and the way of tracking.
        is_measured: whether the person takes the reference postures first, if they are in sight.
        is_corrected: whether the package's corrector takes part.
        points: probability that measured people have points.
    """
    fps = float(rng.choice(RATES))
    viewpoint = draw_viewpoint(rng, body.stature_m)
    scene = Scene(body, motion.resampled(fps), viewpoint, Room(viewpoint.camera, rng))
    has_images, has_points, has_depth = rng.random(3) < (_IMAGES, points, _DEPTH)
    faults = draw_faults(rng)
    person = _measured(scene, faults, rng, has_images) if is_measured else None
    is_measured = person is not None
    person = person or _guessed(scene, rng)
    # With points, the learned correction serves measured people alone.
    has_points = has_points and is_measured
    config = recording_config(bool(has_depth), is_corrected)
    tracker = Tracker(person, viewpoint.camera, config, rng.spawn(1)[0])
    detector = SimulatedDetector(viewpoint.camera, fps, rng) if has_points else None
    degrade = Degrader(faults, rng, fps)
    images: list[Image] = []
    count = 0
    for number, pose in enumerate(_poses(scene.motion, fps)):
        posed = body.posed(*pose)
        count += 1
        stamp_ns = START_NS + round(number * 1e9 / fps)
        rendering = scene.rendered(posed)
        observation = Observation(
            degrade(rendering.silhouette),
            scene.room.image(rendering) if has_images else None,
            _depth_image(rendering, rng) if has_depth else None,
            stamp_ns,
            simulated_points(viewpoint, posed, pose[0], rendering, detector) if detector else None,
        )
        tracker.track(observation)
        # The filter changes when a size of an unmeasured person is found.
        assert isinstance(tracker.filter, WholeBodyFilter)
        recorder = tracker.filter.refine.corrector
        assert isinstance(recorder, Recorder)
        seen = recorder.take()
        if seen is not None:
            true_m = viewpoint.optical(posed.keypoints)
            images.append(Image(seen, true_m, _torso_rad(body, posed), stamp_ns))
    if len(images) < count // 2:
        return None
    origin = Origin(
        *(body.family, body.name, motion.source, motion.name, is_measured),
        *(bool(has_images), bool(has_points), bool(has_depth), fps),
    )
    return Samples.of(origin, images, viewpoint.camera.pitch_rad)


def _poses(motion: Motion, fps: float) -> Iterator[Pose]:
    """Yield the standing person, the way to the first pose of the motion, and the motion."""
    front, first = reference_pose("front"), next(poses(motion))
    yield from [front] * round(_STANDING_S * fps)
    yield from way(front, first, round(_WAY_S * fps))
    yield from poses(motion)


def _measured(
    scene: Scene, faults: Faults, rng: np.random.Generator, has_images: bool
) -> BodyModel | None:
    """Return the person as measured in the reference postures; None if that failed."""
    # People measure themselves in a good picture, so a part of the faults is missing.
    degrade = Degrader(replace(faults, missing=0.0, specks=0.0, chair=0.0), rng)
    camera = scene.viewpoint.camera
    silhouettes, images = {}, {}
    for name in ("front", "side", "arms"):
        shown = [
            scene.rendered(scene.body.posed(*reference_pose(name, rng)))
            for _ in range(_REFERENCE_IMAGES if name != "side" else 1)
        ]
        silhouette = degrade(shown[0].silhouette)
        assert silhouette is not None
        silhouettes[name] = silhouette
        if name != "side":
            images[name] = [scene.room.image(one) for one in shown]
    config = InitializationConfig(
        distance_m=float(scene.viewpoint.place_m[0] * np.exp(rng.normal(0.0, _TOLD_DISTANCE))),
        camera_pitch_rad=camera.pitch_rad + float(rng.normal(0.0, _TOLD_PITCH_RAD)),
        check_postures=False,
        seed=int(rng.integers(1 << 30)),
    )
    try:
        return initialize_body(
            silhouettes, camera, config, images=images if has_images else None
        ).body
    except CardboxError:
        return None


def _guessed(scene: Scene, rng: np.random.Generator) -> BodyModel:
    """Return a person from stature and distance as people state them."""
    told = np.exp(rng.normal(0.0, (_TOLD_STATURE, _TOLD_DISTANCE)))
    stature_m = float(np.clip(scene.body.stature_m * told[0], *STATURE_LIMITS_M))
    distance_m = float(scene.viewpoint.place_m[0] * told[1])
    return body_from_proportions(
        stature_m,
        None if rng.random() < _WITHOUT_DISTANCE else distance_m,
        camera_pitch_rad=scene.viewpoint.camera.pitch_rad + float(rng.normal(0.0, _TOLD_PITCH_RAD)),
    )


def _depth_image(rendering: Rendering, rng: np.random.Generator) -> NDArray[np.float32]:
    """Return a depth image with noise that grows with the square of the depth."""
    depth_m = np.where(rendering.silhouette, rendering.depth_m, 0.0)
    noise = rng.standard_normal(depth_m.shape, dtype=np.float32) * _DEPTH_NOISE
    return np.asarray(depth_m + noise * depth_m * depth_m, np.float32)


def simulated_points(
    viewpoint: Viewpoint,
    posed: Posed,
    turns: FloatArray,
    rendering: Rendering,
    detector: SimulatedDetector,
) -> ImagePoints:
    """Return the points that a detector finds in an image.

    Args:
        viewpoint: of the camera.
        posed: the person in the world.
        turns: rotations of the person's segments in the world, (n, 3, 3).
        rendering: the person's image.
        detector: of the recording.
    """
    optical = viewpoint.optical
    joints_m = dict(zip(KEYPOINT_NAMES, optical(posed.keypoints), strict=True))
    joints_m |= {"head": optical(posed.head), "hips": optical(posed.hips)}
    columns = {"head": 1, "face": 0, "hips": 1, "left_hand": 0, "right_hand": 0}
    axes = {
        name: viewpoint.camera.reference_to_optical(
            turns[INDEX["head" if name == "face" else name]][:, column]
        )
        for name, column in columns.items()
    }
    return detector(joints_m, axes, rendering.depth_m)


def _torso_rad(body: RiggedBody, posed: Posed) -> FloatArray:
    """Return roll, pitch and yaw (3,) of the torso; zero in the T-pose."""
    turn = _trunk_axes(posed) @ _trunk_axes(body.in_t_pose()).T
    pitch = -np.arcsin(np.clip(turn[2, 0], -1.0, 1.0))
    return np.array([np.arctan2(turn[2, 1], turn[2, 2]), pitch, np.arctan2(turn[1, 0], turn[0, 0])])


def _trunk_axes(posed: Posed) -> FloatArray:
    """Return the axes (3, 3) of a trunk as columns: forward, left, up along the spine."""
    up = posed.neck - posed.hips
    up = up / np.linalg.norm(up)
    left = posed.keypoints[0] - posed.keypoints[3]
    left = left - (left @ up) * up
    left = left / np.linalg.norm(left)
    return np.asarray(np.stack([np.cross(left, up), left, up], axis=1), np.float64)
