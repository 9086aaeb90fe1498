"""Black and white images are told from dark and bright ones in which something is seen."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.camera.exposure import exposure_problem


@pytest.mark.parametrize("shape", [(120, 160), (120, 160, 3)])
@pytest.mark.parametrize(
    ("wall", "person", "words"),
    [
        (4, 4, "dark"),
        (10, 18, "dark"),
        (4, 60, ""),
        (40, 10, ""),
        (235, 240, ""),
        (255, 60, ""),
        (255, 255, "overexposed"),
    ],
)
def test_what_shows_nothing_is_told(
    shape: tuple[int, ...], wall: int, person: int, words: str
) -> None:
    image = np.full(shape, wall, np.uint8)
    image[30:, 60:90] = person
    found = exposure_problem(image)
    assert words in found and bool(found) == bool(words)
