"""Compiled motions of the body's rigid segments, from which all Jacobians follow.

The segments are trunk, left upper arm, left forearm, right upper arm and right forearm. To first
order a point on their outline moves with its segment: where a round limb turns towards the camera,
its outline moves along the line of sight only. Each value of a state moves a segment and all those
beyond it as one rigid body, so its twist, six numbers in the optical frame, describes the motion of
all points.

With the twist (v, w) of :mod:`cardbox_tracker.person.kinematics`, a point's force
f = d(distance)/dX and torque X x f give the derivative of its distance by a value as
f . v + (X x f) . w.
"""

from __future__ import annotations

from cardbox_tracker.common.compiling import inlined_kernel, kernel
from cardbox_tracker.person.kinematics import state_twists
from cardbox_tracker.terms.body_outline import TRUNK_PATCHES
from cardbox_tracker.terms.kernel_arguments import BodyTuple, Floats, body_of

# The bar of a limb, and the square at its end.
_PATCHES_OF_LIMB = 2
# The nearest segment that a value moves, in the order of a state.
_MOVED = (0, 0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 0, 0)


@inlined_kernel
def segment_of(patch: int) -> int:
    """Return the segment of a patch."""
    return 0 if patch < TRUNK_PATCHES else 1 + (patch - TRUNK_PATCHES) // _PATCHES_OF_LIMB


@inlined_kernel
def moves(value: int, segment: int) -> bool:
    """Return whether a value of a state moves a segment."""
    nearest = _MOVED[value]
    return nearest == segment or nearest == 0 or (nearest % 2 == 1 and segment == nearest + 1)


@inlined_kernel
def write_velocity(twist: Floats, point: Floats, velocity: Floats) -> None:
    """Write the velocity v + w x X (3,) of a point X (3,) that moves with a twist (v, w), (6,)."""
    velocity[0] = twist[0] + twist[4] * point[2] - twist[5] * point[1]
    velocity[1] = twist[1] + twist[5] * point[0] - twist[3] * point[2]
    velocity[2] = twist[2] + twist[3] * point[1] - twist[4] * point[0]


@kernel
def write_twists(state: Floats, body: BodyTuple, twists: Floats) -> None:
    """Write the twists (14, 6) of the values of ``state`` (14,), in the optical frame."""
    state_twists(state, body_of(body), twists)
