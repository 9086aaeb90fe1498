"""Settings of the whole-body filter: numbers of states, noise, post-processing, thresholds."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.settings import Settings, restarting

# Numbers of states that `effort` scales, and their least values.
_LEAST_TOTALS = MappingProxyType(
    {"survivors": 4, "torsos": 2, "arms": 2, "arms_again": 1, "together": 2, "average": 1}
)
_LEAST_PARTS = MappingProxyType(
    {
        "alike": 1,
        "torso_explorers": 0,
        "fresh_torsos": 0,
        "best_torsos": 1,
        "arm_mirrors": 0,
        "arm_tips": 0,
        "banked_arms": 0,
        "best_arms": 1,
        "paired_arms": 1,
    }
)


@dataclass(frozen=True)
class WholeBodyConfig(Settings):
    """Settings of the whole-body filter; ``docs/architecture.md`` explains the stages.

    Attributes:
        cost: settings of the rating.
    """

    cost: WholeBodyCostConfig = WholeBodyCostConfig()
    effort: float = restarting(
        1.0,
        "factor on all numbers of states; more states are slower and more accurate",
        limits=(0.25, 4.0),
    )
    survivors: int = restarting(32, "states kept from frame to frame", limits=(4, 1000))
    alike: int = restarting(
        12,
        "survivors that may be similar; each other one differs from all better ones",
        limits=(1, 1000),
    )
    apart_m: float = restarting(
        0.12, "least distance of different survivors", unit="m", limits=(0.0, 10.0)
    )
    torsos: int = restarting(70, "torsos that are rated", limits=(2, 100_000))
    torso_explorers: int = restarting(
        16, "number of the torsos that bow or turn by any angle", limits=(0, 100_000)
    )
    fresh_torsos: int = restarting(
        8,
        "number of the torso_explorers that stand upright at the place of the silhouette; at "
        "first, all of them do",
        limits=(0, 100_000),
    )
    best_torsos: int = restarting(
        12,
        "best torsos that are rated with arms, both moved along and fixed in space",
        limits=(1, 1000),
    )
    arms: int = restarting(90, "arms that are proposed per side", limits=(2, 100_000))
    candidates: int = restarting(
        3,
        "proposed arms per rated arm, which is the most promising of them; 1: all are rated. "
        "Several cameras propose four times as many arms and rate a quarter of them",
        limits=(1, 100),
    )
    arm_mirrors: int = restarting(
        8,
        "number of the arms that are survivors mirrored in depth",
        limits=(0, 100_000),
    )
    arm_tips: int = restarting(
        10,
        "number of the arms that reach for foreground that the model leaves uncovered",
        limits=(0, 100_000),
    )
    banked_arms: int = restarting(
        20,
        "number of the arms that are drawn from the learned prior",
        limits=(0, 100_000),
    )
    best_arms: int = restarting(
        15, "best arms around which others are proposed", limits=(1, 100_000)
    )
    arms_again: int = restarting(
        51, "arms that are proposed around the best ones", limits=(1, 100_000)
    )
    paired_arms: int = restarting(
        12, "best arms of either side that are combined", limits=(1, 100_000)
    )
    rounds: int = restarting(2, "rounds in which all joints move together", limits=(0, 100))
    together: int = restarting(36, "states in such a round", limits=(2, 100_000))
    # Differences of survivors follow flat directions of the cost (Storn & Price,
    # "Differential Evolution", 1997).
    differing: float = restarting(
        0.4,
        "fraction of these states that move by the difference of two others",
        limits=(0.0, 1.0),
    )
    difference_scale: float = restarting(0.6, "factor on such a difference", limits=(0.0, 2.0))
    y_noise_m: float = restarting(0.02, "noise of the torso's y", unit="m", limits=(0.0, 1.0))
    roll_noise_rad: float = restarting(
        0.08, "noise of the torso's roll", unit="rad", limits=(0.0, 3.2)
    )
    pitch_noise_rad: float = restarting(
        0.08, "noise of the torso's pitch", unit="rad", limits=(0.0, 3.2)
    )
    yaw_noise_rad: float = restarting(
        0.10, "noise of the torso's yaw", unit="rad", limits=(0.0, 3.2)
    )
    x_noise_m: float = restarting(0.02, "noise of the torso's x", unit="m", limits=(0.0, 1.0))
    z_noise_m: float = restarting(0.01, "noise of the torso's z", unit="m", limits=(0.0, 1.0))
    arm_noise_rad: float = restarting(
        0.22, "noise of an arm's angles", unit="rad", limits=(0.0, 3.2)
    )
    together_noise: float = restarting(
        0.3,
        "factor on the noise of the first round of all joints",
        limits=(0.0, 1.0),
    )
    round_decay: float = restarting(
        0.6, "factor on the noise from one round to the next", limits=(0.0, 1.0)
    )
    home_rate: float = restarting(
        0.02,
        "weight of a frame in the low-pass filter of the torso's usual x",
        limits=(0.0, 1.0),
    )
    average: int = restarting(
        150, "best states whose weighted mean is the result", limits=(1, 1_000_000)
    )
    spread: float = restarting(
        0.02,
        "difference to the best rating, as a fraction of the silhouette's pixels, at which the "
        "weight of a state is 1/e",
        limits=(1e-6, 10.0),
    )
    # Larger values delay fast hands.
    smoothing: float = restarting(
        0.3,
        "weight of the last result in the next one",
        limits=(0.0, 0.99),
    )
    outline_steps: int = restarting(
        2,
        "Gauss-Newton steps of the fit of the result to the outlines; not used with depth images",
        limits=(0, 20),
    )
    start_passes: int = restarting(
        3, "searches in the first silhouette of a person", limits=(1, 100)
    )
    # A person from the side has about half the area of the front view, and less a step away.
    smallest_person: float = restarting(
        0.12,
        "least foreground of a person, as a fraction of the model's area in the front posture",
        limits=(0.0, 1.0),
    )
    # With more foreground, the light has changed, or there are several people.
    largest_person: float = restarting(
        2.5,
        "most foreground of a person, as a fraction of the same area",
        limits=(1.0, 1000.0),
    )
    uncertain_from: float = restarting(
        0.55,
        "probability of loss above which the state is uncertain",
        limits=(0.0, 1.0),
    )
    lost_from: float = restarting(
        0.95,
        "probability of loss above which a frame counts for lost_frames; 1: never",
        limits=(0.0, 1.0),
    )

    def noise(self) -> FloatArray:
        """Return the standard deviations (14,) of a state's noise, metres and rad."""
        torso = [self.y_noise_m, self.roll_noise_rad, self.pitch_noise_rad, self.yaw_noise_rad]
        return np.array([*torso, *[self.arm_noise_rad] * 8, self.x_noise_m, self.z_noise_m])

    def scaled(self) -> WholeBodyConfig:
        """Return the settings with ``effort`` times as many states, and an effort of 1.

        Raises:
            ValueError: a scaled number is out of range; the text names it and ``effort``.
        """
        if self.effort == 1.0:
            return self
        # Totals are rounded up and parts down, so that parts do not exceed their totals.
        totals: dict[str, Any] = {
            name: max(least, math.ceil(self.effort * getattr(self, name)))
            for name, least in _LEAST_TOTALS.items()
        }
        parts: dict[str, Any] = {
            name: max(least, int(self.effort * getattr(self, name)))
            for name, least in _LEAST_PARTS.items()
        }
        try:
            return replace(self, effort=1.0, **totals, **parts)
        except ValueError as error:
            raise ValueError(f"effort is {self.effort:g}, so {error}") from None

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            ValueError: a value is out of range, or values contradict each other; the text names it.
        """
        super().__post_init__()
        if self.candidates > self.arms:
            raise ValueError(f"candidates is {self.candidates}; expected 1 to {self.arms}")
        special = self.arm_mirrors + self.arm_tips + self.banked_arms
        if special >= self.arms:
            raise ValueError(f"arms is {self.arms}; expected more than the {special} special ones")
        if not self.fresh_torsos <= self.torso_explorers <= self.torsos:
            raise ValueError(
                "fresh_torsos, torso_explorers and torsos are "
                f"{self.fresh_torsos}, {self.torso_explorers}, {self.torsos}; expected each to be "
                "among the next ones"
            )
        if self.alike > self.survivors:
            raise ValueError(f"alike is {self.alike}; expected 1 to {self.survivors}")
        if self.best_torsos > self.torsos:
            raise ValueError(f"best_torsos is {self.best_torsos}; expected 1 to {self.torsos}")
        rated = self.arms // self.candidates
        for name in ("best_arms", "paired_arms"):
            if getattr(self, name) > rated:
                raise ValueError(
                    f"{name} is {getattr(self, name)}; expected 1 to {rated}, the number of rated "
                    f"arms: arms is {self.arms} and candidates {self.candidates}"
                )
        self.scaled()
