"""What the whole-body filter does differently with one camera and with several: all of it here.

Several outlines leave less of the fit flat than one, so other steps are worth their time.
``docs/research/two-cameras.md`` says what was tried.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from cardbox_tracker.estimation.filtering.whole_body_config import WholeBodyConfig

# Of the rounds of all joints: the fraction of states that moves by differences, and how the noise
# shrinks from one round to the next.
_DIFFERING, _ROUND_DECAY = 0.8, 0.8
# Share of the arms near the best ones that does as well as all of them where the most promising are
# chosen.
_NEAR_ARMS = 0.6


@dataclass(frozen=True)
class SearchPlan:
    """How a frame is searched.

    Attributes:
        config: settings of the filter.
        candidates: arms that are proposed for each one that is rated.
        crosses: somebody upright is looked for where the lines of sight meet.
        fits_outlines: before all joints move together, a few states that differ are fitted to all
            outlines by Gauss-Newton steps.
        keeps_result: the fitted result of a frame is among the survivors.
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
