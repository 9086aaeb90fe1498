"""A logistic regression of the chance that a result is wrong, on features of any size."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

# Beyond it the chance is 0 or 1, and the exponential could overflow.
_LARGEST_LOGIT = 50.0


def fitted(
    features: FloatArray, is_wrong: BoolArray, weights: FloatArray, inverse_penalty: float
) -> FloatArray:
    """Return intercept and coefficients (1 + F,); wrong and right frames weigh alike as a whole.

    Args:
        features: features of n frames, (n, F).
        is_wrong: whether each frame is wrong, (n,).
        weights: weights of the frames among the wrong ones, or among the right ones, (n,).
        inverse_penalty: weight of the data against the penalty on coefficients.

    Raises:
        ValueError: all frames are right, or all wrong.
    """
    if is_wrong.all() or not is_wrong.any():
        raise ValueError("all frames are of one class")
    shares = [float(weights[is_wrong == one].sum()) for one in (False, True)]
    balanced = weights / np.array(shares)[is_wrong.astype(int)]
    balanced *= len(balanced) / balanced.sum()
    model = make_pipeline(
        StandardScaler(), LogisticRegression(C=inverse_penalty, max_iter=1000)
    ).fit(features, is_wrong, logisticregression__sample_weight=balanced)
    scaler, regression = model[0], model[1]
    coefficients = regression.coef_[0] / scaler.scale_
    return np.array([regression.intercept_[0] - coefficients @ scaler.mean_, *coefficients])


def chances(coefficients: FloatArray, features: FloatArray) -> FloatArray:
    """Return the chance (n,) that intercept and coefficients (1 + F,) give to features (n, F)."""
    logits = coefficients[0] + features @ coefficients[1:]
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(logits, -_LARGEST_LOGIT, _LARGEST_LOGIT))))
