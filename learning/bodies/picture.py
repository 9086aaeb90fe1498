"""Draws a body to look at: ``python -m learning.bodies.picture BODY.npz... OUT.png``.

Each row is one body: front and left side of the T-pose and of hanging arms, with its keypoints.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from learning.bodies.rigged import INDEX, FloatArray, Posed, RiggedBody
from learning.segments import SEGMENTS

_SIZE_PX, _PX_PER_M = 420, 200.0
_VIEWS = (((0, 1, 2), 1.0), ((1, 0, 2), -1.0))
"""Axes towards the viewer, to the right and up, and the sign of the axis to the right."""


def hanging() -> FloatArray:
    """Return the turns of a person whose arms hang a little away from the trunk."""
    turns = np.tile(np.eye(3, dtype=np.float32), (len(SEGMENTS), 1, 1))
    for side, sign in (("left", -1.0), ("right", 1.0)):
        cos, sin = np.cos(np.radians(78.0)), sign * np.sin(np.radians(78.0))
        for part in ("upper_arm", "forearm", "hand"):
            turns[INDEX[f"{side}_{part}"]] = [[1, 0, 0], [0, cos, -sin], [0, sin, cos]]
    return turns


def drawn(body: RiggedBody, posed: Posed, view: int) -> NDArray[np.uint8]:
    """Return an orthographic picture (h, w, 3; BGR) from the front (0) or the left side (1)."""
    (deep, right, up), sign = _VIEWS[view]
    image = np.full((_SIZE_PX, _SIZE_PX, 3), 235, np.uint8)

    def pixels(points: FloatArray) -> NDArray[np.int32]:
        x = _SIZE_PX / 2 + sign * _PX_PER_M * points[..., right]
        y = _SIZE_PX - 20 - _PX_PER_M * points[..., up]
        return np.stack([x, y], axis=-1).round().astype(np.int32)

    corners = posed.vertices[body.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = normals[:, deep] / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
    shade = 0.45 + 0.55 * np.abs(facing)
    colours = body.colours[body.faces].mean(axis=1)[:, ::-1] * shade[:, None]
    for face in np.argsort(corners[:, :, deep].mean(axis=1)):
        cv2.fillConvexPoly(image, pixels(corners[face]), colours[face].tolist())
    centres = np.stack([posed.hips, posed.neck, posed.head])
    for points, colour in ((posed.keypoints[:3], (0, 200, 0)), (posed.keypoints[3:], (0, 0, 255))):
        cv2.polylines(image, [pixels(points)], isClosed=False, color=colour)
        for x, y in pixels(points):
            cv2.circle(image, (int(x), int(y)), 3, colour, -1)
    for x, y in pixels(centres):
        cv2.circle(image, (int(x), int(y)), 3, (255, 0, 255), -1)
    return image


def row(body: RiggedBody) -> NDArray[np.uint8]:
    """Return the four pictures of a body side by side (h, w, 3; BGR)."""
    arms_down = body.posed(hanging(), np.array([0, 0, 1], np.float32))
    posed = (body.in_t_pose(), arms_down)
    pictures = [drawn(body, pose, view) for pose in posed for view in (0, 1)]
    image = np.concatenate(pictures, axis=1)
    text = f"{body.name} {body.sex} {body.stature_m:.2f} m, legs {body.leg_length_m:.2f} m"
    cv2.putText(image, text, (5, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (0, 0, 0))
    return image


def main() -> None:
    """Draw the bodies of files."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bodies", type=Path, nargs="+", help="files of bodies (.npz)")
    parser.add_argument("output", type=Path, help="picture (.png)")
    arguments = parser.parse_args()
    rows = [row(RiggedBody.loaded(path)) for path in arguments.bodies]
    cv2.imwrite(str(arguments.output), np.concatenate(rows))


if __name__ == "__main__":
    main()
