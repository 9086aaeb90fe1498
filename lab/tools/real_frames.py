"""Read a session of people whose joints MediaPipe has marked in the images."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.other_silhouettes import DetectorSilhouetteSource
from cardbox_tracker.recordings.silhouettes import SilhouetteSource, TimeSpan
from lab.tools.silhouette_report import read_masks

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]

LANDMARKS = tuple(f"{s}_{j}" for s in ("left", "right") for j in ("shoulder", "elbow", "wrist"))

_MARGIN_S = 0.2


@dataclass(frozen=True)
class Frames:
    """Every image with a person, N of them, in order.

    Attributes:
        camera: working camera.
        images: (N, H, W, 3), bgr.
        silhouettes: (N, H, W), 0 or 255, of the background model.
        masks: MediaPipe's, (N, H, W), 0 or 255.
        landmarks_px: MediaPipe's, (N, 6, 2), as ``LANDMARKS``; nan where there is none.
        clips: name of the clip, (N,).
        stamps_ns: stamps of the images, (N,).
        detected: masks of the installed detector, (N, H, W), 0 or 255; None without it.
        points: the detector's points in each image, N of them or None; empty without it.
    """

    camera: Camera
    images: Image
    silhouettes: Image
    masks: Image
    landmarks_px: FloatArray
    clips: NDArray[np.str_]
    stamps_ns: NDArray[np.int64]
    detected: Image | None = None
    points: tuple[ImagePoints | None, ...] = ()


def read_frames(folder: Path, detector: Detector | None = None) -> Frames:
    """Read a session, cut out its silhouettes, and let a detector find the people.

    Raises:
        CardboxError: the folder is no such session, or the detector cannot be loaded.
    """
    try:
        reference = json.loads((folder / "reference.json").read_text(encoding="utf-8"))
        masks = read_masks(folder / "mediapipe_masks.npz")
        numbers = {f["stamp_ns"]: i for i, f in enumerate(reference["frames"])}
        first = reference["segments"][0]
    except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
        raise CardboxError(
            f"{folder} is no session of real people: {error!r}; expected bag/, reference.json and "
            "mediapipe_masks.npz"
        ) from None
    empty = TimeSpan(first["start_s"] + _MARGIN_S, first["end_s"] - _MARGIN_S)
    with BagReader(folder / "bag") as bag:
        source = SilhouetteSource(bag, empty)
        frames = list(source.frames(first["end_s"]))
        found = []
        if detector is not None:
            people = DetectorSilhouetteSource(bag, detector, points=detector)
            found = list(people.frames(first["end_s"]))
    chosen = [numbers[frame.stamp_ns] for frame in frames]
    seen = [reference["frames"][i] for i in chosen]
    return Frames(
        source.camera,
        np.array([frame.image for frame in frames]),
        np.array([frame.silhouette for frame in frames]),
        np.where(masks[chosen], 255, 0).astype(np.uint8),
        np.array([_landmarks(frame) for frame in seen]),
        np.array([frame["segment"] for frame in seen]),
        np.array([frame.stamp_ns for frame in frames]),
        np.array([frame.silhouette for frame in found]) if found else None,
        tuple(frame.points for frame in found),
    )


def _landmarks(frame: dict[str, Any]) -> list[list[float]]:
    found = frame.get("mediapipe_px", {})
    return [found.get(name, [np.nan, np.nan]) for name in LANDMARKS]
