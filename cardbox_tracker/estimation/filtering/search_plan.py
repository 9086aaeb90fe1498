"""Parameters of the whole-body search that depend on the number of cameras.

Several outlines determine a posture better than one, so other steps are efficient
(``docs/research/two-cameras.md``).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation.filtering.whole_body_config import WholeBodyConfig

# Rounds of all joints: fraction of states that move by differences, and factor on the noise from
# one round to the next.
_DIFFERING, _ROUND_DECAY = 0.8, 0.8
# Factors on the numbers of proposed arms, of the best arms and of arms near them; proposed arms per
# rated one. With as few arms as one camera needs, some searches of several cameras fail.
_MORE_ARMS, _MORE_BEST, _NEAR_ARMS, _CANDIDATES = 4, 4 / 3, 0.6, 4


@dataclass(frozen=True)
class SearchPlan:
    """Parameters of the search of a frame.

    Attributes:
        config: settings of the filter.
        crosses: whether an upright person is proposed at the intersection of the lines of sight.
        fits_outlines: whether a few different states are fitted to all outlines by Gauss-Newton
            steps before all joints move together.
        keeps_result: whether the fitted result of a frame is among the survivors.
    """

    config: WholeBodyConfig
    crosses: bool = False
    fits_outlines: bool = False
    keeps_result: bool = False

    @classmethod
    def of(cls, config: WholeBodyConfig, cameras: int) -> SearchPlan:
        """Return the plan for settings and a number of cameras.

        Raises:
            CardboxError: there would be more arms than are allowed.
        """
        if cameras == 1:
            return cls(config)
        config = replace(
            _with_more_arms(config),
            smoothing=config.smoothing / 3,
            round_decay=max(config.round_decay, _ROUND_DECAY),
            differing=max(config.differing, _DIFFERING),
        )
        return cls(config, crosses=True, fits_outlines=True, keeps_result=True)


def _with_more_arms(config: WholeBodyConfig) -> WholeBodyConfig:
    try:
        return replace(
            config,
            candidates=_CANDIDATES,
            arms=_MORE_ARMS * config.arms,
            arm_mirrors=_MORE_ARMS * config.arm_mirrors,
            arm_tips=_MORE_ARMS * config.arm_tips,
            banked_arms=_MORE_ARMS * config.banked_arms,
            best_arms=int(_MORE_BEST * config.best_arms),
            arms_again=_MORE_ARMS * max(int(_NEAR_ARMS * config.arms_again), 1),
        )
    except ValueError as error:
        text = f"several cameras propose {_MORE_ARMS} times as many arms, so {error}"
        raise CardboxError(text) from None
