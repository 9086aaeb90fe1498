"""Calibration of the log-odds that a corrected keypoint is wrong, and its check.

python -m learning.odds SAMPLES... --output docs/evaluation/simulated-states.json

SAMPLES are recordings that the package's network was not trained with. The command writes how the
probabilities and states of keypoints agree with the truth, for ``tools.keypoint_states``.

A network knows its own recordings too well, so its log-odds there are too sure. On recordings that
it was not trained with, a logistic regression for each keypoint finds the factor and the constant
that make its probabilities true (Platt 1999). They become part of the network's last layer.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.linear_model import LogisticRegression

from cardbox_tracker.estimation.filtering.correction import DATA as NETWORK
from cardbox_tracker.estimation.filtering.correction import FAR_M, LOG_ODDS
from cardbox_tracker.estimation.filtering.keypoint_states import HANDS, are_sure, states_of
from cardbox_tracker.estimation.filtering.networks import RecurrentNetwork, load_recurrent_network
from cardbox_tracker.evaluation.recorded.keypoint_states import compared
from cardbox_tracker.evaluation.results import write_json
from learning.answers import answers_of
from learning.command_line import run
from learning.samples import Samples, load_all

FloatArray = NDArray[np.float64]


def odds_of(network: RecurrentNetwork, samples: Samples) -> tuple[FloatArray, FloatArray]:
    """Return log-odds (n, 6) and distances from the truth (n, 6), m, where this is known."""
    corrected_m, log_odds = map(np.array, zip(*answers_of(network, samples), strict=True))
    off_m = np.linalg.norm(corrected_m - samples.true_m, axis=2)
    known = np.isfinite(samples.true_m).all(axis=(1, 2))
    return log_odds[known], off_m[known]


def calibrated(network: RecurrentNetwork, samples: Sequence[Samples]) -> RecurrentNetwork:
    """Return the network with calibrated log-odds; keypoints that are never wrong stay as said.

    Args:
        network: answers displacements and log-odds.
        samples: recordings that it was not trained with.
    """
    both = [odds_of(network, one) for one in samples]
    log_odds = np.concatenate([one for one, _ in both]).reshape(-1, 3)
    is_wrong = np.concatenate([one for _, one in both]).reshape(-1, 3) > FAR_M
    first, (weights, biases) = network.output_layers
    weights, biases = weights.copy(), biases.copy()
    for joint, column in enumerate(range(*LOG_ODDS.indices(len(network.unit)))):
        wrong = is_wrong[:, joint]
        if wrong.all() or not wrong.any():
            continue
        fit = LogisticRegression(C=np.inf).fit(log_odds[:, joint, None], wrong)
        # A negative factor would be chance, and would turn the meaning round.
        factor, constant = max(float(fit.coef_[0, 0]), 0.0), float(fit.intercept_[0])
        weights[:, :, column] *= factor
        biases[:, :, column] = factor * biases[:, :, column] + constant
    return network._replace(output_layers=(first, (weights, biases)))


def figures_of(network: RecurrentNetwork, samples: Sequence[Samples]) -> dict[str, Any]:
    """Return figures of recordings as ``cardbox evaluate`` has them, without hidden keypoints."""
    both = [odds_of(network, one) for one in samples]
    chances = 1.0 / (1.0 + np.exp(-np.concatenate([one for one, _ in both])))
    off_m = np.concatenate([one for _, one in both])
    seen = np.zeros(off_m.shape[1], dtype=np.bool_)
    states = np.array([states_of(one, seen) for one in chances])
    is_tracking = np.array([are_sure(one[HANDS]) for one in chances])
    return {
        "frames": len(off_m),
        "states": {"tracking": int(is_tracking.sum())},
        "far_but_tracking": int((is_tracking & (off_m.mean(axis=1) > FAR_M)).sum()),
        "hand_far_but_tracking": int((is_tracking & (off_m[:, HANDS] > FAR_M).any(axis=1)).sum()),
        "keypoint_states": compared(off_m, chances, states),
    }


def main(args: list[str] | None = None) -> int:
    """Compare and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("samples", nargs="+", type=Path)
    parser.add_argument("--output", type=Path, required=True)
    given = parser.parse_args(args)
    network, samples = load_recurrent_network(NETWORK), load_all(given.samples)
    groups = {
        "measured": [one for one in samples if one.origin.is_measured],
        "unmeasured": [one for one in samples if not one.origin.is_measured],
    }
    found = {name: figures_of(network, group) for name, group in groups.items() if group}
    write_json({"recordings": len(samples), "groups": found}, given.output)
    print(f"written: {given.output}")
    return 0


if __name__ == "__main__":
    sys.exit(run(main))
