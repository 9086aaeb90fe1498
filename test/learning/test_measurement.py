"""True lengths are those between the body's joints."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from learning import measurement as tool
from learning.bodies.rigged import RiggedBody
from learning.motions.reference import reference_pose


@pytest.mark.parametrize("name", ["front", "side"])
def test_lengths_in_any_posture_without_raised_shoulders(boxes: RiggedBody, name: str) -> None:
    posed = boxes.posed(*reference_pose(name))
    assert tool.true_lengths_m(posed) == pytest.approx([0.29, 0.34, 0.36], abs=1e-6)


def test_lengths_of_both_arms_are_averaged(boxes: RiggedBody) -> None:
    posed = boxes.in_t_pose()
    posed.keypoints[2, 1] += 0.02
    assert tool.true_lengths_m(posed) == pytest.approx([0.29, 0.35, 0.36], abs=1e-6)


def test_a_box_person_measures_about_right(boxes: RiggedBody) -> None:
    found = tool.ratios(boxes, np.random.default_rng(1))
    assert found is not None and found.shape == (4,)
    assert found[:3] == pytest.approx(1.0, abs=0.3)
    assert abs(found[3]) < 0.15


def test_the_table_has_means_by_sex(
    monkeypatch: pytest.MonkeyPatch,
    boxes: RiggedBody,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    people = iter([replace(boxes, sex=sex) for sex in ("female", "male", "female", "female")])
    found = iter([[1.1, 1.0, 0.9, 0.02], [1, 1, 1, 0], [0.9, 1.0, 0.96, 0.0], None])
    monkeypatch.setattr(tool, "draw", lambda *_: next(people))

    def ratios(*_: object) -> np.ndarray | None:
        one = next(found)
        return None if one is None else np.array(one)

    monkeypatch.setattr(tool, "ratios", ratios)
    assert tool.main(["--rocketbox", str(tmp_path), "--count", "4"]) == 0
    _, female, male = capsys.readouterr().out.splitlines()
    # A refused measurement does not count.
    assert female.startswith("rocketbox female (2)") and male.startswith("rocketbox male (1)")
    cells = female.split()[3:]
    assert cells[:4] == ["1.000", "+-0.100", "0", "%"]
    assert cells[8:12] == ["0.930", "+-0.030", "50", "%"] and cells[12:] == ["1.0", "+-1.0"]
