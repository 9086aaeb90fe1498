"""Parameters of the whole-body search that depend on the number of cameras.

Several outlines determine a posture better than one, so other steps are efficient
(``docs/research/two-cameras.md``).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from cardbox_tracker.estimation.filtering.whole_body_config import WholeBodyConfig

# Rounds of all joints: fraction of states that move by differences, and factor on the noise from
# one round to the next.
_DIFFERING, _ROUND_DECAY = 0.8, 0.8
# Fraction of the arms near the best ones that suffices if the most promising arms are selected.
_NEAR_ARMS = 0.6


@dataclass(frozen=True)
class SearchPlan:
    """Parameters of the search of a frame.

    Attributes:
        config: settings of the filter.
        candidates: number of proposed arms per rated arm.
        crosses: whether an upright person is proposed at the intersection of the lines of sight.
        fits_outlines: whether a few different states are fitted to all outlines by Gauss-Newton
            steps before all joints move together.
        keeps_result: whether the fitted result of a frame is among the survivors.
    """

    config: WholeBodyConfig
    candidates: int = 1
    crosses: bool = False
    fits_outlines: bool = False
    keeps_result: bool = False

    @classmethod
    def of(cls, config: WholeBodyConfig, cameras: int) -> SearchPlan:
        """Return the plan for settings and a number of cameras."""
        if cameras == 1:
            return cls(config)
        config = replace(
            config,
            arms_again=max(int(_NEAR_ARMS * config.arms_again), 1),
            smoothing=config.smoothing / 3,
            round_decay=max(config.round_decay, _ROUND_DECAY),
            differing=max(config.differing, _DIFFERING),
        )
        return cls(config, candidates=4, crosses=True, fits_outlines=True, keeps_result=True)
