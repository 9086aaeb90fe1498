"""Renders a triangle mesh with a depth buffer: depth, colour, and thereby the exact silhouette."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.compiling import kernel
from cardbox_tracker.vision.camera import Camera

FloatArray = NDArray[np.float64]

# Nearer vertices are not projected, so their triangles are left out.
_NEAREST_M = 0.1


class Rendering(NamedTuple):
    """A rendered mesh.

    Attributes:
        depth_m: (H, W), metres along the optical axis; infinite where nothing is seen.
        colour: (H, W, 3) uint8, in the channel order of the vertices; 0 where nothing is seen.
    """

    depth_m: FloatArray
    colour: NDArray[np.uint8]

    @property
    def silhouette(self) -> NDArray[np.bool_]:
        """(H, W), whether the mesh is seen at the centre of the pixel."""
        return np.isfinite(self.depth_m)


def render(
    optical_m: FloatArray,
    faces: NDArray[np.int32],
    colours: NDArray[np.uint8],
    camera: Camera,
    light: FloatArray,
) -> Rendering:
    """Render a mesh with flat shading.

    Args:
        optical_m: vertices (V, 3), metres in the optical frame.
        faces: indices of the triangles' vertices, (F, 3).
        colours: of the vertices, (V, 3); a triangle has the colour of its first vertex.
        camera: ideal camera of the images' size.
        light: unit vector (3,) towards the light, in the optical frame.
    """
    depth_m = np.full((camera.height, camera.width), np.inf)
    colour = np.zeros((camera.height, camera.width, 3), np.uint8)
    pixels = np.full((len(optical_m), 2), np.nan)
    ahead = optical_m[:, 2] > _NEAREST_M
    pixels[ahead] = camera.project(optical_m[ahead])
    _draw(pixels, np.asarray(optical_m, np.float64), faces, colours, light, depth_m, colour)
    return Rendering(depth_m, colour)


@kernel
def _draw(
    pixels: Any, optical_m: Any, faces: Any, colours: Any, light: Any, depth_m: Any, colour: Any
) -> None:
    """Write depth and colour of the nearest triangle at each pixel's centre."""
    height, width = depth_m.shape
    for n in range(len(faces)):
        a, b, c = faces[n]
        ax, ay = pixels[a]
        bx, by = pixels[b]
        cx, cy = pixels[c]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if not abs(area) > 1e-9:
            continue
        first_row = max(int(np.ceil(min(ay, by, cy))), 0)
        last_row = min(int(np.floor(max(ay, by, cy))), height - 1)
        first_column = max(int(np.ceil(min(ax, bx, cx))), 0)
        last_column = min(int(np.floor(max(ax, bx, cx))), width - 1)
        if first_row > last_row or first_column > last_column:
            continue
        shade = _shade(optical_m[a], optical_m[b], optical_m[c], light)
        # The inverse of the depth is linear in the image.
        za, zb, zc = 1.0 / optical_m[a, 2], 1.0 / optical_m[b, 2], 1.0 / optical_m[c, 2]
        for row in range(first_row, last_row + 1):
            for column in range(first_column, last_column + 1):
                of_b = ((column - ax) * (cy - ay) - (row - ay) * (cx - ax)) / area
                of_c = ((bx - ax) * (row - ay) - (by - ay) * (column - ax)) / area
                if of_b < 0.0 or of_c < 0.0 or of_b + of_c > 1.0:
                    continue
                z = 1.0 / (za + of_b * (zb - za) + of_c * (zc - za))
                if z < depth_m[row, column]:
                    depth_m[row, column] = z
                    for channel in range(3):
                        colour[row, column, channel] = np.uint8(shade * colours[a, channel])


@kernel
def _shade(a: Any, b: Any, c: Any, light: Any) -> float:
    """Return the brightness, 0.55 to 1, of a triangle that is lit from both sides."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    length = np.sqrt(nx * nx + ny * ny + nz * nz) + 1e-12
    shade: float = 0.55 + 0.45 * abs(nx * light[0] + ny * light[1] + nz * light[2]) / length
    return shade
