"""Compiled cue inside the outline: maps of a frame, arms in the image, and their gains."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from cardbox_tracker.camera.camera import NEAREST_M
from cardbox_tracker.common.compiling import kernel
from cardbox_tracker.person.kinematics import (
    angles_in,
    new_arm,
    pose_arm,
    side_of,
    state_pose,
    turn_arm,
)
from cardbox_tracker.person.parts import BOTTOM, FORWARD, HEAD, HEIGHT, TOP_WIDTH, TORSO, WAIST
from cardbox_tracker.terms.kernel_arguments import BodyTuple, Drawn, body_of

# Begin and end of the forearm's patch between elbow and fist, and its width in forearm widths; a
# wider patch would sample pixels outside of the forearm.
_BEGIN, _END, _WIDTH = 0.04, 0.76, 0.7
_POINTS = (6, 3)
# The hand's patch is nearly square; its middle lies before the forearm's end.
_HAND_LENGTH_M, _HAND_WIDTH_M, _HAND_BEFORE_END_M = 0.09, 0.075, 0.02
_HAND_POINTS = (4, 3)
# A hand this far behind the torso's middle, and within its width, is hidden.
_BEHIND_M = 0.03

_TORSO_ZONE, _HEAD_ZONE, _LOWER_ZONE = 0, 1, 2


Maps = tuple[Any, int, int]
"""Log-likelihood ratios (2, h, w), nats, of hand and forearm, and their first column and row."""

Forearm = tuple[float, float, float]
"""Length including the fist and width of a forearm, m; scale at the expected place of the person,
px/m, which areas use, so that a nearer state has no advantage."""

Pair = tuple[float, float]


@kernel
def torso_zones(state: Any, body: BodyTuple, zones: Any) -> None:
    """Write the places of head and torso of a state (14,) in the image: ``zones`` (6,), px.

    The values are the head's centre (u, v), the half axes of an ellipse around it, the row of the
    hips, and the row of the torso's top.
    """
    of = body_of(body)
    camera, head = of.camera, of.parts[HEAD]
    rotation, hip = np.empty((3, 3)), np.empty(3)
    state_pose(state, of.place, camera, rotation, hip)
    top = of.parts[TORSO, BOTTOM] + of.parts[TORSO, HEIGHT]
    heights = (head[BOTTOM] + 0.5 * head[HEIGHT], 0.6 * of.parts[WAIST, HEIGHT], top)
    for i in range(3):
        forward = head[FORWARD] if i == 0 else 0.0
        x = hip[0] + forward * rotation[0, 0] + heights[i] * rotation[0, 2]
        y = hip[1] + forward * rotation[1, 0] + heights[i] * rotation[1, 2]
        z = max(hip[2] + forward * rotation[2, 0] + heights[i] * rotation[2, 2], NEAREST_M)
        row = camera.fy * y / z + camera.cy
        if i == 0:
            per_m = camera.fx / z
            zones[0], zones[1] = camera.fx * x / z + camera.cx, row
            zones[2], zones[3] = 0.6 * head[TOP_WIDTH] * per_m, 0.6 * head[HEIGHT] * per_m
        elif i == 1:
            zones[4] = row
        else:
            zones[5] = row + 0.02 * per_m


@kernel
def ratio_maps(
    pixels: Any, inside: Any, steps_of_levels: Any, steps: int, ratios: Any, zones: Any, maps: Any
) -> None:
    """Write the log-likelihood ratios (2, h, w), nats, of hand and forearm against other parts.

    ``pixels`` are (h, w, channels), ``inside`` the silhouette (h, w); ``steps_of_levels``
    (channels, 256) maps levels to one of ``steps``. ``ratios`` (3, 2, bins) are by zone, hand or
    forearm, and bin; ``zones`` (6,) are in pixels of these arrays, see :func:`torso_zones`.
    """
    for v in range(maps.shape[1]):
        for u in range(maps.shape[2]):
            maps[0, v, u] = maps[1, v, u] = 0.0
            if inside[v, u] == 0:
                continue
            color = 0
            for c in range(pixels.shape[2]):
                color = color * steps + steps_of_levels[c, pixels[v, u, c]]
            zone = _LOWER_ZONE if v > zones[4] else _TORSO_ZONE
            a, b = (u - zones[0]) / zones[2], (v - zones[1]) / zones[3]
            # The neck, between head and torso's top, is skin, too.
            if a * a + b * b < 1.0 or (abs(a) < 0.8 and b > 0.0 and v < zones[5]):
                zone = _HEAD_ZONE
            maps[0, v, u] = ratios[zone, 0, color]
            maps[1, v, u] = ratios[zone, 1, color]


@kernel
def project_arms(states: Any, arm: int, body: BodyTuple, points: Any, hidden: Any) -> None:
    """Write the places of arms 0, left, or 1, right, of ``states`` (N, 14) in the image.

    ``points`` (N, 2, 3) has column, row and pixels per metre of elbow and hand (the forearm's end);
    ``hidden`` (N,) marks hands behind the trunk.
    """
    of = body_of(body)
    camera, side = of.camera, side_of(arm)
    rotation, hip, posed = np.empty((3, 3)), np.empty(3), new_arm()
    top = of.parts[TORSO, BOTTOM] + of.parts[TORSO, HEIGHT]
    for i in range(states.shape[0]):
        state_pose(states[i], of.place, camera, rotation, hip)
        angles = angles_in(states[i], arm)
        pose_arm(angles, side, of.parts, of.girdle, posed.points, posed.directions)
        turn_arm(posed, rotation, hip)
        for j in range(2):
            joint = posed.joints[1 + j]
            z = max(joint[2], NEAREST_M)
            points[i, j, 0] = camera.fx * joint[0] / z + camera.cx
            points[i, j, 1] = camera.fy * joint[1] / z + camera.cy
            points[i, j, 2] = camera.fx / z
        hand = posed.points[2]
        width = of.parts[TORSO if hand[2] < top else HEAD, TOP_WIDTH]
        hidden[i] = hand[0] < -_BEHIND_M and abs(hand[1]) < width / 2


@kernel
def _mean(ratios: Any, centre: Pair, half: Pair, aside: Pair, points: tuple[int, int]) -> float:
    """Return the mean of ``ratios`` (h, w) at ``points`` of a patch of half axes, px; 0 outside."""
    h, w = ratios.shape
    along, across = points
    total = 0.0
    for i in range(along):
        s = (2.0 * i + 1.0) / along - 1.0
        for j in range(across):
            t = (2.0 * j + 1.0) / across - 1.0
            x = int(centre[0] + s * half[0] + t * aside[0] + 0.5)
            y = int(centre[1] + s * half[1] + t * aside[1] + 0.5)
            if 0 <= x < w and 0 <= y < h:
                total += ratios[y, x]
    return total / (along * across)


@kernel
def arm_gains(
    points: Any,
    hidden: Any,
    maps: Maps,
    forearm: Forearm,
    weights: Any,
    gains: Any,
) -> None:
    """Write the gains (N,), px, of arms with the ``points`` and ``hidden`` of :func:`project_arms`.

    ``weights`` (2,) are those of a nat of hand and forearm, px of the outline.
    """
    ratios, u0, v0 = maps
    forearm_m, width_m, px_per_m = forearm
    for i in range(points.shape[0]):
        gains[i] = 0.0
        if hidden[i]:
            continue
        eu, ev = points[i, 0, 0] - u0, points[i, 0, 1] - v0
        hu, hv = points[i, 1, 0] - u0, points[i, 1, 1] - v0
        per_m = points[i, 1, 2]
        du, dv = hu - eu, hv - ev
        length = sqrt(du * du + dv * dv)
        au, av = (du / length, dv / length) if length > 1e-6 else (0.0, 1.0)
        along, across = 0.5 * _HAND_LENGTH_M * per_m, 0.5 * _HAND_WIDTH_M * per_m
        before = _HAND_BEFORE_END_M / forearm_m
        centre = (hu - before * du, hv - before * dv)
        half, aside = (au * along, av * along), (-av * across, au * across)
        hand = _mean(ratios[0], centre, half, aside, _HAND_POINTS)
        gains[i] += weights[0] * hand * _HAND_LENGTH_M * _HAND_WIDTH_M * px_per_m**2
        middle, reach = 0.5 * (_BEGIN + _END), 0.5 * (_END - _BEGIN)
        across = 0.5 * _WIDTH * width_m * per_m
        centre = (eu + middle * du, ev + middle * dv)
        half, aside = (reach * du, reach * dv), (-av * across, au * across)
        covered = _mean(ratios[1], centre, half, aside, _POINTS)
        # The length in the image counts, because a forearm that points to the camera covers less.
        area_m2 = _WIDTH * width_m * (_END - _BEGIN) * length / per_m
        gains[i] += weights[1] * covered * area_m2 * px_per_m**2


@kernel
def costs_of_arms(
    states: Any,
    counted: Drawn,
    body: BodyTuple,
    maps: Maps,
    forearm: Forearm,
    weights: Any,
    costs: Any,
) -> None:
    """Subtract the gains of the arms of states (N, 14) from ``costs`` (N,), px.

    ``counted`` says whether trunk, left arm and right arm count; ``weights`` are those of
    :func:`arm_gains`.
    """
    count = states.shape[0]
    points, hidden = np.empty((count, 2, 3)), np.empty(count, np.bool_)
    gains = np.empty(count)
    for arm in range(2):
        if counted[1 + arm]:
            project_arms(states, arm, body, points, hidden)
            arm_gains(points, hidden, maps, forearm, weights, gains)
            for i in range(count):
                costs[i] -= gains[i]
