"""The digest of the sources of the paper's figures."""

from __future__ import annotations

from pathlib import Path

import pytest

import cardbox_tracker
from lab.experiments import digest


@pytest.mark.parametrize(
    ("source", "is_same"),
    [
        ('"""Other words."""\nX = 1  # why\n\n\ndef f() -> int:\n    return (X)\n', True),
        ('"""Words."""\nX = 2\n\n\ndef f() -> int:\n    return X\n', False),
        ('"""Words."""\nX = 1\n\n\ndef f() -> int:\n    return -X\n', False),
    ],
)
def test_only_code_changes_it(
    source: str, is_same: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cardbox_tracker, "__file__", str(tmp_path / "__init__.py"))
    monkeypatch.setattr(digest, "SOURCES", ("one.py",))
    place = tmp_path / "one.py"
    place.write_text('"""Words."""\nX = 1\n\n\ndef f() -> int:\n    """Return."""\n    return X\n')
    before = digest.paper_digest()
    place.write_text(source)
    assert (digest.paper_digest() == before) == is_same
