"""Read YAML that anybody may have written: small, flat and plain, in time linear to its size."""

from __future__ import annotations

import os
import stat
from collections.abc import Hashable
from typing import Any

import yaml

from cardbox_tracker.errors import CardboxError, cut, quoted

MOST_BYTES = 64 * 1024
MOST_DEPTH = 8


class SmallYamlError(CardboxError):
    """A text is no YAML, or more of it than is read here; the text names no source."""


def parse_small_yaml(text: str) -> Any:
    """Return the mapping, list or value that a YAML text holds.

    Aliases, tags, a key given twice, and more than 64 kB or 8 levels are refused: no file of ours
    has them, and a small text can stand for gigabytes with them.

    Raises:
        SmallYamlError: it holds one of these, or is no YAML.
    """
    # No character has fewer bytes than one.
    if len(text) > MOST_BYTES or len(text.encode("utf-8", "replace")) > MOST_BYTES:
        raise SmallYamlError(f"it has more than {MOST_BYTES // 1024} kB; expected a few")
    try:
        return yaml.load(text, Loader=_Loader)
    except yaml.YAMLError as error:
        raise SmallYamlError(f"it is not valid YAML: {cut(str(error))}") from None
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        # What conversions raise, such as of a date that no calendar has.
        raise SmallYamlError(f"it is not valid YAML: {cut(str(error))}") from None


class _Loader(yaml.SafeLoader):
    """Checks each node before what is inside it is read."""

    _depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent):
            raise SmallYamlError(f"it has the alias *{quoted(event.anchor)}; write the value out")
        if getattr(event, "tag", None) not in (None, "!"):
            raise SmallYamlError(f"it has the tag {quoted(event.tag)}; remove it")
        if self._depth >= MOST_DEPTH:
            raise SmallYamlError(f"it has more than {MOST_DEPTH} levels; expected two or three")
        self._depth += 1
        try:
            return super().compose_node(parent, index)
        finally:
            self._depth -= 1

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode) or key.tag.endswith(":merge"):
                raise SmallYamlError("it has a key that is no plain word")
            if key.value in seen:
                raise SmallYamlError(f"key {quoted(key.value)} is given twice; keep one")
            seen.add(key.value)
        return super().construct_mapping(node, deep)


def read_small_text(path: str | os.PathLike[str]) -> str:
    """Return the text of a file of at most 64 kB; never wait for one.

    Raises:
        SmallYamlError: it cannot be read, is no file or no text, or is larger.
    """
    try:
        # A pipe without a writer would be waited for.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        with os.fdopen(descriptor, "rb") as file:
            mode = os.fstat(descriptor).st_mode
            if not stat.S_ISREG(mode):
                what = "Is a directory" if stat.S_ISDIR(mode) else "it is no file"
                raise SmallYamlError(what)
            data = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise SmallYamlError(error.strerror or str(error)) from None
    except ValueError as error:  # a NUL in the name
        raise SmallYamlError(str(error)) from None
    if len(data) > MOST_BYTES:
        raise SmallYamlError(f"it has more than {MOST_BYTES // 1024} kB; expected a few")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        raise SmallYamlError("it is not a text file") from None
