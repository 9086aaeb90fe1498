"""The input of the experiments: silhouettes of a session, and the truth of each image.

A session is a synthetic or real recording with ``ground_truth.json``. Background and sizes of the
person are learned from its own segments ``empty``, ``front``, ``side`` and ``arms``; tracking
starts with the segment ``neutral``, in the front reference posture.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.simulation.session import SessionFormat, synthesize_session
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.encodings import brightness_of
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.measuring.config import InitializationConfig
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_JOINTS
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.initialize import initialize_from_recording
from cardbox_tracker.recordings.silhouettes import RecordedFrame, SilhouetteSource, TimeSpan
from cardbox_tracker.recordings.truth import GroundTruth, load_ground_truth
from cardbox_tracker.segmentation.background_config import BackgroundConfig

FloatArray = NDArray[np.float64]

SEQUENCE_LENGTH = 7
"""Number of images of each motion that are kept for the image sequences."""

_NOT_MOTIONS = ("empty", "enter", "front", "side", "arms", "transition", "neutral")
# People do not take a posture, or leave the view, exactly at the end of a segment.
_MARGIN_S = 0.2
# The background is learned from every image of the empty scene.
_WHOLE_SPAN = BackgroundConfig(learn_images=10000)


@dataclass(frozen=True, eq=False)
class Session:
    """One session from its first ``neutral`` segment on; n images.

    Attributes:
        body: the person as the initialization measured them.
        camera: working camera, pitched.
        silhouettes: (n, H, W), 0 or 255.
        segments: name of the motion in each image, (n,) of str.
        time_s: seconds from the first image of the recording, (n,).
        keypoints_m: true shoulders, elbows and hands, (n, 6, 3), metres in the optical frame; NaN
            in an image without truth.
        postures: true d1..d12, (n, 12); NaN where the truth lacks them.
        shown: indices of the images kept, at most ``SEQUENCE_LENGTH`` of each motion.
        images: the images kept, (len(shown), H, W), brightness.
        initialization_iou: fit of each reference, by name.
    """

    body: BodyModel
    camera: Camera
    silhouettes: NDArray[np.uint8]
    segments: NDArray[np.str_]
    time_s: FloatArray
    keypoints_m: FloatArray
    postures: FloatArray
    shown: NDArray[np.intp]
    images: NDArray[np.uint8]
    initialization_iou: Mapping[str, float]

    @property
    def motions(self) -> list[str]:
        """The motions in it, in the order of the recording."""
        return motions_of(self.segments)


def motions_of(segments: NDArray[np.str_]) -> list[str]:
    """Return the names of ``segments`` (n,) that are motions, each once, in order."""
    return [name for name in dict.fromkeys(segments.tolist()) if name not in _NOT_MOTIONS]


def synthetic_session(
    motion: str, seed: int, fps: float = 15.0, size: tuple[int, int] = (320, 240)
) -> Session:
    """Record the synthetic person in ``motion``, and read the recording like any other."""
    with TemporaryDirectory(prefix="cardbox_evaluate_") as folder:
        bag = Path(folder) / "session"
        synthesize_session(bag, motion, seed, SessionFormat(fps, *size))
        return recorded_session(bag, seed, size)


def recorded_session(
    folder: Path,
    seed: int = 0,
    size: tuple[int, int] = (320, 240),
    progress: Callable[[float], None] | None = None,
) -> Session:
    """Read a session: learn background and person, and compute every silhouette.

    Args:
        folder: holds ``ground_truth.json`` and the recording, or the recording in ``bag``.
        seed: of the initialization.
        size: working resolution, px.
        progress: called with the finished fraction of the initialization.

    Raises:
        CardboxError: there is no ground truth, or it lacks a segment.
        BagError: the recording cannot be read.
        InitializationError: the person cannot be measured.
    """
    truth_file = folder / "ground_truth.json"
    if not truth_file.is_file():
        raise CardboxError(
            f"{folder} has no ground_truth.json; expected the folder of a session with ground "
            "truth, such as 'cardbox synthesize' writes"
        )
    truth = load_ground_truth(truth_file)
    spans = {name: _span(truth, name, folder) for name in ("empty", "front", "side", "arms")}
    start_s = _span(truth, "neutral", folder).start_s - _MARGIN_S
    bag_folder = folder / "bag" if (folder / "bag").is_dir() else folder
    config = InitializationConfig(
        distance_m=truth.distance_m,
        camera_pitch_rad=float(np.radians(truth.pitch_deg)),
        side_turn=truth.side_turn,
        seed=seed,
    )
    with BagReader(bag_folder) as bag:
        source = SilhouetteSource(bag, spans.pop("empty"), _WHOLE_SPAN, size)
        result = initialize_from_recording(source, spans, config, progress)
        frames = list(source.frames(start_s))
        camera = source.camera.with_pitch(config.camera_pitch_rad)
    return _session(frames, truth, camera, result.body, result.iou, folder)


def _span(truth: GroundTruth, name: str, folder: Path) -> TimeSpan:
    if name not in truth.spans:
        raise CardboxError(
            f"the ground truth in {folder} has no segment '{name}'; a session has empty, front, "
            "side, arms and neutral, then its motions"
        )
    start_s, end_s = truth.spans[name]
    margin_s = min(_MARGIN_S, (end_s - start_s) / 4)
    return TimeSpan(start_s + margin_s, end_s - margin_s)


def _session(
    frames: list[RecordedFrame],
    truth: GroundTruth,
    camera: Camera,
    body: BodyModel,
    iou: Mapping[str, float],
    folder: Path,
) -> Session:
    n = len(frames)
    segments = ["neutral"] * n
    keypoints_m = np.full((n, 6, 3), np.nan)
    postures = np.full((n, N_JOINTS), np.nan)
    for i, frame in enumerate(frames):
        true = truth.frames.get(frame.stamp_ns)
        if true is None:
            continue
        segments[i] = true.segment
        keypoints_m[i] = true.keypoints_m
        if true.posture is not None:
            postures[i] = true.posture
    names = np.array(segments)
    motions = motions_of(names)
    if not motions:
        raise CardboxError(
            f"no image of {folder} after the reference postures has a motion in the ground "
            "truth; are recording and truth of one session?"
        )
    shown = np.unique(np.concatenate([_spread(np.nonzero(names == m)[0]) for m in motions]))
    return Session(
        body,
        camera,
        np.array([frame.silhouette for frame in frames]),
        names,
        np.array([frame.time_s for frame in frames]),
        keypoints_m,
        postures,
        shown,
        np.array([brightness_of(frames[i].image) for i in shown]),
        iou,
    )


def _spread(indices: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return at most ``SEQUENCE_LENGTH`` of ``indices``, evenly spaced, without the ends."""
    places = (np.arange(SEQUENCE_LENGTH) + 0.5) / SEQUENCE_LENGTH * len(indices)
    return indices[np.unique(places.astype(np.intp))]
