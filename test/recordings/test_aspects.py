"""Images of any aspect ratio give the same numbers as a film, as a bag, and through nodes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from cardbox_tracker.applications.simulation.renderer import Renderer
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.view import OtherCamera, View
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel, body_from_proportions
from cardbox_tracker.person.posture import POSTURE, reference_posture
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.recording import FrameSet, RecordingRequest
from cardbox_tracker.recordings.silhouettes import TimeSpan
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.tracking.session import Session

SIZES = {"4:3": (640, 480), "16:9": (640, 360), "1:1": (480, 480), "upright": (360, 640)}
WORKING = {"4:3": (320, 240), "16:9": (368, 208), "1:1": (280, 280), "upright": (208, 370)}
FOCAL_PX, EMPTY, SHOWN = 420.0, 6, 6
BODY = body_from_proportions(1.75, 4.2, hip_height_m=0.0).with_values(unknown=())
# A camera that is 1.5 m to the right, and looks at the person.
TURN = cv2.Rodrigues(np.array([0.0, np.arctan2(1.5, 4.2), 0.0]))[0]
ASIDE = Extrinsics(TURN, -TURN @ (1.5, 0.0, 0.0))
GIVEN = TimeSpan(0.0, EMPTY - 0.5)


def camera_of(aspect: str) -> Camera:
    width, height = SIZES[aspect]
    return Camera(width, height, FOCAL_PX, FOCAL_PX, (width - 1) / 2, (height - 1) / 2)


def posture_of(image: int) -> FloatArray:
    """Return the posture in an image: the left arm rises."""
    posture = reference_posture("front")
    posture[4] += 0.1 * image
    return posture


def images(camera: Camera, body: BodyModel, postures: list[FloatArray]) -> list[Any]:
    """Return images of the empty scene, then of a whole person."""
    renderer = Renderer(camera, np.random.default_rng(0))
    empty = [renderer.image()[0] for _ in range(EMPTY)]
    return empty + [renderer.image(body, posture)[0] for posture in postures]


def bag(path: Path, cameras: dict[str, tuple[Camera, list[Any]]]) -> Path:
    with BagWriter(path) as writer:
        for number in range(EMPTY + SHOWN):
            for name, (camera, shown) in cameras.items():
                below, at_ns = f"/{name}".rstrip("/"), (1 + number) * 10**9
                frame = f"{name}_eye"
                data = cv2.imencode(".png", shown[number])[1].tobytes()
                writer.write_compressed(f"{below}/image_raw/compressed", at_ns, frame, data)
                writer.write_camera_info(f"{below}/camera_info", at_ns, frame, camera)
    return path


def film(path: Path, shown: list[Any]) -> Path:
    path.mkdir()
    for number, image in enumerate(shown):
        cv2.imwrite(str(path / f"{number:03}.png"), image)
    return path


def calibration(path: Path, camera: Camera) -> Path:
    k = [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
    content = {
        "image_width": camera.width,
        "image_height": camera.height,
        "camera_matrix": {"rows": 3, "cols": 3, "data": k},
        "distortion_model": "plumb_bob",
        "distortion_coefficients": {"rows": 1, "cols": 5, "data": [0.0] * 5},
    }
    path.write_text(yaml.safe_dump(content))
    return path


def tracked(request: RecordingRequest) -> tuple[list[FrameSet], list[FloatArray], Camera]:
    """Return frames with a person, their keypoints, and the working camera."""
    found = []
    with request.open() as recording:
        rng = np.random.default_rng(0)
        given = recording.first.camera, default_preset(), rng, recording.others
        session = Session([BODY], *given)
        frames = list(recording.frames(EMPTY - 0.5))
        for frame in frames:
            (estimate,) = session.track(frame.observations)
            assert estimate.keypoints_m is not None, estimate.state
            found.append(np.asarray(estimate.keypoints_m))
        return frames, found, recording.first.camera


def aside(camera: Camera, postures: list[FloatArray]) -> tuple[BodyModel, list[FloatArray]]:
    """Return body and postures as a camera at the side sees them."""
    view = View.of(BODY, camera, OtherCamera(camera, ASIDE))
    states = [view.states(np.append(posture, np.zeros(2))) for posture in postures]
    return view.body, [state[POSTURE] for state in states]


def errors_m(found: list[FloatArray], camera: Camera, postures: list[FloatArray]) -> FloatArray:
    true = camera.reference_to_optical(pose(BODY, np.array(postures)).keypoints_m)
    return np.linalg.norm(np.array(found) - true, axis=-1).mean(axis=1)


@pytest.mark.parametrize("aspect", SIZES)
def test_a_film_and_a_bag_of_the_same_images_give_the_same(aspect: str, tmp_path: Path) -> None:
    camera, postures = camera_of(aspect), [posture_of(n) for n in range(SHOWN)]
    shown = images(camera, BODY, postures)
    lens = calibration(tmp_path / "lens.yaml", camera)
    of_film = GivenCamera(calibration=lens, fps=1.0)
    as_film = tracked(RecordingRequest(film(tmp_path / "film", shown), GIVEN, camera=of_film))
    as_bag = tracked(RecordingRequest(bag(tmp_path / "bag", {"": (camera, shown)}), GIVEN))
    assert as_film[2] == as_bag[2]
    assert (as_bag[2].width, as_bag[2].height) == WORKING[aspect]
    # Pixels are square.
    assert as_bag[2].fx == pytest.approx(as_bag[2].fy, rel=0.005)
    for one, other in zip(as_film[0], as_bag[0], strict=True):
        np.testing.assert_array_equal(one.first.image, other.first.image)
        np.testing.assert_array_equal(one.first.silhouette, other.first.silhouette)
    np.testing.assert_array_equal(as_film[1], as_bag[1])
    assert errors_m(as_bag[1], camera, postures).mean() < 0.12


@pytest.mark.parametrize("aspect", SIZES)
def test_two_cameras_agree_at_every_aspect(aspect: str, tmp_path: Path) -> None:
    camera, postures = camera_of(aspect), [posture_of(n) for n in range(SHOWN)]
    other = images(camera, *aside(camera, postures))
    shown = {"a": (camera, images(camera, BODY, postures)), "b": (camera, other)}
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = ASIDE.rotation, ASIDE.translation_m
    chain = {
        "cam0": {"rostopic": "/a/image_raw"},
        "cam1": {"rostopic": "/b/image_raw", "T_cn_cnm1": matrix.tolist()},
    }
    (tmp_path / "chain.yaml").write_text(yaml.safe_dump(chain))
    request = RecordingRequest(
        bag(tmp_path / "bag", shown), GIVEN, ("a", "b"), tmp_path / "chain.yaml"
    )
    _, found, _ = tracked(request)
    assert errors_m(found, camera, postures).mean() < 0.06
