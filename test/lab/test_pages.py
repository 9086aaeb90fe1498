"""Generated parts of documents stand between two marks."""

from __future__ import annotations

import pytest

from cardbox_tracker.common.errors import CardboxError
from lab.pages import replaced

BEGIN, END = "<!-- begin -->", "<!-- end -->"


def test_a_section_is_replaced_between_its_marks() -> None:
    document = f"before\n{BEGIN}\nold\n{END}\nafter\n"
    new = replaced(document, "new", BEGIN, END)
    assert new == f"before\n{BEGIN}\nnew\n{END}\nafter\n"
    assert replaced(new, "new", BEGIN, END) == new


@pytest.mark.parametrize("document", ["nothing", BEGIN, f"{BEGIN}{BEGIN}{END}"])
def test_a_document_without_both_marks_once_is_refused(document: str) -> None:
    with pytest.raises(CardboxError, match=END):
        replaced(document, "new", BEGIN, END)
