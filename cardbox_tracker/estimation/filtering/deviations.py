"""Learned standard deviations: how wrong results like this one are.

The spread of the particles says how well other postures would fit, not how wrong the model, the
silhouette and the correction of the result are. A small neural network has learned from rendered
recordings with ground truth how large the errors of the angles are on average, given the posture
found, the spread and the fit (``tools/make_deviations.py``; the data file names the recordings).
It answers with logarithms, of which the exponentials are deviations: 2 of them hold 95 % of the
errors of the recordings.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.filtering.networks import Network

DATA = "deviations.npz"
"""Name of the network's data file."""
TORSO = 3
"""The first answers are of roll, pitch and yaw of the torso, the others of one arm."""
# Beyond these, rad, the recordings say nothing.
_LIMITS_RAD = (0.01, 1.5)


def deviations_of(network: Network, features: FloatArray) -> FloatArray:
    """Return the deviations of the 11 angles of ``JOINT_NAMES[1:]``, (n, 11), rad.

    Args:
        network: of the data file.
        features: (n, 2, F), see :func:`~.result_features.features_of`.
    """
    logarithms = network(features.reshape(-1, features.shape[2]))
    stddevs = np.clip(np.exp(logarithms), *_LIMITS_RAD)
    both = stddevs.reshape(-1, 2, stddevs.shape[1])
    torso = both[:, :, :TORSO].mean(axis=1)
    return np.hstack([torso, both[:, 0, TORSO:], both[:, 1, TORSO:]])
