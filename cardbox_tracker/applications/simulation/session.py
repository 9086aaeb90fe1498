"""Synthetic sessions: rosbag2 recordings of rendered images with ground truth.

The folder of the recording also has ``ground_truth.json`` and ``masks.npz``. The same seed gives
the same images byte for byte.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.simulation.motions import Segment, timeline
from cardbox_tracker.applications.simulation.person import person_frames
from cardbox_tracker.applications.simulation.renderer import Renderer
from cardbox_tracker.camera.camera import OPTICAL_FRAME, Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.extrinsics_files import save_camchain
from cardbox_tracker.camera.pairing import MOST_CAMERAS
from cardbox_tracker.camera.view import OtherCamera, View
from cardbox_tracker.common.errors import CardboxError, EncodingError
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.posture import PLACE, POSTURE, TORSO_Y, TURNS
from cardbox_tracker.person.skeleton import JOINT_NAMES, KEYPOINT_NAMES
from cardbox_tracker.recordings.bag_writer import BagWriter

FRAME_ID = OPTICAL_FRAME

# Azimuths of the cameras towards the person's left, degrees; all have the same distance.
_ROUND_DEG = (0.0, 65.0, -55.0, 110.0)


@dataclass(frozen=True)
class SyntheticCamera:
    """One camera of a session."""

    name: str  #: namespace of its topics
    camera: Camera  #: intrinsics and pitch
    extrinsics: Extrinsics  #: transform from the optical frame of the first camera to this one's
    #: transform of body states to a further camera; None for the first camera
    view: View | None = None

    @property
    def image_topic(self) -> str:
        """Topic of the images."""
        return f"/{self.name}/image_raw"

    @property
    def info_topic(self) -> str:
        """Topic of the CameraInfo."""
        return f"/{self.name}/camera_info"

    @property
    def frame_id(self) -> str:
        """Name of the optical frame."""
        return f"{self.name}_optical_frame"

    def seen(
        self, body: BodyModel, posture: NDArray[np.float64]
    ) -> tuple[BodyModel, NDArray[np.float64]]:
        """Return body and posture (12,) in this camera's reference frame."""
        if self.view is None:
            return body, posture
        there = self.view.states(np.append(posture, [0.0, 0.0]))
        place = self.view.body.placement
        x_m, z_m = there[PLACE].tolist()
        moved = self.view.body.with_values(
            distance_m=place.distance_m - x_m, hip_height_m=place.hip_height_m + z_m
        )
        return moved, there[POSTURE]

    def truth(self) -> dict[str, Any]:
        """Return the camera's entry of ``ground_truth.json``."""
        rows = np.column_stack([self.extrinsics.rotation, self.extrinsics.translation_m])
        return {
            "name": self.name,
            "width": self.camera.width,
            "height": self.camera.height,
            "focal_px": self.camera.fx,
            "cx": self.camera.cx,
            "cy": self.camera.cy,
            "frame_id": self.frame_id,
            "image_topic": self.image_topic,
            "info_topic": self.info_topic,
            "from_first": [*rows.tolist(), [0.0, 0.0, 0.0, 1.0]],
        }


def synthetic_cameras(body: BodyModel, first: Camera, count: int) -> list[SyntheticCamera]:
    """Return ``count`` cameras like ``first``; the person, placed as in ``body``, faces the first.

    All have the height of the first camera and look at the person. Raises CardboxError if ``count``
    is out of range.
    """
    if not 1 <= count <= MOST_CAMERAS:
        raise CardboxError(f"{count} cameras were requested; expected 1 to {MOST_CAMERAS}")
    alone = Extrinsics(np.eye(3), np.zeros(3))
    if count == 1:
        return [SyntheticCamera("camera", first, alone)]
    cameras = [SyntheticCamera("cam0", first, alone)]
    upright = first.reference_to_optical_rotation()
    place = body.placement
    middle = np.array([-place.distance_m, place.lateral_m, 0.0])
    for number, angle in enumerate(np.radians(_ROUND_DEG[1:count]).tolist(), 1):
        c, s = np.cos(angle), np.sin(angle)
        # A level frame turned about the vertical through the person.
        level = np.array([(c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)])
        centre = middle + level.T @ np.array([place.distance_m, 0.0, 0.0])
        rotation = upright @ level @ upright.T
        where = Extrinsics(rotation, -upright @ level @ centre)
        view = View.of(body, first, OtherCamera(first.with_pitch(0.0), where))
        cameras.append(SyntheticCamera(f"cam{number}", view.camera, where, view))
    return cameras


START_NS = 1_700_000_000_000_000_000
TRUTH_TOPIC = "/ground_truth/joint_states"

_ENCODINGS = ("mono8", "rgb8", "bgr8")
_SWAY_M = 0.003
_FOCAL_OF_WIDTH = 330.0 / 320.0


@dataclass(frozen=True)
class SessionFormat:
    """Format of a synthetic recording."""

    fps: float = 15.0  #: images per second
    width: int = 320  #: image width, px
    height: int = 240  #: image height, px
    #: number of cameras, 1 to 4. Several have the namespaces ``cam0``, ``cam1``, ...;
    #: ``extrinsics.yaml`` in the folder has their poses.
    cameras: int = 1
    compressed: bool = False  #: JPEG images on ``/camera/image_raw/compressed`` instead of raw ones
    encoding: str = "mono8"  #: encoding of raw images: ``mono8``, ``rgb8`` or ``bgr8``
    storage: str = "mcap"  #: ``mcap`` or ``sqlite3``


DEFAULT_FORMAT = SessionFormat()


def session_camera(width: int = 320, height: int = 240) -> Camera:
    """Return the level camera of a session, f = 330 px at a width of 320."""
    focal = _FOCAL_OF_WIDTH * width
    return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)


def synthesize_session(
    output: str | os.PathLike[str],
    motion: str = "all",
    seed: int = 0,
    form: SessionFormat = DEFAULT_FORMAT,
    body: BodyModel | None = None,
    overwrite: bool = False,
    progress: Callable[[float], None] | None = None,
) -> dict[str, Any]:
    """Write a session to the folder ``output``, which appears complete; return its truth.

    The motion is ``wave``, ``bend``, ``bow`` or ``all``. The body has the pitch of the camera; by
    default it is the usual person. Raises CardboxError if motion or encoding is unknown, or the
    folder cannot be written.
    """
    if form.encoding not in _ENCODINGS:
        raise EncodingError(
            f"encoding '{form.encoding}' cannot be synthesized; expected {', '.join(_ENCODINGS)}"
        )
    body = body or BodyModel.of(hip_height_m=-0.51)
    segments = timeline(motion, body.side_turn)
    fps, width, height, cameras = form.fps, form.width, form.height, form.cameras
    camera = session_camera(width, height).with_pitch(body.camera_pose.pitch_rad)
    rng = np.random.default_rng(seed)
    views = synthetic_cameras(body, camera, cameras)
    renderers = [
        Renderer(view.camera, own) for view, own in zip(views, rng.spawn(cameras), strict=True)
    ]
    count = round(segments[-1].end_s * fps)
    truth: list[dict[str, Any]] = []
    masks = np.zeros((cameras, count, height * width), np.uint8)
    sway = 0.0
    with BagWriter(output, form.storage, overwrite) as bag:
        for number in range(count):
            time_s = number / fps
            stamp_ns = START_NS + round(number * 1e9 / fps)
            index = next(i for i, s in enumerate(segments) if time_s < s.end_s)
            segment = segments[index]
            entry: dict[str, Any] = {
                "stamp_ns": stamp_ns,
                "segment": segment.name,
                "segment_index": index,
            }
            posture = None
            if segment.pose is not None:
                # The person sways: a slow random walk that is pulled back to its centre.
                sway = 0.95 * sway + 0.3 * _SWAY_M * rng.standard_normal()
                posture = segment.pose(time_s - segment.start_s)
                posture[TORSO_Y] += body.placement.lateral_m + sway
            seen = [
                renderer.image() if posture is None else renderer.image(*view.seen(body, posture))
                for renderer, view in zip(renderers, views, strict=True)
            ]
            if posture is not None:
                entry |= _truth(body, camera, posture, seen[0][1])
                frame_id = views[0].frame_id
                bag.write_joint_state(TRUTH_TOPIC, stamp_ns, frame_id, JOINT_NAMES, posture)
            truth.append(entry)
            for view, (image, mask), of_view in zip(views, seen, masks, strict=True):
                of_view[number] = (mask > 0).ravel()
                bag.write_camera_info(view.info_topic, stamp_ns, view.frame_id, view.camera)
                _write_image(bag, view, stamp_ns, image, form)
            if progress is not None:
                progress((number + 1) / count)
        session = _session(body, camera, fps, segments, truth, seed)
        shape = np.array([count, height, width])
        packed = {"packed": np.packbits(masks[0], axis=1), "shape": shape}
        if cameras > 1:
            session["camera"]["frame_id"] = views[0].frame_id
            session["cameras"] = [view.truth() for view in views]
            for view, of_view in zip(views, masks, strict=True):
                packed[f"packed_{view.name}"] = np.packbits(of_view, axis=1)
                packed[f"shape_{view.name}"] = shape
            save_camchain(
                bag.folder / "extrinsics.yaml",
                {view.name: view.camera for view in views},
                {view.name: view.extrinsics for view in views[1:]},
            )
        (bag.folder / "ground_truth.json").write_text(json.dumps(session), encoding="utf-8")
        np.savez_compressed(bag.folder / "masks.npz", **packed)  # type: ignore[arg-type]
    return session


def _write_image(
    bag: BagWriter,
    view: SyntheticCamera,
    stamp_ns: int,
    image: NDArray[np.uint8],
    form: SessionFormat,
) -> None:
    if form.compressed:
        jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes()
        bag.write_compressed(f"{view.image_topic}/compressed", stamp_ns, view.frame_id, jpeg)
        return
    if form.encoding != "mono8":
        image = np.repeat(image[..., None], 3, axis=2)
    bag.write_image(view.image_topic, stamp_ns, view.frame_id, image, form.encoding)


def _truth(
    body: BodyModel, camera: Camera, posture: NDArray[np.float64], mask: NDArray[np.uint8]
) -> dict[str, Any]:
    frames = person_frames(body, posture)
    names = ("hips", "neck", "head", *KEYPOINT_NAMES)
    points = np.vstack([frames.hip, frames.neck, frames.head, frames.keypoints_m])
    optical = camera.reference_to_optical(points)
    return {
        "joints_m": dict(zip(names, np.round(optical, 4).tolist(), strict=True)),
        "joints_px": dict(zip(names, np.round(camera.project(optical), 2).tolist(), strict=True)),
        "torso_rpy_deg": np.round(np.degrees(posture[TURNS]), 2).tolist(),
        "posture": dict(zip(JOINT_NAMES, np.round(posture, 6).tolist(), strict=True)),
        "mask_px": int(np.count_nonzero(mask)),
    }


def _session(
    body: BodyModel,
    camera: Camera,
    fps: float,
    segments: list[Segment],
    frames: list[dict[str, Any]],
    seed: int,
) -> dict[str, Any]:
    size = body.size
    return {
        "format": 1,
        "camera": {
            "width": camera.width,
            "height": camera.height,
            "focal_px": camera.fx,
            "cx": camera.cx,
            "cy": camera.cy,
            "pitch_down_deg": float(np.degrees(camera.pitch_rad)),
            "frame_id": FRAME_ID,
        },
        "person": {
            "distance_m": body.placement.distance_m,
            "upper_arm": size("upper_arm_length"),
            "forearm_to_hand": size("forearm_length"),
            "shoulder_breadth": size("shoulder_breadth"),
            "hips_to_neck": body_parts(body.sizes).torso.top_m,
        },
        "side_posture_turns_to": body.side_turn,
        "fps": fps,
        "segments": [{"name": s.name, "start_s": s.start_s, "end_s": s.end_s} for s in segments],
        "scene": {"seed": seed},
        "frames": frames,
    }
