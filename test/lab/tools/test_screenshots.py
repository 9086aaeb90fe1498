"""The images of the documents: made again, they are the same and small."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from cardbox_tracker.applications.drawing.guidance import FIT_BGR
from cardbox_tracker.applications.drawing.overlay import OUTLINE_BGR, UNCERTAIN_BGR
from cardbox_tracker.common.errors import CardboxError
from lab.tools.screenshots import write_screenshots

NAMES = ["guidance", "steps"]
COMMITTED = Path(__file__).parents[3] / "docs" / "images"


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("images") / "images"
    finished: list[float] = []
    written = write_screenshots(folder, 0, finished.append)
    assert finished[-1] == 1.0
    assert finished == sorted(finished)
    return {path.stem: path for path in written}


def near(image: np.ndarray, colour: tuple[int, int, int]) -> int:
    return np.count_nonzero(np.abs(image.astype(int) - colour).max(axis=2) < 60)


@pytest.mark.slow
def test_every_image_is_made_and_shows_what_it_is_about(images: dict[str, Path]) -> None:
    assert sorted(images) == NAMES
    shown = {name: cv2.imread(str(path)) for name, path in images.items()}
    # Parts of the drawn person may be doubted, which have another colour.
    width = shown["steps"].shape[1] // 3
    _, silhouette, overlay = (shown["steps"][:, i * width : (i + 1) * width] for i in range(3))
    assert sum(near(overlay, bgr) for bgr in (OUTLINE_BGR, UNCERTAIN_BGR)) > 1000
    # It is drawn at the edge of the silhouette.
    edge = cv2.Canny(silhouette, 100, 200)
    away_px = cv2.distanceTransform(np.where(edge > 0, 0, 255).astype(np.uint8), cv2.DIST_L2, 5)
    drawn = np.abs(overlay.astype(int) - OUTLINE_BGR).max(axis=2) < 60
    drawn |= np.abs(overlay.astype(int) - UNCERTAIN_BGR).max(axis=2) < 60
    assert np.median(away_px[drawn]) < 8
    for colour in FIT_BGR.values():
        assert near(shown["guidance"], colour) > 1000
    white = shown["steps"][:, shown["steps"].shape[1] // 3 : 2 * shown["steps"].shape[1] // 3]
    assert near(white, (255, 255, 255)) > 5000


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_the_committed_image_is_the_present_one(images: dict[str, Path], name: str) -> None:
    """If not: ``python -m lab.tools.screenshots --output docs/images``.

    Fonts and JPEG differ between releases of OpenCV, so images are compared coarsely.
    """
    made, committed = (
        cv2.resize(cv2.imread(str(path)), (60, 24), interpolation=cv2.INTER_AREA).astype(int)
        for path in (images[name], COMMITTED / f"{name}.jpg")
    )
    assert np.abs(made - committed).mean() < 6


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(CardboxError, match=r"folder .*file"):
        write_screenshots(tmp_path / "file", 0)
