"""Learned standard deviations of a result's angles.

The spread of the particles measures the fit of other postures, not the errors of model, silhouette
and correction. A small neural network, trained on rendered recordings with ground truth, predicts
the size of the angles' errors from posture, spread and fit (``learning/deviations.py``; the data
file names the recordings). Its outputs are logarithms of deviations, scaled so that 95 % of the
errors of the recordings are below two deviations.
"""

from __future__ import annotations

from math import exp

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.compiling import kernel
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
    of_arm = logarithms.shape[1] - TORSO
    deviations_rad = np.empty((len(features), TORSO + 2 * of_arm))
    _join(logarithms, deviations_rad)
    return deviations_rad


@kernel
def _join(logarithms: FloatArray, deviations_rad: FloatArray) -> None:
    """Write the deviations of torso, left and right arm from the answers (2 n, A) for both arms."""
    low_rad, high_rad = _LIMITS_RAD
    of_arm = logarithms.shape[1] - TORSO
    for n in range(deviations_rad.shape[0]):
        row = deviations_rad[n]
        row[:] = 0.0
        for arm in range(2):
            for i in range(logarithms.shape[1]):
                one_rad = min(max(exp(logarithms[2 * n + arm, i]), low_rad), high_rad)
                if i < TORSO:
                    row[i] += 0.5 * one_rad
                else:
                    row[i + of_arm * arm] = one_rad
