"""The README's badges say what package.xml and setup.py say."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

from lab.tools.badges import FOLDER, ROOT, badges


def test_the_committed_badges_are_the_present_ones() -> None:
    """If not: ``python -m lab.tools.badges``."""
    made = badges()
    assert {path.name: path.read_text(encoding="utf-8") for path in FOLDER.iterdir()} == made
    for name, text in made.items():
        assert f"docs/images/badges/{name}" in (ROOT / "README.md").read_text(encoding="utf-8")
        assert ElementTree.fromstring(text).tag.endswith("svg")
    assert "Apache-2.0" in made["licence.svg"]
    assert "Jazzy" in made["ros.svg"]
