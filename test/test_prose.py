"""Rules of plain prose that a program can check: docstrings, comments and headings."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
CHECKED = (
    *("cardbox_tracker", "experiments", "benchmarks", "learning", "tools"),
    *("docs", "README.md", "CONTRIBUTING.md"),
)
# Paths that are not yet written plainly; remove each as soon as it is.
NOT_YET = ()
OPENING = re.compile(
    r"(?:\A|\n\s*\n|[.!?]\s)\s*(What|Whatever|Who|Whoever|Whose|Of which|Of an?)\b(?![^.]*\?)"
)
MOST_COMMENT_LINES = 2
TOOL_COMMENT = re.compile(r"#!|# (?:type|noqa|ruff|fmt|pragma|mypy)\b")


def paths(suffix: str) -> list[Path]:
    """Return the files that are held to the rules."""
    found: set[Path] = set()
    for name in CHECKED:
        base = ROOT / name
        found |= {base} if base.is_file() else set(base.rglob(f"*{suffix}"))
    skipped = [ROOT / name for name in NOT_YET]
    return sorted(
        path
        for path in found
        if path.suffix == suffix
        and not any(path == other or other in path.parents for other in skipped)
    )


def docstrings(source: str) -> Iterator[tuple[int, str]]:
    """Yield the line and the text of every string that stands by itself."""
    for node in ast.walk(ast.parse(source)):
        value = node.value if isinstance(node, ast.Expr) else None
        if isinstance(value, ast.Constant) and isinstance(value.value, str):
            yield value.lineno, value.value


def comments(source: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the first line and the lines of every comment; one beside code stands alone."""
    blocks: list[tuple[int, list[str]]] = []
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type != tokenize.COMMENT or TOOL_COMMENT.match(token.string):
            continue
        line, text = token.start[0], token.string.lstrip("# ")
        is_beside = not token.line.lstrip().startswith("#")
        if blocks and not is_beside and blocks[-1][0] + len(blocks[-1][1]) == line:
            blocks[-1][1].append(text)
        else:
            blocks.append((line, [text]))
    yield from blocks


def wrong_in_code(source: str) -> Iterator[tuple[int, str]]:
    """Yield the line and the reason of each breach of the rules in Python code."""
    blocks = list(comments(source))
    texts = [*docstrings(source), *((line, " ".join(block)) for line, block in blocks)]
    for line, text in texts:
        for opening in OPENING.findall(text):
            yield line, f"a sentence opens with {opening!r}"
    for line, block in blocks:
        if len(block) > MOST_COMMENT_LINES:
            yield line, f"a comment of {len(block)} lines"


def wrong_in_document(text: str) -> Iterator[tuple[int, str]]:
    """Yield the line and the reason of each breach of the rules in a document."""
    for number, line in enumerate(text.splitlines(), 1):
        heading = re.match(r"#+ (.*)", line)
        if heading and OPENING.match(heading[1]):
            yield number, f"the heading {heading[1]!r} is no topic"


@pytest.mark.parametrize("path", paths(".py"), ids=lambda path: str(path.relative_to(ROOT)))
def test_code_is_commented_plainly(path: Path) -> None:
    found = [f"{line}: {reason}" for line, reason in wrong_in_code(path.read_text("utf-8"))]
    assert not found, found


@pytest.mark.parametrize("path", paths(".md"), ids=lambda path: str(path.relative_to(ROOT)))
def test_headings_name_their_topic(path: Path) -> None:
    found = [f"{line}: {reason}" for line, reason in wrong_in_document(path.read_text("utf-8"))]
    assert not found, found


def test_breaches_are_found() -> None:
    source = '"""Whoever sways."""\n# One. Of a\n# two\n# three\nx = 1  # Of which\n'
    assert list(wrong_in_code(source)) == [
        (1, "a sentence opens with 'Whoever'"),
        (2, "a sentence opens with 'Of a'"),
        (5, "a sentence opens with 'Of which'"),
        (2, "a comment of 3 lines"),
    ]
    assert list(wrong_in_code('"""Plain. What for?"""\n# One.\n# Two.\ny = 2  # Three.\n')) == []
    assert [line for line, _ in wrong_in_document("# Topic\n\n## What is tried\n")] == [3]
