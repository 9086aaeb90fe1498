"""The lens is found from a film of a board, within the deviation that is told."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from cardbox_tracker.camera.board import Board, board_views, calibrated
from cardbox_tracker.camera.calibration_file import load_calibration
from cardbox_tracker.common.errors import CameraError

WIDTH, HEIGHT, FOCAL_PX = 640, 480, 560.0
K = np.array([(FOCAL_PX, 0.0, 319.5), (0.0, FOCAL_PX, 239.5), (0.0, 0.0, 1.0)])
# Turns about the two axes of the image, degrees; aside, down and away, widths of the board.
VIEWS = [
    *[(0, 0, 0.0, 0.0, 1.6), (35, 0, 0.1, 0.1, 1.5), (-35, 5, -0.1, 0.0, 1.6)],
    *[(0, 35, 0.1, -0.1, 1.5), (5, -35, 0.0, 0.1, 1.7), (25, 25, -0.2, 0.1, 1.8)],
    *[(-25, 25, 0.2, -0.1, 1.8), (25, -25, 0.3, 0.15, 2.2), (-25, -25, -0.3, -0.15, 2.2)],
    *[(15, 30, 0.35, 0.2, 2.0), (-30, -10, -0.35, 0.2, 2.1), (40, 10, 0.0, -0.2, 1.9)],
]


def chessboard(columns: int, rows: int, square: int = 60) -> np.ndarray:
    """Return a board with inner corners, with a white margin."""
    rows_of, columns_of = np.mgrid[: rows + 1, : columns + 1]
    squares = np.where((rows_of + columns_of) % 2 == 0, 0, 255).astype(np.uint8)
    return np.pad(
        np.kron(squares, np.ones((square, square), np.uint8)), square, constant_values=255
    )


@cache
def chessboard_seen(columns: int, rows: int) -> list[np.ndarray]:
    return seen(chessboard(columns, rows))


def seen(
    board: np.ndarray, views: Sequence[Sequence[float]] = VIEWS, behind: int = 110
) -> list[np.ndarray]:
    """Return the images (480, 640) of a picture of a board in each view."""
    images = []
    high, wide = board.shape
    for turn, tilt, x, y, z in views:
        about = cv2.Rodrigues(np.radians([turn, 0.0, 0.0]))[0]
        about = about @ cv2.Rodrigues(np.radians([0.0, tilt, 0.0]))[0]
        # From pixels of the board to its middle, in widths of the board.
        to_board = np.array([(1 / wide, 0, -0.5), (0, 1 / wide, -high / wide / 2), (0, 0, 1)])
        to_image = K @ np.column_stack([about[:, 0], about[:, 1], (x, y, z)]) @ to_board
        # Drawn four times as large, the edges are as smooth as those of a camera.
        larger = np.array([(4.0, 0.0, 1.5), (0.0, 4.0, 1.5), (0.0, 0.0, 1.0)]) @ to_image
        size = (4 * WIDTH, 4 * HEIGHT)
        drawn = np.full(size[::-1], behind, np.uint8)
        cv2.warpPerspective(board, larger, size, drawn, cv2.INTER_AREA, cv2.BORDER_TRANSPARENT)
        images.append(cv2.resize(drawn, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA))
    return images


SHEET = np.full((707, 1000), 235, np.uint8)


def charuco() -> np.ndarray:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_50)
    board = cv2.aruco.CharucoBoard((5, 7), 1.0, 0.7, dictionary)
    return np.asarray(board.generateImage((500, 700), marginSize=30), np.uint8)


@pytest.mark.parametrize("name", ["9x6", "charuco:5x7", "a4"])
def test_views_of_a_board_show_the_lens(name: str) -> None:
    rng = np.random.default_rng(0)
    pictures = {"9x6": chessboard(9, 6), "charuco:5x7": charuco(), "a4": SHEET}
    images = [
        np.clip(image + rng.normal(0.0, 3.0, image.shape), 0, 255).astype(np.uint8)
        for image in seen(pictures[name], behind=60)
    ]
    board = Board.parse(name)
    views, shown = board_views(board, [*images, images[0], np.zeros_like(images[0])])
    # The same view counts once.
    assert len(VIEWS) - 1 <= len(views) < shown <= len(VIEWS) + 1
    found = calibrated(board, views, WIDTH, HEIGHT)
    lens = found.calibration
    assert 0.004 < lens.focal_stddev < 0.02
    assert abs(np.log(lens.k[0, 0] / FOCAL_PX)) < 3 * lens.focal_stddev
    assert np.abs(lens.k[:2, 2] - (319.5, 239.5)).max() < 5.0
    assert lens.is_distorted == (name != "a4")
    assert found.error_px < 0.3
    assert found.turn_deg > 60


def test_the_deviation_grows_where_views_are_few_and_noisy() -> None:
    rng = np.random.default_rng(0)
    board = Board.parse("9x6")
    views, _ = board_views(board, chessboard_seen(9, 6))
    noisy = [
        view._replace(px=(view.px + rng.normal(0.0, 1.0, view.px.shape)).astype(np.float32))
        for view in views
    ]
    sure, unsure = (calibrated(board, some, WIDTH, HEIGHT) for some in (views, noisy[:6]))
    assert unsure.calibration.focal_stddev > 1.5 * sure.calibration.focal_stddev


def test_a_sheet_before_other_bright_things_is_not_mistaken() -> None:
    """A square, a strip and a sheet that the image cuts off have other corners."""
    board = Board.parse("a4")
    for picture, view in (
        (np.full((700, 700), 235, np.uint8), VIEWS[0]),
        (np.full((200, 1000), 235, np.uint8), VIEWS[0]),
        (SHEET, (0, 0, 0.5, 0.0, 1.0)),
    ):
        assert board.view(seen(picture, [view], behind=60)[0]) is None
    # A thumb hides a part of a side.
    image = seen(SHEET, [VIEWS[0]], behind=60)[0]
    whole = board.view(image)
    assert whole is not None
    x, y = (whole.px[0] + whole.px[1]) / 2
    hidden = board.view(cv2.circle(image, (int(x), int(y)), 12, 60, -1))
    assert hidden is not None
    assert hidden.px == pytest.approx(whole.px, abs=0.5)


@pytest.mark.parametrize(
    ("views", "named"),
    [
        (VIEWS[:4], "4 different views"),
        ([(0, 0, 0.1 * k - 0.3, 0.1, 1.6) for k in range(7)], "are alike"),
    ],
)
def test_too_few_views_and_views_that_are_alike_are_refused(
    views: list[tuple[float, ...]], named: str
) -> None:
    board = Board.parse("7x5")
    found, _ = board_views(board, seen(chessboard(7, 5), views))
    with pytest.raises(CameraError, match=named):
        calibrated(board, found, WIDTH, HEIGHT)


def test_other_numbers_of_corners_are_named() -> None:
    images = chessboard_seen(9, 6)[:2]
    assert board_views(Board.parse("8x5"), images) == ([], 0)
    assert "9x6" in Board.parse("8x5").other(images)
    assert Board.parse("8x5").other([np.zeros((480, 640), np.uint8)]) == ""


@pytest.mark.parametrize("text", ["9", "2x6", "9x6x2", "aruco:5x7", "letter", ""])
def test_what_is_no_board_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="inner corners"):
        Board.parse(text)


@pytest.fixture
def film(tmp_path: Path) -> Path:
    """Return a folder of images of a board."""
    folder = tmp_path / "film"
    folder.mkdir()
    for number, image in enumerate(chessboard_seen(7, 5)):
        cv2.imwrite(str(folder / f"{number:03}.png"), image)
    return folder


def test_a_film_of_a_board_gives_a_calibration(
    film: Path, tmp_path: Path, cardbox: Callable
) -> None:
    output = tmp_path / "camera.yaml"
    done = cardbox("calibrate-camera", film, "--board", "7x5", "--output", output)
    assert done.code == 0, done.err
    assert "12 views" in done.out
    found = load_calibration(output)
    assert found.k[0, 0] == pytest.approx(FOCAL_PX, rel=0.01)
    assert 0.004 < found.focal_stddev < 0.02
    again = cardbox("calibrate-camera", film, "--board", "7x5", "--output", output)
    again.assert_refused("calibrate-camera", "exists", "--force")
    output.write_text(output.read_text().replace("stddev: 0.0", "stddev: -0.0"))
    with pytest.raises(CameraError, match="focal_length_stddev"):
        load_calibration(output)


def test_a_film_without_the_board_names_the_one_that_it_shows(
    film: Path, tmp_path: Path, cardbox: Callable
) -> None:
    output = tmp_path / "camera.yaml"
    done = cardbox("calibrate-camera", film, "--board", "8x6", "--output", output)
    done.assert_refused("calibrate-camera", "no chessboard of 8x6", "7x5", "--board")
    for number in range(12):
        cv2.imwrite(str(film / f"{number:03}.png"), np.zeros((480, 640), np.uint8))
    done = cardbox("calibrate-camera", film, "--board", "a4", "--output", output)
    done.assert_refused("calibrate-camera", "no sheet of A4", "brighter")
    done = cardbox("calibrate-camera", film, "--board", "big", "--output", output)
    done.assert_refused("calibrate-camera", "--board", "inner corners")
    assert not output.exists()
