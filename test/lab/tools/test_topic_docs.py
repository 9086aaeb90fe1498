"""The tables of docs/topics.md are those of the table in the package."""

from __future__ import annotations

import pytest

from cardbox_tracker.common.errors import CardboxError
from lab.tools import topic_docs


def test_the_committed_document_is_the_generated_one() -> None:
    text = topic_docs.DOCUMENT.read_text(encoding="utf-8")
    assert topic_docs.document(text) == text, "run python -m lab.tools.topic_docs"


def test_a_changed_row_and_a_lost_mark_are_noticed() -> None:
    text = topic_docs.DOCUMENT.read_text(encoding="utf-8")
    row = "| `tracker/reset` | std_srvs/Trigger |"
    assert row in text
    assert topic_docs.document(text.replace(row, "| `tracker/stop` | std_srvs/Trigger |")) == text
    with pytest.raises(CardboxError, match="tracker services:begin"):
        topic_docs.document(text.replace("<!-- tracker services:begin -->", ""))
