"""How well a posture explains what was observed: terms over one observation.

``silhouette`` defines the cost of equation (2) and implements it as it reads. ``compiled`` gives
the same numbers, fast: with ``row_sums`` of the silhouette, and ``kernels`` that take body and
camera as ``kernel_arguments`` makes them.
"""
