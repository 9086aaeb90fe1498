"""Answers of the correcting network to the images of a recording."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.estimation.filtering.correction import (
    DISPLACEMENTS,
    DOUBT,
    LOG_ODDS,
    MIDDLE_Z,
    limited,
    moved,
)
from cardbox_tracker.estimation.filtering.networks import RecurrentNetwork
from learning.samples import Samples

FloatArray = NDArray[np.float64]


def answers_of(
    network: RecurrentNetwork, samples: Samples, doubt: float = DOUBT
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield for each image the corrected keypoints (6, 3), m, and their log-odds of error (6,).

    This does what the tracker's corrector does, but for the bound by the silhouette.

    Args:
        network: answers displacements and log-odds.
        samples: the recording.
        doubt: see :func:`~cardbox_tracker.estimation.filtering.correction.limited`.
    """
    hidden = network.initial_hidden(2)
    for features, found_m in zip(samples.features, samples.found_m, strict=True):
        answers, spread, hidden = network(np.asarray(features, np.float64), hidden)
        answers_m = limited(answers[:, DISPLACEMENTS], spread[:, DISPLACEMENTS], doubt)
        if samples.origin.is_measured:
            answers_m[:, MIDDLE_Z] = 0.0
        yield moved(np.asarray(found_m, np.float64), answers_m), answers[:, LOG_ODDS].ravel()
