"""Reader of small and plain YAML from untrusted sources: PyYAML's safe loader with limits.

The safe loader alone accepts aliases, which can expand to gigabytes, and any depth and size.
"""

from __future__ import annotations

import os
from collections.abc import Hashable
from typing import Any

import yaml

from cardbox_tracker.common.errors import CardboxError, cut, quoted, reason_of
from cardbox_tracker.common.files import UnreadableFileError, read_regular

MOST_BYTES = 64 * 1024
MOST_DEPTH = 8


class SmallYamlError(CardboxError):
    """A text is not valid YAML, or exceeds the limits of this module."""


def parse_small_yaml(text: str) -> Any:
    """Return the mapping, list or value of a YAML text.

    Aliases, tags, repeated keys, more than 64 kB, and more than 8 levels are refused. Raises
    SmallYamlError if the text is refused or not valid YAML. The message does not name the source.
    """
    # The first comparison avoids encoding a long text, because a character has at least one byte.
    if len(text) > MOST_BYTES or len(text.encode("utf-8", "replace")) > MOST_BYTES:
        raise SmallYamlError(f"it has more than {MOST_BYTES // 1024} kB; expected a few")
    try:
        return yaml.load(text, Loader=_Loader)
    except yaml.YAMLError as error:
        raise SmallYamlError(f"it is not valid YAML: {cut(str(error))}") from None
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        # PyYAML does not catch errors of conversions, for example of an impossible date.
        raise SmallYamlError(f"it is not valid YAML: {reason_of(error)}") from None


class _Loader(yaml.SafeLoader):
    """Safe loader that checks each node before it reads the node's content."""

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
                raise SmallYamlError("it has a key that is not a plain word; write it as a word")
            if key.value in seen:
                raise SmallYamlError(f"key {quoted(key.value)} is given twice; keep one")
            seen.add(key.value)
        return super().construct_mapping(node, deep)


def read_small_text(path: str | os.PathLike[str]) -> str:
    """Return the text of a regular file of at most 64 kB; SmallYamlError if it is none."""
    try:
        data = read_regular(path, MOST_BYTES)
    except UnreadableFileError as error:
        raise SmallYamlError(str(error)) from None
    try:
        # Editors of Windows begin a file with a byte order mark.
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise SmallYamlError("it is not a text file") from None
