"""Settings and result of the initialization, and which fit is good enough."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import REFERENCE_NAMES, SIDE_TURNS
from cardbox_tracker.errors import InitializationError
from cardbox_tracker.estimation.initialization.wording import rounded_down
from cardbox_tracker.settings import check, setting

MAX_PITCH_RAD = float(np.radians(80.0))
"""A camera that looks further up or down does not see an upright person's outline."""


@dataclass(frozen=True)
class InitializationConfig:
    """Settings of the initialization."""

    distance_m: float = setting(
        2.0,
        "level distance from the camera to the person; a silhouette gives sizes only up to scale",
        unit="m",
        limits=(0.3, 20.0),
    )
    camera_pitch_rad: float = setting(
        0.0,
        "how far the camera looks down; travels to the tracker in the body model",
        unit="rad",
        limits=(-MAX_PITCH_RAD, MAX_PITCH_RAD),
    )
    side_turn: str = setting(
        "left",
        "which way the person turns for the side reference, as they see it",
        choices=SIDE_TURNS,
    )
    hypotheses: int = setting(500, "hypotheses M of the estimation", limits=(10, 100000))
    max_rounds: int = setting(100, "rounds of a step of the estimation at most", limits=(1, 10000))
    sigma_alpha_m: float = setting(
        0.05, "initial noise of the sizes (paper)", unit="m", limits=(1e-4, 1.0)
    )
    accuracy_m: float = setting(
        0.002, "a step ends when its noise has shrunk below this", unit="m", limits=(0.0, 1.0)
    )
    prior: float = setting(
        0.003,
        "cost of a size one standard deviation off, as a fraction of the silhouette's pixels",
        limits=(0.0, 1.0),
    )
    min_iou: float = setting(
        0.6,
        "a measurement is refused if the mean fit (IoU) of the references is below this",
        limits=(0.0, 1.0),
    )
    # Clean silhouettes of people who hold the postures fit with 0.79 and more, those with a fifth
    # of the person missing with 0.57 and more; 'front' and 'side' swapped fit with 0.55 to 0.88,
    # so that this does not replace the check of the postures.
    least_iou: float = setting(
        0.55,
        "a measurement is refused if the fit (IoU) of any reference is below this",
        limits=(0.0, 1.0),
    )
    check_postures: bool = setting(
        True, "refuse references whose outline shows another posture than was asked for"
    )
    seed: int = setting(0, "seed of the random draws", limits=(0, 2**31 - 1))

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            ValueError: a value is out of range; the text names it.
        """
        check(self)


@dataclass(frozen=True)
class InitializationResult:
    """What the initialization found.

    Attributes:
        body: the measured person.
        iou: fit of each reference, by name.
        rounds: rounds that were needed, by subset, both passes together.
        costs_px: cost and prior of the best hypothesis before the first and after each round, one
            tuple a pass, by subset.
    """

    body: BodyModel
    iou: dict[str, float]
    rounds: dict[str, int]
    costs_px: dict[str, list[tuple[float, ...]]]

    @property
    def mean_iou(self) -> float:
        """Mean fit of the three references."""
        return float(np.mean(list(self.iou.values())))


GOOD_IOU = 0.8
"""Clean silhouettes of people who hold the postures fit about as well or better."""


def fit_text(result: InitializationResult) -> str:
    """Return how well the references fit, with a warning where it is not well, for a person."""
    text = f"fit (IoU) {_fits(result)}, mean {rounded_down(result.mean_iou)}"
    doubtful = [name for name in REFERENCE_NAMES if result.iou[name] < GOOD_IOU]
    if not doubtful:
        return text
    names = " and ".join(f"'{name}'" for name in doubtful)
    return (
        f"{text}; warning: {names} below {GOOD_IOU:.2f}, sizes may be wrong: look at the "
        f"silhouettes, and capture {names} again"
    )


def _fits(result: InitializationResult) -> str:
    return ", ".join(f"{name} {rounded_down(iou)}" for name, iou in result.iou.items())


def check_fit(result: InitializationResult, config: InitializationConfig) -> None:
    """Refuse references that the model fits poorly, all together or one of them.

    Raises:
        InitializationError: the text has every fit, and names the references that fit too poorly.
    """
    fits = _fits(result)
    advice = (
        f"check person_distance_m ({config.distance_m:g} m), the camera's pitch "
        f"({np.degrees(config.camera_pitch_rad):g} degrees), the side the person turned to "
        f"({config.side_turn}), and look at the silhouettes"
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
            f"of each); capture {names} again in the posture asked for, or {advice}"
        )
