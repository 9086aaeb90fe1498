"""The pinhole camera, its calibration, and lens distortion."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera_checks import (
    DISTORTION_MODELS,
    distortion_problem,
    lens_problem,
    matrix_problem,
    normal_lens,
    numbers_of,
    real_number,
    whole_pixels,
)
from cardbox_tracker.common.errors import CameraError, quoted

FloatArray = NDArray[np.float64]

# Largest difference of the aspect ratios of a calibration and of the images.
_ASPECT = 0.02
# Programs that resize a calibration count pixels from their corners or from their centres.
_SAME_PX = 1.0
WORKING_SIZE = (320, 240)
"""Working size (width, height), px, of images of 4:3; others have as many pixels."""
# The kernels draw rows of pixels fastest if their number is a multiple of this.
_MULTIPLE_PX = 8
NEAREST_M = 0.1
"""Depth of points that are nearer to a camera, or behind it, when they are projected, m."""
OPTICAL_FRAME = "camera_optical_frame"
"""Name of the optical frame of a camera that has none."""
CALIBRATED, GIVEN_FIELD_OF_VIEW = 0.005, 0.03
"""Relative standard deviations of the focal lengths: of a calibration, and of a field of view that
a person states."""
# Largest side of a JPEG image; a CameraInfo and a file may contain any number.
_MOST_SIDE_PX = 65535
# Of a field of view of nearly 180 degrees; no lens is so unknown.
_MOST_STDDEV = 100.0


def roll_turn(roll_rad: float) -> FloatArray:
    """Return the rotation (3, 3) from the optical frame of a rolled camera into the upright one."""
    c, s = np.cos(roll_rad), np.sin(roll_rad)
    return np.array([(c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)])


def level_to_optical(pitch_rad: float, roll_rad: float = 0.0) -> FloatArray:
    """Return the rotation (3, 3) from the level reference frame into the optical frame.

    Without ``roll_rad`` it is the frame of images that are turned upright, else of the camera
    itself.
    """
    # Level camera: x_optical = Y, y_optical = -Z, z_optical = -X of the reference frame.
    level = np.array([(0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (-1.0, 0.0, 0.0)])
    c, s = np.cos(pitch_rad), np.sin(pitch_rad)
    look_down = np.array([(1.0, 0.0, 0.0), (0.0, c, -s), (0.0, s, c)])
    rotation: FloatArray = look_down @ level
    return roll_turn(roll_rad).T @ rotation if roll_rad else rotation


@dataclass(frozen=True)
class Camera:
    """An ideal pinhole camera at a working resolution.

    Raises CameraError if a value is impossible; the text names it.
    """

    width: int  #: image width, px
    height: int  #: image height, px
    fx: float  #: horizontal focal length, px
    fy: float  #: vertical focal length, px
    cx: float  #: principal point, px; (0, 0) is the centre of the first pixel
    cy: float  #: principal point, px
    pitch_rad: float = 0.0  #: downward pitch of the camera, rad; the reference frame stays level
    focal_stddev: float = CALIBRATED  #: relative standard deviation of the focal lengths

    def __post_init__(self) -> None:
        """Check the values; whole numbers of another type become ``int``."""
        for name in ("width", "height"):
            object.__setattr__(self, name, whole_pixels(name, getattr(self, name)))
        for name in ("fx", "fy", "cx", "cy", "pitch_rad", "focal_stddev"):
            object.__setattr__(self, name, real_number(name, getattr(self, name)))
        if not 0.0 <= self.focal_stddev <= _MOST_STDDEV:
            raise CameraError(
                f"the deviation of the camera's focal lengths is {self.focal_stddev:g}; expected a "
                f"share of them from 0 to {_MOST_STDDEV:g}, such as 0.02"
            )
        if not all(0 < side <= _MOST_SIDE_PX for side in (self.width, self.height)):
            raise CameraError(
                f"the camera's image has {self.width}x{self.height} px; expected 1 to "
                f"{_MOST_SIDE_PX} each: give the size of the silhouettes"
            )
        if not all(0.0 < length < math.inf for length in (self.fx, self.fy)):
            raise CameraError(
                f"the camera's focal lengths are {self.fx:g} and {self.fy:g} px; expected finite "
                "numbers above 0: calibrate the camera, or take half of the image's width divided "
                "by the tangent of half the field of view"
            )
        if not all(map(math.isfinite, (self.cx, self.cy, self.pitch_rad))):
            raise CameraError(
                f"the camera's principal point ({self.cx:g}, {self.cy:g}) px or pitch "
                f"{self.pitch_rad:g} rad is not finite; expected the middle of the image and the "
                "angle by which the camera looks down"
            )

    def scaled(self, width: int, height: int) -> Camera:
        """Return the same camera with its image resized to ``width`` x ``height`` px."""
        sx, sy = width / self.width, height / self.height
        return Camera(
            width,
            height,
            self.fx * sx,
            self.fy * sy,
            # The centre of the first pixel is half a pixel inside the image.
            (self.cx + 0.5) * sx - 0.5,
            (self.cy + 0.5) * sy - 0.5,
            self.pitch_rad,
            self.focal_stddev,
        )

    @property
    def k(self) -> FloatArray:
        """The matrix (3, 3) of rays to pixels."""
        return np.array([(self.fx, 0.0, self.cx), (0.0, self.fy, self.cy), (0.0, 0.0, 1.0)])

    def with_pitch(self, pitch_rad: float) -> Camera:
        """Return the same camera looking down by ``pitch_rad``."""
        return replace(self, pitch_rad=pitch_rad)

    def reference_to_optical_rotation(self) -> FloatArray:
        """Return the rotation (3, 3) from the reference frame into the optical frame."""
        return level_to_optical(self.pitch_rad)

    def reference_to_optical(self, points_m: FloatArray) -> FloatArray:
        """Rotate points (..., 3), metres, from the level reference frame into the optical frame."""
        turned: FloatArray = np.asarray(points_m) @ self.reference_to_optical_rotation().T
        return turned

    def optical_to_reference(self, points_m: FloatArray) -> FloatArray:
        """Rotate points (..., 3), metres, from the optical frame into the level reference frame."""
        turned: FloatArray = np.asarray(points_m) @ self.reference_to_optical_rotation()
        return turned

    def project(self, points_m: FloatArray) -> FloatArray:
        """Project points (..., 3), metres, of the optical frame, z > 0, to pixels (..., 2)."""
        points = np.asarray(points_m, dtype=np.float64)
        z = points[..., 2]
        return np.stack(
            [self.fx * points[..., 0] / z + self.cx, self.fy * points[..., 1] / z + self.cy], -1
        )

    def rays(self, px: FloatArray) -> FloatArray:
        """Return the points (..., 3) at the depth 1 of pixels (..., 2), in the optical frame."""
        across = (np.asarray(px, np.float64) - (self.cx, self.cy)) / (self.fx, self.fy)
        return np.concatenate([across, np.ones((*across.shape[:-1], 1))], -1)


@dataclass(frozen=True)
class Calibration:
    """Calibration of a real camera, from a CameraInfo message or a camera_calibration file."""

    width: int  #: calibrated image width, px
    height: int  #: calibrated image height, px
    k: FloatArray  #: intrinsic matrix (3, 3)
    #: coefficients (n,) of ``distortion_model``; all zero without distortion
    distortion: FloatArray
    #: ``plumb_bob``, ``rational_polynomial`` or ``equidistant``; other names and numbers of
    #: coefficients become those of :func:`~.lens.normal_lens`
    distortion_model: str = "plumb_bob"
    frame_id: str = OPTICAL_FRAME  #: name of the optical frame, which has no leading slash
    #: how far the camera is turned clockwise about its axis, seen from behind it; working images
    #: are turned back, so that they are level. Near a quarter turn, width and height are exchanged.
    roll_rad: float = 0.0
    focal_stddev: float = CALIBRATED  #: relative standard deviation of the focal lengths
    is_mirrored: bool = False  #: whether the images are mirrored; working images are turned back
    told_by: str = ""  #: what tells the focal lengths, in words; empty if that is not known
    #: how many views of the camera fill an image; working images have so many times more pixels.
    views: float = 1.0
    region_px: int = 0  #: width of the region of the sensor of which images are; 0 for all of it

    def __post_init__(self) -> None:
        """Check the types, and bring the lens and the name of the frame into their usual form."""
        for name in ("width", "height"):
            object.__setattr__(self, name, whole_pixels(name, getattr(self, name)))
        for name in ("roll_rad", "focal_stddev", "views"):
            if not math.isfinite(real_number(name, getattr(self, name))):
                raise CameraError(f"the camera's {name} is no finite number")
        for name in ("distortion_model", "frame_id"):
            if not isinstance(given := getattr(self, name), str):
                raise CameraError(f"the camera's {name} is {quoted(given)}; expected text")
        object.__setattr__(self, "k", numbers_of("K", self.k, (3, 3)))
        distortion = numbers_of("distortion", self.distortion)
        model, distortion = normal_lens(self.distortion_model, distortion)
        object.__setattr__(self, "distortion_model", model)
        object.__setattr__(self, "distortion", distortion)
        object.__setattr__(self, "frame_id", self.frame_id.lstrip("/") or OPTICAL_FRAME)

    @classmethod
    def of_fov(cls, width: int, height: int, fov_deg: float) -> Calibration:
        """Return an ideal lens with a field of view, 0 to 180 degrees, across the image's width."""
        fov_deg = real_number("field of view", fov_deg)
        if not 1e-3 <= fov_deg < 180.0:
            raise CameraError(
                f"the field of view is {fov_deg:g} degrees; expected 0.001 or more, less than 180"
            )
        focal_px = width / 2 / np.tan(np.radians(fov_deg) / 2)
        k = np.diag([focal_px, focal_px, 1.0])
        k[:2, 2] = (width - 1) / 2, (height - 1) / 2
        return cls(width, height, k, np.zeros(5), focal_stddev=GIVEN_FIELD_OF_VIEW)

    @property
    def is_distorted(self) -> bool:
        """Whether any distortion coefficient is not zero."""
        return bool(np.any(self.distortion != 0))

    def is_same(self, other: Calibration) -> bool:
        """Return whether ``other`` has the same intrinsics; the names of the frames may differ."""
        return (
            (self.width, self.height) == (other.width, other.height)
            and np.array_equal(self.k, other.k)
            and self._lens() == other._lens()
            and self.roll_rad == other.roll_rad
            and self.is_mirrored == other.is_mirrored
        )

    def is_resized(self, other: Calibration) -> bool:
        """Return whether ``other`` is the same camera, whose images have another size."""
        scale = np.diag([other.width / self.width, other.height / self.height, 1.0])
        return (
            self.width != other.width
            and self.has_shape(other.width, other.height)
            and np.allclose(scale @ self.k, other.k, rtol=0.0, atol=_SAME_PX)
            and self.is_same(replace(other, width=self.width, height=self.height, k=self.k))
        )

    def _lens(self) -> tuple[Any, ...]:
        """Return model and coefficients of the distortion; empty without distortion."""
        return (self.distortion_model, *self.distortion) if self.is_distorted else ()

    def __str__(self) -> str:
        """Return a short description with size, focal length and lens."""
        lens = self.distortion_model if self.is_distorted else "no distortion"
        return f"{self.width}x{self.height}, f {self.k[0, 0]:g} px, {lens}"

    def has_shape(self, width: int, height: int) -> bool:
        """Return whether images of ``width`` x ``height`` px have the same aspect ratio."""
        return min(width, height) > 0 and (
            abs(width * self.height / (height * self.width) - 1) < _ASPECT
        )

    def stretched(self, across: float, down: float) -> Calibration:
        """Return the calibration of the same images, wider and higher by these factors."""
        full = self.camera(round(self.width * across), round(self.height * down))
        return replace(self, width=full.width, height=full.height, k=full.k)

    def working_size(self, most: tuple[int, int] = WORKING_SIZE) -> tuple[int, int]:
        """Return the size (width, height), px, at which images as they are sent are used.

        It has their aspect ratio, and about as many pixels as ``most`` in each view. Raises
        CameraError as :meth:`camera` does.
        """
        self._check()
        aspect = self.width / self.height
        width = _multiple(_MULTIPLE_PX, math.sqrt(self.views * most[0] * most[1] * aspect))
        # Colours are kept for two pixels across and down.
        return width, _multiple(2, width / aspect)

    def level_size(self, width: int, height: int) -> tuple[int, int]:
        """Return the size of images of ``width`` x ``height`` px after they are turned level."""
        return (height, width) if self._quarters % 2 else (width, height)

    @property
    def _quarters(self) -> int:
        """Number of quarter turns, 0 to 3, nearest to the roll."""
        return round(self.roll_rad / (math.pi / 2)) % 4

    def check_shape(self, width: int, height: int, images: str, source: str) -> None:
        """Raise CameraError unless images of ``width`` x ``height`` px have this aspect ratio.

        Images of a region must not be larger than it, either. ``images`` and ``source`` name the
        images and the origin of the calibration in the text.
        """
        if min(self.width, self.height) > 0 and not self.has_shape(width, height):
            raise CameraError(
                f"the calibration of {source} is for images of {self.width}x{self.height}, but "
                f"those of {images} are {width}x{height}, another shape; calibrate the camera at "
                "the size it delivers, or with images of the same aspect ratio and orientation"
            )
        if 0 < self.region_px < width:
            raise CameraError(
                f"the region of interest in {source} is {self.region_px} px wide, but the images "
                f"of {images} have {width}x{height}; expected no more than the region: "
                "correct the camera's driver, or give --fov DEG or --calibration FILE"
            )

    def camera(self, width: int, height: int, pitch_rad: float = 0.0) -> Camera:
        """Return the pinhole camera at the working resolution ``width`` x ``height``, px.

        Raises CameraError if the camera is uncalibrated or its distortion model is unknown.
        """
        self._check()
        w, h, k = self.width, self.height, self.k
        cx, cy = k[0, 2], k[1, 2]
        right, down = w - 1 - cx, h - 1 - cy
        cx, cy = ((cx, cy), (down, cx), (right, down), (cy, right))[self._quarters]
        fx, fy = self.level_size(k[0, 0], k[1, 1])
        w, h = self.level_size(w, h)
        cx = w - 1 - cx if self.is_mirrored else cx
        full = Camera(w, h, fx, fy, cx, cy, pitch_rad, self.focal_stddev)
        return full.scaled(width, height)

    def rectifier(self, width: int, height: int) -> Rectifier | None:
        """Return a rectifier for level images of ``width`` x ``height`` px; None if none is needed.

        Raises CameraError as :meth:`camera` does.
        """
        self._check()
        turn = self.turn()
        if not self.is_distorted and np.array_equal(turn, np.eye(3)):
            return None
        sent = replace(self, roll_rad=0.0, is_mirrored=False)
        level = self.camera(width, height).k
        k = sent.camera(*self.level_size(width, height)).k
        size = (width, height)
        if not self.is_distorted:
            maps = cv2.initUndistortRectifyMap(k, np.zeros(5), turn, level, size, cv2.CV_16SC2)
        elif self.distortion_model == "equidistant":
            maps = cv2.fisheye.initUndistortRectifyMap(
                k, self.distortion[:4].reshape(4, 1), turn, level, size, cv2.CV_16SC2
            )
        else:
            maps = cv2.initUndistortRectifyMap(k, self.distortion, turn, level, size, cv2.CV_16SC2)
        return Rectifier(*maps)

    def turn(self) -> FloatArray:
        """Return the matrix (3, 3) that makes rays of the camera level, and mirrors them back."""
        turn = roll_turn(self.roll_rad)
        return turn * [(-1.0,), (1.0,), (1.0,)] if self.is_mirrored else turn

    def rectified(self, px: FloatArray, width: int, height: int) -> FloatArray:
        """Return where pixels (N, 2) of the calibrated image lie in the working image, px."""
        camera, rays = self.camera(width, height), np.empty((len(px), 2))
        if not self.is_distorted:
            rays[:] = (px - self.k[:2, 2]) / self.k.diagonal()[:2]
        elif self.distortion_model == "equidistant":
            lens = self.distortion[:4].reshape(4, 1)
            rays[:] = cv2.fisheye.undistortPoints(px[:, None], self.k, lens).reshape(-1, 2)
        else:
            rays[:] = cv2.undistortPoints(px[:, None], self.k, self.distortion).reshape(-1, 2)
        if self.roll_rad or self.is_mirrored:
            rays = rays @ self.turn()[:2, :2].T
        placed: FloatArray = rays * (camera.fx, camera.fy) + (camera.cx, camera.cy)
        return placed

    def _check(self) -> None:
        size = (self.width, self.height)
        if not all(0 < side <= _MOST_SIDE_PX for side in size):
            raise CameraError(
                f"the calibration is for an image of {quoted(self.width)}x{quoted(self.height)}; "
                f"expected the camera's size in pixels, at most {_MOST_SIDE_PX} each: calibrate "
                "the camera, or fill in width and height"
            )
        problem = matrix_problem(self.k, self.width, self.height)
        if problem:
            raise CameraError(
                f"the camera is not calibrated (its matrix K {problem}); calibrate it with "
                "camera_calibration, or give its driver a calibration file"
            )
        problem = distortion_problem(self.distortion)
        if problem:
            raise CameraError(
                f"the distortion coefficients D {problem}; calibrate the camera anew, or feed "
                "rectified images with all-zero distortion"
            )
        if self.is_distorted and self.distortion_model not in DISTORTION_MODELS:
            raise CameraError(
                f"distortion model {quoted(self.distortion_model)} is unknown; supported are "
                f"{', '.join(DISTORTION_MODELS)}: calibrate with one of those, or feed "
                "rectified images with all-zero distortion"
            )
        problem = lens_problem(self.distortion_model, self.distortion)
        if self.is_distorted and problem:
            raise CameraError(problem)


def _multiple(step: int, side: float) -> int:
    return max(1, round(side / step)) * step


class Rectifier:
    """Undistorts images of one size with maps computed once."""

    def __init__(self, map_1: NDArray[Any], map_2: NDArray[Any]) -> None:
        """Keep the fixed-point maps of ``cv2.remap``."""
        self._maps = (map_1, map_2)

    def __call__(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return ``image`` (H, W) or (H, W, 3) undistorted; its border is repeated beyond it."""
        rectified = cv2.remap(image, *self._maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(rectified, dtype=np.uint8)


def unrectified(calibration: Calibration, px: FloatArray, width: int, height: int) -> FloatArray:
    """Return where pixels (N, 2) of a working image of that size lie in the calibrated image.

    This is the inverse of :meth:`.Calibration.rectified`, and raises CameraError like that.
    """
    camera = calibration.camera(width, height)
    rays = camera.rays(px)[:, :2] @ calibration.turn()[:2, :2]
    k, lens = calibration.k, calibration.distortion
    if not calibration.is_distorted:
        return np.asarray(rays * k.diagonal()[:2] + k[:2, 2])
    if calibration.distortion_model == "equidistant":
        placed = cv2.fisheye.distortPoints(rays[:, None], k, lens[:4].reshape(4, 1))
    else:
        ahead, none = np.column_stack([rays, np.ones(len(rays))]), np.zeros(3)
        placed, _ = cv2.projectPoints(ahead, none, none, k, lens)
    return np.asarray(placed.reshape(-1, 2))
