"""Settings of the whole-body filter, and the constants of its search."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from cardbox_tracker.common.settings import Settings, restarting
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig

# Numbers of states that `effort` scales, and their least values. Totals are rounded up and parts
# down, so that parts do not exceed their totals.
_LEAST_TOTALS = MappingProxyType(
    {"survivors": 4, "torsos": 2, "arms": 6, "arms_again": 1, "together": 2, "average": 1}
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
class SearchProfile:
    """Constants of the search; ``docs/architecture.md`` explains the stages.

    The values were chosen on recorded sessions with ground truth (``docs/research.md#search``).
    """

    survivors: int = 32  #: states kept from frame to frame
    alike: int = 12  #: survivors that may be similar; each other one differs from all better ones
    apart_m: float = 0.12  #: least distance of different survivors, m
    torsos: int = 70  #: torsos that are rated
    torso_explorers: int = 16  #: number of the torsos that bow or turn by any angle
    #: number of the torso_explorers that stand upright at the place of the silhouette; at first,
    #: all of them do.
    fresh_torsos: int = 8
    #: best torsos that are rated with arms, both moved along and fixed in space.
    best_torsos: int = 12
    arms: int = 90  #: arms that are proposed per side
    #: proposed arms per rated arm, which is the most promising of them; 1: all are rated. Several
    #: cameras propose four times as many arms and rate a quarter of them.
    candidates: int = 3
    arm_mirrors: int = 8  #: number of the arms that are survivors mirrored in depth
    #: number of the arms that reach for foreground that the model leaves uncovered.
    arm_tips: int = 10
    banked_arms: int = 20  #: number of the arms that are drawn from the learned prior
    best_arms: int = 15  #: best arms around which others are proposed
    arms_again: int = 51  #: arms that are proposed around the best ones
    paired_arms: int = 12  #: best arms of either side that are combined
    rounds: int = 2  #: rounds in which all joints move together
    together: int = 36  #: states in such a round
    # Differences of survivors follow flat directions of the cost (Storn & Price,
    # "Differential Evolution", 1997).
    differing: float = 0.4  #: fraction of these states that move by the difference of two others
    difference_scale: float = 0.6  #: factor on such a difference
    y_noise_m: float = 0.02  #: noise of the torso's y, m
    roll_noise_rad: float = 0.08  #: noise of the torso's roll, rad
    pitch_noise_rad: float = 0.08  #: noise of the torso's pitch, rad
    yaw_noise_rad: float = 0.10  #: noise of the torso's yaw, rad
    x_noise_m: float = 0.02  #: noise of the torso's x, m
    z_noise_m: float = 0.01  #: noise of the torso's z, m
    arm_noise_rad: float = 0.22  #: noise of an arm's angles, rad
    together_noise: float = 0.3  #: factor on the noise of the first round of all joints
    round_decay: float = 0.6  #: factor on the noise from one round to the next
    home_rate: float = 0.02  #: weight of a frame in the low-pass filter of the torso's usual x
    average: int = 150  #: best states whose weighted mean is the result
    #: difference to the best rating, as a fraction of the silhouette's pixels, at which the weight
    #: of a state is 1/e.
    spread: float = 0.02
    #: Gauss-Newton steps that fit the result to the outlines; twice as many if there are cues that
    #: tell where joints are.
    refining_steps: int = 2
    start_passes: int = 3  #: searches in the first silhouette of a person
    smoothing: float = 1.0  #: factor on the setting ``smoothing``

    def noise(self) -> FloatArray:
        """Return the standard deviations (14,) of a state's noise, metres and rad."""
        torso = [self.y_noise_m, self.roll_noise_rad, self.pitch_noise_rad, self.yaw_noise_rad]
        return np.array([*torso, *[self.arm_noise_rad] * 8, self.x_noise_m, self.z_noise_m])

    def scaled(self, effort: float) -> SearchProfile:
        """Return the constants with ``effort`` times as many states."""
        if effort == 1.0:
            return self
        totals: dict[str, Any] = {
            name: max(least, math.ceil(effort * getattr(self, name)))
            for name, least in _LEAST_TOTALS.items()
        }
        parts: dict[str, Any] = {
            name: max(least, int(effort * getattr(self, name)))
            for name, least in _LEAST_PARTS.items()
        }
        return replace(self, **totals, **parts)


ONE_CAMERA = SearchProfile()
SEVERAL_CAMERAS = replace(
    ONE_CAMERA,
    candidates=4,
    arms=360,
    arm_mirrors=32,
    arm_tips=40,
    banked_arms=80,
    best_arms=20,
    arms_again=120,
    differing=0.8,
    round_decay=0.8,
    smoothing=1.0 / 3.0,
)
"""Several outlines determine a posture better than one, so other steps are efficient: with as few
arms as one camera needs, some searches fail (``docs/research.md#several-cameras``)."""


@dataclass(frozen=True)
class WholeBodyConfig(Settings):
    """Settings of the whole-body filter."""

    cost: WholeBodyCostConfig = WholeBodyCostConfig()  #: constants of the rating
    #: constants of the search; None for those of the number of cameras
    profile: SearchProfile | None = None
    effort: float = restarting(
        1.0,
        "factor on all numbers of states; more states are slower and more accurate",
        limits=(0.25, 4.0),
    )
    # Larger values delay fast hands.
    smoothing: float = restarting(
        0.3,
        "weight of the last result in the next one",
        limits=(0.0, 0.99),
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

    def profile_for(self, cameras: int) -> SearchProfile:
        """Return the constants of the search for a number of cameras."""
        return self.profile or (ONE_CAMERA if cameras == 1 else SEVERAL_CAMERAS)
