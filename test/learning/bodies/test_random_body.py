from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.errors import CardboxError
from learning.bodies import FAMILIES, draw
from learning.bodies.picture import row
from learning.bodies.rigged import RiggedBody


def test_equal_generators_give_equal_bodies(stick: RiggedBody, tmp_path: Path) -> None:
    for number in range(3):
        replace(stick, name=f"Male_{number}").saved(tmp_path / f"{number}.npz")
    folders = {"rocketbox": tmp_path}
    bodies = [draw(np.random.default_rng(seed), ["rocketbox"], folders) for seed in (4, 4, 5)]
    assert (bodies[0].vertices == bodies[1].vertices).all()
    assert (bodies[0].colours == bodies[1].colours).all()
    assert not np.array_equal(bodies[0].joints, bodies[2].joints)


def test_unknown_families_and_empty_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="martians"):
        draw(np.random.default_rng(0), ["martians"], {"martians": tmp_path})
    with pytest.raises(CardboxError, match="no bodies"):
        draw(np.random.default_rng(0), ["rocketbox"], {"rocketbox": tmp_path})


@pytest.mark.parametrize("family", FAMILIES)
def test_a_missing_folder_is_named_with_what_it_should_have(family: str, tmp_path: Path) -> None:
    missing = tmp_path / "missing"
    with pytest.raises(CardboxError, match=f"{missing}.*learning.md"):
        draw(np.random.default_rng(0), [family], {family: missing})


def test_a_picture_shows_four_views(stick: RiggedBody) -> None:
    image = row(stick)
    assert image.shape[1] == 4 * image.shape[0]
    assert (image != 235).any()
