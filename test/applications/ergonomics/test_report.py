"""RULA of a recording: rows, times, worst moments, and the page of HTML that shows them."""

from __future__ import annotations

import base64
import csv
import re
from dataclasses import replace
from functools import partial
from html.parser import HTMLParser
from pathlib import Path
from typing import Any, cast

import cv2
import numpy as np
import pytest

from cardbox_tracker.applications.ergonomics import recording
from cardbox_tracker.applications.ergonomics.recording import (
    MomentImages,
    RulaRow,
    ScoreObserver,
    header_of,
    score_rula,
    score_shares,
    summarize,
    worst_rows,
    write_csv,
)
from cardbox_tracker.applications.ergonomics.report import (
    PageContent,
    report_lines,
    score_plot,
    write_page,
)
from cardbox_tracker.applications.ergonomics.rula import (
    RULA,
    RulaConfig,
    ScoreDistribution,
    declared,
)
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.model import body_from_proportions
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.tracking.estimate import NO_PERSON, TRACKING, UNCERTAIN, Estimate

JPEG = b"\xff\xd8 an image \xff\xd9"


def one_of(score: int, highest: int) -> np.ndarray:
    return np.asarray(np.eye(highest)[score - 1])


def row(
    time_s: float,
    score: float | None,
    state: str = "tracking",
    trunk: int = 1,
    measured: tuple[str, ...] = (),
) -> RulaRow:
    """Return an image; a score between two whole ones is either of them."""
    scores = None
    if score is not None:
        low = int(score)
        grand = (1 + low - score) * one_of(low, 7)
        if score > low:
            grand = grand + (score - low) * one_of(low + 1, 7)
        parts = {part.name: one_of(1, part.highest) for part in RULA.parts}
        parts["trunk"] = one_of(trunk, 6)
        scores = ScoreDistribution(grand, grand, grand, parts, of_mean=low)
    return RulaRow(round(time_s * 1e9), state, scores, time_s, frozenset(measured))


def rows_of(*scores: int | None) -> list[RulaRow]:
    """Return images a tenth of a second apart."""
    return [
        row(number / 10, score, "tracking" if score else "lost")
        for number, score in enumerate(scores)
    ]


def test_time_above_five_is_that_of_six_and_seven() -> None:
    summary = summarize(rows_of(5, 6, None, 7, 1))
    assert summary.measured_s == pytest.approx(0.4)
    assert summary.above_s == pytest.approx(0.2)
    assert summary.by_level_s == pytest.approx((0.1, 0.0, 0.2, 0.1))
    assert summary.mean == pytest.approx((5 + 6 + 7 + 1) / 4)
    assert np.isnan(summarize(rows_of(None)).mean)


def test_a_gap_in_the_images_is_not_time_at_a_score() -> None:
    rows = rows_of(6, 6, 6, 6)
    rows[-1] = replace(rows[-1], stamp_ns=10**11)
    assert summarize(rows).above_s == pytest.approx(0.1 + 0.1 + 0.3 + 0.1)


def test_the_table_has_a_row_an_image(tmp_path: Path) -> None:
    write_csv(rows_of(3, None, 6), tmp_path / "r.csv")
    with (tmp_path / "r.csv").open(encoding="utf-8") as file:
        header, first, lost, last = csv.reader(file)
    assert tuple(header) == header_of(RULA)
    assert first[:5] == ["0", "tracking", "3.000", "3", "0.000"]
    assert lost == ["100000000", "lost", *[""] * (len(header_of(RULA)) - 2)]
    assert (last[3], last[4]) == ("6", "1.000")
    declared = ["declared"] * 2
    assert last[-4 - len(RULA.parts) :] == [
        *["1.000"] * len(RULA.parts),
        "declared",
        "6",
        *declared,
    ]


def test_time_is_divided_among_scores() -> None:
    """Five images a second apart; one has no posture."""
    rows = [row(0, 3, trunk=2), row(1, 3.5), row(2, None, "lost"), row(3, 6), row(4, 6)]
    found = {one.name: one for one in score_shares(rows, RulaConfig(wrist=3))}
    assert found["grand"].time_s == pytest.approx([0, 0, 1.5, 0.5, 0, 2, 0])
    assert found["mean_posture"].time_s == pytest.approx([0, 0, 2, 0, 0, 2, 0])
    assert found["grand"].shares[5] == pytest.approx(0.5)
    assert found["grand"].mean == pytest.approx((3 + 3.5 + 6 + 6) / 4)
    assert found["trunk"].time_s == pytest.approx([3, 1, 0, 0, 0, 0])
    assert (found["trunk"].source, found["left_wrist"].source) == ("measured", "declared")
    assert found["wrist_twist"].time_s == pytest.approx([4, 0])
    assert found["table_b"].source == "mixed"


@pytest.mark.parametrize(
    ("measured", "source"),
    [((False, False), "declared"), ((True, False), "mixed"), ((True, True), "measured")],
)
def test_the_neck_is_what_its_images_are(measured: tuple[bool, ...], source: str) -> None:
    rows = [row(n, 3, measured=("neck",) * one) for n, one in enumerate(measured)]
    shares = {one.name: one for one in score_shares(rows, RulaConfig())}
    assert shares["neck"].source == source
    assert summarize(rows).measured_parts_s["neck"] == sum(measured)


def test_worst_moments_are_apart() -> None:
    rows = [
        row(0.0, 5),
        row(1.0, 5.5),  # near a worse one
        row(2.0, 6),
        row(5.0, 6),  # near the worst one
        row(6.0, 7, "uncertain"),
        row(7.0, None, "lost"),
        row(9.0, 2),
    ]
    found = worst_rows(rows)
    assert [one.time_s for one in found] == [6.0, 2.0, 9.0]


def test_without_a_posture_there_is_no_moment() -> None:
    assert worst_rows([row(1, None, "lost")]) == []


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
        ([row(0, 3), row(1, 3, measured=("neck",))], "for 1.0 of 2.0 s", True),
        ([row(n, 3, measured=("neck",)) for n in range(2)], "all the time", False),
    ):
        text = "\n".join(report_lines(summarize(rows), score_shares(rows, config), config))
        assert f"the neck was measured {words}" in text
        assert ("declared, not seen: neck 2" in text) == is_declared


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
    found = page(tmp_path, {6 * 10**9: JPEG})
    tags = [tag for tag, _ in found.elements]
    assert not {"script", "link", "iframe", "object"} & set(tags)
    plot, image = (str(attributes["src"]) for tag, attributes in found.elements if tag == "img")
    assert image == "data:image/jpeg;base64," + base64.b64encode(JPEG).decode()
    png = base64.b64decode(plot.removeprefix("data:image/png;base64,"))
    assert png == score_plot(ROWS, worst_rows(ROWS))
    for tag, attributes in found.elements:
        for name in ("src", "href", "action"):
            assert str(attributes.get(name, "data:")).startswith("data:"), tag
    assert "url(" not in found.text["style"][0]
    assert "@media print" in found.text["style"][0]


def test_a_page_has_what_the_reader_needs(tmp_path: Path) -> None:
    words = page(tmp_path, {6 * 10**9: JPEG}).words
    for one in declared(RulaConfig()):
        assert one.name.replace("_", " ") in words
    for part in RULA.parts:
        assert part.words in words
    assert "McAtamney" in words
    assert "1. 6.0 s: score 7.0, but the posture may be wrong (" in words
    assert "2. 1.0 s: score 6.0 (" in words
    assert "mean score of the mean postures: 5.7" in words
    assert "head of the tracked person is hidden, and faces" in words


def test_names_are_only_text(tmp_path: Path) -> None:
    found = page(tmp_path, None, title='<script>alert("1")</script> "A" & B')
    assert found.text["h1"] == ['<script>alert("1")</script> "A" & B']
    assert "<img src=x onerror=alert(1)> & more" in found.text["td"]
    assert "a?b.yaml" in found.text["td"]
    assert "script" not in dict(found.elements)


def test_a_page_says_that_it_has_no_images_or_shows_faces(tmp_path: Path) -> None:
    assert "images of the recording were not given" in page(tmp_path, None).words
    assert "Faces are shown" in page(tmp_path, {}, are_heads_hidden=False).words


def test_a_page_without_a_posture_says_so(tmp_path: Path) -> None:
    content = PageContent("Task", {}, RulaConfig(), [row(0, None, "lost")])
    write_page(content, tmp_path / "rula.html")
    assert "no time with a posture" in Page(tmp_path / "rula.html").words


def shown(rows: list[RulaRow]) -> np.ndarray:
    """Return the plot of some images (H, W, 3), bgr."""
    decoded = cv2.imdecode(np.frombuffer(score_plot(rows), np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    return np.asarray(decoded, int)


LINE_BGR, UNCERTAIN_BGR, NOTHING_BGR = (0x8A, 0x4F, 0x1B), (0x00, 0x9F, 0xE6), (0x9A, 0x9A, 0x9A)


def columns_of(plot: np.ndarray, bgr: tuple[int, ...]) -> np.ndarray:
    """Return in which columns within the axes a colour is."""
    found = np.flatnonzero((np.abs(plot - bgr).max(axis=2) < 12)[30:326].any(axis=0))
    return found[(found > 80) & (found < 1180)]


def test_the_line_breaks_where_no_posture_is_known(tmp_path: Path) -> None:
    """Images of 1 s from 0 to 19 s: lost from 5 to 10, missing from 14 to 19."""
    rows = [
        row(n, None if 5 <= n < 10 else 3, "lost" if 5 <= n < 10 else "tracking") for n in range(14)
    ]
    plot = shown([*rows, *(row(n, 3) for n in range(19, 33))])
    steps = np.diff(columns_of(plot, LINE_BGR))
    assert (steps > 100).sum() == 2
    nothing = columns_of(plot, NOTHING_BGR)
    assert len(nothing) and not len(columns_of(plot, UNCERTAIN_BGR))
    lost = np.argmax(steps > 100)
    line = columns_of(plot, LINE_BGR)
    assert line[lost] < nothing.min() and nothing.max() <= line[lost + 1]
    uncertain = shown([row(n, 3, "uncertain" if n > 4 else "tracking") for n in range(10)])
    assert columns_of(uncertain, UNCERTAIN_BGR).min() > 500


def test_an_hour_is_a_page_of_bounded_size(tmp_path: Path) -> None:
    rows = [row(n, 2 + 4 * (n % 2)) for n in range(3600)]
    write_page(PageContent("Task", {}, RulaConfig(), rows), tmp_path / "rula.html")
    assert (tmp_path / "rula.html").stat().st_size < 100_000


class Still:
    """A tracker that is sure that the person stands upright, with hanging arms."""

    body = body_from_proportions(1.75, 2.0)


def scored(images: MomentImages | None = None) -> ScoreObserver:
    return ScoreObserver(Path("film.mp4"), partial(score_rula, config=RulaConfig(), seed=0), images)


def likeliest(*estimates: Estimate) -> list[int | None]:
    observer, grey = scored(), np.zeros((4, 4), np.uint8)
    for number, estimate in enumerate(estimates):
        frame = RecordedFrame(number, float(number), grey, grey)
        observer(frame, estimate, cast(Any, Still()))
    return [None if row.scores is None else row.scores.likeliest for row in observer.rows]


def test_a_bent_neck_raises_the_score() -> None:
    """On the worksheet, A 2 with necks 1 and 3 give 2 and 3."""
    plain = Estimate(TRACKING, np.zeros(12), np.zeros(12), np.zeros((6, 3)), 0, 1.0)
    bent = replace(plain, neck=np.array([0.0, 0.5]), neck_stddev=np.full(2, 0.01))
    assert likeliest(plain, bent, Estimate(NO_PERSON)) == [2, 3, None]


def observed(images: MomentImages, *pitches_rad: float, state: str = TRACKING) -> ScoreObserver:
    """Return an observer of one image a second, in which the person bows by each angle."""
    observer = scored(images)
    tracker = Still()
    cast(Any, tracker).camera = Camera(320, 240, 330.0, 330.0, 159.5, 119.5)
    grey = np.full((240, 320), 128, np.uint8)
    for number, pitch_rad in enumerate(pitches_rad):
        posture = np.zeros(12)
        posture[2] = pitch_rad
        frame = RecordedFrame(number * 10**9, float(number), grey, grey)
        estimate = Estimate(state, posture, np.zeros(12), np.zeros((6, 3)), 0, 1.0)
        observer(frame, estimate, cast(Any, tracker))
    return observer


def test_the_images_of_the_worst_moments_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Trunks of 1, 3 and 4 give 2, 3 and 4 or more; of equal scores the first ones stay."""
    monkeypatch.setattr(recording, "_MOST_IMAGES", 2)
    images = MomentImages()
    rows = observed(images, 0.0, 0.6, 1.2, 0.6, 0.0).rows
    assert sorted(images.by_stamp()) == [1 * 10**9, 2 * 10**9]
    worst, *_ = worst_rows(rows)
    jpeg = np.frombuffer(images.by_stamp()[worst.stamp_ns], np.uint8)
    picture = cv2.imdecode(jpeg, cv2.IMREAD_COLOR)
    assert picture is not None
    assert picture.shape == (480, 640, 3)


def test_the_image_of_an_uncertain_posture_is_kept() -> None:
    images = MomentImages()
    observed(images, 0.6, state=UNCERTAIN)
    assert list(images.by_stamp()) == [0]
