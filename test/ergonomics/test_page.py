"""Shares of time, worst moments, and the page of HTML that shows them."""

from __future__ import annotations

import base64
import csv
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.ergonomics.config import RulaConfig
from cardbox_tracker.ergonomics.distribution import ScoreDistribution
from cardbox_tracker.ergonomics.moments import worst_moments
from cardbox_tracker.ergonomics.page import PageContent, write_page
from cardbox_tracker.ergonomics.parts import PARTS, declared
from cardbox_tracker.ergonomics.recording import RulaRow, summarize
from cardbox_tracker.ergonomics.report import part_values, report_lines
from cardbox_tracker.ergonomics.shares import SHARES_HEADER, score_shares, write_shares

JPEG = b"\xff\xd8 an image \xff\xd9"


def one_of(score: int, highest: int) -> np.ndarray:
    return np.asarray(np.eye(highest)[score - 1])


def row(
    time_s: float,
    score: float | None,
    state: str = "tracking",
    trunk: int = 1,
    is_neck_measured: bool = False,
) -> RulaRow:
    """Return an image; a score between two whole ones is either of them."""
    scores = None
    if score is not None:
        low = int(score)
        grand = (1 + low - score) * one_of(low, 7)
        if score > low:
            grand = grand + (score - low) * one_of(low + 1, 7)
        parts = {part.name: one_of(1, part.highest) for part in PARTS}
        scores = ScoreDistribution(grand, grand, grand, {**parts, "trunk": one_of(trunk, 6)})
    return RulaRow(round(time_s * 1e9), state, scores, time_s, is_neck_measured)


def test_time_is_divided_among_scores() -> None:
    """Five images a second apart; one has no posture."""
    rows = [row(0, 3, trunk=2), row(1, 3.5), row(2, None, "lost"), row(3, 6), row(4, 6)]
    found = {one.name: one for one in score_shares(rows, RulaConfig(wrist=3))}
    assert found["grand"].time_s == pytest.approx([0, 0, 1.5, 0.5, 0, 2, 0])
    assert found["grand"].shares[5] == pytest.approx(0.5)
    assert found["grand"].mean == pytest.approx((3 + 3.5 + 6 + 6) / 4)
    assert found["trunk"].time_s == pytest.approx([3, 1, 0, 0, 0, 0])
    assert (found["trunk"].source, found["wrist"].source) == ("measured", "declared")
    assert found["wrist"].time_s == pytest.approx([0, 0, 4, 0])
    assert found["table_b"].source == "mixed"


@pytest.mark.parametrize(
    ("measured", "source"),
    [((False, False), "declared"), ((True, False), "mixed"), ((True, True), "measured")],
)
def test_the_neck_is_what_its_images_are(measured: tuple[bool, ...], source: str) -> None:
    rows = [row(n, 3, is_neck_measured=one) for n, one in enumerate(measured)]
    shares = {one.name: one for one in score_shares(rows, RulaConfig())}
    assert shares["neck"].source == source
    assert summarize(rows).neck_measured_s == sum(measured)


def test_shares_are_a_table(tmp_path: Path) -> None:
    shares = score_shares([row(0, 3), row(1, 3), row(2, 6), row(3, 6)], RulaConfig())
    write_shares(shares, tmp_path / "shares.csv")
    with (tmp_path / "shares.csv").open(encoding="utf-8") as file:
        header, *lines = csv.reader(file)
    assert tuple(header) == SHARES_HEADER
    assert ["grand", "mixed", "6", "2.000", "0.5000"] in lines
    assert ["legs", "declared", "1", "4.000", "1.0000"] in lines
    assert len(lines) == sum(len(one.time_s) for one in shares)


def test_shares_without_a_posture_are_empty(tmp_path: Path) -> None:
    shares = score_shares([row(0, None, "lost")], RulaConfig())
    write_shares(shares, tmp_path / "shares.csv")
    lines = (tmp_path / "shares.csv").read_text(encoding="utf-8").splitlines()[1:]
    assert {line.split(",", 3)[3] for line in lines} == {"0.000,"}


def test_worst_moments_are_apart_and_certain() -> None:
    rows = [
        row(0.0, 5),
        row(1.0, 5.5),  # near the worst one
        row(2.0, 6),
        row(5.0, 6),  # exactly the gap after the worst one, as bad, and later
        row(6.0, 7, "uncertain"),
        row(7.0, None, "lost"),
        row(9.0, 2),
    ]
    found = worst_moments(rows, most=3, gap_s=3.0)
    assert [one.time_s for one in found.rows] == [2.0, 5.0, 9.0]
    assert found.uncertain == 1
    assert [one.time_s for one in worst_moments(rows, most=1).rows] == [2.0]


def test_without_a_certain_image_there_is_no_moment() -> None:
    assert worst_moments([row(0, 7, "uncertain"), row(1, None, "lost")]).rows == ()


def test_the_report_names_what_was_not_seen() -> None:
    config = RulaConfig(wrist=2, arm_load=3)
    rows = [row(0, 3), row(1, 6, "uncertain")]
    text = "\n".join(report_lines(summarize(rows), score_shares(rows, config), config))
    assert "of these, 1.0 s have a posture that may be wrong" in text
    assert re.search(r"grand score +4\.5 +mixed +3: 50%, 6: 50%", text)
    assert "declared, not seen: wrist 2, arm load 3\n" in text
    assert "with the default value: neck 1, wrist twist 1, legs 1" in text
    text = "\n".join(report_lines(summarize(rows), score_shares(rows, config), RulaConfig()))
    assert "not seen, with the default value: neck 1" in text and "not seen: " not in text
    nothing = [row(0, None, "lost")]
    lines = list(report_lines(summarize(nothing), score_shares(nothing, config), config))
    assert [line.split(":")[0] for line in lines] == [
        "declared, not seen",
        "declared, not seen, with the default value",
    ]


def test_the_report_says_how_long_the_neck_was_measured() -> None:
    config = RulaConfig(neck=2)
    for rows, words, is_declared in (
        ([row(0, 3), row(1, 3, is_neck_measured=True)], "for 1.0 of 2.0 s", True),
        ([row(n, 3, is_neck_measured=True) for n in range(2)], "all the time", False),
    ):
        text = "\n".join(report_lines(summarize(rows), score_shares(rows, config), config))
        assert f"the neck was measured {words}" in text
        assert ("declared, not seen: neck 2" in text) == is_declared


def test_a_measured_neck_is_not_among_the_declared_inputs() -> None:
    scores = row(0, 3).scores
    assert scores is not None
    measured, assumed = (part_values(scores, RulaConfig(neck=2), one) for one in (True, False))
    assert measured["neck (measured)"] == "1.00"
    assert "neck" not in measured["declared, not seen"]
    assert assumed["declared, not seen"].startswith("neck 2, wrist 1 (default)")
    assert assumed["legs (declared)"] == "1"


class Page(HTMLParser):
    """Texts and attributes of a page; it fails on elements that are not closed in order."""

    VOID = ("meta", "img")

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text: dict[str, list[str]] = {}
        self.feed(path.read_text(encoding="utf-8"))
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open:
            self.text.setdefault(self.open[-1], []).append(data)

    @property
    def words(self) -> str:
        return " ".join(" ".join(texts) for tag, texts in self.text.items() if tag != "style")


ROWS = [row(0, 3), row(1, 6), row(5, 6.5), row(6, 7, "uncertain"), row(7, None, "lost")]


def page(path: Path, images: dict[int, bytes] | None, title: str = "Task", **more: bool) -> Page:
    facts = {"Recording": "<img src=x onerror=alert(1)> & more", "Person": "a\udcffb.yaml"}
    content = PageContent(title, facts, RulaConfig(arm_load=2), ROWS, images, **more)
    write_page(content, path / "rula.html")
    return Page(path / "rula.html")


def test_a_page_is_whole_by_itself(tmp_path: Path) -> None:
    found = page(tmp_path, {5 * 10**9: JPEG})
    tags = [tag for tag, _ in found.elements]
    assert not {"script", "link", "iframe", "object"} & set(tags)
    (image,) = (attributes for tag, attributes in found.elements if tag == "img")
    head, _, data = str(image["src"]).partition(",")
    assert (head, base64.b64decode(data)) == ("data:image/jpeg;base64", JPEG)
    for tag, attributes in found.elements:
        for name in ("src", "href", "action"):
            assert str(attributes.get(name, "data:")).startswith("data:"), tag
    assert "url(" not in found.text["style"][0]
    assert "@media print" in found.text["style"][0]


def test_a_page_has_what_the_reader_needs(tmp_path: Path) -> None:
    words = page(tmp_path, {5 * 10**9: JPEG}).words
    for one in declared(RulaConfig()):
        assert one.name.replace("_", " ") in words
    for part in PARTS:
        assert part.words in words
    assert "McAtamney" in words
    assert "left out, since their posture may be wrong: 1." in words
    assert "1. 5.0 s: score 6.5" in words
    assert "2. 1.0 s: score 6.0" in words
    assert "head of the tracked person is hidden" in words


def test_names_are_only_text(tmp_path: Path) -> None:
    found = page(tmp_path, None, title='<script>alert("1")</script> "A" & B')
    assert found.text["h1"] == ['<script>alert("1")</script> "A" & B']
    assert "<img src=x onerror=alert(1)> & more" in found.text["td"]
    assert "a?b.yaml" in found.text["td"]
    assert "script" not in dict(found.elements)


def test_a_page_says_that_it_has_no_images_or_shows_faces(tmp_path: Path) -> None:
    assert "images of the recording were not given" in page(tmp_path, None).words
    assert "Faces are shown" in page(tmp_path, {}, are_heads_hidden=False).words


def test_a_page_of_uncertain_images_shows_none(tmp_path: Path) -> None:
    content = PageContent(
        "Task", {}, RulaConfig(), [row(0, 6, "uncertain"), row(1, 6, "uncertain")], {}
    )
    write_page(content, tmp_path / "rula.html")
    found = Page(tmp_path / "rula.html")
    assert "There is no other image, so none is shown" in found.words
    assert "figure" not in dict(found.elements)


def test_a_page_without_a_posture_says_so(tmp_path: Path) -> None:
    content = PageContent("Task", {}, RulaConfig(), [row(0, None, "lost")])
    write_page(content, tmp_path / "rula.html")
    assert "no time with a posture" in Page(tmp_path / "rula.html").words


def test_the_line_breaks_where_no_posture_is_known(tmp_path: Path) -> None:
    rows = [row(0, 3), row(1, 3), row(2, None, "lost"), row(3, 3), row(4, 3), row(60, 3)]
    write_page(PageContent("Task", {}, RulaConfig(), rows), tmp_path / "rula.html")
    lines = [a for tag, a in Page(tmp_path / "rula.html").elements if tag == "polyline"]
    assert [len(str(line["points"]).split()) for line in lines] == [2, 2, 1]


def test_scores_of_equal_pixels_are_one_point(tmp_path: Path) -> None:
    """An hour of images is drawn with at most a point a pixel, and the range of each."""
    rows = [row(n / 10, 2 + 4 * (n % 2)) for n in range(36_000)]
    write_page(PageContent("Task", {}, RulaConfig(), rows), tmp_path / "rula.html")
    found = Page(tmp_path / "rula.html")
    (line,) = (a for tag, a in found.elements if tag == "polyline")
    assert 800 < len(str(line["points"]).split()) < 860
    assert (tmp_path / "rula.html").stat().st_size < 100_000
