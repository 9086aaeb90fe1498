"""Compiled ratings of whole bodies.

The rating of a state (14,) is a share of the silhouette:

    rating = (pixels in which model and silhouette differ) / (pixels of the silhouette) + priors

The pixels are those of equation (2), with the outlines of
:mod:`cardbox_tracker.terms.body_outline` in place of the cardbox; the priors are those of
:mod:`cardbox_tracker.terms.body_priors`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cardbox_tracker.common.compiling import (
    borrowing_kernel,
    inlined_allocation,
    inlined_kernel,
    kernel,
)
from cardbox_tracker.person.kinematics import (
    PosedArm,
    angles_in,
    new_arm,
    pose_arm,
    side_of,
    state_pose,
    turn_arm,
)
from cardbox_tracker.terms.bit_masks import Masks, cover_masks, new_masks, sum_masks
from cardbox_tracker.terms.bit_planes import Planes
from cardbox_tracker.terms.body_outline import ARM_PATCHES, TRUNK_PATCHES, place_arm, place_trunk
from cardbox_tracker.terms.body_priors import Prior, PriorTuple, arm_prior, torso_prior
from cardbox_tracker.terms.kernel_arguments import Body, BodyTuple, Drawn, Floats, body_of
from cardbox_tracker.terms.rasterisation import Workspace, draw, new_workspace


class Observed(NamedTuple):
    """A silhouette, or the part of it outside of parts that are already drawn."""

    planes: Planes  #: pixels that count, and foreground, (2, words, rows); see :mod:`.bit_planes`
    rows: int  #: number of rows that count, from the top
    width: int  #: width of the image, px
    base_px: int  #: cost without further parts, px
    scale: float  #: 1 / (pixels of the silhouette)


class Points(NamedTuple):
    """Shoulder, elbow and hand of the left, then of the right arm of N states."""

    joints_m: Floats  #: in the torso's frame, (N, 6, 3), metres
    keypoints_m: Floats  #: in the optical frame, (N, 6, 3), metres


ObservedTuple = tuple[Planes, int, int, int, float]
PointsTuple = tuple[Floats, Floats]


class Scratch(NamedTuple):
    """Scratch arrays of the ratings."""

    work: Workspace  #: for the drawn patches
    arm: PosedArm  #: for one arm
    masks: Masks  #: for the union of the patches
    logs: Floats  #: one value for each Gaussian of the prior, (K,)


@inlined_allocation
def new_scratch(patches: int, seen: Observed, given: Prior) -> Scratch:
    """Return the scratch arrays for a number of patches."""
    return Scratch(
        new_workspace(patches, seen.planes.shape[2]),
        new_arm(),
        new_masks(patches, seen.planes),
        np.empty(given.gaussians.shape[1]),
    )


@inlined_kernel
def _copy(points: Floats, written: Floats) -> None:
    """Copy points (3, 3)."""
    for i in range(3):
        for j in range(3):
            written[i, j] = points[i, j]


@inlined_kernel
def _place_arms(
    states: Floats,
    i: int,
    p: int,
    rated: float,
    of: Body,
    given: Prior,
    scratch: Scratch,
    points: Points,
) -> float:
    """Write both arms of a state, their patches from ``p`` on; return ``rated`` + their priors."""
    work, arm = scratch.work, scratch.arm
    for k in range(2):
        angles, side = angles_in(states[i], k), side_of(k)
        pose_arm(angles, side, of.parts, of.girdle, arm.points, arm.directions)
        turn_arm(arm, work.torso, work.hip)
        place_arm(arm, p + ARM_PATCHES * k, of.drawn, work.corners)
        _copy(arm.points, points.joints_m[i, 3 * k : 3 * k + 3])
        _copy(arm.joints, points.keypoints_m[i, 3 * k : 3 * k + 3])
        rated += arm_prior(arm, side, of.parts, given, scratch.logs)
    return rated


@kernel
def rate_arms(
    arms: Floats,
    side: float,
    torso: Floats,
    body: BodyTuple,
    observed: ObservedTuple,
    prior: PriorTuple,
    ratings: Floats,
    joints_m: Floats,
) -> None:
    """Write ratings (N,) of one arm (N, 4) beside the trunk of the state ``torso`` (14,).

    ``observed`` is the silhouette with that trunk drawn; ``side`` is 1 for left, -1 for right.
    Shoulder, elbow and hand in the torso's frame are written to ``joints_m`` (N, 3, 3).
    """
    seen, given = Observed(*observed), Prior(*prior)
    scratch = new_scratch(ARM_PATCHES, seen, given)
    _rate_arms(arms, side, torso, body_of(body), seen, given, scratch, ratings, joints_m)


@borrowing_kernel
def _rate_arms(
    arms: Floats,
    side: float,
    torso: Floats,
    of: Body,
    seen: Observed,
    given: Prior,
    scratch: Scratch,
    ratings: Floats,
    joints_m: Floats,
) -> None:
    work, arm = scratch.work, scratch.arm
    state_pose(torso, of.place, of.camera, work.torso, work.hip)
    for i in range(arms.shape[0]):
        pose_arm(arms[i], side, of.parts, of.girdle, arm.points, arm.directions)
        turn_arm(arm, work.torso, work.hip)
        place_arm(arm, 0, of.drawn, work.corners)
        _copy(arm.points, joints_m[i])
        has_cuts = draw(work, of.camera, seen.rows, seen.width)
        gain = sum_masks(work, has_cuts, seen.width, seen.planes, scratch.masks)[0]
        rated = arm_prior(arm, side, of.parts, given, scratch.logs)
        ratings[i] = (seen.base_px + gain) * seen.scale + rated


@kernel
def rate_bodies(
    states: Floats,
    drawn: tuple[bool, bool],
    body: BodyTuple,
    observed: ObservedTuple,
    prior: PriorTuple,
    ratings: Floats,
    pixels: tuple[Floats, Floats],
    points: PointsTuple,
) -> None:
    """Write ratings (N,) of states (N, 14), their pixels, and the points of their arms.

    ``drawn`` says whether trunks and arms are drawn. Without trunks, ``observed`` is the silhouette
    with that of the first state drawn, which all states have; without arms, no points are written.
    ``body``, ``observed``, ``prior`` and ``points`` are fields of :class:`~.kernel_arguments.Body`,
    :class:`Observed`, :class:`~.body_priors.Prior` and :class:`Points`. ``pixels`` (N,) each are
    those in which model and silhouette differ, and of the model.
    """
    seen, given = Observed(*observed), Prior(*prior)
    scratch = new_scratch(TRUNK_PATCHES * drawn[0] + 2 * ARM_PATCHES * drawn[1], seen, given)
    of, into = body_of(body), Points(*points)
    _rate_bodies(states, drawn, of, seen, given, scratch, ratings, pixels, into)


@borrowing_kernel
def _rate_bodies(
    states: Floats,
    drawn: tuple[bool, bool],
    of: Body,
    seen: Observed,
    given: Prior,
    scratch: Scratch,
    ratings: Floats,
    pixels: tuple[Floats, Floats],
    points: Points,
) -> None:
    work = scratch.work
    costs_px, areas_px = pixels
    has_trunk, has_arms = drawn
    of_torso = 0.0
    for i in range(states.shape[0]):
        if has_trunk or i == 0:
            state_pose(states[i], of.place, of.camera, work.torso, work.hip)
            of_torso = torso_prior(states[i], given)
        if has_trunk:
            place_trunk(work, of.drawn)
        rated = of_torso
        if has_arms:
            p = TRUNK_PATCHES * has_trunk
            rated = _place_arms(states, i, p, rated, of, given, scratch, points)
        has_cuts = draw(work, of.camera, seen.rows, seen.width)
        gain, area = sum_masks(work, has_cuts, seen.width, seen.planes, scratch.masks)
        costs_px[i] = seen.base_px + gain
        areas_px[i] = area
        ratings[i] = costs_px[i] * seen.scale + rated


@kernel
def cover(
    state: Floats,
    drawn: Drawn,
    body: BodyTuple,
    size: tuple[int, int],
    planes: Planes,
    covered: Planes,
) -> int:
    """Write the planes outside of the ``drawn`` parts of a state; return the gain of the parts.

    The gain is the sum of (1 - 2 f) under these parts; ``size`` is the rows that count, and the
    width.
    """
    of = body_of(body)
    has_trunk, has_left, has_right = drawn
    rows, width = size
    patches = TRUNK_PATCHES * has_trunk + ARM_PATCHES * (int(has_left) + int(has_right))
    work, arm = new_workspace(patches, planes.shape[2]), new_arm()
    masks = new_masks(patches, planes)
    state_pose(state, of.place, of.camera, work.torso, work.hip)
    p = 0
    if has_trunk:
        place_trunk(work, of.drawn)
        p = TRUNK_PATCHES
    for k in range(2):
        if drawn[1 + k]:
            angles = angles_in(state, k)
            pose_arm(angles, side_of(k), of.parts, of.girdle, arm.points, arm.directions)
            turn_arm(arm, work.torso, work.hip)
            place_arm(arm, p, of.drawn, work.corners)
            p += ARM_PATCHES
    has_cuts = draw(work, of.camera, rows, width)
    gain = sum_masks(work, has_cuts, width, planes, masks)[0]
    cover_masks(masks, planes, covered)
    return gain
