"""Make the film of ``cardbox demo`` from a session, with blurred faces, and what belongs to it.

python -m lab.tools.demo_film SESSION --output cardbox_tracker/applications/demo

It writes ``film.mp4``, and ``film.npz`` with field of view, stature, the true joints and what the
installed detector finds in the images before they are blurred.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.drawing.video import video_file
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import atomic_path
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.pose_network import LANDMARKS, Detection
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.recording import RecordingRequest
from lab.evaluation.films import make_film

FloatArray = NDArray[np.float64]

_FACE = LANDMARKS.index("mouth_right") + 1
# Radius that is blurred around the middle of the face, in usual distances of it to the shoulders.
_RADIUS = 1.1
_CELLS = 5


def _middles(found: Detection) -> FloatArray:
    """Return the middles of face and shoulders, (2, 2), px."""
    points = found.points_px
    return np.array([points[:_FACE].mean(axis=0), points[_FACE : _FACE + 2].mean(axis=0)])


def blurred(image: NDArray[np.uint8], middle: FloatArray, radius: float) -> NDArray[np.uint8]:
    """Return an image (H, W, 3) with coarse cells within a radius of a point (2,), px."""
    cell = max(1, round(2 * radius / _CELLS))
    size = tuple(-(-length // cell) for length in image.shape[1::-1])
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    coarse = cv2.resize(small, image.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    v, u = np.indices(image.shape[:2])
    is_near = np.hypot(u - middle[0], v - middle[1]) <= radius
    return np.where(is_near[..., None], coarse, image).astype(np.uint8)


def main(arguments: list[str] | None = None) -> int:
    """Make the files."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0] if __doc__ else None)
    parser.add_argument("session", type=Path, metavar="SESSION")
    parser.add_argument("--output", type=Path, required=True, metavar="DIR")
    options = parser.parse_args(arguments)
    detector = Detector.installed()
    with TemporaryDirectory() as folder:
        film = make_film(options.session, "across", Path(folder) / "film.mp4")
        camera = GivenCamera(film.fov_deg)
        with RecordingRequest(
            film.path, detector, points=detector, camera=camera
        ).open() as recording:
            find = detector.start()
            images = [*recording.first.images()]
            found = [one for image in images if (one := find(image.image, image.stamp_ns))]
            fps = round(1e9 / recording.first.period_ns(), 2)
        if len(found) < len(images):
            raise CardboxError(f"{len(images) - len(found)} images of the film show nobody")
        middles = np.array([_middles(one) for one in found])
        radius = _RADIUS * float(np.median(np.linalg.norm(middles[:, 0] - middles[:, 1], axis=1)))
        with video_file(options.output / "film.mp4", fps) as add:
            for image, middle in zip(images, middles[:, 0], strict=True):
                shown = image.recorded.as_sent
                scale = shown.shape[1] / image.image.shape[1]
                add(blurred(shown, middle * scale, radius * scale))
    true_m = np.full((len(found), *film.session.keypoints_m.shape[1:]), np.nan, np.float32)
    numbers = {stamp_ns: number for number, stamp_ns in enumerate(film.stamps_ns)}
    true_m[[numbers[s] for s in film.session.stamps_ns.tolist()]] = film.session.keypoints_m
    with atomic_path(options.output / "film.npz") as temporary, temporary.open("wb") as file:
        np.savez_compressed(
            file,
            fov_deg=film.fov_deg,
            stature_m=np.array(film.session.truth.stature_m, float),
            true_m=true_m,
            points_px=np.array([one.points_px for one in found], np.float32),
            scores=np.array([one.scores for one in found], np.float16),
            spatial_m=np.array([one.spatial_m for one in found], np.float16),
            masks=np.packbits([one.silhouette() > 0 for one in found], axis=-1),
        )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
