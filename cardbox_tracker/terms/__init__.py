"""Terms of the cost of a posture: one file a cue, and the kernels that draw and rate.

A term is built for a body before a camera; what it observes in a frame rates states (N, n) with
costs (N,), px. ``silhouette`` defines the cost of equation (2) and implements it literally;
``compiled`` computes the same numbers fast. Compiled code consists of ``kinematics`` (state to
joints), patches (``cardbox_kernels`` for the paper's model, ``body_outline`` for the whole body),
``rasterisation`` (patches to columns of rows) and the pixels under any patch (``bit_masks``, of
``bit_planes``).
"""
