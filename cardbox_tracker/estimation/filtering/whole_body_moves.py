"""Compiled proposals of the whole-body filter: where to look next, from what has fitted so far.

Nothing here looks at an image; every random number is an argument, unit normal or uniform in 0..1.
States are (14,) and arms (4,) as in
:mod:`cardbox_tracker.estimation.cost.whole_body_kernels`, whose functions are used here: who
changes that file has to delete the cache of this one's compiled code.
"""

from __future__ import annotations

from math import cos, exp, pi, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.compiling import njit
from cardbox_tracker.estimation.cost.kernels import Floats, Place, PlaceTuple, View, ViewTuple
from cardbox_tracker.estimation.cost.row_sums import RowSums
from cardbox_tracker.estimation.cost.whole_body_kernels import (
    ARM_ANGLES,
    FOREARM,
    HEIGHT,
    LEFT_ARM,
    N_STATE,
    PITCH,
    RIGHT_ARM,
    ROLL,
    TORSO_X,
    TORSO_Y,
    UPPER_ARM,
    YAW,
    _pose,
    _pose_arm,
    angles_of_arm,
)

_compile = njit(cache=True, nogil=True, error_model="numpy")
_inline = njit(cache=True, nogil=True, error_model="numpy", forceinline=True)

# Explorers of the torso: half of them bow by this range, two fifths turn anywhere, the others turn
# to the other side; all of them move towards the camera or away with this deviation, m.
_BOW_FROM_RAD, _BOW_RANGE_RAD = -5.0 * pi / 180.0, 60.0 * pi / 180.0
_BOWING, _BOWING_OR_TURNING = 0.5, 0.9
_EXPLORERS_X_M = 0.06
# Of the torsos that stand upright where the silhouette is, this part is turned anywhere, as people
# are who walk in; the others face the camera with this deviation, rad.
_FRESH_TURNED, _FRESH_YAW_RAD = 0.5, 0.3
# An arm that reaches for a pixel is bent so far at most that shoulder and hand are this far apart
# beyond the difference of its bones, and never quite straight; m.
_FOLDED_M, _STRETCHED_M = 0.05, 0.001
# The nearer one of the two points at a distance is taken so often: people gesture to the front.
_NEARER = 0.8
# An elbow hangs down and outwards: the direction (forwards, outwards, up) it has without a turn.
_ELBOW_HANGS = (-0.2, 0.4, -1.0)
_ELBOW_TURNS_RAD = 1.2 * pi
# In a round of all joints, this part of the noise stays in a move by a difference.
_NOISE_OF_DIFFERENCE = 0.2
# Metres that a radian of yaw or pitch counts when states are compared.
_RADIAN_M = 0.3
Indices = NDArray[np.int64]


@_inline
def _clip(state: Floats, limits: Floats) -> None:
    """Move a state (14,) into its ``limits`` (14, 2)."""
    for d in range(N_STATE):
        state[d] = min(max(state[d], limits[d, 0]), limits[d, 1])


@_inline
def _pivot(state: Floats, source: Floats, lever_m: float) -> None:
    """Let the torso turn about the shoulders, ``lever_m`` above the hips, instead of the hips."""
    state[TORSO_Y] += lever_m * (sin(state[ROLL]) - sin(source[ROLL]))
    state[TORSO_X] -= lever_m * (sin(state[PITCH]) - sin(source[PITCH]))


@_compile
def propose_torsos(
    survivors: Floats,
    sigma: Floats,
    lever_m: float,
    explorers: int,
    fresh: int,
    fresh_state: Floats,
    fresh_x_m: float,
    sight: float,
    step_m: float,
    distance_m: float,
    limits: Floats,
    normals: Floats,
    uniforms: Floats,
) -> Floats:
    """Return states (N, 14) with new torsos around ``survivors`` (M, 14), whose arms they keep.

    Every second one turns about the shoulders; half of either kind moves by ``step_m``, as far as
    the silhouette did: somebody walking makes more way than the noise does. The last ``explorers``
    bow, turn or turn over; the last ``fresh`` of them are ``fresh_state`` (14,) with other x and
    yaw, where the direction of ``sight``, aside over ahead, is. ``normals`` are (N, 14),
    ``uniforms`` (N, 2).
    """
    n = normals.shape[0]
    states = np.empty((n, N_STATE))
    for i in range(n):
        source, state = survivors[i % survivors.shape[0]], states[i]
        for d in range(N_STATE):
            state[d] = source[d] + sigma[d] * normals[i, d]
        if (i // 2) % 2 == 1:
            state[TORSO_Y] += step_m
        _clip(state, limits)
        if i < n - explorers:
            if i % 2 == 1:
                _pivot(state, source, lever_m)
        elif i < n - fresh:
            kind, value = uniforms[i, 0], uniforms[i, 1]
            if kind < _BOWING:
                state[PITCH] = _BOW_FROM_RAD + _BOW_RANGE_RAD * value
            elif kind < _BOWING_OR_TURNING:
                state[YAW] = limits[YAW, 0] + (limits[YAW, 1] - limits[YAW, 0]) * value
            else:
                state[YAW] = -state[YAW]
            # The noise of the arms is not used here.
            state[TORSO_X] += _EXPLORERS_X_M * normals[i, LEFT_ARM]
        else:
            for d in range(N_STATE):
                state[d] = fresh_state[d]
            state[TORSO_X] += fresh_x_m * normals[i, TORSO_X]
            _clip(state, limits)
            if uniforms[i, 0] < _FRESH_TURNED:
                state[YAW] = limits[YAW, 0] + (limits[YAW, 1] - limits[YAW, 0]) * uniforms[i, 1]
            else:
                state[YAW] = _FRESH_YAW_RAD * normals[i, YAW]
            state[TORSO_Y] = sight * (distance_m - state[TORSO_X])
        _clip(state, limits)
    return states


@_compile
def pool_of(
    survivors: Floats,
    torsos: Floats,
    ratings: Floats,
    count: int,
    arms_of: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    arm_limits: Floats,
) -> Floats:
    """Return ``survivors`` (M, 14) and the best ``count`` of ``torsos`` twice, (M + 2 count, 14).

    First with the arms they carry along, then with those of the state ``arms_of`` (14,), which stay
    fixed in space.
    """
    m = survivors.shape[0]
    order = np.argsort(ratings, kind="mergesort")
    pool = np.empty((m + 2 * count, N_STATE))
    pool[:m] = survivors
    old, new, hip = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    points, directions, turned = np.empty((3, 3)), np.empty(6), np.empty(6)
    no_parts, no_girdle = np.zeros((6, 6)), np.zeros(5)
    _pose(arms_of, Place(*place), View(*view), old, hip)
    for i in range(count):
        pool[m + i] = torsos[order[i]]
        state = pool[m + count + i]
        state[:] = torsos[order[i]]
        _pose(state, Place(*place), View(*view), new, hip)
        for arm in range(2):
            first, side = LEFT_ARM + ARM_ANGLES * arm, 1.0 - 2.0 * arm
            angles = arms_of[first : first + ARM_ANGLES]
            _pose_arm(angles, side, no_parts, no_girdle, points, directions)
            for half in range(2):
                for a in range(3):
                    turned[3 * half + a] = 0.0
                    for b in range(3):
                        world = 0.0
                        for c in range(3):
                            world += old[b, c] * directions[3 * half + c]
                        turned[3 * half + a] += new[b, a] * world
            angles_of_arm(turned, side, arm_limits, state[first : first + ARM_ANGLES])
    return pool


@_inline
def _mirror(
    angles: Floats,
    side: float,
    flips: int,
    ray: Floats,
    arm_limits: Floats,
    points: Floats,
    directions: Floats,
    no_parts: Floats,
    no_girdle: Floats,
) -> None:
    """Mirror upper arm (bit 0 of ``flips``) and forearm (bit 1) of an arm (4,) along ``ray`` (3,).

    ``ray`` is the line of sight in the torso's frame, a unit vector; the outline stays nearly.
    """
    _pose_arm(angles, side, no_parts, no_girdle, points, directions)
    for half in range(2):
        if (flips >> half) & 1:
            o = 3 * half
            along = directions[o] * ray[0] + directions[o + 1] * ray[1] + directions[o + 2] * ray[2]
            for c in range(3):
                directions[o + c] -= 2.0 * along * ray[c]
    angles_of_arm(directions, side, arm_limits, angles)


@_inline
def _reach(
    angles: Floats,
    side: float,
    shoulder: Floats,
    ray: Floats,
    rotation: Floats,
    parts: Floats,
    stretch: float,
    which: float,
    turn: float,
    arm_limits: Floats,
    directions: Floats,
) -> None:
    """Write the angles (4,) of an arm whose hand is on a ``ray`` (3,) of the optical frame.

    Two-bone inverse kinematics. The distance r from ``shoulder`` (3,) to the hand is ``stretch``
    (0 to 1) of the way from the nearest possible one to the whole arm; of the two points of the ray
    at that distance ``which`` (0 to 1) takes one. With bones a and b the elbow lies on a circle
    about the line from shoulder to hand, at cos = (a^2 + r^2 - b^2) / (2 a r); ``turn`` (0 to 1)
    says where.
    """
    a, b = parts[UPPER_ARM, HEIGHT], parts[FOREARM, HEIGHT]
    along = shoulder[0] * ray[0] + shoulder[1] * ray[1] + shoulder[2] * ray[2]
    # From the shoulder to the point of the ray that is nearest to it.
    squares = 0.0
    for j in range(3):
        squares += (along * ray[j] - shoulder[j]) ** 2
    near = sqrt(squares)
    farthest = a + b - _STRETCHED_M
    low = min(max(near, abs(a - b) + _FOLDED_M), farthest)
    reach = low + (farthest - low) * stretch
    step = sqrt(max(reach * reach - near * near, 0.0))
    if which < _NEARER:
        step = -step
    ux, uy, uz = 0.0, 0.0, 0.0
    length = 1e-12
    for j in range(3):
        hand = (along + step) * ray[j] - shoulder[j]
        ux += rotation[j, 0] * hand
        uy += rotation[j, 1] * hand
        uz += rotation[j, 2] * hand
        length += hand * hand
    length = sqrt(length)
    ux, uy, uz = ux / length, uy / length, uz / length
    cosine = min(max((a * a + reach * reach - b * b) / (2.0 * a * reach), -1.0), 1.0)
    sine = sqrt(1.0 - cosine * cosine)
    # v and w span the circle of the elbow; v is where it hangs.
    vx, vy, vz = _ELBOW_HANGS[0], _ELBOW_HANGS[1] * side, _ELBOW_HANGS[2]
    dot = ux * vx + uy * vy + uz * vz
    vx, vy, vz = vx - dot * ux, vy - dot * uy, vz - dot * uz
    norm = sqrt(vx * vx + vy * vy + vz * vz) + 1e-9
    vx, vy, vz = vx / norm, vy / norm, vz / norm
    wx, wy, wz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    angle = (turn - 0.5) * _ELBOW_TURNS_RAD
    ct, st = sine * cos(angle), sine * sin(angle)
    directions[0] = cosine * ux + ct * vx + st * wx
    directions[1] = cosine * uy + ct * vy + st * wy
    directions[2] = cosine * uz + ct * vz + st * wz
    directions[3] = (reach * ux - a * directions[0]) / b
    directions[4] = (reach * uy - a * directions[1]) / b
    directions[5] = (reach * uz - a * directions[2]) / b
    norm = sqrt(directions[3] ** 2 + directions[4] ** 2 + directions[5] ** 2) + 1e-9
    for c in range(3, 6):
        directions[c] /= norm
    angles_of_arm(directions, side, arm_limits, angles)


@_compile
def propose_arms(
    pool: Floats,
    arm: int,
    sources: int,
    sigma_rad: float,
    mirrors: int,
    tips: int,
    bank: Floats,
    banked: int,
    uncovered: RowSums,
    parts: Floats,
    girdle: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    arm_limits: Floats,
    normals: Floats,
    uniforms: Floats,
) -> Floats:
    """Return arms (N, 4), 0 left or 1 right, for the torso of the first state of ``pool`` (M, 14).

    The first is that of the first state, the next ones lie around those of the first ``sources``
    states. The last are, from the end: ``mirrors`` in depth of the first four states; ``tips`` that
    reach for the end of what the model leaves uncovered, if there is any; ``banked`` out of
    ``bank`` (K, 4). ``uncovered`` are the row sums beside trunk and other arm; ``normals``
    are (N, 4), ``uniforms`` (N, 3).
    """
    n = normals.shape[0]
    first, side = LEFT_ARM + ARM_ANGLES * arm, 1.0 - 2.0 * arm
    arms = np.empty((n, ARM_ANGLES))
    rotation, hip = np.empty((3, 3)), np.empty(3)
    points, directions = np.empty((3, 3)), np.empty(6)
    shoulder, ray, sight = np.empty(3), np.empty(3), np.empty(3)
    no_parts, no_girdle = np.zeros((6, 6)), np.zeros(5)
    torso = pool[0]
    _pose(torso, Place(*place), View(*view), rotation, hip)
    _pose_arm(torso[first : first + ARM_ANGLES], side, parts, girdle, points, directions)
    norm = 0.0
    for j in range(3):
        shoulder[j] = hip[j]
        for c in range(3):
            shoulder[j] += rotation[j, c] * points[0, c]
        norm += shoulder[j] ** 2
    for c in range(3):
        sight[c] = 0.0
        for j in range(3):
            sight[c] += rotation[j, c] * shoulder[j] / sqrt(norm)
    around = min(sources, pool.shape[0])
    for i in range(n):
        source = pool[i % around]
        for d in range(ARM_ANGLES):
            moved = source[first + d] + (sigma_rad * normals[i, d] if i > 0 else 0.0)
            arms[i, d] = min(max(moved, arm_limits[d, 0]), arm_limits[d, 1])
    end = n - mirrors
    for i in range(mirrors):
        angles = arms[end + i]
        source = pool[i % min(4, pool.shape[0])]
        for d in range(ARM_ANGLES):
            angles[d] = source[first + d]
        flips = 1 + int(3.0 * uniforms[end + i, 0])
        _mirror(angles, side, flips, sight, arm_limits, points, directions, no_parts, no_girdle)
    fx, fy, cx, cy = view[0], view[1], view[2], view[3]
    u, v = fx * shoulder[0] / shoulder[2] + cx, fy * shoulder[1] / shoulder[2] + cy
    length_px = (parts[UPPER_ARM, HEIGHT] + parts[FOREARM, HEIGHT]) * fx / shoulder[2]
    count, tip_u, tip_v = farthest_uncovered(uncovered, u, v, _REACH * length_px)
    if count >= _FEWEST_TIPS:
        # The hand keypoint lies somewhat before the end of the outline.
        far = sqrt((u - tip_u) ** 2 + (v - tip_v) ** 2) + 1e-9
        inwards = min(_INWARDS_PX / far, 1.0)
        tip_u, tip_v = tip_u + inwards * (u - tip_u), tip_v + inwards * (v - tip_v)
        ray[0], ray[1], ray[2] = (tip_u - cx) / fx, (tip_v - cy) / fy, 1.0
        norm = sqrt(ray[0] ** 2 + ray[1] ** 2 + 1.0)
        for c in range(3):
            ray[c] /= norm
        end -= tips
        for i in range(end, end + tips):
            _reach(
                arms[i],
                side,
                shoulder,
                ray,
                rotation,
                parts,
                uniforms[i, 0],
                uniforms[i, 1],
                uniforms[i, 2],
                arm_limits,
                directions,
            )
    for i in range(end - banked, end):
        chosen = int(uniforms[i, 0] * bank.shape[0])
        for d in range(ARM_ANGLES):
            arms[i, d] = bank[chosen, d]
    return arms


# The tip of an arm is looked for on a grid of this many pixels, within this times the arm's length
# from the shoulder; if fewer points of the grid are uncovered, there is none.
_GRID_PX, _REACH, _FEWEST_TIPS = 3, 1.1, 3
_INWARDS_PX = 3.0


@_compile
def farthest_uncovered(
    uncovered: RowSums, u: float, v: float, reach_px: float
) -> tuple[int, float, float]:
    """Find the foreground that the model leaves uncovered, farthest from the pixel (u, v).

    ``uncovered`` (rows, W + 1) are row sums, level under what is covered. A point of the grid
    counts if four of the five pixels around it in its row are foreground and so is the point above
    or below. Returns how many there are within ``reach_px``, and column and row of the farthest.
    """
    rows, width = uncovered.shape[0], uncovered.shape[1] - 1
    count, best = 0, -1.0
    tip_u, tip_v = 0.0, 0.0
    step = _GRID_PX
    left, right = max(int(u - reach_px), step), min(int(u + reach_px), width - step - 1)
    top, bottom = max(int(v - reach_px), step), min(int(v + reach_px), rows - step - 1)
    for row in range(top, bottom, step):
        for column in range(left, right, step):
            if uncovered[row, column + 1] - uncovered[row, column] != -1:
                continue
            if uncovered[row, column + 3] - uncovered[row, column - 2] > -4:
                continue
            above = uncovered[row - step, column + 1] - uncovered[row - step, column]
            below = uncovered[row + step, column + 1] - uncovered[row + step, column]
            if above != -1 and below != -1:
                continue
            far = (column - u) ** 2 + (row - v) ** 2
            if far <= reach_px * reach_px:
                count += 1
                if far > best:
                    best, tip_u, tip_v = far, float(column), float(row)
    return count, tip_u, tip_v


@_compile
def around_best(
    arms: Floats, ratings: Floats, count: int, sigma_rad: float, arm_limits: Floats, normals: Floats
) -> Floats:
    """Return arms (N, 4) around the best ``count`` of ``arms`` (M, 4); ``normals`` are (N, 4)."""
    order = np.argsort(ratings, kind="mergesort")
    moved = np.empty_like(normals)
    for i in range(normals.shape[0]):
        source = arms[order[i % count]]
        for d in range(ARM_ANGLES):
            value = source[d] + sigma_rad * normals[i, d]
            moved[i, d] = min(max(value, arm_limits[d, 0]), arm_limits[d, 1])
    return moved


@_compile
def spread_of_arm(
    arms: Floats, ratings: Floats, side: float, spread: float, parts: Floats, girdle: Floats
) -> tuple[float, float]:
    """Return the deviations of elbow and hand in the torso's frame, m, weighted by fit.

    Arms (N, 4) weigh exp(-(rating - best) / ``spread``).
    """
    points, directions = np.empty((3, 3)), np.empty(6)
    best = ratings.min()
    total = 0.0
    sums, squares = np.zeros((3, 3)), np.zeros((3, 3))
    for i in range(arms.shape[0]):
        weight = exp((best - ratings[i]) / spread)
        if weight < 1e-4:
            continue
        _pose_arm(arms[i], side, parts, girdle, points, directions)
        total += weight
        for j in range(1, 3):
            for c in range(3):
                sums[j, c] += weight * points[j, c]
                squares[j, c] += weight * points[j, c] ** 2
    elbow, hand = 0.0, 0.0
    for c in range(3):
        elbow += max(squares[1, c] / total - (sums[1, c] / total) ** 2, 0.0)
        hand += max(squares[2, c] / total - (sums[2, c] / total) ** 2, 0.0)
    return sqrt(elbow), sqrt(hand)


@_compile
def combine(
    torso: Floats, left: Floats, left_ratings: Floats, right: Floats, right_ratings: Floats, n: int
) -> Floats:
    """Return ``torso`` (14,) with the best of both arms, (2 n, 14).

    The i-th left with the i-th right arm for the best n of them, then the best one with the second
    to the n/2 + 1-th, and the other way round.
    """
    lefts = np.argsort(left_ratings, kind="mergesort")
    rights = np.argsort(right_ratings, kind="mergesort")
    states = np.empty((2 * n, N_STATE))
    for i in range(2 * n):
        states[i] = torso
        j = i - n
        if i < n:
            one, other = i, i
        elif j < n // 2:
            one, other = 0, j + 1
        else:
            one, other = j - n // 2 + 1, 0
        states[i, LEFT_ARM : LEFT_ARM + ARM_ANGLES] = left[lefts[one]]
        states[i, RIGHT_ARM : RIGHT_ARM + ARM_ANGLES] = right[rights[other]]
    return states


@_compile
def move_all(
    sources: Floats,
    sigma: Floats,
    lever_m: float,
    differing: int,
    difference_scale: float,
    limits: Floats,
    normals: Floats,
    uniforms: Floats,
) -> Floats:
    """Return states (N, 14) around ``sources`` (M, 14), all joints moved together.

    Every second one turns about the shoulders. In the first half one moves its torso alone, the
    next its left arm, the next its right arm, in turn. The last ``differing`` move by the
    difference of two sources, which follows the directions in which the fit is flat. ``normals``
    are (N, 14), ``uniforms`` (N, 2).
    """
    n, m = normals.shape[0], sources.shape[0]
    states = np.empty((n, N_STATE))
    for i in range(n):
        source, state = sources[i % m], states[i]
        for d in range(N_STATE):
            state[d] = source[d] + sigma[d] * normals[i, d]
        if i % 2 == 1:
            _pivot(state, source, lever_m)
        if i >= n - differing:
            base = sources[(i - (n - differing)) % m]
            one, other = sources[int(uniforms[i, 0] * m)], sources[int(uniforms[i, 1] * m)]
            for d in range(N_STATE):
                noise = _NOISE_OF_DIFFERENCE * (state[d] - source[d])
                state[d] = base[d] + difference_scale * (one[d] - other[d]) + noise
        elif i < n // 2:
            part = i % 3
            for d in range(N_STATE):
                is_left = LEFT_ARM <= d < RIGHT_ARM
                is_right = RIGHT_ARM <= d < RIGHT_ARM + ARM_ANGLES
                of = 1 if is_left else (2 if is_right else 0)
                if of != part:
                    state[d] = source[d]
        _clip(state, limits)
    return states


@_compile
def choose_apart(
    states: Floats,
    ratings: Floats,
    most: int,
    alike: int,
    apart_m: float,
    parts: Floats,
    girdle: Floats,
) -> Indices:
    """Return up to ``most`` indices: the best ``alike``, then the best that differ from all chosen.

    States (N, 14) differ if elbows and hands in the torso's frame, its place and its turns, at
    0.3 m a radian, are ``apart_m`` away, as the root of the summed squares.
    """
    order = np.argsort(ratings, kind="mergesort")
    chosen = np.empty(most, np.int64)
    features, one = np.empty((most, 16)), np.empty(16)
    points, directions = np.empty((3, 3)), np.empty(6)
    found = 0
    for i in order:
        state = states[i]
        for arm in range(2):
            first, side = LEFT_ARM + ARM_ANGLES * arm, 1.0 - 2.0 * arm
            _pose_arm(state[first : first + ARM_ANGLES], side, parts, girdle, points, directions)
            for c in range(3):
                one[6 * arm + c] = points[1, c]
                one[6 * arm + 3 + c] = points[2, c]
        one[12], one[13] = state[TORSO_X], state[TORSO_Y]
        one[14], one[15] = _RADIAN_M * state[YAW], _RADIAN_M * state[PITCH]
        is_new = True
        if found >= alike:
            for j in range(found):
                squares = 0.0
                for c in range(16):
                    squares += (features[j, c] - one[c]) ** 2
                if squares < apart_m * apart_m:
                    is_new = False
                    break
        if is_new:
            features[found] = one
            chosen[found] = i
            found += 1
            if found == most:
                break
    return chosen[:found]


@_compile
def best_states(states: Floats, ratings: Floats, count: int) -> Floats:
    """Return the best ``count`` of ``states`` (N, 14), best first."""
    order = np.argsort(ratings, kind="mergesort")
    best = np.empty((count, N_STATE))
    for i in range(count):
        best[i] = states[order[i]]
    return best


@_compile
def mean_and_spread(states: Floats, ratings: Floats, count: int, spread: float) -> tuple[Any, Any]:
    """Return the mean (14,) of the best ``count`` states, and deviations (14,) of all around it.

    States (N, 14) weigh exp(-(rating - best) / ``spread``).
    """
    order = np.argsort(ratings, kind="mergesort")
    best = ratings[order[0]]
    mean, squares = np.zeros(N_STATE), np.zeros(N_STATE)
    total = 0.0
    for i in range(min(count, order.shape[0])):
        weight = exp((best - ratings[order[i]]) / spread)
        total += weight
        for d in range(N_STATE):
            mean[d] += weight * states[order[i], d]
    for d in range(N_STATE):
        mean[d] /= total
    total = 0.0
    for i in range(states.shape[0]):
        weight = exp((best - ratings[i]) / spread)
        total += weight
        for d in range(N_STATE):
            squares[d] += weight * (states[i, d] - mean[d]) ** 2
    return mean, np.sqrt(squares / total)
