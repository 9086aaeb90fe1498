"""The calibration of a camera from views of a board, or of a sheet of paper, with its deviation.

Each view of a plane gives two equations for the intrinsics (Zhang, "A flexible new technique for
camera calibration", PAMI 2000). How well the corners fit does not tell how well these are known:
views that are alike fit any focal length. So the deviation comes from the jackknife, which leaves
out each of some groups of views (Efron and Tibshirani, "An introduction to the bootstrap", 1993,
equation 11.5), and views that are alike are refused.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, islice
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import CALIBRATED, Calibration
from cardbox_tracker.common.errors import CameraError, quoted

FloatArray = NDArray[np.float64]
Grey = NDArray[np.uint8]

CHESSBOARD, CHARUCO, A4 = "chessboard", "charuco", "a4"
BOARDS = "COLUMNSxROWS, the inner corners of a chessboard, charuco:COLUMNSxROWS, its squares, or a4"
"""How a board is named."""
LEAST_VIEWS = 6
"""Fewest views of a calibration."""
# Long by short side of paper of ISO 216, and the relative deviation of a sheet that bends.
_PAPER_RATIO, _PAPER_STDDEV = 2.0**0.5, 0.01
# Largest and smallest image of a sheet beside that ratio, before the focal length is known, and
# least share of the image that it covers, and of its outline that hands leave.
_RATIO_OFF, _LEAST_SHEET, _LEAST_FULL = 1.2, 0.01, 0.8
# Width of a marker as a share of its square on usual boards; least corners of a view.
_MARKER, _LEAST_CORNERS = 0.75, 8
_DICTIONARIES = (
    *("DICT_4X4_1000", "DICT_5X5_1000", "DICT_6X6_1000", "DICT_7X7_1000"),
    *("DICT_ARUCO_ORIGINAL", "DICT_APRILTAG_36h11"),
)
# Views that differ less, as a share of the image's width, are the same; most views that are used.
_SAME, _MOST_VIEWS = 0.02, 40
# Least angle between two boards, degrees; without a lens, this field of view is taken for it.
_LEAST_TURN_DEG, _USUAL_FOV_DEG = 15.0, 60.0
# Groups of the jackknife; errors of a view, beside the median, from which on it is left out.
_GROUPS, _OUTLIER = 8, 3.0
# Images in which other boards are sought.
_OTHERS = 20
_LENS = cv2.CALIB_FIX_K3
_PLAIN = cv2.CALIB_FIX_PRINCIPAL_POINT | cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_ZERO_TANGENT_DIST
_PLAIN |= cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3


class View(NamedTuple):
    """The corners of a board in an image.

    Attributes:
        board: where they are on the board, in squares or sheets, (n, 3).
        px: column and row of each, (n, 2).
    """

    board: NDArray[np.float32]
    px: NDArray[np.float32]


class Calibrated(NamedTuple):
    """A calibration and how well its views fit.

    Attributes:
        calibration: with the deviation of its focal length.
        views: number of views that it rests on.
        error_px: root mean square of the distances of the corners.
        turn_deg: largest angle between two of the boards.
    """

    calibration: Calibration
    views: int
    error_px: float
    turn_deg: float


@dataclass(frozen=True)
class Board:
    """A chessboard, a ChArUco board, or a sheet of A4.

    Attributes:
        kind: one of those.
        columns: inner corners of a chessboard, squares of a ChArUco board, 2 for a sheet.
        rows: the same.
    """

    kind: str
    columns: int
    rows: int

    @classmethod
    def parse(cls, text: str) -> Board:
        """Return the board of a name (``BOARDS``); ValueError if it is none."""
        if text.lower() == A4:
            return cls(A4, 2, 2)
        match = re.fullmatch(r"(charuco:)?(\d{1,2})x(\d{1,2})", text.lower())
        if match is None or min(map(int, match.groups()[1:])) < 3:
            raise ValueError(f"expected {BOARDS}, each 3 or more, got {quoted(text)}")
        return cls(CHARUCO if match[1] else CHESSBOARD, int(match[2]), int(match[3]))

    def __str__(self) -> str:
        """Return what an image has to show."""
        if self.kind == A4:
            return "sheet of A4"
        if self.kind == CHARUCO:
            return f"ChArUco board of {self.columns}x{self.rows} squares"
        return f"chessboard of {self.columns}x{self.rows} inner corners"

    def view(self, image: Grey) -> View | None:
        """Return the corners in an image (H, W); None if the board is not found."""
        return self._find(image)

    @cached_property
    def _find(self) -> Callable[[Grey], View | None]:
        if self.kind == A4:
            return _sheet
        return _Charuco(self.columns, self.rows) if self.kind == CHARUCO else self._chessboard

    def _chessboard(self, image: Grey) -> View | None:
        is_found, corners = cv2.findChessboardCornersSB(image, (self.columns, self.rows))
        if not is_found:
            return None
        at = np.mgrid[: self.columns, : self.rows].T.reshape(-1, 2)
        return View(_flat(at), corners.reshape(-1, 2).astype(np.float32))

    def other(self, images: Iterable[Grey]) -> str:
        """Return what images (H, W) show in place of the board, in words; empty if nothing."""
        if self.kind != CHESSBOARD:
            return ""
        for image in islice(images, _OTHERS):
            found = cv2.findChessboardCornersSBWithMeta(image, (3, 3), cv2.CALIB_CB_LARGER)
            if found[0]:
                fewer, more = sorted(found[2].shape[:2])
                return f"; there is one of about {more}x{fewer} inner corners"
        return ""


class _Charuco:
    """Finder of a ChArUco board, whose dictionary and pattern are those that the images fit."""

    def __init__(self, columns: int, rows: int) -> None:
        self._detectors = []
        for name in _DICTIONARIES:
            for is_legacy in (False, True):
                number = getattr(cv2.aruco, name)
                dictionary = cv2.aruco.getPredefinedDictionary(number)
                board = cv2.aruco.CharucoBoard((columns, rows), 1.0, _MARKER, dictionary)
                board.setLegacyPattern(is_legacy)
                self._detectors.append((board, cv2.aruco.CharucoDetector(board)))

    def __call__(self, image: Grey) -> View | None:
        best: View | None = None
        for board, detector in self._detectors:
            px, ids, *_ = detector.detectBoard(image)
            if ids is None or len(ids) < max(_LEAST_CORNERS, 0 if best is None else len(best.px)):
                continue
            corners = np.asarray(board.getChessboardCorners(), np.float32)
            at, px = corners[ids.ravel()], np.asarray(px, np.float32).reshape(-1, 2)
            if np.ptp(at, axis=0)[:2].min() > 0.5 and (best is None or len(px) > len(best.px)):
                best, found = View(at, px), (board, detector)
        if best is not None:
            self._detectors = [found]
        return best


def _flat(at: NDArray[Any]) -> NDArray[np.float32]:
    """Return places on a plane (n, 2) in space, (n, 3)."""
    return np.pad(at.astype(np.float32), ((0, 0), (0, 1)))


def _sheet(image: Grey) -> View | None:
    """Return the corners of the largest bright sheet in an image, clockwise."""
    height, width = image.shape
    smooth = cv2.GaussianBlur(image, (5, 5), 0)
    _, bright = cv2.threshold(smooth, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    outlines, _ = cv2.findContours(bright, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    guess = Calibration.of_fov(width, height, _USUAL_FOV_DEG).k
    for outline in sorted(outlines, key=cv2.contourArea, reverse=True):
        area = cv2.contourArea(outline)
        if area < _LEAST_SHEET * width * height:
            return None
        # Hands cut into the outline, but not into its hull.
        hull = cv2.convexHull(outline)
        quad = cv2.approxPolyDP(hull, 0.02 * cv2.arcLength(hull, True), True).reshape(-1, 2)
        is_inside = ((quad > 2) & (quad < (width - 3, height - 3))).all()
        if len(quad) != 4 or not is_inside or area < _LEAST_FULL * cv2.contourArea(hull):
            continue
        corners = _crossings(outline.reshape(-1, 2), quad.astype(np.float64))
        square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
        ends = np.linalg.solve(guess, cv2.getPerspectiveTransform(square, corners))
        ratio = float(np.linalg.norm(ends[:, 0]) / np.linalg.norm(ends[:, 1]))
        if ratio < 1.0:
            corners, ratio = np.roll(corners, -1, axis=0), 1.0 / ratio
        if 1 / _RATIO_OFF < ratio / _PAPER_RATIO < _RATIO_OFF:
            return View(_flat(square * (_PAPER_RATIO, 1.0)), corners)
    return None


def _crossings(outline: NDArray[Any], quad: FloatArray) -> NDArray[np.float32]:
    """Return where the lines cross that fit the outline (n, 2) along the sides of ``quad``."""
    lines = []
    for begin, end in zip(quad, np.roll(quad, -1, axis=0), strict=True):
        along = (end - begin) / np.linalg.norm(end - begin)
        away = outline - begin
        far = away @ along / np.linalg.norm(end - begin)
        is_near = np.abs(away @ (-along[1], along[0])) < 3.0
        side = outline[is_near & (far > 0.1) & (far < 0.9)]
        if len(side) < _LEAST_CORNERS:
            lines.append(np.cross([*begin, 1.0], [*end, 1.0]))
            continue
        x, y, *at = cv2.fitLine(side.astype(np.float32), cv2.DIST_HUBER, 0, 0.01, 0.01).ravel()
        lines.append(np.cross([*at, 1.0], [at[0] + x, at[1] + y, 1.0]))
    crossed = np.array([np.cross(lines[i - 1], lines[i]) for i in range(4)])
    return np.asarray(crossed[:, :2] / crossed[:, 2:], np.float32)


def board_views(board: Board, images: Iterable[Grey]) -> tuple[list[View], int]:
    """Return the views of a board in images (H, W) that differ, and how many images show it."""
    views, kept, shown = list[View](), list[FloatArray](), 0
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float64)
    for image in images:
        view = board.view(image)
        if view is None:
            continue
        shown += 1
        # It is None for corners on one line.
        turned: Any = cv2.findHomography(view.board[:, :2], view.px)[0]
        if turned is None:
            continue
        ends = square[None] * (board.columns, board.rows)
        there = cv2.perspectiveTransform(ends, turned)[0]
        limit = _SAME * image.shape[1]
        if all(np.abs(there - other).mean() > limit for other in kept):
            kept.append(there)
            views.append(view)
    return views, shown


def calibrated(board: Board, views: Sequence[View], width: int, height: int) -> Calibrated:
    """Return the calibration of images of ``width`` x ``height`` px by views of a board.

    A sheet shows the focal length alone; a board also principal point and distortion. Raises
    CameraError if there are too few views, or all are alike.
    """
    if len(views) < LEAST_VIEWS:
        raise CameraError(
            f"{len(views)} different views show the {board}; expected {LEAST_VIEWS} or more, "
            "better 20: move it slowly to all parts of the image, near and far, and tilt it to all "
            "sides"
        )
    views = [views[i] for i in np.unique(np.linspace(0, len(views) - 1, _MOST_VIEWS).astype(int))]
    guess = Calibration.of_fov(width, height, _USUAL_FOV_DEG).k
    turn_deg = _turn_deg(views, guess)
    if turn_deg < _LEAST_TURN_DEG:
        raise CameraError(
            f"all {len(views)} views of the {board} are alike: they are tilted by at most "
            f"{turn_deg:.0f} degrees against each other, which shows no focal length; tilt it by "
            "30 degrees and more, to all sides"
        )
    flags = _PLAIN if board.kind == A4 else _LENS

    def fit(used: Sequence[View]) -> tuple[Any, Any, Any]:
        on_board, px = [one.board for one in used], [one.px for one in used]
        given = on_board, px, (width, height), guess.copy(), np.zeros(5)
        _, k, lens, *_, errors_px = cv2.calibrateCameraExtended(
            *given, flags=flags | cv2.CALIB_USE_INTRINSIC_GUESS
        )
        return np.asarray(k), np.asarray(lens).ravel(), np.asarray(errors_px).ravel()

    *_, errors_px = fit(views)
    limit = _OUTLIER * float(np.median(errors_px))
    views = [view for view, error in zip(views, errors_px, strict=True) if error <= limit]
    k, lens, errors_px = fit(views)
    groups = min(_GROUPS, len(views))
    without = [
        fit([view for i, view in enumerate(views) if i % groups != group])[0][0, 0]
        for group in range(groups)
    ]
    # Of a film, views beside each other are alike, so each group has views of the whole film.
    spread = float(np.sqrt(groups - 1) * np.std(np.log(without)))
    stddev = float(np.hypot(spread, _PAPER_STDDEV if board.kind == A4 else CALIBRATED))
    found = Calibration(width, height, k, lens[:5], focal_stddev=stddev)
    found.camera(width, height)
    error_px = float(np.sqrt(np.mean(errors_px**2)))
    return Calibrated(found, len(views), error_px, _turn_deg(views, k))


def _turn_deg(views: Sequence[View], k: FloatArray) -> float:
    """Return the largest angle between two boards, degrees."""
    poses = [cv2.solvePnP(view.board, view.px, k, None)[1] for view in views]
    normals = [cv2.Rodrigues(one)[0][:, 2] for one in poses]
    # A board that is turned by half a turn in its plane has the same normal.
    cosines = [float(np.clip(abs(a @ b), 0.0, 1.0)) for a, b in combinations(normals, 2)]
    return float(np.degrees(np.arccos(min(cosines))))
