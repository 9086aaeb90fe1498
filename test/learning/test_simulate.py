"""The command writes one file for each recording in which the person was tracked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from learning import simulate as tool
from learning.bodies.rigged import RiggedBody
from learning.samples import load


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch, boxes: RiggedBody, make_samples: Any) -> None:
    """Recordings whose results are 3 cm off; in that of number 3 nobody is tracked."""

    def simulate(body: RiggedBody, motion: Any, rng: np.random.Generator, *given: Any) -> Any:
        is_measured, is_corrected, _ = given
        number = next(n for n in range(9) if same(rng, n))
        one = make_samples(5, is_measured=is_measured, has_images=is_corrected, motion=str(number))
        one.found_m[..., 2] += 0.03
        return None if number == 3 else one

    def same(rng: np.random.Generator, number: int) -> bool:
        fresh = np.random.default_rng((tool.SEED, number))
        fresh.uniform(*tool.SECONDS)
        fresh.random()
        return bool(fresh.bit_generator.state == rng.bit_generator.state)

    monkeypatch.setattr(tool, "draw", lambda *_: boxes)
    monkeypatch.setattr(tool, "draw_motion", lambda *_: make_named("07_01"))
    monkeypatch.setattr(tool, "simulate", simulate)


def make_named(name: str) -> Any:
    return type("Named", (), {"name": name})()


@pytest.mark.usefixtures("drawn")
def test_numbers_name_the_files_and_seed_the_recordings(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "new" / "samples"
    words = ["--count", "3", "--first", "2", "--motions", str(tmp_path), "--rocketbox", "avatars"]
    assert tool.main([str(output), *words, "--measured", "1", "--corrected"]) == 0
    assert sorted(path.name for path in output.iterdir()) == ["00002.npz", "00004.npz"]
    for path in output.iterdir():
        origin = load(path).origin
        assert origin.motion == str(int(path.stem))
        assert origin.is_measured and origin.has_images
    # Absolute and aligned errors, cm: all joints are as far off.
    assert capsys.readouterr().out.splitlines() == [
        "2 boxes 07_01 3.0 0.0",
        "3 boxes 07_01: seldom tracked, left out",
        "4 boxes 07_01 3.0 0.0",
    ]


@pytest.mark.usefixtures("drawn")
def test_nobody_is_measured_with_a_share_of_0(tmp_path: Path) -> None:
    folders = tool.Folders(tmp_path, {"rocketbox": tmp_path})
    tool.write(1, folders, tmp_path, tool.Ways(measured=0.0))
    assert not load(tmp_path / "00001.npz").origin.is_measured


def test_bodies_are_needed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "samples"
    with pytest.raises(SystemExit):
        tool.main([str(output), "--count", "1", "--motions", str(tmp_path)])
    assert "give a folder of bodies: --makehuman or --rocketbox" in capsys.readouterr().err
    assert not output.exists()
