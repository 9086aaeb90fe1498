"""Settings and result of the initialization, and the check of the result's fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.common.settings import Settings, setting
from cardbox_tracker.measuring.references import rounded_down
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import REFERENCE_NAMES, SIDE_TURNS

MAX_PITCH_RAD = float(np.radians(80.0))
"""Limit of the camera's pitch, beyond which an upright person's outline is not visible."""


@dataclass(frozen=True)
class InitializationConfig(Settings):
    """Settings of the initialization."""

    distance_m: float = setting(
        2.0,
        "level distance from the camera to the person; a silhouette gives sizes only up to scale",
        unit="m",
        limits=(0.3, 20.0),
    )
    camera_pitch_rad: float = setting(
        0.0,
        "pitch of the camera, positive downwards; the body model stores it for the tracker",
        unit="rad",
        limits=(-MAX_PITCH_RAD, MAX_PITCH_RAD),
    )
    side_turn: str = setting(
        "left",
        "direction in which the person turns for the side reference, as seen by the person",
        choices=SIDE_TURNS,
    )
    hypotheses: int = setting(500, "hypotheses M of the estimation", limits=(10, 100000))
    max_rounds: int = setting(
        100, "largest number of rounds of an estimation step", limits=(1, 10000)
    )
    min_iou: float = setting(
        0.6,
        "least mean fit (IoU) of the references; a measurement with less is refused",
        limits=(0.0, 1.0),
    )
    # Wrong postures can have a larger IoU, so this does not replace the check of the postures.
    least_iou: float = setting(
        0.55,
        "least fit (IoU) of each reference; a measurement with less is refused",
        limits=(0.0, 1.0),
    )
    check_postures: bool = setting(
        True, "refuse references that show another posture than the requested one"
    )
    seed: int = setting(0, "seed of the random draws", limits=(0, 2**31 - 1))


@dataclass(frozen=True)
class InitializationResult:
    """Result of the initialization."""

    body: BodyModel  #: the measured person
    iou: dict[str, float]  #: fit of each reference by name
    rounds: dict[str, int]  #: number of rounds of both passes by subset
    #: cost plus prior of the best hypothesis before the first and after each round, by subset, with
    #: one tuple for each pass
    costs_px: dict[str, list[tuple[float, ...]]]

    @property
    def mean_iou(self) -> float:
        """Mean fit of the three references."""
        return float(np.mean(list(self.iou.values())))


GOOD_IOU = 0.8
"""Usual least IoU of clean silhouettes in the right postures."""


def fit_text(result: InitializationResult) -> str:
    """Return the fit of the references as text, with a warning if it is poor."""
    text = f"fit (IoU) {_fits(result)}, mean {rounded_down(result.mean_iou)}"
    doubtful = [name for name in REFERENCE_NAMES if result.iou[name] < GOOD_IOU]
    if not doubtful:
        return text
    names = " and ".join(f"'{name}'" for name in doubtful)
    return (
        f"{text}; warning: {names} below {GOOD_IOU:.2f}, sizes may be wrong: check the "
        f"silhouettes and capture {names} again"
    )


def _fits(result: InitializationResult) -> str:
    return ", ".join(f"{name} {rounded_down(iou)}" for name, iou in result.iou.items())


def check_fit(result: InitializationResult, config: InitializationConfig) -> None:
    """Raise InitializationError if the mean IoU, or that of a single reference, is too low."""
    fits = _fits(result)
    advice = (
        f"check person_distance_m ({config.distance_m:g} m), the camera's pitch "
        f"({np.degrees(config.camera_pitch_rad):g} degrees), the side to which the person turned "
        f"({config.side_turn}), and the silhouettes"
    )
    if result.mean_iou < config.min_iou:
        raise InitializationError(
            f"the model fits the references poorly (IoU {fits}; mean "
            f"{rounded_down(result.mean_iou)}, expected {config.min_iou:.2f} or more); {advice}"
        )
    poor = [name for name in REFERENCE_NAMES if result.iou[name] < config.least_iou]
    if poor:
        names = " and ".join(f"'{name}'" for name in poor)
        raise InitializationError(
            f"the model fits {names} poorly (IoU {fits}; expected {config.least_iou:.2f} or more "
            f"for each); capture {names} again in the requested posture, or {advice}"
        )
