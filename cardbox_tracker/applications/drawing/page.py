"""Pages that need no other file, and figures as PNG or PDF."""

from __future__ import annotations

import base64
import io
from pathlib import Path
from typing import TYPE_CHECKING

from cardbox_tracker.common.files import atomic_path

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def render_page(path: Path, template: Path, **values: object) -> None:
    """Write a page from a template of Jinja, whose filter ``data`` turns bytes into base64.

    Raises CardboxError if the file cannot be written.
    """
    import jinja2

    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    environment.filters["data"] = lambda content: base64.b64encode(content).decode("ascii")
    text = environment.from_string(template.read_text(encoding="utf-8")).render(values)
    with atomic_path(path) as temporary:
        # Letters of broken file names become "?".
        temporary.write_bytes(text.encode("utf-8", "replace"))


def png_of(figure: Figure) -> bytes:
    """Return a figure as PNG, the same bytes for the same figure."""
    return _saved(figure, "png", "Software")


def pdf_of(figure: Figure) -> bytes:
    """Return a figure as PDF, the same bytes for the same figure."""
    return _saved(figure, "pdf", "CreationDate")


def _saved(figure: Figure, kind: str, without: str) -> bytes:
    saved = io.BytesIO()
    figure.savefig(saved, format=kind, metadata={without: None})
    return saved.getvalue()
