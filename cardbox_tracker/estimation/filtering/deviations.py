"""Learned standard deviations of a result's angles.

The spread of the particles measures the fit of other postures, not the errors of model, silhouette
and correction. A small neural network, trained on rendered recordings with ground truth, predicts
the size of the angles' errors from posture, spread and fit (``learning/deviations.py``; the data
file names the recordings). Its outputs are logarithms of deviations, scaled so that 95 % of the
errors of the recordings are below two deviations.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.filtering.networks import Network

DATA = "deviations.npz"
"""Data file of the network."""
TORSO = 3
"""Number of outputs for roll, pitch and yaw of the torso, which precede those of one arm."""
# Range of the deviations in the recordings, rad.
_LIMITS_RAD = (0.01, 1.5)


def deviations_of(network: Network, features: FloatArray) -> FloatArray:
    """Return the deviations (n, 11) of the angles ``JOINT_NAMES[1:]``, rad.

    Args:
        network: network of the data file.
        features: (n, 2, F), see :func:`~.result_features.features_of`.
    """
    logarithms = network(features.reshape(-1, features.shape[2]))
    stddevs = np.clip(np.exp(logarithms), *_LIMITS_RAD)
    both = stddevs.reshape(-1, 2, stddevs.shape[1])
    torso = both[:, :, :TORSO].mean(axis=1)
    return np.hstack([torso, both[:, 0, TORSO:], both[:, 1, TORSO:]])
