"""What the documents name is there: links, files, commands, and what nodes are quoted with."""

from __future__ import annotations

import argparse
import ast
import re
import shlex
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from cardbox_tracker.commands.main import build_parser
from cardbox_tracker.common.health import WATCHES

ROOT = Path(__file__).parents[1]
DOCUMENTS = sorted(
    path.relative_to(ROOT)
    for path in [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
)
WRITTEN = [path for path in DOCUMENTS if "evaluation" not in path.parts]
LARGEST_IMAGE_BYTES = 200_000
IMAGE_SUFFIXES = (".png", ".jpg")

INLINE = re.compile(r"(?<!`)`([^`]+)`(?!`)")
LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
FILE = re.compile(r"[\w.-]+(?:/[\w.-]+)+\.(?:py|md|yaml|xml|rviz|json|png|jpg)")
# Made by a command, or of a user.
NOT_HERE = ("demo_output/", "example/", "/", "~")


def text_of(document: Path) -> str:
    return (ROOT / document).read_text(encoding="utf-8")


def blocks(text: str) -> Iterator[str]:
    """Yield each line of the code blocks (indented or fenced), continuation lines joined."""
    lines, fenced, before = [], False, ""
    for line in text.splitlines():
        if line.startswith("```"):
            fenced = not fenced
        elif fenced or (line.startswith("    ") and (not before.strip() or lines)):
            lines.append(line.strip())
        elif lines:
            yield from re.sub(r"\\\n", " ", "\n".join(lines)).splitlines()
            lines = []
        before = line
    yield from re.sub(r"\\\n", " ", "\n".join(lines)).splitlines()


def prose(text: str) -> str:
    """Return the text without its code blocks."""
    text = re.sub(r"(?ms)^```.*?^```", "", text)
    return re.sub(r"(?m)^    .*$", "", text)


def inline(text: str) -> list[str]:
    return [" ".join(code.split()) for code in INLINE.findall(prose(text))]


def slug(heading: str) -> str:
    """Return the anchor that a heading gets."""
    kept = re.sub(r"[^\w\- ]", "", heading.strip().lower())
    return kept.replace(" ", "-")


def anchors(path: Path) -> set[str]:
    headings = re.findall(r"(?m)^#+ (.*)$", prose(path.read_text(encoding="utf-8")))
    return {slug(heading) for heading in headings}


@pytest.mark.parametrize("document", DOCUMENTS, ids=str)
def test_links_and_images_are_there(document: Path) -> None:
    for target in LINK.findall(prose(text_of(document))):
        if re.match(r"https?://", target):
            continue
        name, _, anchor = target.partition("#")
        path = (ROOT / document).parent / name if name else ROOT / document
        assert path.exists(), f"{document}: {target}"
        if anchor:
            assert anchor in anchors(path), f"{document}: {target}"
        if path.suffix in IMAGE_SUFFIXES and "evaluation" not in path.parts:
            assert path.stat().st_size < LARGEST_IMAGE_BYTES, path


@pytest.mark.parametrize("document", WRITTEN, ids=str)
def test_named_files_are_there(document: Path) -> None:
    for code in inline(text_of(document)):
        for name in FILE.findall(code):
            if not code.startswith(NOT_HERE) and "$" not in code:
                places = [ROOT / name, ROOT / "cardbox_tracker" / name]
                assert any(place.exists() for place in places), f"{document}: {name}"


def defined_in(path: Path) -> set[str]:
    """Return the names of all functions, classes and constants of a module."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            found |= {target.id for target in targets if isinstance(target, ast.Name)}
    return found


def test_the_page_of_the_paper_names_what_there_is() -> None:
    text = text_of(Path("docs/paper.md"))
    named = re.findall(r"`([\w/]+\.py):(\w+)`", text)
    for name, what in named:
        place = next(p for p in (ROOT / "cardbox_tracker" / name, ROOT / name) if p.exists())
        assert what in defined_in(place), f"{name}:{what}"
    rows = [row.split("|") for row in text.splitlines() if re.search(r"`[\w/]+\.py:", row)]
    parts = " ".join(row[1] for row in rows if len(row) > 3)
    for part in (*(f"({i})" for i in range(1, 14)), *(f"algorithm {i}" for i in range(1, 5))):
        assert part in parts
    assert "Table I" in parts


def commands(first: str) -> list[tuple[Path, str, bool]]:
    """Return (document, command, whether it stands in a code block) of all that start so."""
    found = []
    for document in WRITTEN:
        text = text_of(document)
        found += [(document, line, True) for line in blocks(text) if line.startswith(f"{first} ")]
        found += [(document, line, False) for line in inline(text) if line.startswith(f"{first} ")]
    return found


def subcommands() -> dict[str, argparse.ArgumentParser]:
    parser = build_parser()
    groups = (a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    return dict(next(groups).choices)


@pytest.mark.parametrize(("document", "command", "is_block"), commands("cardbox"))
def test_cardbox_commands_parse(
    document: Path, command: str, is_block: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    words = shlex.split(command, comments=True)[1:]
    if not is_block and len(words) == 1 and words[0] in subcommands():
        return
    try:
        build_parser().parse_args(words)
    except SystemExit as end:
        assert not end.code, f"{document}: {command}: {capsys.readouterr().err}"


def test_each_subcommand_is_in_a_document() -> None:
    named = {shlex.split(command)[1] for _, command, _ in commands("cardbox")}
    assert set(subcommands()) <= named


def test_make_targets_exist() -> None:
    targets = set(re.findall(r"(?m)^\.PHONY: ([\w-]+)$", (ROOT / "Makefile").read_text()))
    for document, command, _ in commands("make"):
        assert shlex.split(command, comments=True)[1] in targets, f"{document}: {command}"
    written = {shlex.split(command, comments=True)[1] for _, command, _ in commands("make")}
    assert {"setup", "demo", "test"} <= written
    named = set(re.findall(r"(?m)^# make ([\w-]+)", (ROOT / "Makefile").read_text()))
    assert {"setup", "demo", "test"} <= named <= targets


def launch_arguments(name: str) -> set[str]:
    """Arguments that a launch file declares, itself or by the launch files that it includes."""
    text = (ROOT / "launch" / name).read_text(encoding="utf-8")
    found = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Dict):
            names = [target.id for target in node.targets if isinstance(target, ast.Name)]
            if "ARGUMENTS" in names:
                found |= {k.value for k in node.value.keys if isinstance(k, ast.Constant)}
        if isinstance(node, ast.Call) and getattr(node.func, "id", "").startswith("with_"):
            found |= launch_arguments("nodes.launch.py")
    return {str(argument) for argument in found}


def launch_commands() -> list[tuple[Path, str]]:
    started = [(d, c.split(maxsplit=3)[3]) for d, c, _ in commands("ros2 launch cardbox_tracker")]
    for document in WRITTEN:
        codes = inline(text_of(document))
        started += [(document, code) for code in codes if re.match(r"\w+\.launch\.py\b", code)]
    return started


@pytest.mark.parametrize(("document", "command"), launch_commands())
def test_launch_files_have_the_arguments(document: Path, command: str) -> None:
    name, *given = shlex.split(command)
    assert (ROOT / "launch" / name).exists(), f"{document}: {name}"
    for argument in given:
        assert argument.partition(":=")[0] in launch_arguments(name), f"{document}: {argument}"


def test_the_launch_arguments_are_found() -> None:
    assert {"device", "person_distance_m", "rviz"} <= launch_arguments("live.launch.py")
    assert "device" not in launch_arguments("replay.launch.py")
    assert {"bag", "pause_at", "image"} <= launch_arguments("replay.launch.py")


def key_words(text: str) -> set[str]:
    """Return the stems of the words of a text, but the shortest."""
    return {word[:5] for word in re.findall(r"[a-z_]{3,}", text.lower())}


@cache
def spoken() -> list[set[str]]:
    """Return the key words of each text in the code but docstrings."""
    texts = [watch.words for watch in WATCHES.values()]
    for path in sorted((ROOT / "cardbox_tracker").rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        silent = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.JoinedStr):
                silent |= {id(part) for part in node.values}
                parts = (p.value if isinstance(p, ast.Constant) else " " for p in node.values)
                texts.append("".join(map(str, parts)))
            elif isinstance(node, ast.Constant) and id(node) not in silent:
                texts.append(str(node.value))
    return [key_words(text) for text in texts]


def is_spoken(quote: str, texts: list[set[str]]) -> bool:
    """Return whether one text has two thirds of the key words of a quote."""
    words = key_words(quote.removeprefix("waiting for "))
    return any(len(words & text) >= 0.66 * len(words) for text in texts)


def test_messages_that_are_quoted_exist() -> None:
    texts = spoken()
    quotes = re.findall(r"(?m)^> (.*)$", text_of(Path("docs/troubleshooting.md")))
    assert len(quotes) > 10
    for quote in quotes:
        assert is_spoken(quote, texts), quote


def test_a_made_up_quote_would_be_noticed() -> None:
    texts = spoken()
    assert is_spoken("the brightness of the whole scene has changed", texts)
    assert not is_spoken("the whole scene turned into a lake", texts)
    assert not is_spoken("every camera dreams of electric sheep", texts)


def test_joint_limits_of_the_conventions_are_those_of_the_code() -> None:
    import numpy as np

    from cardbox_tracker.person.posture import TURNING_LIMITS, place_limits
    from cardbox_tracker.person.skeleton import (
        JOINT_NAMES,
        NECK_LIMITS,
        NECK_NAMES,
        PLACE_NAMES,
        Group,
        joints_of,
    )

    rows = re.findall(
        r"(?m)^\| `(\w+)`.*\| (-?[\d.]+) to ([\d.]+) \|$", text_of(Path("docs/conventions.md"))
    )
    limits = dict(zip(JOINT_NAMES, np.degrees(TURNING_LIMITS), strict=True))
    limits["torso_y"] = TURNING_LIMITS[0]
    limits |= dict(zip(PLACE_NAMES, place_limits(2.0), strict=True))
    limits |= dict(zip(NECK_NAMES, np.degrees(NECK_LIMITS), strict=True))
    limits |= {joint.name: joint.limits for joint in joints_of(Group.CLAVICLE)}
    limits |= {joint.name: np.degrees(joint.limits) for joint in joints_of(Group.HAND)}
    assert len(rows) == 16
    for name, lowest, highest in rows:
        assert (float(lowest), float(highest)) == pytest.approx(tuple(limits[name])), name
