"""Files of samples come back; sources are divided."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.errors import CardboxError
from learning.recorder import Seen
from learning.samples import Image, Samples, grouped, load, load_all, split


def seen(number: int) -> Seen:
    arrays = {
        "features": np.full((2, 5), number),
        "found_m": np.full((6, 3), number + 0.1),
        "evidence": np.full(8, number + 0.2),
        "result_features": np.full((2, 4), number + 0.3),
        "result_m": np.full((6, 3), number + 0.4),
        "state": np.full(14, number + 0.5),
        "stddev": np.full(14, number + 0.6),
    }
    return Seen(**{name: array.astype(np.float64) for name, array in arrays.items()})


def test_images_become_arrays_in_order(make_samples: Any) -> None:
    origin = make_samples().origin
    images = [Image(seen(n), np.full((6, 3), n + 0.7), np.full(3, n), 10 * n) for n in range(3)]
    found = Samples.of(origin, images, 0.2)
    assert found.origin is origin
    assert found.features[:, 0, 0].tolist() == [0.0, 1.0, 2.0]
    assert found.found_m[1] == pytest.approx(1.1) and found.result_m[1] == pytest.approx(1.4)
    assert found.evidence.shape == (3, 8) and found.result_features.shape == (3, 2, 4)
    assert found.states[2] == pytest.approx(2.5) and found.stddevs[2] == pytest.approx(2.6)
    assert found.true_m[2] == pytest.approx(2.7) and found.torso_rad[2] == pytest.approx(2.0)
    assert found.stamps_ns.tolist() == [0, 10, 20] and found.pitch_rad == pytest.approx(0.2)


def test_a_file_keeps_the_samples(tmp_path: Path, make_samples: Any) -> None:
    start_ns = 1_700_000_000_123_456_789
    samples = make_samples(3, has_points=True, stamps_ns=start_ns + np.arange(3))
    samples.true_m[1] = np.nan
    samples.save(tmp_path / "one.npz")
    again = load(tmp_path / "one.npz")
    assert again.origin == samples.origin and again.origin.has_points
    np.testing.assert_array_equal(again.stamps_ns, samples.stamps_ns)
    for one in fields(Samples)[1:]:
        found, expected = getattr(again, one.name), getattr(samples, one.name)
        np.testing.assert_allclose(found, expected, rtol=1e-6, err_msg=one.name)


def test_folders_are_read_by_name(tmp_path: Path, make_samples: Any) -> None:
    for name in ("b", "a"):
        (tmp_path / name).mkdir()
        for number in (2, 1):
            path = tmp_path / name / f"{number:05d}.npz"
            make_samples(2, motion=f"{name}{number}").save(path)
    (tmp_path / "a" / "notes.txt").write_text("none")
    found = load_all([tmp_path / "b", tmp_path / "a"])
    assert [one.origin.motion for one in found] == ["b1", "b2", "a1", "a2"]


@pytest.mark.parametrize("kind", ["text", "nothing", "cut", "other", "extra", "missing"])
def test_other_files_are_refused(tmp_path: Path, make_samples: Any, kind: str) -> None:
    path = tmp_path / "one.npz"
    make_samples(2).save(path)
    whole = path.read_bytes()
    with np.load(path) as stored:
        arrays = dict(stored)
    if kind == "missing":
        path.unlink()
    elif kind in ("other", "extra"):
        changed = {"a": np.zeros(2)} if kind == "other" else arrays | {"a": np.zeros(2)}
        np.savez(path, **changed)
    else:
        path.write_bytes({"text": b"no", "nothing": b"", "cut": whole[: len(whole) // 2]}[kind])
    with pytest.raises(CardboxError, match=r"one\.npz has no samples.*learning\.simulate"):
        load(path)


def test_a_source_is_left_out(make_samples: Any) -> None:
    each = [
        make_samples(2, family=family, source=source)
        for family in ("makehuman", "rocketbox")
        for source in ("cmu-07", "cmu-13", "cmu_text-walk", "scripted")
    ]
    others, chosen = split(each, "family=rocketbox")
    assert others == each[:4] and chosen == each[4:]
    # Sources are prefixes: subjects 1 to 9.
    others, chosen = split(each, "source=cmu-0")
    assert [one.origin.source for one in chosen] == ["cmu-07"] * 2 and len(others) == 6
    assert len(split(each, "source=cmu")[1]) == 6


def test_groups_are_families_and_sources(make_samples: Any) -> None:
    names = ("real", "b"), ("kit", "c"), ("real", "b"), ("real", "a")
    each = [make_samples(2, family=family, source=source) for family, source in names]
    found = grouped(each)
    assert list(found) == ["kit c", "real a", "real b"]
    assert found["real b"] == [each[0], each[2]]


@pytest.mark.parametrize("text", ["rocketbox", "body=boxes", "family", ""])
def test_texts_that_name_no_source(make_samples: Any, text: str) -> None:
    with pytest.raises(CardboxError, match="expected family=NAME or source=PREFIX"):
        split([make_samples()], text)


@pytest.mark.parametrize(
    ("text", "counts"), [("family=other", "0 samples, others 2"), ("source=", "2 .*others 0")]
)
def test_sources_without_samples_and_without_others(
    make_samples: Any, text: str, counts: str
) -> None:
    one = make_samples()
    other = replace(one, origin=replace(one.origin, source="scripted"))
    with pytest.raises(CardboxError, match=counts):
        split([one, other], text)


def test_a_folder_without_samples_is_named(tmp_path: Path) -> None:
    with pytest.raises(CardboxError, match=r"has no samples .* learning\.simulate"):
        load_all([tmp_path])
