"""Small YAML is read, and nothing that a stranger writes takes long or much memory."""

from __future__ import annotations

import os
import threading
import tracemalloc
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.common.errors import cut, quoted
from cardbox_tracker.common.small_yaml import (
    MOST_BYTES,
    MOST_DEPTH,
    SmallYamlError,
    parse_small_yaml,
    read_small_text,
)

# Each level has ten times the level before: ten gigabytes in a few hundred bytes.
ALIASES = "a: &a [x,x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"{name}: &{name} [{','.join([f'*{before}'] * 10)}]\n"
    for before, name in zip("abcdefghi", "bcdefghij", strict=True)
)
PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=6,
)


@given(PLAIN)
def test_what_has_few_levels_is_read_as_it_was_written(value: object) -> None:
    text = yaml.safe_dump(value, default_flow_style=True)
    try:
        assert parse_small_yaml(text) == value
    except SmallYamlError as error:
        assert f"{MOST_DEPTH} levels" in str(error)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (ALIASES, r"alias \*'a'"),
        ("a: &a [*a]", "alias"),
        ("[" * 5000, "8 levels"),
        ("{a: " * 5000, "8 levels"),
        ("- " * 5000 + "a", "8 levels"),
        ("a" * (MOST_BYTES + 1), "64 kB"),
        ("\u00e9" * (MOST_BYTES // 2 + 1), "64 kB"),
        ("!!python/object/apply:os.system ['true']", "tag:yaml.org,2002:python/object"),
        ("a: !!int ''", "tag"),
        ("a: !!timestamp x", "tag"),
        ("a: 1\na: 2", "'a' .*twice"),
        ("? [1]\n: 2", "plain word"),
        ("<<: {a: 1}", "plain word"),
        ("a: 2001-99-99", "YAML"),
        ("a: 2001-01-01 00:00:00 +99:99", "YAML"),
        ("a: " + "9" * 5000, "YAML"),
        ("a: [1", "YAML"),
        ("\x00", "YAML"),
        ("\ud800", "YAML"),
        ("a: 1\n---\nb: 2", "YAML"),
    ],
)
def test_what_is_not_small_and_plain_is_refused_in_few_words(text: str, words: str) -> None:
    with pytest.raises(SmallYamlError, match=words) as refused:
        parse_small_yaml(text)
    assert len(str(refused.value)) < 300


def test_as_many_keys_as_fit_are_read() -> None:
    """Comparing each with each other took a minute."""
    keys = MOST_BYTES // 9
    assert len(parse_small_yaml("".join(f"k{number:05d}: \n" for number in range(keys)))) == keys


@pytest.mark.promise("No input fills memory, disk or log, or holds up a program")
def test_what_is_refused_needs_little_memory() -> None:
    large = "x" * 50_000_000
    tracemalloc.start()
    try:
        for text in (ALIASES, large, "[" * MOST_BYTES):
            before = tracemalloc.get_traced_memory()[0]
            tracemalloc.reset_peak()
            with pytest.raises(SmallYamlError):
                parse_small_yaml(text)
            assert tracemalloc.get_traced_memory()[1] - before < 5_000_000
    finally:
        tracemalloc.stop()


@pytest.mark.promise("No input fills memory, disk or log, or holds up a program")
def test_a_byte_order_mark_does_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "file.yaml"
    path.write_text("a: 1\n", encoding="utf-8-sig")
    assert read_small_text(path) == "a: 1\n"


def test_a_pipe_is_not_waited_for_and_a_device_not_read(tmp_path: Path) -> None:
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    told: list[str] = []

    def read() -> None:
        for path in (fifo, Path("/dev/zero"), Path("/dev/null")):
            with pytest.raises(SmallYamlError) as refused:
                read_small_text(path)
            told.append(str(refused.value))

    reading = threading.Thread(target=read, daemon=True)
    reading.start()
    reading.join(30)
    assert ["pipe or a device" in text for text in told] == [True] * 3


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"x" * (MOST_BYTES + 1), "64 kB"),
        (b"\xff\xfe", "text file"),
        (None, "No such file"),
    ],
)
def test_what_is_no_small_text_is_refused(
    content: bytes | None, words: str, tmp_path: Path
) -> None:
    path = tmp_path / "file"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SmallYamlError, match=words):
        read_small_text(path)
    for bad in (tmp_path, tmp_path / ("n" * 300), "a\0b"):
        with pytest.raises(SmallYamlError):
            read_small_text(bad)


@pytest.mark.parametrize("value", ["x" * 10**6, ["x"] * 10**5, [16**5000], {"a": "x" * 10**6}])
def test_a_value_is_quoted_in_few_words(value: object) -> None:
    assert len(quoted(value)) < 80
    assert quoted("left") == "'left'"
    assert cut("short") == "short"
