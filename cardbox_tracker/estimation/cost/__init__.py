"""Cost of a posture: terms over one observation.

``silhouette`` defines the cost of equation (2) and implements it literally; ``compiled`` computes
the same numbers fast. Compiled code consists of ``kinematics`` (state to joints), patches
(``cardbox_kernels`` for the paper's model, ``body_outline`` for the whole body), ``rasterisation``
(patches to columns of rows) and the pixels under any patch: ``union``, from ``row_sums``, for the
paper's model, and ``bit_masks``, from ``bit_planes``, for the whole body.
``kernel_arguments`` converts body and camera to the arguments of the kernels.
"""
