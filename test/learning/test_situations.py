"""The table of situations: how people turn, and what is said about missing folders."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.estimation.initialization.part_colors import LEARNED_FROM
from learning import situations as tool
from learning.bodies import FAMILIES
from learning.command_line import run
from learning.motions.rotations import about_axis


def test_a_person_turns_round_evenly_and_stays_turned() -> None:
    back = about_axis(2, np.array([np.pi]))[0]
    turning = tool.Situation("turns", turned=back, turning_s=2.0)
    for seconds, degrees in ((0.0, 0.0), (0.5, 45.0), (1.0, 90.0), (2.0, 180.0), (9.0, 180.0)):
        forward = turning.turned_after(seconds) @ [1.0, 0.0, 0.0]
        assert forward[0] == pytest.approx(np.cos(np.radians(degrees)), abs=1e-6)
        assert forward[2] == pytest.approx(0.0, abs=1e-6)
    at_once = tool.Situation("back", turned=back)
    np.testing.assert_array_equal(at_once.turned_after(0.0), back)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_missing_folder_is_told_in_words(
    family: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = tmp_path / "missing"
    assert run(partial(tool.main, [f"--{family}", str(missing)])) == 1
    assert str(missing) in capsys.readouterr().err


def test_a_folder_of_bodies_is_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        tool.main([])
    assert all(f"--{family}" in capsys.readouterr().err for family in FAMILIES[:1])


def test_situations_with_images_have_colours_to_learn() -> None:
    names = [one.name for one in tool.SITUATIONS if one.has_images]
    assert len(names) == 3
    assert all("with images" in name for name in names)
    assert set(LEARNED_FROM) <= {"front", "side", "arms"}
