"""The fit of the doubt about points to simulated people, on images whose coefficients are known."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.estimation.filtering import point_doubt
from learning import simulated_doubt as tool
from learning.bodies import FAMILIES
from learning.command_line import run
from learning.logistic import chances
from learning.simulated_doubt import Frames, report, shares, together

TRUE = np.array([-1.0, 4.0, -2.0, 20.0, 0.5])
SCALE = np.array([0.3, 1.0, 0.1, 3.0])


def frames(count: int, seed: int) -> Frames:
    """Images that are wrong with the chance of the coefficients ``TRUE``."""
    rng = np.random.default_rng(seed)
    features = rng.random((count, len(SCALE))) * SCALE
    is_wrong = rng.random(count) < chances(TRUE, features)
    return Frames(features, is_wrong, np.ones(count, bool))


def test_the_shares_of_certain_and_of_wrong_images() -> None:
    wrong, sure = np.array([True, False, False, True]), np.array([True, True, True, False])
    every = Frames(np.zeros((4, 4)), wrong, sure)
    # The last image is not sure by other reasons, and the third one by its chance.
    assert shares(every, np.array([0.1, 0.2, 0.3, 0.0]), 0.2) == (0.5, 0.25)
    assert shares(together([every, every]), np.zeros(8), 0.2) == (0.75, 0.25)


def test_the_report_finds_the_coefficients_and_judges_others() -> None:
    text = report(frames(50_000, 0), frames(1_000, 1), inverse_penalty=1e6)
    rows = {line.split()[0]: line.split()[1:] for line in text.splitlines() if line.strip()}
    for name, true, scale in zip(point_doubt.FEATURES, TRUE[1:], SCALE, strict=True):
        assert float(rows[name][0]) == pytest.approx(true, abs=0.2 / scale)
        assert name in text
    assert float(rows["intercept"][1]) == pytest.approx(point_doubt.INTERCEPT, abs=0.005)
    assert "fitted to: 50000 images" in text
    assert "not fitted: 1000 images" in text


def test_without_wrong_images_there_is_no_fit() -> None:
    right = frames(100, 2)._replace(is_wrong=np.zeros(100, bool))
    with pytest.raises(ValueError, match="class"):
        report(right, None)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_missing_folder_is_told_in_words(
    family: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = tmp_path / "missing"
    assert run(partial(tool.main, [f"--{family}", str(missing)])) == 1
    assert str(missing) in capsys.readouterr().err
