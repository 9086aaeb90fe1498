"""The folders of the package: a module imports only what stands below it, never in a circle."""

from __future__ import annotations

import ast
import re
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = "cardbox_tracker"
SOURCES = Path(__file__).resolve().parents[1] / PACKAGE

# From the bottom to the top: a module imports from its own folder and from the folders before.
FOLDERS = (
    *("common", "person", "camera", "segmentation", "detectors", "terms", "search"),
    *("measuring", "tracking", "recordings", "applications", "ros", "commands", "start"),
)
# The layers inside a folder; folders of one layer do not import each other, and what is not named
# may use all of them.
INSIDE: dict[str, tuple[tuple[str, ...], ...]] = {
    "applications": (
        ("drawing",),
        ("ergonomics", "exporting", "retargeting", "simulation"),
        ("viewing",),
    ),
    "ros": (("runtime", "messages"), ("nodes",), ("demo",)),
}


def modules(root: Path) -> dict[str, Path]:
    """Return every module below ``root`` by its name within the package; "" is the package."""
    found = {}
    for path in sorted(root.rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        found[".".join(part for part in parts if part != "__init__")] = path
    return found


@cache
def statements(path: Path) -> list[ast.AST]:
    """Return the statements of a file that import, wherever in it."""
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    return [node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom)]


def imports(path: Path, known: dict[str, Path]) -> set[str]:
    """Return the modules of the package that a file imports, wherever in it."""
    found: set[str] = set()
    for node in statements(path):
        if isinstance(node, ast.Import):
            found |= {alias.name.removeprefix(f"{PACKAGE}.") for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            module = node.module.removeprefix(PACKAGE).removeprefix(".")
            for alias in node.names:
                below = f"{module}.{alias.name}".removeprefix(".")
                found.add(below if below in known else module)
    return found & set(known) - {""}


def is_upward(module: str, other: str) -> bool:
    """Return whether ``module`` must not import ``other``."""
    (folder, *inner), (other_folder, *other_inner) = module.split("."), other.split(".")
    if folder != other_folder:
        if folder not in FOLDERS or other_folder not in FOLDERS:
            return True
        return FOLDERS.index(folder) < FOLDERS.index(other_folder)
    layers = INSIDE.get(folder, ())
    if not inner or not other_inner or inner[0] == other_inner[0]:
        return False

    def rank(name: str) -> int:
        return next((i for i, layer in enumerate(layers) if name in layer), len(layers))

    low, high = rank(inner[0]), rank(other_inner[0])
    return low < high or (low == high < len(layers))


def upward(root: Path) -> list[str]:
    """Return every import that points to a higher folder, or to a higher layer of its own."""
    known = modules(root)
    return [
        f"{module} -> {other}"
        for module, path in known.items()
        if module  # the public API is a list of what stands anywhere below
        for other in sorted(imports(path, known))
        if is_upward(module, other)
    ]


def test_every_folder_has_its_place() -> None:
    assert {module.split(".")[0] for module in modules(SOURCES) if module} == set(FOLDERS)


def test_nothing_imports_upwards() -> None:
    assert upward(SOURCES) == []


def test_there_is_no_circle() -> None:
    known = modules(SOURCES)
    graph = {module: imports(path, known) - {module} for module, path in known.items() if module}
    TopologicalSorter(graph).prepare()


def test_an_upward_import_would_be_found(tmp_path: Path) -> None:
    for name, text in (
        ("person/low.py", "def late():\n    from cardbox_tracker.ros import high\n"),
        ("ros/high.py", "import cardbox_tracker.person.low\n"),
        ("terms/a.py", "from cardbox_tracker.search import b\n"),
        ("search/b.py", "from cardbox_tracker.person.low import late\n"),
        ("ros/runtime/c.py", "from cardbox_tracker.ros.nodes.d import x\n"),
        ("ros/nodes/d.py", "x = 1\n"),
        ("applications/exporting/e.py", "from cardbox_tracker.applications.ergonomics import f\n"),
        ("applications/ergonomics/f.py", "from cardbox_tracker.applications.drawing import g\n"),
        ("applications/drawing/g.py", ""),
        ("elsewhere.py", "from cardbox_tracker.search import b\n"),
    ):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    assert upward(tmp_path) == [
        "applications.exporting.e -> applications.ergonomics.f",
        "elsewhere -> search.b",
        "person.low -> ros.high",
        "ros.runtime.c -> ros.nodes.d",
        "terms.a -> search.b",
    ]
    known = modules(tmp_path)
    with pytest.raises(CycleError):
        TopologicalSorter({m: imports(p, known) for m, p in known.items()}).prepare()


def test_the_document_has_the_folders_in_this_order() -> None:
    text = (SOURCES.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
    table = text.split("| layer | what |")[1].split("\n\n")[0]
    rows = [row.split("|")[1] for row in table.splitlines() if row.startswith("| `")]
    assert [name for row in rows for name in re.findall(r"`(\w+)(?:/|\.py)`", row)] == list(FOLDERS)
