"""A body of triangles that its segments move (linear blend skinning)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.compiling import kernel
from learning.segments import PARENTS, SEGMENTS

FloatArray = NDArray[np.float32]
IntArray = NDArray[np.int32]
ByteArray = NDArray[np.uint8]

INDEX = {name: index for index, name in enumerate(SEGMENTS)}
"""Index of each segment by its name."""

STRONGEST = 4
"""Number of segments that move one vertex at most."""

_KEYPOINTS = [
    (INDEX[f"{side}_{part}"], knuckles)
    for knuckles, side in enumerate(("left", "right"))
    for part in ("upper_arm", "forearm", "hand")
]


class Posed(NamedTuple):
    """A body in a pose: positions in the world, metres.

    ``vertices`` is (v, 3) and ``keypoints`` (6, 3): left shoulder, elbow, hand, then the right
    ones. ``hips`` is the middle of the hip joints; each of ``hips``, ``neck``, ``head`` is (3,).
    """

    vertices: FloatArray
    keypoints: FloatArray
    hips: FloatArray
    neck: FloatArray
    head: FloatArray


@dataclass(frozen=True)
class RiggedBody:
    """Mesh, joints and weights of one person in the rest posture of its rig.

    ``vertices`` (v, 3), ``joints`` (segments, 3), ``knuckles`` (2, 3; mean of the four finger
    knuckles, left and right) and ``head_centre`` (3,) are metres at rest. ``faces`` (f, 3) are
    triangles seen counter-clockwise from outside. Segment ``bones[v, k]`` moves vertex v with
    weight ``shares[v, k]``; both are (v, 4), the strongest first. ``to_t_pose`` (segments, 3, 3)
    turns each segment from rest to the T-pose. ``colours`` (v, 3) are RGB.
    """

    name: str
    family: str
    sex: str
    vertices: FloatArray
    faces: IntArray
    bones: ByteArray
    shares: FloatArray
    joints: FloatArray
    knuckles: FloatArray
    head_centre: FloatArray
    to_t_pose: FloatArray
    colours: ByteArray

    @property
    def part(self) -> ByteArray:
        """Index of the segment that moves each vertex most, (v,)."""
        return self.bones[:, 0]

    @property
    def weights(self) -> FloatArray:
        """Weight of each segment for each vertex, (v, segments)."""
        dense = np.zeros((len(self.vertices), len(SEGMENTS)), np.float32)
        np.add.at(dense, (np.arange(len(dense))[:, None], self.bones), self.shares)
        return dense

    @cached_property
    def leg_length_m(self) -> float:
        """Height of the hip joints above the floor in the T-pose."""
        low: np.float32 = self._moved(_STILL, np.zeros(3, np.float32))[0][:, 2].min()
        return -float(low)

    @cached_property
    def stature_m(self) -> float:
        """Height of the top of the skull above the floor, soles included, hair and hats not.

        The centre of the head is half way between its joint and that top.
        """
        head, hips = INDEX["head"], INDEX["hips"]
        rise = 2 * self.head_centre[2] - self.joints[head, 2] - self.joints[hips, 2]
        return self.leg_length_m + float(rise)

    def posed(self, turns: NDArray[np.floating[Any]], place: NDArray[np.floating[Any]]) -> Posed:
        """Return the body in a pose.

        Args:
            turns: world rotations of the segments against the T-pose, (segments, 3, 3).
            place: middle of the hips of a person with hip joints 1 m above the floor, (3,).

        Raises:
            ValueError: a shape differs.
        """
        if np.shape(turns) != (len(SEGMENTS), 3, 3) or np.shape(place) != (3,):
            raise ValueError(
                f"turns {np.shape(turns)} and place {np.shape(place)} should be "
                f"({len(SEGMENTS)}, 3, 3) and (3,)"
            )
        hips = (self.leg_length_m * np.asarray(place)).astype(np.float32)
        vertices, joints, linear = self._moved(np.asarray(turns, np.float32), hips)
        keypoints = np.array([joints[segment] for segment, _ in _KEYPOINTS])
        for row, (segment, side) in enumerate(_KEYPOINTS):
            if row % 3 == 2:
                keypoints[row] += linear[segment] @ (self.knuckles[side] - self.joints[segment])
        head = INDEX["head"]
        crown = joints[head] + linear[head] @ (self.head_centre - self.joints[head])
        return Posed(vertices, keypoints, joints[0], joints[INDEX["neck"]], crown)

    def in_t_pose(self) -> Posed:
        """Return the body in the T-pose, standing above the origin."""
        return self.posed(_STILL, np.array([0, 0, 1], np.float32))

    def scaled(self, factor: float) -> RiggedBody:
        """Return the body with all sizes multiplied by ``factor``."""
        f = np.float32(factor)
        return replace(
            self,
            vertices=f * self.vertices,
            joints=f * self.joints,
            knuckles=f * self.knuckles,
            head_centre=f * self.head_centre,
        )

    def with_mesh(self, points: FloatArray, faces: IntArray, weights: FloatArray) -> RiggedBody:
        """Return the body with more triangles.

        Args:
            points: vertices at rest, (n, 3).
            faces: triangles that index ``points``, (m, 3).
            weights: weights of the segments, (n, segments).
        """
        bones, shares = strongest(weights)
        black = np.zeros((len(points), 3), np.uint8)
        return replace(
            self,
            vertices=np.concatenate([self.vertices, points.astype(np.float32)]),
            faces=np.concatenate([self.faces, (faces + len(self.vertices)).astype(np.int32)]),
            bones=np.concatenate([self.bones, bones]),
            shares=np.concatenate([self.shares, shares]),
            colours=np.concatenate([self.colours, black]),
        )

    def saved(self, path: str | Path) -> None:
        """Write the body to a file of arrays (.npz)."""
        values = {name: np.asarray(getattr(self, name)) for name in self.__dataclass_fields__}
        np.savez_compressed(path, allow_pickle=False, **values)

    @classmethod
    def loaded(cls, path: str | Path) -> RiggedBody:
        """Return the body of a file that :meth:`saved` wrote."""
        with np.load(path) as file:
            values = {name: file[name] for name in cls.__dataclass_fields__}
        for name in ("name", "family", "sex"):
            values[name] = str(values[name])
        return cls(**values)

    def _moved(
        self, turns: FloatArray, hips: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return vertices (v, 3), joints (segments, 3) and turns from rest (segments, 3, 3)."""
        linear = np.ascontiguousarray(turns @ self.to_t_pose)
        joints = chain(self.joints, linear, hips)
        shift = joints - np.einsum("sij,sj->si", linear, self.joints)
        return blend(self.vertices, self.bones, self.shares, linear, shift), joints, linear


_STILL = np.tile(np.eye(3, dtype=np.float32), (len(SEGMENTS), 1, 1))


def chain(joints: FloatArray, linear: FloatArray, hips: FloatArray) -> FloatArray:
    """Return where the joints go when each segment maps its offsets by a matrix.

    Args:
        joints: joints at rest, (segments, 3).
        linear: matrices, (segments, 3, 3).
        hips: where the joint of the hips goes, (3,).
    """
    moved = np.empty_like(joints)
    moved[0] = hips
    for child, parent in enumerate(PARENTS[1:], start=1):
        moved[child] = moved[parent] + linear[parent] @ (joints[child] - joints[parent])
    return moved


def strongest(weights: NDArray[np.floating]) -> tuple[ByteArray, FloatArray]:
    """Return the :data:`STRONGEST` segments of each vertex and their weights, which sum to 1.

    Args:
        weights: weights of the segments, (v, segments); each row has a positive one.
    """
    order = np.argsort(-weights, axis=1, kind="stable")[:, :STRONGEST]
    shares = np.take_along_axis(weights, order, axis=1)
    shares = shares / shares.sum(axis=1, keepdims=True)
    return order.astype(np.uint8), shares.astype(np.float32)


@kernel
def blend(
    vertices: FloatArray,
    bones: ByteArray,
    shares: FloatArray,
    linear: FloatArray,
    shift: FloatArray,
) -> FloatArray:
    """Return the vertices (v, 3) that the weighted mean of affine maps moves.

    Args:
        vertices: vertices at rest, (v, 3).
        bones: segments of each vertex, (v, 4).
        shares: their weights, (v, 4).
        linear: matrix of each segment, (segments, 3, 3).
        shift: shift of each segment, metres, (segments, 3).
    """
    moved = np.zeros_like(vertices)
    for v in range(len(vertices)):
        x, y, z = vertices[v]
        for k in range(bones.shape[1]):
            share = shares[v, k]
            if share > 0:
                s = bones[v, k]
                for i in range(3):
                    along = linear[s, i, 0] * x + linear[s, i, 1] * y + linear[s, i, 2] * z
                    moved[v, i] += share * (along + shift[s, i])
    return moved
