"""How well a posture explains what was observed: terms over one observation.

``silhouette`` defines the cost of equation (2) and implements it as it reads; ``compiled`` and
``kernels`` give the same numbers, fast.
"""
