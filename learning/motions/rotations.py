"""Rotation matrices and quaternions of many frames at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


def unit(vectors: ArrayLike) -> FloatArray:
    """Return vectors (..., 3) of length one; vectors of length zero stay zero."""
    values = np.asarray(vectors, dtype=float)
    return np.asarray(values / np.maximum(np.linalg.norm(values, axis=-1, keepdims=True), 1e-12))


def about_vector(vectors_rad: ArrayLike) -> FloatArray:
    """Return rotations (..., 3, 3) by rotation vectors (..., 3), rad."""
    vectors = np.asarray(vectors_rad, dtype=float)
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    cross = cross_matrices(unit(vectors))
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def cross_matrices(vectors: FloatArray) -> FloatArray:
    """Return matrices (..., 3, 3) that multiply like the cross product by vectors (..., 3)."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def about_axis(axis: int, angles_rad: ArrayLike) -> FloatArray:
    """Return rotations (..., 3, 3) about a coordinate axis by angles (...), rad."""
    angles = np.asarray(angles_rad, dtype=float)
    return about_vector(angles[..., None] * np.eye(3)[axis])


def swing(start: ArrayLike, end: ArrayLike) -> FloatArray:
    """Return the smallest rotation (3, 3) that turns one direction (3,) to another.

    Opposite directions have no smallest rotation; the half turn is then about any axis.
    """
    a, b = unit(start), unit(end)
    axis, cosine = np.cross(a, b), float(a @ b)
    if cosine < -1 + 1e-9:
        axis = np.cross(a, np.eye(3)[np.argmin(np.abs(a))])
    angle = np.arctan2(np.linalg.norm(np.cross(a, b)), cosine)
    return about_vector(unit(axis) * angle)


def to_quaternions(matrices: ArrayLike) -> FloatArray:
    """Return unit quaternions (..., 4), real part first and not negative, of rotations."""
    m = np.asarray(matrices, dtype=float)
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    wx, wy, wz = (m[..., j, i] - m[..., i, j] for i, j in ((1, 2), (2, 0), (0, 1)))
    xy, xz, yz = (m[..., i, j] + m[..., j, i] for i, j in ((0, 1), (0, 2), (1, 2)))
    # Each row is four times one component times the quaternion; the longest is exact.
    rows = np.stack([
        np.stack([1 + xx + yy + zz, wx, wy, wz], axis=-1),
        np.stack([wx, 1 + xx - yy - zz, xy, xz], axis=-1),
        np.stack([wy, xy, 1 - xx + yy - zz, yz], axis=-1),
        np.stack([wz, xz, yz, 1 - xx - yy + zz], axis=-1),
    ], axis=-2)  # fmt: skip
    best = np.argmax(np.sum(rows**2, axis=-1), axis=-1)
    row = np.take_along_axis(rows, best[..., None, None], axis=-2)[..., 0, :]
    return unit(np.where(row[..., :1] < 0, -row, row))


def from_quaternions(quaternions: ArrayLike) -> FloatArray:
    """Return rotations (..., 3, 3) of quaternions (..., 4), real part first, of any length."""
    q = unit(quaternions)
    cross = cross_matrices(q[..., 1:])
    return np.asarray(np.eye(3) + 2 * q[..., :1, None] * cross + 2 * cross @ cross)


def between(start: ArrayLike, end: ArrayLike, share: ArrayLike) -> FloatArray:
    """Return quaternions on the shorter arc from ``start`` to ``end``.

    Args:
        start: quaternions (..., 4).
        end: quaternions (..., 4).
        share: of the way (...), 0 to 1, where 0 gives ``start``.
    """
    a, b = unit(start), unit(end)
    cosine = np.sum(a * b, axis=-1, keepdims=True)
    b = np.where(cosine < 0, -b, b)
    angle = np.arccos(np.clip(np.abs(cosine), 0, 1))
    t = np.asarray(share, dtype=float)[..., None]
    # Tiny angles make both sines vanish; there the chord is the arc.
    is_tiny = angle < 1e-4
    safe = np.where(is_tiny, 1.0, np.sin(angle))
    of_a = np.where(is_tiny, 1 - t, np.sin((1 - t) * angle) / safe)
    of_b = np.where(is_tiny, t, np.sin(t * angle) / safe)
    return unit(of_a * a + of_b * b)
