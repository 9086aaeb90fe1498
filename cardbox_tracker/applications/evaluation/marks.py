"""Replace the generated part of a document, which stands between two marks."""

from __future__ import annotations

from cardbox_tracker.common.errors import CardboxError


def replaced(text: str, section: str, begin: str, end: str) -> str:
    """Return the document ``text`` with another ``section`` between its marks.

    Raises:
        CardboxError: the marks are not there, each once.
    """
    if text.count(begin) != 1 or text.count(end) != 1:
        raise CardboxError(f"the document needs the marks {begin} and {end}, each once")
    before, rest = text.split(begin)
    return f"{before}{begin}\n{section}\n{end}{rest.split(end)[1]}"
