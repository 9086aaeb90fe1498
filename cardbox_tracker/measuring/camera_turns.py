"""How a camera turns while it films: the rotation of each image, by the background.

Edges of the background are kept as directions in the frame of the first image, with the brightness
there. Each image is turned until its brightness at all of them is the same (direct alignment with
one rotation: Lucas and Kanade, "An iterative image registration technique", 1981; from blurred
images to sharp ones, each pixel with Cauchy's robust weight). Since all images are compared with
the same directions, errors do not add up. A camera that leaves its place shows parallax: then too
few edges agree on one rotation, and it is unknown. With another focal length than the camera's,
images that are turned back are stretched, so the turns show it, too (self-calibration of a rotating
camera: Hartley, "Self-calibration of stationary cameras", 1997).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from math import exp, hypot
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import NEAREST_M, Camera
from cardbox_tracker.camera.encodings import brightness_of
from cardbox_tracker.camera.extrinsics import angle_of
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.segmentation.partial_scene import MARGIN

Image = NDArray[np.uint8]
Box = tuple[int, int, int, int]

# Tangent of the largest angle from the first image's axis to any point of an image (62 degrees),
# beyond which pixels would be stretched too much; largest side of the map, sides of the image.
_MOST_TANGENT, _MOST_SIDES = 1.9, 6.0
# Standard deviations of the blurs, shares of the longer side; the first is as wide as the largest
# step between two images.
_BLURS = (0.04, 0.02, 0.008, 0.004)
# Least slope of an edge, grey values a pixel, above noise; pixels of an image for one that counts;
# those of one edge that err together.
_SLOPE, _FOR_ONE, _TOGETHER = 3.0, 20, 8.0
# Distance within which an edge agrees, the same share: 0.2 degrees of a usual lens. The least share
# of edges that agree, and the largest standard deviation of the rotation, rad.
_AGREES, _LEAST_SHARE, _MOST_STDDEV = 0.003, 0.7, np.radians(0.15)
# Steps with each blur, and the rotation below which another one is not worth it, rad.
_STEPS, _SMALL = 12, np.radians(0.005)
# Least deviation of grey values.
_NOISE = 2.0
# Parts of the map that images have shown, and in which edges were sought.
_SHOWN, _SOUGHT = 1, 2
# Share of images without a rotation from which on the camera is not followed.
_MOST_UNKNOWN = 0.2
# Focal lengths that are tried, in those of the camera; tolerance of their logarithm. Each is rated
# by the mean distance of the edges, in _AGREES and at most this number of it.
_LENSES, _TOLERANCE, _FAR = 0.6 * 1.35 ** np.arange(7), 0.02, 3.0
# Relative deviation of a focal length: a camera that is held in hands turns about an elbow, half a
# metre behind it, so what is 4 m away seems to turn by an eighth more.
_HELD = 0.06


class CameraTurns(NamedTuple):
    """The rotations of a camera's images, and what all of them show of the background."""

    #: rotations (3, 3) from the frame of the first image into that of each image, by its stamp, ns;
    #: those that are not known are missing.
    rotations: Mapping[int, FloatArray]
    unknown: int  #: number of images whose rotation is not known
    background: Image  #: (H, W) or (H, W, 3), as the first image's camera would see it, black else
    #: column and row of the first pixel of ``background`` in the first image, px.
    corner_px: tuple[int, int]

    @property
    def largest_rad(self) -> float:
        """The largest angle between the first and another image, rad."""
        return max(angle_of(turn) for turn in self.rotations.values())


def follow_turns(frames: Iterable[tuple[int, Image, Image]], camera: Camera) -> CameraTurns | None:
    """Return how the camera turns; None if the background does not show it.

    Args:
        frames: stamp, ns, image (H, W) or (H, W, 3) and silhouette (H, W), 0 or 255, of the people
            in it, in order.
        camera: intrinsics of the images.
    """
    room, rotations = _Map(camera), dict[int, FloatArray]()
    for stamp_ns, image, silhouette in frames:
        turn = room.place(image, silhouette)
        if turn is not None:
            rotations[stamp_ns] = turn
    if room.is_lost:
        return None
    left, top, right, bottom = room.shown
    corner = left - room.origin[0], top - room.origin[1]
    return CameraTurns(rotations, room.unknown, room.pixels[top:bottom, left:right], corner)


def turning_lens(
    frames: Sequence[tuple[Image, Image]], camera: Camera
) -> tuple[float, float] | None:
    """Return the focal length by how the background turns, and its relative deviation, or None.

    The length is in those of the ``camera``. ``frames`` are images and silhouettes of
    :func:`follow_turns`. None if other lenses fit as well, or edges agree on no rotation.
    """
    # Its import takes a quarter of the time in which a command starts.
    from scipy.optimize import minimize_scalar

    def seen(log_length: float) -> _Map:
        lens = exp(log_length)
        room = _Map(replace(camera, fx=lens * camera.fx, fy=lens * camera.fy))
        for one in frames:
            room.place(*one)
        return room

    tried = np.log(_LENSES)
    misfits = [seen(one).misfit for one in tried.tolist()]
    best = int(np.argmin(misfits))
    if best in (0, len(tried) - 1) or misfits[best] > 1.0:
        return None
    ends = [best - 1, best + 1]
    given = {"bounds": tuple(tried[ends]), "options": {"xatol": _TOLERANCE}}
    peak = float(minimize_scalar(lambda one: seen(one).misfit, method="bounded", **given).x)
    room = seen(peak)
    rise = np.take(misfits, ends) / room.misfit - 1.0
    if room.is_lost or rise.min() <= 0.0:
        return None
    # Edges that are near to each other err together, and so do those of all images.
    stddev = np.mean(np.abs(tried[ends] - peak) / np.sqrt(rise * room.edges / _TOGETHER))
    return exp(peak), hypot(_HELD, stddev)


class _Map:
    """The background in the image plane of the first image.

    Attributes:
        pixels: of the background, (H, W) or (H, W, 3); 0 where nothing was seen.
        origin: column and row of the first image's first pixel.
        shown: left, top, right and bottom of what images have shown so far.
        edges: the largest number of edges that were compared with an image.
        unknown: number of images without a rotation.
    """

    def __init__(self, camera: Camera) -> None:
        """Start without an image."""
        side = max(camera.width, camera.height)
        most = _MOST_SIDES * side / 2
        across, down = (round(min(_MOST_TANGENT * f, most)) for f in (camera.fx, camera.fy))
        self._camera, self._side = camera, side
        self.origin = across - round(camera.cx), down - round(camera.cy)
        self._there = camera.k
        self._there[:2, 2] += self.origin
        self._seen = np.zeros((2 * down, 2 * across), np.uint8)
        self.pixels = self._seen
        self.shown: Box = (*self.origin, *self.origin)
        self.edges = self.unknown = self._images = 0
        self._misfits = list[float]()
        # From the frame of the last image into that of the first one.
        self._back = np.eye(3)
        # Edges: directions, brightness with each blur, slopes with the last one.
        self._rays, self._slopes = np.zeros((0, 3)), np.zeros(0)
        self._values = np.zeros((len(_BLURS), 0))

    @property
    def is_lost(self) -> bool:
        """Whether too few images, or none, have a rotation."""
        return not self._images or self.unknown > _MOST_UNKNOWN * self._images

    @property
    def misfit(self) -> float:
        """Mean distance of the edges from where they are with the rotations, in ``_AGREES``."""
        return float(np.mean(self._misfits)) if self._misfits else _FAR

    def place(self, image: Image, silhouette: Image) -> FloatArray | None:
        """Return the rotation (3, 3) into an image, which continues the map; None if unknown."""
        # What is so near to the person, or to the border, does not count.
        reach = 2 * round(MARGIN * self._side) + 1
        free = np.asarray(cv2.dilate(silhouette, np.ones((reach, reach), np.uint8)) == 0)
        border = reach // 4
        inside = np.zeros_like(free)
        inside[border:-border, border:-border] = free[border:-border, border:-border]
        grey = brightness_of(image)
        levels = [blurred(grey, free, blur * self._side) for blur in _BLURS]
        is_first = self.pixels is self._seen
        back: FloatArray | None = self._back if is_first else self._placed(levels, inside)
        box = None if back is None else self._box(back)
        self._images += 1
        if back is None or box is None:
            self.unknown += 1
            return None
        self._back = back
        begin, end = np.minimum(self.shown[:2], box[:2]), np.maximum(self.shown[2:], box[2:])
        self.shown = int(begin[0]), int(begin[1]), int(end[0]), int(end[1])
        # Without a person, nobody was found, who may be there nevertheless.
        if is_first or silhouette.any():
            self._continue(image, levels, free, inside, box)
        return np.asarray(back.T)

    def _continue(
        self,
        image: Image,
        levels: Sequence[FloatArray],
        free: NDArray[np.bool_],
        inside: NDArray[np.bool_],
        box: Box,
    ) -> None:
        """Add what the last image shows and none before."""
        if not self._seen.any():
            self.pixels = np.zeros((*self._seen.shape, *image.shape[2:]), np.uint8)
        left, top, right, bottom = box
        to_box = np.array([(1.0, 0.0, -left), (0.0, 1.0, -top), (0.0, 0.0, 1.0)])
        matrix = to_box @ self._there @ self._back @ np.linalg.inv(self._camera.k)
        window, size = (slice(top, bottom), slice(left, right)), (right - left, bottom - top)
        back = cv2.WARP_INVERSE_MAP | cv2.INTER_NEAREST
        known = cv2.warpPerspective(self._seen[window], matrix, free.shape[::-1], flags=back)
        slope = np.hypot(*_slopes(levels[-1]))
        is_new = inside & (np.asarray(known) < _SOUGHT)
        rows, columns = np.nonzero(is_new & (slope > _SLOPE))
        some = slice(None, None, max(1, round(_FOR_ONE * len(rows) / max(1, is_new.sum()))))
        rows, columns = rows[some], columns[some]
        rays = self._camera.rays(np.column_stack([columns, rows])) @ self._back.T
        self._rays = np.concatenate([self._rays, rays])
        self._slopes = np.concatenate([self._slopes, slope[rows, columns]])
        added = np.array([level[rows, columns] for level in levels])
        self._values = np.concatenate([self._values, added], axis=1)
        shown, sought = (
            np.asarray(cv2.warpPerspective(255 * one.astype(np.uint8), matrix, size) == 255)
            for one in (free, inside)
        )
        fill = shown & (self._seen[window] == 0)
        self._seen[window][fill] = _SHOWN
        self._seen[window][sought] = _SOUGHT
        self.pixels[window][fill] = np.asarray(cv2.warpPerspective(image, matrix, size))[fill]

    def _placed(self, levels: Sequence[FloatArray], inside: NDArray[np.bool_]) -> FloatArray | None:
        """Return the rotation from an image into the first one."""
        camera, back = self._camera, self._back
        gain, bias = 1.0, 0.0
        near_px, last = _AGREES * self._side, (camera.width - 1, camera.height - 1)
        for level, values in zip(levels, self._values, strict=True):
            layers = np.dstack([level, *_slopes(level), inside]).astype(np.float32)
            for _ in range(_STEPS):
                local = self._rays @ back
                px = camera.project(np.maximum(local, (-np.inf, -np.inf, NEAREST_M)))
                counts = np.flatnonzero(((px > 0) & (px < last)).all(axis=1))
                if not len(counts):
                    return None
                at = px[counts, None].astype(np.float32)
                here = cv2.remap(layers, at, None, cv2.INTER_LINEAR)  # type: ignore[call-overload]
                shown, across, down, is_in = np.asarray(here, np.float64)[:, 0].T
                is_free = is_in > 0.99
                counts, shown = counts[is_free], shown[is_free]
                if len(counts) < 3 * _TOGETHER:
                    return None
                x, y = camera.rays(px[counts])[:, :2].T
                across, down = camera.fx * across[is_free], camera.fy * down[is_free]
                away = gain * shown + bias - values[counts]
                weights = 1.0 / (1.0 + (away / max(_NOISE, float(np.median(np.abs(away))))) ** 2)
                turning = np.stack(
                    [
                        across * x * y + down * (1 + y * y),
                        -across * (1 + x * x) - down * x * y,
                        across * y - down * x,
                    ]
                )
                slopes = np.vstack([gain * turning, shown, np.ones(len(shown))])
                matrix = (weights * slopes) @ slopes.T + 1e-6 * np.eye(5)
                step = np.linalg.solve(matrix, -(weights * slopes) @ away)
                back = back @ cv2.Rodrigues(step[:3])[0]
                gain, bias = gain + step[3], bias + step[4]
                if np.linalg.norm(step[:3]) < _SMALL:
                    break
        off = np.abs(away) / (near_px * self._slopes[counts])
        self._misfits.append(float(np.minimum(off, _FAR).mean()))
        self.edges = max(self.edges, len(off))
        agree = off < 1.0
        # Edges tell how they move across themselves, in px.
        normals = turning[:, agree] / np.maximum(self._slopes[counts][agree], 1e-9)
        tell = normals @ normals.T / _TOGETHER / near_px**2
        stddev = 1.0 / np.sqrt(max(float(np.linalg.eigvalsh(tell)[0]), 1e-12))
        return back if agree.mean() >= _LEAST_SHARE and stddev <= _MOST_STDDEV else None

    def _box(self, back: FloatArray) -> Box | None:
        """Return the part of the map that an image fills, or None if it is beyond the map."""
        camera = self._camera
        ends = [(x, y) for x in (-0.5, camera.width - 0.5) for y in (-0.5, camera.height - 0.5)]
        there = camera.rays(np.array(ends)) @ (self._there @ back).T
        if (there[:, 2] <= 0).any():
            return None
        px = there[:, :2] / there[:, 2:]
        (left, top), (right, bottom) = np.rint(px.min(axis=0) + 0.5), np.rint(px.max(axis=0) + 0.5)
        if left < 0 or top < 0 or right > self._seen.shape[1] or bottom > self._seen.shape[0]:
            return None
        return int(left), int(top), int(right), int(bottom)


def blurred(grey: Image, free: NDArray[np.bool_], stddev_px: float) -> FloatArray:
    """Return an image (H, W) that is blurred by what is free alone."""
    weight = cv2.GaussianBlur(free.astype(np.float32), None, stddev_px)  # type: ignore[call-overload]
    kept = cv2.GaussianBlur(np.where(free, grey, 0).astype(np.float32), None, stddev_px)  # type: ignore[call-overload]
    return np.asarray(kept / np.maximum(weight, 1e-3))


def _slopes(image: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the slopes of an image (H, W) across and down, grey values a pixel."""
    down, across = np.gradient(image)
    return np.asarray(across), np.asarray(down)
