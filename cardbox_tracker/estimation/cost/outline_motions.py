"""Compiled motions of the body's rigid segments, and normal equations of points that move along.

The segments are trunk, left upper arm, left forearm, right upper arm and right forearm. To first
order a point on their outline moves with its segment: where a round limb turns towards the camera,
its outline moves along the line of sight only. Each value of a state moves a segment and all those
beyond it as one rigid body, so its twist, six numbers in the optical frame, describes the motion of
all points. Sums over the points of a segment therefore suffice for the normal equations, as in the
composite rigid body algorithm (Featherstone, "Rigid Body Dynamics Algorithms", 2008).

With the twist (v, w) of :mod:`cardbox_tracker.body.kinematics`, a point's force f = d(distance)/dX
and torque X x f give the derivative of its distance by a value as f . v + (X x f) . w.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.body.kinematics import TWIST
from cardbox_tracker.body.posture import N_STATE
from cardbox_tracker.compiling import inlined_kernel, kernel
from cardbox_tracker.estimation.cost.body_outline import TRUNK_PATCHES
from cardbox_tracker.estimation.cost.kernel_arguments import Floats

SEGMENTS = 5
# The bar of a limb, and the square at its end.
_PATCHES_OF_LIMB = 2
# The nearest segment that a value moves, in the order of a state.
_MOVED = (0, 0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 0, 0)


@inlined_kernel
def segment_of(patch: int) -> int:
    """Return the segment of a patch."""
    return 0 if patch < TRUNK_PATCHES else 1 + (patch - TRUNK_PATCHES) // _PATCHES_OF_LIMB


@kernel
def add_moments(
    twists: Floats, sums: Floats, moments: Floats, matrix: Floats, right: Floats
) -> None:
    """Add the points of all segments to normal equations.

    Args:
        twists: of the values of a state, (14, 6).
        sums: weighted sums of distance * derivative of each segment, (5, 6); overwritten.
        moments: weighted sums of derivative * derivative, (5, 6, 6); overwritten.
        matrix: (14, 14), its lower triangle changes.
        right: (14,); changed.
    """
    # Forearms move with their upper arms, and these with the trunk.
    for part, whole in ((2, 1), (4, 3), (1, 0), (3, 0)):
        for a in range(TWIST):
            sums[whole, a] += sums[part, a]
            for b in range(TWIST):
                moments[whole, a, b] += moments[part, a, b]
    momentum = np.empty(TWIST)
    for i in range(N_STATE):
        moved = _MOVED[i]
        for a in range(TWIST):
            total = 0.0
            for b in range(TWIST):
                total += moments[moved, a, b] * twists[i, b]
            momentum[a] = total
            right[i] += twists[i, a] * sums[moved, a]
        for j in range(N_STATE):
            whole = _MOVED[j]
            if whole == moved:
                counts = j <= i
            else:
                counts = whole == 0 or (whole % 2 == 1 and moved == whole + 1)
            if counts:
                total = 0.0
                for a in range(TWIST):
                    total += momentum[a] * twists[j, a]
                matrix[max(i, j), min(i, j)] += total
