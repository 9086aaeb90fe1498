r"""Track real people without measuring them, and compare with MediaPipe on the same images.

python -m lab.tools.real_report --session DIR \
    --output docs/evaluation/real-people.md --sheet docs/images/real.jpg

The session is a folder with ``bag/``, ``reference.json`` (segments, and MediaPipe's landmarks in
pixels) and ``mediapipe_masks.npz``. There is no truth; MediaPipe serves as the reference.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.measuring.first_sight import upper_body
from cardbox_tracker.measuring.references import lateral_m
from cardbox_tracker.measuring.stature import at_height_of
from cardbox_tracker.person.model import BodyModel, body_from_proportions
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.terms.whole_body import WholeBodyCost, iou_of
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.session import Session
from lab.evaluation.people_report import replaced
from lab.tools.real_frames import LANDMARKS, Frames, read_frames
from lab.tools.real_sheet import contact_sheet

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]

WRIST = 0.757
"""Elbow to wrist, of elbow to knuckles (de Leva, 1996): the model's hand is the knuckles."""

BEGIN, END = "<!-- figures of lab.tools.real_report -->", "<!-- end of the figures -->"


@dataclass(frozen=True)
class Variant:
    """One way to track a session.

    Attributes:
        name: its name in the table.
        silhouettes: ``ours``, ``region`` (the largest region of ours), ``mediapipe`` (its masks in
            the session) or ``detector`` (the masks of the installed detector).
        fits: whether the body is fitted to the first silhouette, instead of only placed there.
        distance: whether the distance is given.
        colors: whether images are given.
        anew: whether tracking starts anew with each clip.
        points: whether the points of the installed detector are given.
    """

    name: str
    silhouettes: str = "region"
    fits: bool = True
    distance: bool = True
    colors: bool = True
    anew: bool = True
    points: bool = False

    @property
    def needs_detector(self) -> bool:
        """Whether the detector has to be installed."""
        return self.points or self.silhouettes == "detector"


VARIANTS = (
    Variant("not fitted, silhouettes as they are", "ours", fits=False),
    Variant("fitted, silhouettes as they are", "ours"),
    Variant("not fitted, largest region", fits=False),
    Variant("**fitted, largest region**"),
    Variant("the same without colours", colors=False),
    Variant("the same, distance not given", distance=False),
    Variant("the same, one run through all clips", anew=False),
    Variant("fitted, MediaPipe's masks", "mediapipe"),
    Variant("the same without colours", "mediapipe", colors=False),
    Variant("fitted, the detector's masks", "detector"),
    Variant("fitted, largest region, the detector's points", points=True),
    Variant("fitted, the detector's masks and points", "detector", points=True),
)
SHOWN = VARIANTS[3]
"""The variant that is drawn."""


@dataclass(frozen=True)
class Run:
    """Results: estimates and bodies (N,), errors (N, 6) in px (nan without), IoU (N,)."""

    estimates: list[Estimate]
    bodies: list[BodyModel]
    errors_px: FloatArray
    iou: FloatArray


def projected(keypoints_m: FloatArray, camera: Camera) -> FloatArray:
    """Return shoulders, elbows and wrists (6, 2), px, of keypoints (6, 3), metres, optical."""
    points = keypoints_m.copy()
    for elbow, hand in ((1, 2), (4, 5)):
        points[hand] = points[elbow] + WRIST * (points[hand] - points[elbow])
    return camera.project(points)


def track(frames: Frames, variant: Variant, stature_m: float, distance_m: float, seed: int) -> Run:
    """Track every frame as the variant says."""
    config, camera = default_preset(), frames.camera
    count = len(frames.clips)
    errors, iou = np.full((count, len(LANDMARKS)), np.nan), np.full(count, np.nan)
    estimates, bodies = [], []
    session = None
    for i, clip in enumerate(frames.clips):
        silhouette = _silhouette(frames, variant, i)
        if session is None or (variant.anew and clip != frames.clips[i - 1]):
            body = body_from_proportions(stature_m, distance_m if variant.distance else None)
            if not variant.fits:
                body = _placed(body.with_values(unknown=()), silhouette, camera)
            session = Session([body], camera, config, np.random.default_rng(seed))
        image = frames.images[i] if variant.colors else None
        points = frames.points[i] if variant.points else None
        stamp_ns = int(frames.stamps_ns[i])
        seen = Observation(silhouette, image, stamp_ns=stamp_ns, points=points)
        (estimate,) = session.track(seen)
        estimates.append(estimate)
        bodies.append(session.trackers[0].body)
        if estimate.posture is None or estimate.keypoints_m is None:
            continue
        away = projected(estimate.keypoints_m, camera) - frames.landmarks_px[i]
        errors[i] = np.hypot(away[:, 0], away[:, 1])
        cost = WholeBodyCost(bodies[-1], camera, config.whole_body.cost)
        iou[i] = _iou(cost, estimate, frames.masks[i])
    return Run(estimates, bodies, errors, iou)


def _silhouette(frames: Frames, variant: Variant, i: int) -> Image:
    if variant.silhouettes == "mediapipe":
        mask: Image = frames.masks[i]
        return mask
    if variant.silhouettes == "detector" and frames.detected is not None:
        found: Image = frames.detected[i]
        return found
    seen: Image = frames.silhouettes[i]
    if variant.silhouettes == "ours":
        return seen
    person = upper_body(seen)
    return np.zeros_like(seen) if person is None else person


def _placed(body: BodyModel, silhouette: Image, camera: Camera) -> BodyModel:
    """Return the body with its head at that of the silhouette."""
    person = upper_body(silhouette)
    if person is None:
        return body
    aside = lateral_m(person, camera, body.placement.distance_m)
    return at_height_of(person, body.with_values(lateral_m=aside), camera)


def _iou(cost: WholeBodyCost, estimate: Estimate, mask: Image) -> float:
    """Return the overlap of the drawn model and a mask in the rows that the tracker uses."""
    state = estimate.placed_posture
    cost.see(mask, state)
    rated = cost.bodies(state[None])
    return iou_of(cost.silhouette_px, rated.areas_px[0], rated.costs_px[0])


def cells(runs: list[Run], chosen: NDArray[np.bool_]) -> list[str]:
    """Return the figures of the chosen frames (N,), as means over the runs."""
    errors = np.concatenate([run.errors_px[chosen] for run in runs])
    missing = np.mean([np.count_nonzero(np.isnan(run.iou[chosen])) for run in runs])
    if missing == np.count_nonzero(chosen):
        return ["-"] * 5 + [f"{missing:.0f} of {np.count_nonzero(chosen)}"]
    joints = np.nanmean(errors, axis=0).reshape(2, 3).mean(axis=0)
    iou = np.nanmean([run.iou[chosen] for run in runs])
    of = f"{missing:.0f} of {np.count_nonzero(chosen)}"
    return [f"{np.nanmean(errors):.1f}", *(f"{e:.1f}" for e in joints), f"{iou:.2f}", of]


_HEADER = "mean, px | shoulders | elbows | wrists | model's IoU | frames without estimate"


def report(
    frames: Frames, results: dict[Variant, list[Run]], given: argparse.Namespace
) -> Iterator[str]:
    """Yield the lines of the document."""
    everything = np.ones(len(frames.clips), bool)
    clips = list(dict.fromkeys(frames.clips.tolist()))
    yield (
        f"{len(clips)} clips, {len(frames.clips)} frames; the body is that of `cardbox body "
        f"--stature {given.stature:g} --distance {given.distance:g}` for everybody; seeds: "
        f"{given.seeds}."
    )
    yield ""
    yield f"| what | {_HEADER} |"
    yield "|---|" + "---|" * 6
    for variant, runs in results.items():
        yield f"| {variant.name} | " + " | ".join(cells(runs, everything)) + " |"
    yield ""


def sheet_of(frames: Frames, run: Run) -> Image:
    """Return the middle frame of each clip with model and landmarks."""
    numbers = [np.flatnonzero(frames.clips == clip) for clip in dict.fromkeys(frames.clips)]
    middles = [int(of_clip[len(of_clip) // 2]) for of_clip in numbers]
    return contact_sheet(
        [
            (
                frames.images[i],
                frames.masks[i],
                frames.landmarks_px[i],
                run.bodies[i],
                run.estimates[i],
            )
            for i in middles
        ],
        frames.camera,
    )


def _installed() -> Detector | None:
    try:
        return Detector.installed()
    except CardboxError as error:
        print(f"without the detector: {error}", flush=True)
        return None


def main(arguments: list[str] | None = None) -> int:
    """Track, and write the document and the pictures."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0] if __doc__ else None)
    parser.add_argument("--session", type=Path, required=True, metavar="DIR")
    parser.add_argument("--stature", type=float, default=1.75, metavar="M")
    parser.add_argument("--distance", type=float, default=1.5, metavar="M")
    parser.add_argument("--seeds", type=int, default=3, metavar="N")
    parser.add_argument("--output", type=Path, required=True, metavar="FILE.md")
    parser.add_argument("--sheet", type=Path, metavar="FILE.jpg", help="contact sheet to write")
    options = parser.parse_args(arguments)
    frames = read_frames(options.session, _installed())
    results = {}
    for variant in VARIANTS:
        if variant.needs_detector and not frames.points:
            continue
        given = (options.stature, options.distance)
        results[variant] = [track(frames, variant, *given, seed) for seed in range(options.seeds)]
        chosen = np.ones(len(frames.clips), bool)
        print(variant.name, *cells(results[variant], chosen), sep=" | ", flush=True)
    document = options.output.read_text(encoding="utf-8")
    figures = "\n".join(report(frames, results, options))
    options.output.write_text(replaced(document, figures, BEGIN, END), encoding="utf-8")
    if options.sheet is not None:
        quality = (cv2.IMWRITE_JPEG_QUALITY, 85)
        cv2.imwrite(str(options.sheet), sheet_of(frames, results[SHOWN][0]), quality)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
