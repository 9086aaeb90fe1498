"""The layers of the package: a module imports only what stands below it, never in a circle."""

from __future__ import annotations

import ast
import re
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from pathlib import Path

import pytest

PACKAGE = "cardbox_tracker"
SOURCES = Path(__file__).resolve().parents[1] / PACKAGE

# From the bottom to the top: a module imports from its own folder and from the layers before.
# Folders named together do not import each other.
LAYERS: tuple[tuple[str, ...], ...] = (
    (
        *("compiling", "errors", "files", "garbage", "interrupts"),
        *("processes", "progress", "settings", "small_yaml"),
    ),
    ("body",),
    ("vision",),
    ("detection",),
    ("estimation",),
    ("keypoint_status", "markers"),
    ("outputs",),
    ("tracking_report",),
    ("recordings",),
    ("simulation",),
    ("evaluation",),
    ("applications",),
    ("ros",),
    ("demo",),
    ("commands",),
    ("start",),
)
# The layers inside a folder; what is not named may use all of them.
INSIDE: dict[str, tuple[tuple[str, ...], ...]] = {
    "applications": (("drawing",), ("ergonomics", "exporting", "retargeting", "viewing")),
    "estimation": (("cost",), ("config", "filtering"), ("initialization",)),
    "ros": (("runtime", "messages"), ("nodes",)),
}


def modules(root: Path) -> dict[str, Path]:
    """Return every module below ``root`` by its name within the package; "" is the package."""
    found = {}
    for path in sorted(root.rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        found[".".join(part for part in parts if part != "__init__")] = path
    return found


def imports(path: Path, known: dict[str, Path]) -> set[str]:
    """Return the modules of the package that a file imports, wherever in it."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.removeprefix(f"{PACKAGE}.") for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            module = node.module.removeprefix(PACKAGE).removeprefix(".")
            for alias in node.names:
                below = f"{module}.{alias.name}".removeprefix(".")
                found.add(below if below in known else module)
    return found & set(known) - {""}


def rank(module: str, layers: tuple[tuple[str, ...], ...], depth: int) -> int:
    """Return the number of the layer that holds ``module``, or that above all if none does."""
    name = ".".join(module.split(".")[depth : depth + 1])
    return next((i for i, layer in enumerate(layers) if name in layer), len(layers))


def is_upward(module: str, other: str) -> bool:
    """Return whether ``module`` must not import ``other``."""
    (top, *inner), (other_top, *other_inner) = module.split("."), other.split(".")
    if top != other_top:
        return rank(module, LAYERS, 0) <= rank(other, LAYERS, 0) and rank(module, LAYERS, 0) > 0
    if inner[:1] == other_inner[:1] or top not in INSIDE:
        return False
    return rank(other, INSIDE[top], 1) > rank(module, INSIDE[top], 1)


def upward(root: Path) -> list[str]:
    """Return every import that points to a higher layer, or beside it in the same one."""
    known = modules(root)
    return [
        f"{module} -> {other}"
        for module, path in known.items()
        if module  # the public API is a list of what stands anywhere below
        for other in sorted(imports(path, known))
        if is_upward(module, other)
    ]


def test_every_folder_has_its_layer() -> None:
    names = {module.split(".")[0] for module in modules(SOURCES) if module}
    assert names == {name for layer in LAYERS for name in layer}


def test_nothing_imports_upwards() -> None:
    assert upward(SOURCES) == []


def test_there_is_no_circle() -> None:
    known = modules(SOURCES)
    graph = {module: imports(path, known) - {module} for module, path in known.items() if module}
    TopologicalSorter(graph).prepare()


def test_the_package_does_not_import_what_only_a_checkout_has() -> None:
    folders = {"experiments", "benchmarks", "learning", "tools"}
    for path in SOURCES.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            else:
                names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not folders & {name.partition(".")[0] for name in names}, path


def test_an_upward_import_would_be_found(tmp_path: Path) -> None:
    for name, text in (
        ("body/low.py", "def late():\n    from cardbox_tracker.ros import high\n"),
        ("ros/high.py", "import cardbox_tracker.body.low\n"),
        ("keypoint_status/a.py", "from cardbox_tracker.markers import b\n"),
        ("markers/b.py", ""),
        ("estimation/cost/c.py", "from cardbox_tracker.estimation.filtering.d import x\n"),
        ("estimation/filtering/d.py", "x = 1\n"),
    ):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    assert upward(tmp_path) == [
        "body.low -> ros.high",
        "keypoint_status.a -> markers.b",
        "estimation.cost.c -> estimation.filtering.d",
    ]
    known = modules(tmp_path)
    with pytest.raises(CycleError):
        TopologicalSorter({m: imports(p, known) for m, p in known.items()}).prepare()


def test_the_document_has_the_layers_in_this_order() -> None:
    text = (SOURCES.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
    table = text.split("| layer | what |")[1].split("\n\n")[0]
    rows = [row.split("|")[1] for row in table.splitlines() if row.startswith("| `")]
    named = [name for row in rows for name in re.findall(r"`(\w+)(?:/|\.py)`", row)]
    written = list(dict.fromkeys(named))
    layers = [name for layer in LAYERS for name in layer]
    assert sorted(written) == sorted(layers)
    for name, other in pairwise(written):
        assert rank(name, LAYERS, 0) <= rank(other, LAYERS, 0), f"{other} stands below {name}"
