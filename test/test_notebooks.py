"""The notebooks in the documents are stored without results and run from top to bottom."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import matplotlib
import pytest

DOCS = Path(__file__).parents[1] / "docs"
NOTEBOOKS = sorted(DOCS.rglob("*.ipynb"))
by_notebook = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: str(path.stem))


def cells(path: Path, kind: str) -> list[dict[str, Any]]:
    found = json.loads(path.read_text(encoding="utf-8"))
    assert found["nbformat"] == 4
    return [cell for cell in found["cells"] if cell["cell_type"] == kind]


def source(cell: dict[str, Any]) -> str:
    return "".join(cell["source"])


def test_the_index_links_every_notebook() -> None:
    index = (DOCS / "README.md").read_text(encoding="utf-8")
    assert NOTEBOOKS
    for path in NOTEBOOKS:
        assert f"]({path.relative_to(DOCS)})" in index


@by_notebook
def test_results_are_not_stored(path: Path) -> None:
    """Figures would be stored again by every run, and could contain paths of a computer."""
    for cell in cells(path, "code"):
        assert cell["outputs"] == [], source(cell)
        assert cell["execution_count"] is None, source(cell)


@by_notebook
def test_links_lead_to_files(path: Path) -> None:
    links = re.findall(r"\]\(([^)\s#]+)", "\n".join(map(source, cells(path, "markdown"))))
    assert links
    for link in links:
        assert (path.parent / link).is_file(), link


@by_notebook
def test_the_cells_run_in_their_order(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    matplotlib.use("Agg")
    from matplotlib import pyplot

    pyplot.close("all")
    names: dict[str, Any] = {"__name__": "__main__"}
    try:
        for number, cell in enumerate(cells(path, "code"), 1):
            exec(compile(source(cell), f"{path.name}, code cell {number}", "exec"), names)
        assert len(pyplot.get_fignums()) >= 3
    finally:
        pyplot.close("all")
