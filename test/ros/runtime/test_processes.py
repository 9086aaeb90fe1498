"""Nodes as child processes: the installed package is compiled before they start."""

from __future__ import annotations

from pathlib import Path

import pytest

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.ros.demo import run
from cardbox_tracker.ros.runtime import processes


def test_a_failed_compilation_shows_its_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "python"
    program.write_text('#!/bin/sh\necho "no memory for $1"\nexit 3\n')
    program.chmod(0o755)
    monkeypatch.setattr(processes, "_OF_PACKAGE", (str(program),))
    with pytest.raises(CardboxError, match=r"ended with 3.*make setup") as caught:
        processes.compile_kernels()
    assert "no memory for cardbox_tracker.tracking.precompile" in str(caught.value)


def test_the_demo_compiles_before_it_starts_nodes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps: list[str] = []

    def begun(*_: object) -> None:
        raise InterruptedError

    for name in ("synthesize_session", "compile_kernels"):
        monkeypatch.setattr(run, name, lambda *_, name=name, **__: steps.append(name))
    monkeypatch.setattr(run, "load_ground_truth", begun)
    with pytest.raises(InterruptedError):
        run.run_demo(tmp_path, "default", seed=0)
    assert steps == ["synthesize_session", "compile_kernels"]
