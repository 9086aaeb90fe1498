"""Extrinsics of a further camera: the rigid transform between two optical frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.errors import CameraError, quoted

FloatArray = NDArray[np.float64]

FARTHEST_M = 30.0
"""Cameras that see one person are nearer to each other, metres."""

# Tolerance for a rotation matrix in a file, which may be rounded to three digits.
_ROTATION_TOLERANCE = 1e-2
# Largest plausible length, even in millimetres; sums of such numbers stay finite.
_LARGEST = 1e6
# Lenses have at least this distance, metres.
_NEAREST_M = 0.005
# Cosine of the angle between optical axes that hardly meet.
_PARALLEL = 0.99


def _is_possible(values: FloatArray) -> bool:
    return bool(np.all(np.abs(values) <= _LARGEST))  # false for NaN, too


@dataclass(frozen=True, eq=False)
class Extrinsics:
    """Rigid transform from the first camera's optical frame into another camera's.

    A point p of that frame is ``rotation @ p + translation_m`` in the other's optical frame.
    """

    rotation: FloatArray  #: (3, 3)
    translation_m: FloatArray  #: (3,), metres
    source: str = ""  #: description of the origin, for messages

    @classmethod
    def of(cls, matrix: object, source: str = "") -> Extrinsics:
        """Create from a matrix (4, 4) or (3, 4), or raise CameraError with ``source``."""
        try:
            values = np.array(matrix, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            values = np.zeros(0)
        if values.shape not in ((4, 4), (3, 4)) or not _is_possible(values):
            raise CameraError(
                f"{source}: expected a rigid transform of 4 x 4 finite numbers in metres, got "
                f"{quoted(matrix)}"
            )
        if values.shape == (4, 4) and not np.array_equal(values[3], (0.0, 0.0, 0.0, 1.0)):
            raise CameraError(
                f"{source}: the last row of the matrix is {quoted(values[3].tolist())}; expected "
                "0, 0, 0, 1: is it transposed?"
            )
        rotation = values[:3, :3]
        u, _, v = np.linalg.svd(rotation)
        nearest = u @ v
        if np.abs(nearest - rotation).max() > _ROTATION_TOLERANCE or np.linalg.det(nearest) < 0:
            raise CameraError(
                f"{source}: the matrix is no rotation with a translation; calibrate the cameras "
                "anew, or copy the transform with all its digits"
            )
        return cls(nearest, values[:3, 3].copy(), source)

    @classmethod
    def of_vectors(cls, rotation: object, translation_m: object, source: str = "") -> Extrinsics:
        """Create from a rotation vector, rad, and translation, m, (3,), or raise CameraError."""
        try:
            vectors = np.array([rotation, translation_m], dtype=np.float64).reshape(2, 3)
        except (TypeError, ValueError, OverflowError):
            vectors = np.full((2, 3), np.nan)
        if not _is_possible(vectors):
            raise CameraError(
                f"{source}: expected a rotation vector and a translation of three numbers each, "
                f"got {quoted(rotation)} and {quoted(translation_m)}"
            )
        turn = np.asarray(cv2.Rodrigues(vectors[0])[0], np.float64)
        return cls(turn, vectors[1].copy(), source)

    def after(self, first: Extrinsics) -> Extrinsics:
        """Return the composition that applies ``first``, then this transform."""
        moved = self.rotation @ first.translation_m + self.translation_m
        return Extrinsics(self.rotation @ first.rotation, moved, self.source or first.source)

    def inverse(self) -> Extrinsics:
        """Return the inverse transform."""
        turned = self.rotation.T
        return Extrinsics(turned, -turned @ self.translation_m, self.source)

    @property
    def centre_m(self) -> FloatArray:
        """Centre (3,), metres, of the other camera in the first camera's optical frame."""
        centre: FloatArray = -self.rotation.T @ self.translation_m
        return centre

    def difference(self, other: Extrinsics) -> tuple[float, float]:
        """Return the angle between the rotations, rad, and the distance of the centres, metres."""
        angle = angle_of(self.rotation @ other.rotation.T)
        return angle, float(np.linalg.norm(self.centre_m - other.centre_m))

    def check(self) -> None:
        """Raise CameraError if the cameras stand at the same place."""
        if np.linalg.norm(self.translation_m) < _NEAREST_M:
            raise CameraError(
                f"{self.source or 'the extrinsics'}: two cameras stand at the same place, as none "
                "do, so the pose is a placeholder; expected the measured one, in metres: give "
                "--extrinsics FILE, which 'cardbox calibrate-extrinsics' writes"
            )

    def __str__(self) -> str:
        angle = np.degrees(angle_of(self.rotation))
        text = f"{np.linalg.norm(self.translation_m):.3f} m and {angle:.1f} degrees apart"
        return f"{text} ({self.source})" if self.source else text


def angle_of(rotation: FloatArray) -> float:
    """Return the angle of a rotation (3, 3), rad."""
    return float(np.linalg.norm(cv2.Rodrigues(rotation)[0]))


def meeting_m(others: Sequence[Extrinsics]) -> float | None:
    """Return how far from the first camera the optical axes come nearest to each other, metres.

    People stand where the cameras look. None if no axis comes near within 0.5 to 10 m, as of
    parallel cameras.
    """
    found = []
    for one in others:
        axis = one.rotation[2]
        # The point of the first axis, and that of the other one, with the least distance.
        sides = np.column_stack([(0.0, 0.0, 1.0), -axis])
        (ahead_m, _), *_ = np.linalg.lstsq(sides, one.centre_m, rcond=None)
        if abs(axis[2]) < _PARALLEL and 0.5 <= ahead_m <= 10.0:
            found.append(float(ahead_m))
    return float(np.mean(found)) if found else None
