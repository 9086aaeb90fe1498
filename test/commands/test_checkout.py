"""Commands that delegate to folders of a checkout."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from cardbox_tracker.commands import checkout
from cardbox_tracker.commands.checkout import from_checkout
from cardbox_tracker.errors import CardboxError

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package that does not lie in a checkout, run from a folder elsewhere."""
    monkeypatch.setattr(checkout, "_PACKAGE", tmp_path / "site-packages" / "cardbox_tracker")
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("words", "target"),
    [
        (("benchmark", "--json", "b.json"), "make benchmark"),
        (("evaluate", "--runs", "2", "--output", "out"), "make experiments"),
    ],
)
def test_without_a_checkout_the_make_target_is_named(
    words: tuple[str, ...], target: str, installed: Path, cardbox: Callable
) -> None:
    cardbox(*words).assert_refused(words[0], target)
    assert list(installed.iterdir()) == []


def test_the_checkout_is_found_from_a_folder_inside(
    installed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = installed / "checkout" / "docs"
    for name in ("docs", "cardbox_tracker", "of_a_checkout"):
        (installed / "checkout" / name).mkdir(parents=True)
    (installed / "checkout" / "of_a_checkout" / "__init__.py").touch()
    (installed / "checkout" / "of_a_checkout" / "run.py").write_text("ANSWER = 42\n")
    monkeypatch.chdir(folder)
    assert from_checkout("of_a_checkout.run", "nothing").ANSWER == 42


def test_a_missing_library_is_named(installed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (installed / "cardbox_tracker").mkdir()
    (installed / "needs_more").mkdir()
    (installed / "needs_more" / "__init__.py").write_text("import no_such_library\n")
    with pytest.raises(CardboxError, match=r"no_such_library.*pip install \."):
        from_checkout("needs_more", "nothing")


def test_beside_the_package_it_is_found_from_anywhere(tmp_path: Path) -> None:
    program = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r})\n"
        "from cardbox_tracker.commands.checkout import from_checkout\n"
        "print(from_checkout('benchmarks.report', 'benchmark').COMMAND)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, cwd=tmp_path, check=True
    )
    assert done.stdout == "make benchmark\n"
