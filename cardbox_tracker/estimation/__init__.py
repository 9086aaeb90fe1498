"""How a posture is found: cost, resampling, particle filter, hierarchy, initialization."""
