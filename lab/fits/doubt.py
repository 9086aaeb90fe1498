"""Fit the models of doubt on recorded sessions with ground truth; check them on left-out sources.

    python -m lab.fits.doubt SESSION... --output cardbox_tracker/search/doubt.json

A source is a rendered recording, or a real person with all clips and choices of cameras. Each is
tracked by the preset ``default`` without and, if the detector is installed, with its points, and
before one camera by ``paper``. Models of outlines of people of mean proportions learn from those of
measured people, too, and are checked on their own sources. A model is a ridge-penalized logistic
regression in which all parts of sources weigh the same. The printed table has, for each source,
what the models that were fitted without it say about it. It takes some ten minutes on two cores.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import write_file
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.recordings.truth import beside_shoulders
from cardbox_tracker.search.config import PRESETS
from cardbox_tracker.search.doubt import (
    FAR_M,
    HANDS,
    IMAGE,
    KINDS,
    LOST_FROM,
    STAYS_SURE,
    Source,
    evidence_of_image,
    remembered,
)
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.tracker import Tracker
from lab.evaluation.plan import choices_of_cameras
from lab.evaluation.session import load_session
from lab.evaluation.tracking import InputSelection, track_session

FloatArray = NDArray[np.float64]
PENALTY = 0.02
"""Ridge penalty of a standardized coefficient, beside a mean log-likelihood."""
MOST_WRONG, HIGHEST = 0.02, 0.25
"""Largest share of wrong keypoints among tracked ones, and highest threshold."""
MOST_WRONG_IMAGES = {Source.POINTS: 0.025}
"""Largest share of images with a wrong keypoint among those that are ``tracking``, if it is not
``MOST_WRONG``; with points, among those of real people."""
REAL = "real_"
"""How the names of sources begin that are real people."""
OF_ARMS = ("better", "sure", "slope", "beside trunk")
OF_JOINTS = (*OF_ARMS, "spread", "yaw", "cameras")
"""Evidence that differs between joints, and all from which a joint is judged: with more of it, the
models say less about sources that were left out. The whole is judged from all other evidence."""
ARMS = [1, 2, 4, 5]
"""Indices of elbows and hands among the keypoints, whose mean error says if all is wrong."""
MODELS, MODELED = (*dict.fromkeys(KINDS), "whole"), (*KINDS, "whole")
"""Models of all sources, and the model of each of the seven probabilities."""


@dataclass(frozen=True)
class Samples:
    """Results of one source.

    Attributes:
        evidence: by name, (n, 6).
        aligned_m: errors relative to the middle of the shoulders, (n, 6).
        whole_m: mean errors by which a whole result is wrong, (n,).
    """

    evidence: Mapping[str, FloatArray]
    aligned_m: FloatArray
    whole_m: FloatArray

    def rows(self, model: str) -> tuple[Mapping[str, FloatArray], FloatArray]:
        """Return evidence by name, (k,), and whether a result is wrong, (k,), for a model."""
        if model == "whole":
            wrong = self.whole_m > FAR_M
            return {name: one[:, 0] for name, one in self.evidence.items()}, wrong.astype(float)
        at = [number for number, kind in enumerate(KINDS) if kind == model]
        wrong = self.aligned_m[:, at].ravel() > FAR_M
        return {name: one[:, at].ravel() for name, one in self.evidence.items()}, wrong.astype(
            float
        )


class Collector:
    """Collects results whose truth is known."""

    def __init__(self, truth: Mapping[int, FloatArray], source: Source) -> None:
        """Prepare for true keypoints (6, 3), metres, by stamp, and what results rest on."""
        self._truth, self._has_points = truth, source is Source.POINTS
        self._is_paper = source is Source.PAPER
        self._evidence: defaultdict[str, list[FloatArray]] = defaultdict(list)
        self._errors: list[FloatArray] = []

    def __call__(self, seed: int, stamp_ns: int, estimate: Estimate, tracker: Tracker) -> None:
        """Add an estimate."""
        truth = self._truth.get(stamp_ns)
        if truth is None or estimate.evidence is None or estimate.keypoints_m is None:
            return
        if ("point distance" in estimate.evidence) != self._has_points:
            return
        for name, values in estimate.evidence.items():
            self._evidence[name].append(values)
        self._errors.append(estimate.keypoints_m - truth)

    def samples(self) -> Samples | None:
        """Return what was collected; None if there is nothing."""
        if not self._errors:
            return None
        errors = np.array(self._errors)
        aligned = beside_shoulders(errors)
        evidence = {name: np.array(values) for name, values in self._evidence.items()}
        aligned_m = np.linalg.norm(aligned, axis=2)
        # The paper's filter keeps the distance constant; its model says if the person is elsewhere.
        whole_m = np.linalg.norm(errors, axis=2) if self._is_paper else aligned_m[:, ARMS]
        return Samples(evidence, aligned_m, whole_m.mean(axis=1))


def fit(
    sources: Sequence[Samples], model: str, names: Sequence[str]
) -> tuple[float, dict[str, float]]:
    """Return intercept and coefficients by name of a logistic regression, by Newton's method."""
    return regression([source.rows(model) for source in sources], names)


def regression(
    parts: Sequence[tuple[Mapping[str, FloatArray], FloatArray]], names: Sequence[str]
) -> tuple[float, dict[str, float]]:
    """Return the same of parts of evidence by name, (k,), and whether a result is wrong, (k,)."""
    x = np.concatenate([np.column_stack([rows[name] for name in names]) for rows, _ in parts])
    y = np.concatenate([wrong for _, wrong in parts])
    weight = np.concatenate([np.full(len(wrong), 1.0 / len(wrong)) for _, wrong in parts])
    weight /= weight.sum()
    mean = weight @ x
    scale = np.sqrt(weight @ (x - mean) ** 2) + 1e-9
    z = np.column_stack([np.ones(len(x)), (x - mean) / scale])
    penalty = np.full(z.shape[1], PENALTY)
    penalty[0] = 1e-4
    beta = np.zeros(z.shape[1])
    for _ in range(50):
        p = 1.0 / (1.0 + np.exp(-np.clip(z @ beta, -30.0, 30.0)))
        gradient = z.T @ (weight * (y - p)) - penalty * beta
        hessian = (z * (weight * p * (1.0 - p))[:, None]).T @ z + np.diag(penalty)
        step = np.linalg.solve(hessian, gradient)
        beta += np.clip(step, -2.0, 2.0)
        if np.abs(step).max() < 1e-8:
            break
    coefficients = beta[1:] / scale
    return float(beta[0] - coefficients @ mean), dict(
        zip(names, coefficients.tolist(), strict=True)
    )


def chances(samples: Samples, models: Mapping[str, tuple[float, dict[str, float]]]) -> FloatArray:
    """Return the probabilities (n, 7) of the keypoints and of the whole, and (n, 8) of the image.

    The last one is there if ``models`` have one of it.
    """
    columns = [*enumerate(KINDS), (0, "whole")]
    found = np.empty((len(samples.whole_m), len(columns)))
    for column, (at, model) in enumerate(columns):
        intercept, coefficients = models[model]
        logit = intercept + sum(
            coefficient * samples.evidence[name][:, at]
            for name, coefficient in coefficients.items()
        )
        found[:, column] = 1.0 / (1.0 + np.exp(-np.clip(logit, -50.0, 50.0)))
    if IMAGE not in models:
        return found
    intercept, coefficients = models[IMAGE]
    seen = image_evidence(samples, found)
    logit = intercept + sum(one * seen[name] for name, one in coefficients.items())
    return np.column_stack([found, 1.0 / (1.0 + np.exp(-np.clip(logit, -50.0, 50.0)))])


def hands_over_time(said: FloatArray) -> FloatArray:
    """Return the doubt (n,) about the worse hand in images in turn, with probabilities (n, 7)."""
    found, before = np.empty(len(said)), np.zeros(len(HANDS))
    for number, one in enumerate(said[:, HANDS]):
        before = remembered(before, one)
        found[number] = before.max()
    return found


def image_evidence(samples: Samples, said: FloatArray) -> dict[str, FloatArray]:
    """Return the evidence of images in turn by name, (n,), with probabilities (n, 7)."""
    left_over = samples.evidence["left over"][:, 0].tolist()
    hands = hands_over_time(said).tolist()
    rows = [evidence_of_image(*one) for one in zip(hands, said, left_over, strict=True)]
    return {name: np.array([row[name][0] for row in rows]) for name in rows[0]}


def fit_image(
    sources: Sequence[Samples], models: Mapping[str, tuple[float, dict[str, float]]]
) -> tuple[float, dict[str, float]]:
    """Return the model of an image with a wrong keypoint, by what the other models say."""
    parts = []
    for one in sources:
        wrong = (one.aligned_m > FAR_M).any(axis=1)
        parts.append((image_evidence(one, chances(one, models)), wrong.astype(float)))
    return regression(parts, list(parts[0][0]))


def names_for(model: str, available: Sequence[str]) -> list[str]:
    """Return the evidence of a model; the paper's filter has no evidence of arms."""
    if model != "whole" and set(OF_JOINTS) <= set(available):
        return list(OF_JOINTS)
    return [name for name in available if name not in OF_ARMS]


def doubts(said: FloatArray) -> FloatArray:
    """Return the doubt (n,) about images in turn, with the probabilities (n, 7 or 8); 1 if lost."""
    found = hands = hands_over_time(said)
    if said.shape[1] > len(MODELED):
        found = np.where(hands > HIGHEST, 1.0, said[:, -1])
    return np.where(said[:, 6] <= LOST_FROM, found, 1.0)


def thresholds_of(
    checked: Sequence[tuple[Samples, FloatArray]], most_wrong_images: float = MOST_WRONG
) -> tuple[float, float]:
    """Return the thresholds of a keypoint, and of the hands of an image that is ``tracking``.

    Args:
        checked: left-out results, and their probabilities (n, 7).
        most_wrong_images: largest share of wrong images.
    """
    wrong = [one.aligned_m > FAR_M for one, _ in checked]
    of_keypoints = threshold_of(
        np.concatenate([one.ravel() for one in wrong]),
        np.concatenate([said[:, :6].ravel() for _, said in checked]),
    )
    said = [doubts(one) for _, one in checked]
    of_images = threshold_of(
        np.concatenate([one.any(axis=1) for one in wrong]), np.concatenate(said), most_wrong_images
    )
    # A sure image stays so up to this limit.
    return of_keypoints, round(min(of_images, of_keypoints) / STAYS_SURE, 3)


def threshold_of(
    wrong: NDArray[np.bool_], said: FloatArray, most_wrong: float = MOST_WRONG
) -> float:
    """Return the highest threshold with which a share of what is below it is wrong.

    It has three digits and is at most ``HIGHEST``. With it, at most that share is wrong.

    Args:
        wrong: what is wrong, (n,).
        said: probabilities, (n,).
        most_wrong: this share.
    """
    order = np.argsort(said)
    thresholds = np.arange(round(1000 * HIGHEST) + 1) / 1000
    tracked = np.searchsorted(said[order], thresholds, side="right")
    wrong_tracked = np.concatenate([[0], np.cumsum(wrong[order])])[tracked]
    return float(thresholds[wrong_tracked <= most_wrong * tracked][-1])


def row_of(
    name: str, samples: Samples, said: FloatArray, uncertain_from: float, doubtful_from: float
) -> str:
    """Return a row of the table: how the states of a source compare with its errors."""
    keypoints, wrong = said[:, :6], samples.aligned_m > FAR_M
    tracked = keypoints <= uncertain_from
    uncertain = ~tracked & (keypoints <= LOST_FROM)
    is_tracking = doubts(said) <= doubtful_from

    def share(of: Any, among: Any) -> str:
        return f"{100.0 * float(of[among].mean()):.1f}" if among.any() else ""

    everything = np.ones_like(tracked)
    return (
        f"| {name} | {len(said)} | {share(is_tracking, np.ones(len(said), bool))} "
        f"| {share(is_tracking, ~wrong.any(axis=1))} "
        f"| {share(np.asarray(wrong.any(axis=1)), is_tracking)} | {share(tracked, everything)} "
        f"| {share(wrong, tracked)} | {share(samples.aligned_m > 0.15, uncertain)} "
        f"| {100.0 * float(keypoints.mean()):.1f} | {share(wrong, everything)} |"
    )


HEADER = """| source | images | `tracking` % | of right ones % | of these a joint > 30 cm % \
| joints tracked % | of these > 30 cm % | uncertain ones > 15 cm % | mean chance % | wrong % |
|---|---|---|---|---|---|---|---|---|---|"""


def collect(folder: Path, seed: int) -> list[tuple[Source, Samples]]:
    """Return the samples of a session, one for each way to track it, and what they rest on."""
    try:
        detector: Detector | None = Detector.installed()
    except CardboxError:
        detector = None
    whole = load_session(folder)
    found: list[tuple[Source, Samples]] = []
    for cameras in [()] if whole.has_references else choices_of_cameras(whole):
        session = load_session(folder, cameras)
        truth = dict(zip(session.stamps_ns.tolist(), session.keypoints_m, strict=True))
        outline = Source.MEASURED if whole.has_references else Source.OUTLINE
        ways = [(outline, "default", InputSelection())]
        if detector is not None:
            ways.append((Source.POINTS, "default", InputSelection(points=detector)))
        if len(session.truth.cameras) <= 1:
            ways.append((Source.PAPER, "paper", InputSelection()))
        for source, preset, inputs in ways:
            collector = Collector(truth, source)
            track_session(session, PRESETS[preset](), (seed,), inputs, collector)
            samples = collector.samples()
            if samples is not None:
                found.append((source, samples))
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Fit, check and write the models."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("sessions", nargs="+", type=Path, help="recorded sessions with truth")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, help="JSON file of the models")
    parser.add_argument("--jobs", type=int, default=2, help="number of processes")
    given = parser.parse_args(arguments)
    # Clips of one person are one source, also before other cameras.
    by_source: defaultdict[Source, defaultdict[str, list[Samples]]] = defaultdict(
        lambda: defaultdict(list)
    )
    with ProcessPoolExecutor(given.jobs) as pool:
        found = pool.map(collect, given.sessions, repeat(given.seed))
        for folder, ways in zip(given.sessions, found, strict=True):
            is_clip = folder.parent.name.startswith(REAL)
            name = folder.parent.name if is_clip else folder.name
            for source, samples in ways:
                by_source[source][name].append(samples)
            print(f"tracked {folder}", flush=True)
    stored = fit_all(by_source)
    if given.output is not None:
        write_file(given.output, json.dumps(stored, indent=1) + "\n")


def fit_all(
    by_source: Mapping[Source, Mapping[str, Sequence[Samples]]],
) -> dict[str, dict[str, Any]]:
    """Return the models of all sources, and print what left-out ones say."""
    stored: dict[str, dict[str, Any]] = {}
    for source, people in by_source.items():
        measured = by_source.get(Source.MEASURED, {}) if source is Source.OUTLINE else {}
        learned = {**measured, **people}
        everyone = [one for parts in learned.values() for one in parts]
        available = sorted(set.intersection(*(set(one.evidence) for one in everyone)))
        checked = []
        for left_out, own in people.items():
            others = [one for name, parts in learned.items() if name != left_out for one in parts]
            if others:
                models = _models(source, others, available)
                checked += [(left_out, one, chances(one, models)) for one in own]
        most_wrong = MOST_WRONG_IMAGES.get(source, MOST_WRONG)
        every = [(one, said) for _, one, said in checked]
        # Detectors learned from people, and err otherwise with rendered ones.
        real = [(one, said) for name, one, said in checked if name.startswith(REAL)]
        surer = real if source is Source.POINTS and real else every
        thresholds = thresholds_of(every)[0], thresholds_of(surer, most_wrong)[1]
        print(f"\n{source.value}: uncertain above {thresholds}\n\n{HEADER}")
        for name, one, said in checked:
            print(row_of(name, one, said, *thresholds))
        stored[source.value] = {
            "uncertain_from": thresholds[0],
            "doubtful_from": thresholds[1],
            "models": {
                model: [
                    round(intercept, 4),
                    {name: round(value, 4) for name, value in coefficients.items()},
                ]
                for model, (intercept, coefficients) in _models(source, everyone, available).items()
            },
        }
    return stored


def _models(
    source: Source, samples: Sequence[Samples], available: Sequence[str]
) -> dict[str, tuple[float, dict[str, float]]]:
    models = {model: fit(samples, model, names_for(model, available)) for model in MODELS}
    # Only with points do hands and elbows fit so well that the rest tells more.
    return models | ({IMAGE: fit_image(samples, models)} if source is Source.POINTS else {})


if __name__ == "__main__":
    main()
