"""Settings of Sphinx for 'make docs' and for rosdoc2.

The pages are written for GitHub, so two things are added while they are read: the order of the
pages, which is that of the tables in README.md, and addresses of files outside this folder.
"""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

HERE = Path(__file__).resolve().parent
_PACKAGE = ElementTree.parse(HERE.parent / "package.xml").getroot()
HOME = f"{_PACKAGE.findtext('url')}/blob/main"


def is_installed(module: str) -> bool:
    """Return whether a module can be imported."""
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:
        return False


project = "cardbox_tracker"
author = "cardbox_tracker maintainers"
release = _PACKAGE.findtext("version") or ""
root_doc = "README"
extensions = ["myst_parser"]
myst_heading_anchors = 4
# rosdoc2 brings neither of these two.
if is_installed("sphinxcontrib.mermaid"):
    extensions.append("sphinxcontrib.mermaid")
    myst_fence_as_directive = ["mermaid"]
if is_installed("furo"):
    html_theme = "furo"
html_title = "cardbox_tracker"
# Addresses of this repository are known by its files.
linkcheck_ignore = [re.escape(HOME), r"http://localhost"]
linkcheck_timeout = 20

_ROW = re.compile(r"(?m)^\| (.*?) \|")
_PAGE = re.compile(r"\]\(([\w./-]+\.md)\)")
_OUTSIDE = re.compile(r"\]\((?:\.\./)+([^)]*)\)")


def order(text: str) -> str:
    """Return the directives for the pages in the first column of each table, in that order."""
    sections = re.split(r"(?m)^\*\*(.+?)\*\*.*$", text)
    titled = [("", sections[0]), *zip(sections[1::2], sections[2::2], strict=True)]
    found = ""
    for title, section in titled:
        pages = [page for cell in _ROW.findall(section) for page in _PAGE.findall(cell)]
        if pages:
            caption = f":caption: {title}\n" if title else ""
            found += "\n```{toctree}\n:hidden:\n" + caption + "\n".join(["", *pages]) + "\n```\n"
    return found


def addressed(text: str, page: Path) -> str:
    """Return the text of a page whose links to files outside this folder are addresses."""

    def address(link: re.Match[str]) -> str:
        target = (page.parent / link[0][2:-1].partition("#")[0]).resolve()
        if target.is_relative_to(HERE):
            return link[0]
        anchor = link[0][2:-1].partition("#")[2]
        name = target.relative_to(HERE.parent)
        return f"]({HOME}/{name}{'#' if anchor else ''}{anchor})"

    return _OUTSIDE.sub(address, text)


def read(_: Any, name: str, source: list[str]) -> None:
    """Change the text of a page before it is parsed."""
    source[0] = addressed(source[0], HERE / f"{name}.md")
    if Path(name).name == "README":
        source[0] += order(source[0])


def setup(app: Any) -> None:
    """Connect to Sphinx."""
    app.connect("source-read", read)
