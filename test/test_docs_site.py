"""The site of the documents: its order is that of docs/README.md, and its links lead somewhere."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(scope="module")
def conf() -> dict[str, Any]:
    return runpy.run_path(str(DOCS / "conf.py"))


def test_the_pages_have_the_order_of_the_tables(conf: dict[str, Any]) -> None:
    text = (
        "# Documents\n\n**Tutorial**\n\n| page | content |\n|---|---|\n"
        "| [first](a.md) | not [this](c.md) |\n\n**Reports** (figures)\n\n"
        "| [one](r/b.md), [two](d.md) | x |\n"
    )
    assert conf["order"](text) == (
        "\n```{toctree}\n:hidden:\n:caption: Tutorial\n\na.md\n```\n"
        "\n```{toctree}\n:hidden:\n:caption: Reports\n\nr/b.md\nd.md\n```\n"
    )


def test_every_page_is_in_the_order(conf: dict[str, Any]) -> None:
    lines = conf["order"]((DOCS / "README.md").read_text(encoding="utf-8")).splitlines()
    listed = {DOCS / "README.md"} | {DOCS / line for line in lines if line.endswith(".md")}
    assert listed == set(DOCS.rglob("*.md"))


@pytest.mark.parametrize(
    ("link", "expected"),
    [
        ("[a](../README.md#versions)", "[a](HOME/README.md#versions)"),
        ("[a](../config/tracker.yaml)", "[a](HOME/config/tracker.yaml)"),
        ("[a](topics.md)", "[a](topics.md)"),
    ],
)
def test_links_out_of_the_folder_become_addresses(
    conf: dict[str, Any], link: str, expected: str
) -> None:
    assert conf["addressed"](link, DOCS / "a.md") == expected.replace("HOME", conf["HOME"])


def test_links_between_folders_stay(conf: dict[str, Any]) -> None:
    link = "[a](../topics.md#tracker)"
    assert conf["addressed"](link, DOCS / "evaluation" / "films.md") == link


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    for module in ("sphinx", "myst_parser", "furo", "sphinxcontrib.mermaid"):
        pytest.importorskip(module, reason="the extra docs is not installed")
    words = ("--fail-on-warning", "--nitpicky", "--keep-going", "--quiet")
    command = [sys.executable, "-m", "sphinx", *words, str(DOCS), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "How to" in (tmp_path / "README.html").read_text(encoding="utf-8")
