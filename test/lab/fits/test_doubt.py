"""Fitted models of doubt: coefficients of synthetic data, weights of sources, and the table."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.search import doubt as package
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.search.doubt import Doubt, Source
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.tracker import Tracker
from lab.fits import doubt
from lab.fits.doubt import (
    Collector,
    Samples,
    chances,
    fit,
    fit_all,
    row_of,
    threshold_of,
    thresholds_of,
)

# Intercept, and coefficients of evidence of different size, for each kind of keypoint.
TRUE = {
    "shoulder": (-2.0, {"area": 1.0, "spread": 0.0}),
    "elbow": (-1.0, {"area": 0.5, "spread": 40.0}),
    "hand": (0.5, {"area": -1.0, "spread": 80.0}),
}
NAMES = ("area", "spread")


def samples(seed: int, count: int, area: float = 0.0) -> Samples:
    """Results of a source with errors of 0.1 m or 0.5 m, by the probabilities of ``TRUE``."""
    rng = np.random.default_rng(seed)
    evidence = {
        "area": rng.normal(area, 1.0, (count, 6)),
        "spread": rng.normal(0.0, 0.02, (count, 6)),
    }
    chance = chances(
        Samples(evidence, np.empty(0), np.empty(count)), {**TRUE, "whole": TRUE["hand"]}
    )
    wrong = rng.random((count, 7)) < chance
    whole_m = np.where(wrong[:, 6], 0.5, 0.1)
    return Samples(evidence, np.where(wrong[:, :6], 0.5, 0.1), whole_m)


# Sources of different size, whose evidence is distributed differently.
SOURCES = [samples(0, 12_000), samples(1, 8_000, 1.0), samples(2, 4_000, -1.0)]


@pytest.mark.parametrize("model", ["shoulder", "elbow", "hand", "whole"])
def test_known_coefficients_are_found(monkeypatch: pytest.MonkeyPatch, model: str) -> None:
    true = TRUE["hand" if model == "whole" else model]
    monkeypatch.setattr(doubt, "PENALTY", 1e-9)
    intercept, found = fit(SOURCES, model, NAMES)
    assert intercept == pytest.approx(true[0], abs=0.12)
    assert found["area"] == pytest.approx(true[1]["area"], abs=0.12)
    assert found["spread"] == pytest.approx(true[1]["spread"], abs=5.0)


def test_the_penalty_shrinks_coefficients_alike_whatever_their_unit() -> None:
    intercept, found = fit(SOURCES, "hand", NAMES)
    shares = [found[name] / TRUE["hand"][1][name] for name in NAMES]
    assert min(shares) > 0.7 and max(shares) < 1.0
    metres = [
        Samples(
            {**one.evidence, "spread": one.evidence["spread"] / 1000.0}, one.aligned_m, one.whole_m
        )
        for one in SOURCES
    ]
    again = fit(metres, "hand", NAMES)
    assert again[0] == pytest.approx(intercept, rel=1e-4)
    assert again[1]["spread"] / 1000.0 == pytest.approx(found["spread"], rel=1e-3)


def test_evidence_that_never_changes_has_no_coefficient() -> None:
    constant = [
        Samples(
            {**one.evidence, "cameras": np.zeros_like(one.aligned_m)}, one.aligned_m, one.whole_m
        )
        for one in SOURCES
    ]
    intercept, found = fit(constant, "elbow", (*NAMES, "cameras"))
    assert found.pop("cameras") == 0.0
    without = fit(SOURCES, "elbow", NAMES)
    assert intercept == pytest.approx(without[0])
    assert found == pytest.approx(without[1])


def test_all_sources_weigh_the_same() -> None:
    """Whether a source is long or short; many more results of one change nothing."""
    first, second = SOURCES[1:]
    longer = Samples(
        {name: np.tile(one, (5, 1)) for name, one in second.evidence.items()},
        np.tile(second.aligned_m, (5, 1)),
        np.tile(second.whole_m, 5),
    )
    expected, found = (fit([first, other], "hand", NAMES) for other in (second, longer))
    assert found[0] == pytest.approx(expected[0], rel=1e-6)
    assert found[1] == pytest.approx(expected[1], rel=1e-6)
    assert fit([second], "hand", NAMES)[0] != pytest.approx(expected[0], abs=0.01)


def test_rows_are_the_keypoints_of_a_kind_or_whole_results() -> None:
    values = np.arange(12.0).reshape(2, 6)
    aligned_m = np.array([[0.0, 0.31, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 0.31]])
    one = Samples({"yaw": values}, aligned_m, np.array([0.29, 0.31]))
    evidence, wrong = one.rows("elbow")
    assert evidence["yaw"].tolist() == [1.0, 4.0, 7.0, 10.0] and wrong.tolist() == [1, 0, 0, 0]
    evidence, wrong = one.rows("hand")
    assert evidence["yaw"].tolist() == [2.0, 5.0, 8.0, 11.0] and wrong.tolist() == [0, 0, 0, 1]
    evidence, wrong = one.rows("whole")
    assert evidence["yaw"].tolist() == [0.0, 6.0] and wrong.tolist() == [0.0, 1.0]


def test_chances_are_those_that_the_package_computes(monkeypatch: pytest.MonkeyPatch) -> None:
    models = {**TRUE, "whole": (-1.0, {"area": 2.0})}
    some = samples(5, 4)
    found = chances(some, models)
    own = {kind: package.Model(*model) for kind, model in models.items()}
    monkeypatch.setattr(
        package, "models", lambda: dict.fromkeys(Source, package.Models(0.1, 0.1, own))
    )
    for number, row in enumerate(found):
        one = Doubt()
        evidence = {name: values[number] for name, values in some.evidence.items()}
        judged = one.judge(evidence, Source.OUTLINE, np.zeros(6, np.bool_))
        np.testing.assert_allclose(judged.chances, row[:6], rtol=1e-12)
        assert one._whole == pytest.approx(row[6])


def test_the_chance_of_an_image_is_that_which_the_package_computes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    image = (-1.0, {"hand": 0.6, "elbow": 0.3, "left over": 2.0})
    models = {**TRUE, "whole": (-9.0, {"area": 0.0}), package.IMAGE: image}
    some = samples(6, 8)
    some.evidence["left over"] = np.full((8, 6), 0.1)
    found = chances(some, models)
    own = {kind: package.Model(*model) for kind, model in models.items()}
    # An image is sure from the first limit down, and stays so up to 1.25 of it.
    for limit in found[:, 7]:
        given = package.Models(0.999, limit / 1.25, own)
        monkeypatch.setattr(package, "models", lambda given=given: dict.fromkeys(Source, given))
        one, sure = Doubt(), False
        for number, chance in enumerate(found[:, 7]):
            evidence = {name: values[number] for name, values in some.evidence.items()}
            judged = one.judge(evidence, Source.POINTS, np.zeros(6, np.bool_))
            sure = chance <= limit / (1.0 if sure else 1.25)
            assert judged.is_uncertain == (not sure)


def test_with_points_the_images_of_real_people_give_their_limit(
    capsys: pytest.CaptureFixture[str],
) -> None:
    sources = [
        Samples({**one.evidence, "left over": one.evidence["area"]}, one.aligned_m, one.whole_m)
        for one in SOURCES
    ]
    right = [replace(one, aligned_m=np.full_like(one.aligned_m, 0.1)) for one in sources]
    mixed = {"real_one": [right[0]], "real_two": [right[1]], "rendered": [sources[2]]}
    stored = fit_all({Source.POINTS: mixed})["points"]
    assert set(stored["models"]) == {*doubt.MODELS, package.IMAGE}
    alone = fit_all({Source.POINTS: {f"rendered {n}": one for n, one in enumerate(mixed.values())}})
    assert alone["points"]["doubtful_from"] < stored["doubtful_from"]


def errors_of(aligned_m: np.ndarray) -> Samples:
    return Samples({}, aligned_m, aligned_m.mean(axis=1))


def test_a_row_of_the_table_by_hand() -> None:
    aligned_m = np.full((4, 6), 0.05)
    said = np.full((4, 7), 0.01)
    # A lost result; an uncertain elbow; a wrong tracked one; an uncertain hand off by 20 cm.
    said[0, 6] = 0.6
    said[1, 1] = 0.2
    aligned_m[2, 4] = 0.4
    aligned_m[3, 2], said[3, 2] = 0.2, 0.2
    row = row_of("person", errors_of(aligned_m), said, 0.1, 0.1)
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    # Two are `tracking`, one of three right ones and a wrong one; 22 of 24 keypoints are tracked,
    # one of these wrong; one of two uncertain ones is off by 15 cm; 22 say 1 %, two 20 %.
    assert cells == ["person", "4", "50.0", "33.3", "50.0", "91.7", "4.5", "50.0", "2.6", "4.2"]


def test_shares_of_nothing_are_empty() -> None:
    said = np.full((2, 7), 0.9)
    cells = row_of("person", errors_of(np.full((2, 6), 0.05)), said, 0.1, 0.1).split("|")
    assert [cell.strip() for cell in cells[3:9]] == ["0.0", "0.0", "", "0.0", "", ""]


def test_the_threshold_leaves_few_wrong_ones_below_it() -> None:
    said = 0.001 * np.arange(1, 241)
    wrong = np.zeros(240, bool)
    # Of the first 130 3 are wrong, 2.3 %; of the first 150 these are 2 %.
    wrong[[99, 119, 129]] = wrong[150:] = True
    order = np.random.default_rng(0).permutation(240)
    assert threshold_of(wrong[order], said[order]) == 0.15
    # Never above a quarter, also if nothing is wrong.
    assert threshold_of(np.zeros(240, bool), 4.0 * said) == 0.25
    assert threshold_of(np.ones(240, bool), said) == 0.0


def test_the_threshold_is_not_rounded_up_to_where_too_many_are_wrong() -> None:
    # 0.101 would have the last ten below it.
    said = np.repeat([0.05, 0.1006, 0.1008], 10)
    assert threshold_of(np.repeat([False, False, True], 10), said) == 0.1


def test_an_image_needs_surer_hands_than_a_keypoint_if_wrong_keypoints_are_in_many_images() -> None:
    aligned_m, said = np.full((200, 6), 0.05), np.full((200, 7), 0.01)
    # Half of the images have a hand of 0.06, and one of these in ten is wrong: 0.8 % of the
    # keypoints, but 5 % of the images. Later ones, in which the whole is lost, do not count.
    said[100:, 2], aligned_m[100::10, 2] = 0.06, 0.4
    said[190:, 6] = 0.9
    assert thresholds_of([(errors_of(aligned_m), said)]) == (0.25, 0.047)


def test_what_is_stored_is_what_the_package_reads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    by_source = {
        source: {f"person {number}": [one] for number, one in enumerate(SOURCES)}
        for source in (Source.OUTLINE, Source.PAPER)
    }
    stored = fit_all(by_source)
    printed = capsys.readouterr().out
    for name in ("outline: uncertain above", "paper: uncertain above", "| person 0 | 12000 |"):
        assert name in printed
    path = tmp_path / "doubt.json"
    path.write_text(json.dumps(stored), encoding="utf-8")
    monkeypatch.setattr(package, "_FILE", path)
    read = package.models.__wrapped__()
    assert set(read) == set(by_source)
    uncertain_from, doubtful_from, by_kind = read[Source.OUTLINE]
    assert 0.0 <= doubtful_from <= uncertain_from <= doubt.HIGHEST
    assert set(by_kind) == set(doubt.MODELS)
    expected = fit(SOURCES, "hand", NAMES)
    assert by_kind["hand"].intercept == pytest.approx(expected[0], abs=1e-4)
    assert by_kind["hand"].coefficients == pytest.approx(expected[1], abs=1e-4)


def test_only_results_with_truth_and_of_one_kind_are_collected() -> None:
    truth_m = np.zeros((6, 3))
    truth_m[:, 2] = 2.0
    off_m = np.array([0.0, 0.0, 0.3])
    tracker = cast(Tracker, None)  # which is not asked
    without, having = {"yaw": np.ones(6)}, {"yaw": np.ones(6), "point distance": np.ones(6)}
    kinds = (Source.OUTLINE, without), (Source.POINTS, having), (Source.PAPER, without)
    for source, kept in kinds:
        collector = Collector({7: truth_m}, source)
        assert collector.samples() is None
        for stamp_ns, evidence in ((7, without), (7, having), (8, kept)):
            found = Estimate("tracking", keypoints_m=truth_m + off_m, evidence=evidence)
            collector(0, stamp_ns, found, tracker)
        collector(0, 7, Estimate("lost"), tracker)
        collected = collector.samples()
        assert collected is not None
        assert {name: one.shape for name, one in collected.evidence.items()} == dict.fromkeys(
            kept, (1, 6)
        )
        # All joints are off alike, so none is beside the shoulders; the paper's place is wrong.
        np.testing.assert_allclose(collected.aligned_m, 0.0, atol=1e-12)
        whole_m = [0.3] if source is Source.PAPER else [0.0]
        np.testing.assert_allclose(collected.whole_m, whole_m, atol=1e-12)


@pytest.mark.parametrize("has_references", [True, False])
def test_only_one_camera_is_tracked_by_the_papers_filter(
    has_references: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of real people, who have no reference postures, every choice of cameras is tracked."""
    tracked = []

    def load(_: Path, cameras: tuple[str, ...] = ()) -> SimpleNamespace:
        truth = SimpleNamespace(cameras=cameras or ("a", "b"))
        none: dict[str, np.ndarray] = {"stamps_ns": np.empty(0, int), "keypoints_m": np.empty(0)}
        return SimpleNamespace(truth=truth, has_references=has_references, **none)

    def track(session: SimpleNamespace, config: TrackerConfig, *_: object) -> None:
        tracked.append(("".join(session.truth.cameras), config.filter))

    monkeypatch.setattr(doubt, "load_session", load)
    monkeypatch.setattr(doubt, "track_session", track)

    def missing() -> None:
        raise CardboxError("not installed")

    monkeypatch.setattr(doubt.Detector, "installed", missing)
    assert list(doubt.collect(Path("session"), 0)) == []
    alone = [(name, preset) for name in "ab" for preset in ("whole_body", "hierarchical")]
    assert tracked == [("ab", "whole_body"), *([] if has_references else alone)]


def test_people_of_mean_proportions_learn_from_measured_ones() -> None:
    first, second, own = SOURCES
    measured = {"a": [first], "b": [second]}
    stored = fit_all({Source.OUTLINE: {"c": [own]}, Source.MEASURED: measured})
    for source, learned in ((Source.OUTLINE, SOURCES), (Source.MEASURED, [first, second])):
        intercept, coefficients = stored[source.value]["models"]["hand"]
        expected = fit(learned, "hand", NAMES)
        assert intercept == pytest.approx(expected[0], abs=1e-4)
        assert coefficients == pytest.approx(expected[1], abs=1e-4)
