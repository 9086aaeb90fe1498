"""Estimation of a posture: cost, resampling, particle filter, hierarchy, initialization."""
