"""Comparison of the keypoints' states and probabilities of being wrong with their errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.person.skeleton import KeypointState
from cardbox_tracker.search.doubt import FAR_M

FloatArray = NDArray[np.float64]

KINDS = ("shoulder", "elbow", "hand")
"""Keypoints i and i + 3 are of the same kind."""
BINS = 10
"""Number of equal intervals of the probability in a reliability diagram."""


def compared(off_m: FloatArray, chances: FloatArray, states: NDArray[np.str_]) -> dict[str, Any]:
    """Return numbers of keypoints and of wrong ones, by kind, in each state and each interval.

    Args:
        off_m: errors of the keypoints beside the middle of the shoulders, (n, 6), m; nan where they
            are unknown.
        chances: probabilities of being off by more than ``FAR_M``, (n, 6); nan without states.
        states: (n, 6); empty without states.

    Returns:
        For each kind, ``states``: by state the number of keypoints and of wrong ones; ``bins``: for
        each interval of the probability the number of keypoints, the sum of their probabilities,
        and the number of wrong ones. Empty if no image has states.
    """
    known = np.isfinite(off_m).all(axis=1) & np.isfinite(chances).all(axis=1)
    if not known.any():
        return {}
    is_wrong = off_m[known] > FAR_M
    result = {}
    for first, kind in enumerate(KINDS):
        both = [first, first + len(KINDS)]
        wrong = is_wrong[:, both].ravel()
        said = chances[known][:, both].ravel()
        state = states[known][:, both].ravel()
        interval = np.minimum((BINS * said).astype(int), BINS - 1)
        result[kind] = {
            "states": {
                str(one): [int((state == one).sum()), int(wrong[state == one].sum())]
                for one in KeypointState
            },
            "bins": [
                [int(here.sum()), float(said[here].sum()), int(wrong[here].sum())]
                for here in (interval == number for number in range(BINS))
            ],
        }
    return result


def added(tables: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the sum of results of :func:`compared`; empty ones count as nothing."""
    given = [one for one in tables if one]
    if not given:
        return {}
    return {
        kind: {
            "states": {
                state: np.sum([one[kind]["states"][state] for one in given], axis=0).tolist()
                for state in given[0][kind]["states"]
            },
            "bins": np.sum([one[kind]["bins"] for one in given], axis=0).tolist(),
        }
        for kind in given[0]
    }
