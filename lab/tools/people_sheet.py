r"""Draw the model over images of real people with a 3D reference; nobody can be recognized.

python -m lab.tools.people_sheet SESSION... --output docs/images/real-people.jpg

Each session has ``bag/`` and ``ground_truth.json`` without reference postures. It needs the
installed detector, whose points are tracked and whose masks tell the person from the surroundings.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.drawing.overlay import draw_overlay
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import write_file
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.image_points import POINT_NAMES
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.recordings.recording import RecordingRequest
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.tracker import Tracker
from lab.evaluation.session import RecordedSession, load_session
from lab.evaluation.tracking import InputSelection, track_session

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]

REFERENCE_BGR = (255, 255, 0)
"""Colour of the joints to which the model is compared."""
COLUMNS = 5
"""Pictures in a row."""
ATTRIBUTION = (
    "Pictures: github.com/sarkadava/MotionTrackingPipeline_Workshop_ZAS2025 (CC0 1.0); "
    "github.com/perfanalytics/pose2sim (BSD-3-Clause); github.com/mprib/caliscope (BSD-2-Clause)",
    "Changed: cut, faces and surroundings blurred, model and reference (light blue) drawn",
)

HEAD_RADIUS_M = 0.2
"""Radius that is blurred around the head and around each point of the face; a head has 0.12."""

# Cells of a blurred image: a head is about two cells wide.
_CELLS = (10, 8)
_FACE = [POINT_NAMES.index(n) for n in ("nose", "left_eye", "right_eye", "left_ear", "right_ear")]
_QUALITY = 80


class Circle(NamedTuple):
    """A part of an image, px."""

    u: float
    v: float
    radius: float


def hidden(image: Image, mask: Image, heads: list[Circle]) -> Image:
    """Return an image (H, W, 3) in which only the person without the head is sharp.

    Others may be in the image as well, so everything beside the person is blurred, too. Without a
    head, everything is.

    Args:
        image: (H, W, 3), bgr.
        mask: (H, W), above 0 where the person is.
        heads: circles in which the head may be.
    """
    small = cv2.resize(image, _CELLS, interpolation=cv2.INTER_AREA)
    coarse = cv2.resize(small, image.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    v, u = np.indices(image.shape[:2])
    sharp = (mask > 0) & bool(heads)
    for head in heads:
        sharp &= np.hypot(u - head.u, v - head.v) > head.radius
    return np.where(sharp[..., None], image, coarse).astype(np.uint8)


def heads_in(
    frame: RecordedFrame, entry: dict[str, Any], camera: Camera, width: int
) -> list[Circle]:
    """Return the circles around the reference's head and around the detector's face points.

    Args:
        frame: image with points.
        entry: its entry in the ground truth.
        camera: working camera.
        width: width of the images that the entry's pixels belong to.
    """
    z_m = entry["joints_m"]["neck"][2]
    radius = HEAD_RADIUS_M * camera.fx / z_m
    middles = []
    if "head" in entry["joints_px"]:
        middles.append(np.array(entry["joints_px"]["head"]) * camera.width / width)
    if frame.points is not None:
        face = frame.points.px[_FACE]
        middles += list(face[np.isfinite(face).all(axis=1)])
    return [Circle(float(u), float(v), radius) for u, v in middles]


def counts_of(sessions: int, frames: int) -> list[int]:
    """Return how many images of each session are shown: the last have more, to fill their row."""
    more = -sessions * frames % COLUMNS
    return [frames + (more + number) // sessions for number in range(sessions)]


class TrackedFilm:
    """A session of a real person, tracked with the detector's points.

    Attributes:
        numbers: indices of the session's images that have an estimate.
        session: the session.
    """

    def __init__(self, folder: Path) -> None:
        """Track the session in ``folder``.

        Raises:
            CardboxError: the folder is not a session, no image has an estimate, or the detector is
                not installed.
        """
        self.session, detector = load_session(folder), Detector.installed()
        self._found: dict[int, tuple[BodyModel, Estimate]] = {}
        points = InputSelection(points=detector)
        track_session(self.session, default_preset(), (0,), points, self._keep)
        self.numbers = [
            number
            for number, stamp_ns in enumerate(self.session.stamps_ns.tolist())
            if stamp_ns in self._found and self._found[stamp_ns][1].posture is not None
        ]
        if not self.numbers:
            raise CardboxError(f"{self.session.name} has no image with estimate and reference")
        truth = json.loads((folder / "ground_truth.json").read_text(encoding="utf-8"))
        self._width = truth["camera"]["width"]
        self._entries = {entry["stamp_ns"]: entry for entry in truth["frames"]}
        self._frames, self._camera = _frames(self.session, detector)

    def _keep(self, seed: int, stamp_ns: int, estimate: Estimate, tracker: Tracker) -> None:
        self._found[stamp_ns] = tracker.body, estimate

    def estimate(self, number: int) -> Estimate:
        """Return the estimate of one of ``numbers``."""
        return self._found[int(self.session.stamps_ns[number])][1]

    def picture(self, number: int) -> Image:
        """Return the first camera's image (H, W, 3), blurred, with model and reference."""
        stamp_ns = int(self.session.stamps_ns[number])
        frame, (body, estimate) = self._frames[stamp_ns], self._found[stamp_ns]
        heads = heads_in(frame, self._entries[stamp_ns], self._camera, self._width)
        seen = hidden(frame.image, frame.silhouette, heads)
        view = self._camera.with_pitch(body.camera_pose.pitch_rad)
        tile = draw_overlay(seen, body, view, estimate)
        for u, v in self._camera.project(self.session.keypoints_m[number]):
            cv2.circle(tile, (round(u), round(v)), 3, REFERENCE_BGR, -1, cv2.LINE_AA)
        return tile


def tiles_of(folder: Path, count: int) -> list[Image]:
    """Return ``count`` pictures of a session in ``folder``, evenly over its time.

    Raises:
        CardboxError: see :class:`TrackedFilm`.
    """
    film = TrackedFilm(folder)
    numbers = film.numbers
    return [film.picture(numbers[int((i + 0.5) * len(numbers) / count)]) for i in range(count)]


def side_by_side(tiles: Sequence[Image], lines: Sequence[str]) -> Image:
    """Return pictures (H, W, 3) of one size in rows of ``COLUMNS``, and lines of text."""
    height, width = tiles[0].shape[:2]
    strip = np.zeros((24 * len(lines), COLUMNS * width, 3), np.uint8)
    for number, line in enumerate(lines):
        place = (6, 24 * number + 17)
        cv2.putText(strip, line, place, 0, 0.5, (255, 255, 255), 1, cv2.LINE_AA)
    every = [*tiles, *[np.zeros((height, width, 3), np.uint8)] * (-len(tiles) % COLUMNS)]
    rows = [np.hstack(every[n : n + COLUMNS]) for n in range(0, len(every), COLUMNS)]
    return np.asarray(np.vstack([*rows, strip]), np.uint8)


def _frames(
    session: RecordedSession, detector: Detector
) -> tuple[dict[int, RecordedFrame], Camera]:
    """Return the first camera's frames by stamp, with the detector's masks and points."""
    names = session.truth.cameras[:1]
    with RecordingRequest(session.bag, detector, names, points=detector).open() as source:
        return {f.stamp_ns: f for f in source.first.frames()}, source.first.camera


def main(arguments: list[str] | None = None) -> int:
    """Track, and write the picture."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0] if __doc__ else None)
    parser.add_argument("sessions", type=Path, nargs="+", metavar="SESSION")
    parser.add_argument(
        "--frames", type=int, default=2, metavar="N", help="least images of each session"
    )
    parser.add_argument("--output", type=Path, required=True, metavar="FILE.jpg")
    options = parser.parse_args(arguments)
    counts = counts_of(len(options.sessions), options.frames)
    shown = zip(options.sessions, counts, strict=True)
    tiles = [tile for folder, count in shown for tile in tiles_of(folder, count)]
    picture = side_by_side(tiles, ATTRIBUTION)
    encoded = cv2.imencode(".jpg", picture, (cv2.IMWRITE_JPEG_QUALITY, _QUALITY))[1]
    write_file(options.output, encoded.tobytes())
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
