"""The film of ``cardbox demo``, what a detector found in it, and where the joints really were.

``film.mp4`` is from github.com/sarkadava/MotionTrackingPipeline_Workshop_ZAS2025 (CC0 1.0), turned
until the camera looks at its middle, with a blurred face. ``film.npz`` has the reference from three
cameras, and what MediaPipe Pose found in the sharp images: points in the image and in space, and
masks of one bit a pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.drawing.page import png_of
from cardbox_tracker.detectors.detector import Detector, PersonDetector
from cardbox_tracker.detectors.model_files import ModelFiles
from cardbox_tracker.detectors.pose_network import LANDMARKS, Detection
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.recordings.truth import beside_shoulders

SOURCE = "github.com/sarkadava/MotionTrackingPipeline_Workshop_ZAS2025, CC0 1.0; face blurred"

_HERE = Path(__file__).parent
# Of the reference's hand beyond the wrist, as a share of the stature.
_HAND_SHARE = 0.0555


class StoredDetections(Detector):
    """A detector of one film, which was run before."""

    found: Sequence[Detection] = ()

    def start(self, across: float = 1.0, down: float = 1.0) -> PersonDetector:
        """Return a detector for the images of the film in their order."""
        return _Replay(self.found)


class _Replay(PersonDetector):
    remark = ""
    _people = None

    def __init__(self, found: Sequence[Detection]) -> None:
        self._found = found
        self.restart()

    def restart(self) -> None:
        self.missed = 0
        self._next = iter(self._found)

    def __call__(self, image: NDArray[np.uint8], stamp_ns: int | None = None) -> Detection | None:
        return next(self._next)


class DemoFilm(NamedTuple):
    """The film of n images."""

    path: Path  #: the video
    fov_deg: float  #: field of view across its width
    stature_m: float  #: of the woman
    #: reference of shoulders, elbows and hands, (n, 6, 3), metres in the optical frame; nan where
    #: there is none
    true_m: FloatArray
    found: tuple[Detection, ...]  #: what the detector found

    @classmethod
    def load(cls) -> DemoFilm:
        """Read the film's data."""
        with np.load(_HERE / "film.npz") as data:
            masks = 255 * np.unpackbits(data["masks"], axis=-1)
            each = zip(
                data["points_px"].astype(float),
                data["scores"].astype(float),
                masks,
                data["spatial_m"].astype(float),
                strict=True,
            )
            given = float(data["fov_deg"]), float(data["stature_m"]), data["true_m"].astype(float)
            return cls(_HERE / "film.mp4", *given, tuple(Detection(*one) for one in each))

    @property
    def detector(self) -> Detector:
        """What the detector found, as a detector."""
        detector = StoredDetections(ModelFiles(self.path, self.path))
        detector.found = self.found
        return detector

    def mediapipe_m(self, pitch_rad: float = 0.0) -> FloatArray:
        """Return the detector's own points in space, (n, 6, 3), m relative to the hips.

        A hand is where the reference has it: from the wrist towards the knuckles. The detector
        takes the camera for level, so points are turned by its downward pitch ``pitch_rad``.
        """
        points = np.array([one.spatial_m for one in self.found])
        at = {name: points[:, number] for number, name in enumerate(LANDMARKS)}
        joints = []
        for side in ("left", "right"):
            wrist = at[f"{side}_wrist"]
            out = (at[f"{side}_index"] + at[f"{side}_little_finger"]) / 2 - wrist
            out *= _HAND_SHARE * self.stature_m / np.linalg.norm(out, axis=-1, keepdims=True)
            joints += [at[f"{side}_shoulder"], at[f"{side}_elbow"], wrist + out]
        c, s = np.cos(pitch_rad), np.sin(pitch_rad)
        turn = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        return np.asarray(np.stack(joints, axis=1) @ turn.T)

    def errors_m(self, keypoints_m: FloatArray, *, is_placed: bool = False) -> FloatArray:
        """Return the mean distance of keypoints (n, 6, 3), m, to the reference in each image, (n,).

        They are in the optical frame; unless ``is_placed``, the middle of the shoulders is made
        equal.
        """
        difference = keypoints_m - self.true_m
        moved = difference if is_placed else beside_shoulders(difference)
        return np.asarray(np.linalg.norm(moved, axis=-1).mean(axis=-1))

    def error_plot(self, time_s: FloatArray, ours_m: FloatArray, theirs_m: FloatArray) -> bytes:
        """Return the errors of tracker and detector in each image, (n,) as time, s, as PNG."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(9.0, 3.4), dpi=100, layout="constrained")
        axes = figure.subplots()
        for errors_m, name, colour in (
            (theirs_m, "MediaPipe Pose", "#9a9a9a"),
            (ours_m, "cardbox_tracker", "#1b4f8a"),
        ):
            label = f"{name}, mean {100 * np.nanmean(errors_m):.1f} cm"
            axes.plot(time_s, 100 * errors_m, color=colour, label=label)
        what = "mean 3D error of shoulders,\nelbows and hands [cm]"
        axes.set(xlabel="time [s]; gaps: no reference", ylabel=what, ylim=(0.0, None))
        axes.set_title("beside the middle of the shoulders", fontsize=10)
        axes.legend(fontsize=9)
        axes.grid(alpha=0.3)
        axes.margins(x=0.0)
        return png_of(figure)
