"""The scores of a recording as one page of HTML that prints and needs no other file."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cardbox_tracker.ergonomics.charts import (
    ACTION_COLOURS,
    NOTHING_COLOUR,
    UNCERTAIN_COLOUR,
    share_bar,
    timeline,
)
from cardbox_tracker.ergonomics.config import RulaConfig
from cardbox_tracker.ergonomics.distribution import expected
from cardbox_tracker.ergonomics.markup import Element, add, document, element
from cardbox_tracker.ergonomics.moments import GAP_S, WorstMoments, worst_moments
from cardbox_tracker.ergonomics.parts import PARTS, limits
from cardbox_tracker.ergonomics.recording import ABOVE, RulaRow, RulaSummary, summarize
from cardbox_tracker.ergonomics.report import neck_words, share_words, unseen
from cardbox_tracker.ergonomics.shares import score_shares
from cardbox_tracker.ergonomics.tables import ACTION_LEVELS
from cardbox_tracker.files import atomic_path

REFERENCE = (
    "L. McAtamney and E. N. Corlett, “RULA: a survey method for the investigation of work-related "
    "upper limb disorders”, Applied Ergonomics 24(2), 1993, pages 91-99."
)
_LIMITS = (
    "RULA is a screening method, and a camera measured the posture here: neither replaces an "
    "ergonomist. RULA rates single postures; the shares of time are an addition of this program.",
    "Load, muscle use, wrists, legs, a twisted trunk and a neck bent to the side are not measured. "
    "They count as declared for the whole recording, and a wrong declaration shifts every score.",
    "The paper gives no angles for “abducted”, “bent”, “twisted” and “upright”; the limits under "
    "Settings draw these lines.",
    "A posture found in an outline is uncertain, most of all in depth, so that each image has a "
    "chance for each score. The chances contain no errors that are common to all images, such as "
    "a wrong body model.",
)
# The number after it stays on the same line.
_FIRM_COLON = ":\N{NO-BREAK SPACE}"
_STYLE = """
@page { size: A4; margin: 14mm; }
body { font: 15px/1.45 system-ui, sans-serif; color: #111; background: #fff;
  max-width: 920px; margin: 1.5em auto; padding: 0 1em; }
h1 { font-size: 1.6em; } h2 { font-size: 1.15em; margin: 1.6em 0 .4em; }
h1, table.facts td { overflow-wrap: anywhere; }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: left; vertical-align: top; padding: 2px 10px 2px 0; }
th, td:first-child, td.short { white-space: nowrap; }
tr { border-bottom: 1px solid #ddd; }
svg text { font: 12px system-ui, sans-serif; }
svg.timeline, img { width: 100%; height: auto; } svg.bar { display: block; }
.key { display: inline-block; width: 1em; height: .9em; border: 1px solid #888;
  margin: 0 .4em 0 0; }
.moments { display: grid; grid-template-columns: 1fr 1fr 1fr; gap: 12px; }
figure { margin: 0; } figcaption { font-size: .9em; }
@media print {
  body { font-size: 9pt; line-height: 1.3; max-width: none; margin: 0; padding: 0; }
  h2 { margin-top: 1em; } p { margin: .4em 0; }
  * { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
  h2 { break-after: avoid; } tr, figure, svg { break-inside: avoid; }
}
"""


@dataclass(frozen=True)
class PageContent:
    """Content of the page.

    Attributes:
        title: heading of the page.
        facts: lines about recording, person and settings, by name.
        config: settings of the score.
        rows: one image each, in order.
        images: JPEG of images by stamp; None if no images are wanted or given.
        are_heads_hidden: whether heads in the images were made unrecognizable.
    """

    title: str
    facts: Mapping[str, str]
    config: RulaConfig
    rows: Sequence[RulaRow]
    images: Mapping[int, bytes] | None = None
    are_heads_hidden: bool = True


def write_page(content: PageContent, path: Path) -> None:
    """Write the page, a single file without scripts.

    Raises:
        CardboxError: the file cannot be written.
    """
    with atomic_path(path) as temporary:
        temporary.write_bytes(document(_page(content)))


def _page(content: PageContent) -> Element:
    root = element("html", lang="en")
    head = add(root, "head")
    add(head, "meta", charset="utf-8")
    policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
    add(head, "meta", http_equiv="Content-Security-Policy", content=policy)
    add(head, "meta", name="viewport", content="width=device-width")
    add(head, "title", content.title)
    add(head, "style", _STYLE)
    body = add(root, "body")
    add(body, "h1", content.title)
    summary = summarize(content.rows)
    _table(body, content.facts)
    _result(body, summary)
    if summary.measured_s:
        worst = worst_moments(content.rows)
        _timeline(body, content.rows, worst)
        _parts(body, content)
        _declared(body, content.config, summary)
        _moments(body, content, worst)
    else:
        _declared(body, content.config, summary)
    add(body, "h2", "Settings")
    angles = [f"{name.replace('_', ' ')} {x}" for name, x in limits(content.config).items()]
    add(body, "p", f"Limits of angles that the paper leaves open, degrees: {', '.join(angles)}.")
    add(body, "h2", "Method and its limits")
    add(body, "p", REFERENCE)
    listed = add(body, "ul")
    for text in _LIMITS:
        add(listed, "li", text)
    return root


def _result(body: Element, summary: RulaSummary) -> None:
    add(body, "h2", "Result")
    if not summary.measured_s:
        add(body, "p", "There is no time with a posture, so there is no score.")
        return
    share = summary.above_s / summary.measured_s
    add(
        body,
        "p",
        f"Expected RULA score {summary.mean:.1f}, of 1 to 7, over {summary.measured_s:.1f} s with "
        f"a posture; above {ABOVE} for {summary.above_s:.1f} s ({share:.0%}). "
        f"The grand score is that of the worse arm.",
    )
    table = add(body, "table")
    _row(table, ("score", "action level", "time", "share"), "th")
    for level, colour, time_s in zip(
        ACTION_LEVELS, ACTION_COLOURS, summary.by_level_s, strict=True
    ):
        low, high, meaning = level
        scores = str(low) if low == high else f"{low}-{high}"
        row = _row(table, ("", meaning, f"{time_s:.1f} s", f"{time_s / summary.measured_s:.0%}"))
        _key(row[0], colour, scores)
    if summary.uncertain_s:
        add(
            body,
            "p",
            f"{summary.uncertain_s:.1f} s of this time have a posture that may be wrong (state "
            "“uncertain”); these images count in all times.",
        )


def _timeline(body: Element, rows: Sequence[RulaRow], worst: WorstMoments) -> None:
    add(body, "h2", "Score over time")
    body.append(timeline(rows, worst.rows))
    note = add(body, "p")
    _key(note, UNCERTAIN_COLOUR, "posture may be wrong; ")
    _key(note, NOTHING_COLOUR, "no posture; numbers are the worst moments below")


def _parts(body: Element, content: PageContent) -> None:
    add(body, "h2", "Part scores")
    add(
        body,
        "p",
        "Mean score of each part, and the share of the time at each score. Table A rates upper "
        "arm, lower arm and wrist, table B neck, trunk and legs; both without load and muscle use. "
        "The source mixed is a score from measured and declared ones.",
    )
    table = add(body, "table")
    _row(table, ("part", "source", "mean", "share of the time at each score", ""), "th")
    for one in score_shares(content.rows, content.config):
        words = share_words(one).replace(": ", _FIRM_COLON)
        row = _row(table, (one.words, one.source, f"{one.mean:.1f}", "", words))
        row[3].append(share_bar(one.shares))


def _declared(body: Element, config: RulaConfig, summary: RulaSummary) -> None:
    add(body, "h2", "Declared, not seen")
    text = "These inputs are not measured. “default” marks a value that counts if none is declared"
    if summary.neck_measured_s:
        text += f"; {neck_words(summary)}"
    add(body, "p", f"{text}.")
    table = add(body, "table")
    _row(table, ("input", "value", "meaning"), "th")
    for one in unseen(config, summary):
        value = f"{one.value} (default)" if one.is_default else one.value
        row = _row(table, (one.name.replace("_", " "), value, one.description))
        row[1].set("class", "short")


def _moments(body: Element, content: PageContent, worst: WorstMoments) -> None:
    add(body, "h2", "Worst moments")
    text = f"The highest expected scores, at least {GAP_S:g} s apart."
    if worst.uncertain:
        text += f" Images left out, since their posture may be wrong: {worst.uncertain}."
    if not worst.rows:
        text += " There is no other image, so none is shown."
    elif content.images is None:
        text += " The images of the recording were not given, so this page has none."
    elif content.are_heads_hidden:
        text += " The head of the tracked person is hidden; check for others before you share."
    else:
        text += " Faces are shown, as was asked for."
    add(body, "p", text)
    shown = add(body, "div", class_="moments")
    for number, row in enumerate(worst.rows, 1):
        figure = add(shown, "figure")
        words = _moment_words(row)
        if content.images is not None and row.stamp_ns in content.images:
            data = base64.b64encode(content.images[row.stamp_ns]).decode("ascii")
            add(figure, "img", src=f"data:image/jpeg;base64,{data}", alt=f"moment {number}")
        add(figure, "figcaption", f"{number}. {row.time_s:.1f} s: {words}")


def _moment_words(row: RulaRow) -> str:
    if row.scores is None:
        return "no posture"
    parts = [f"{part.words} {expected(row.scores.parts[part.name]):.1f}" for part in PARTS]
    return f"score {row.scores.mean:.1f} ({'; '.join(parts)})"


def _table(body: Element, facts: Mapping[str, str]) -> None:
    table = add(body, "table", class_="facts")
    for name, value in facts.items():
        row = add(table, "tr")
        add(row, "th", name)
        add(row, "td", value)


def _row(table: Element, cells: Sequence[str], tag: str = "td") -> Element:
    row = add(table, "tr")
    for cell in cells:
        add(row, tag, cell)
    return row


def _key(parent: Element, colour: str, text: str) -> None:
    key = add(parent, "span", class_="key", style=f"background: {colour}")
    key.tail = text
