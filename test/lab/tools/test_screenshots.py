"""The picture of the guidance in the documents is the present one."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from cardbox_tracker.applications.drawing.guidance import FIT_BGR
from lab.tools.screenshots import guidance

COMMITTED = Path(__file__).parents[3] / "docs" / "images" / "guidance.jpg"


@pytest.mark.slow
def test_the_committed_picture_is_the_present_one() -> None:
    """If not: ``python -m lab.tools.screenshots docs/images/guidance.jpg``.

    Fonts and JPEG differ between releases of OpenCV, so pictures are compared coarsely.
    """
    pictures = guidance(), cv2.imread(str(COMMITTED))
    for colour in FIT_BGR.values():
        away = np.abs(pictures[0].astype(int) - colour).max(axis=2)
        assert np.count_nonzero(away < 60) > 1000
    made, committed = (
        cv2.resize(picture, (60, 24), interpolation=cv2.INTER_AREA).astype(int)
        for picture in pictures
    )
    assert np.abs(made - committed).mean() < 6
