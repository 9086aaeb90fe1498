"""Reads untrusted YAML that is small, flat and plain, in linear time."""

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
    """A text is no YAML, or not within the limits; the message does not name the source."""


def parse_small_yaml(text: str) -> Any:
    """Parse a YAML text; return a mapping, a list or a value.

    Aliases, tags, duplicate keys, and more than 64 kB or 8 levels are refused, since a small text
    can expand to gigabytes with them.

    Raises:
        SmallYamlError: the text contains one of these, or is no YAML.
    """
    # A character has at least one byte.
    if len(text) > MOST_BYTES or len(text.encode("utf-8", "replace")) > MOST_BYTES:
        raise SmallYamlError(f"it has more than {MOST_BYTES // 1024} kB; expected a few")
    try:
        return yaml.load(text, Loader=_Loader)
    except yaml.YAMLError as error:
        raise SmallYamlError(f"it is not valid YAML: {cut(str(error))}") from None
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        # Conversions raise these errors, for example for an impossible date.
        raise SmallYamlError(f"it is not valid YAML: {cut(str(error))}") from None


class _Loader(yaml.SafeLoader):
    """Loader that checks each node before it reads its content."""

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
    """Return the text of a file of at most 64 kB; pipes are not waited for.

    Raises:
        SmallYamlError: the path cannot be read, is no file or no text, or is larger.
    """
    try:
        # Opening a pipe without a writer would block.
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
