"""Correctors by name: the package's, none, a network from a file, a function of a module."""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation import filtering
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.estimation.filtering.correction import (
    DATA,
    N_ANSWERS,
    N_FEATURES,
    NetworkCorrector,
    learned,
)
from cardbox_tracker.estimation.filtering.corrector_loading import load_corrector
from cardbox_tracker.estimation.filtering.networks import load_recurrent_network
from cardbox_tracker.vision.camera import Camera

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
COST = WholeBodyCost(BodyModel.of(distance_m=2.3), CAMERA, WholeBodyCostConfig())

Arrays = dict[str, np.ndarray]
Change = Callable[[Arrays], Arrays]


def arrays() -> Arrays:
    """The package's network as it is stored."""
    with (
        resources.as_file(resources.files(filtering).joinpath(DATA)) as path,
        np.load(path) as all_,
    ):
        return {name: all_[name] for name in all_.files if name != "allow_pickle"}


def test_the_names_of_the_package() -> None:
    assert load_corrector("none") is None
    assert load_corrector("learned") is learned


def test_a_networks_file_is_used(tmp_path: Path) -> None:
    stored = arrays()
    stored["biases4"] = stored["biases4"] + 1.0
    np.savez(tmp_path / "other.npz", **stored)
    make = load_corrector(f"{tmp_path / 'other.npz'}")
    assert make is not None
    corrector = make(COST, CAMERA, 1)
    assert isinstance(corrector, NetworkCorrector)
    usual = load_recurrent_network(DATA)
    features = np.zeros((2, len(usual.mean)))
    answers, *_ = corrector._network(features, usual.initial_hidden(2))
    expected, *_ = usual(features, usual.initial_hidden(2))
    np.testing.assert_allclose(answers, expected + usual.unit, atol=1e-3 * usual.unit.max())


def without(name: str) -> Change:
    return lambda stored: {key: value for key, value in stored.items() if key != name}


def of_shape(name: str, shape: tuple[int, ...]) -> Change:
    return lambda stored: stored | {name: np.zeros(shape, np.float32)}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (without("weights3"), ["weights3"]),
        (of_shape("weights3", (3, 288, 7)), ["weights4", f"(3, 7, {N_ANSWERS})"]),
        (of_shape("weights2", (3, 100, 384)), ["weights1", "300"]),
        (of_shape("weights0", (111, 192)), ["three axes"]),
        (of_shape("mean", (110,)), ["mean", f"({N_FEATURES},)"]),
        (of_shape("most", (3,)), ["network"]),
        (of_shape("scale", (N_FEATURES,)), ["scale"]),
        (lambda stored: stored | {"unit": np.full(N_ANSWERS, np.nan)}, ["unit", "finite"]),
        (lambda stored: stored | {"mean": np.array([None])}, ["no network"]),
        (lambda stored: {"huge": np.zeros(2**24)}, ["MB"]),
    ],
)
def test_a_file_that_is_no_such_network_is_refused(
    tmp_path: Path, change: Change, words: list[str]
) -> None:
    path = tmp_path / "network.npz"
    np.savez_compressed(path, **change(arrays()))
    with pytest.raises(CardboxError) as caught:
        load_corrector(f"{path}")
    assert all(word in str(caught.value) for word in ("network.npz", *words))


def test_a_network_of_other_features_is_refused(tmp_path: Path) -> None:
    stored = arrays()
    stored |= {name: stored[name][:50] for name in ("mean", "scale")}
    stored["weights0"] = stored["weights0"][:, :50]
    np.savez(tmp_path / "network.npz", **stored)
    with pytest.raises(
        CardboxError,
        match=f"50 features and {N_ANSWERS} answers; expected {N_FEATURES} and {N_ANSWERS}",
    ):
        load_corrector(f"{tmp_path / 'network.npz'}")


@pytest.mark.parametrize(
    ("name", "word"),
    [
        *(("best", "learned"), ("", "learned"), ("a b:c", "MODULE:FUNCTION"), ("os:", "MODULE")),
        *(("no_such_module:make", "no_such_module"), ("os:missing", "missing")),
        *(("os:name", "no function"), ("missing.npz", "missing.npz")),
    ],
)
def test_what_is_no_corrector_is_refused(name: str, word: str) -> None:
    with pytest.raises(CardboxError, match=word):
        load_corrector(name)


def test_a_pipe_is_refused_at_once(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.npz"
    os.mkfifo(pipe)
    with pytest.raises(CardboxError, match=r"pipe\.npz: it is a pipe .*; give a network's file"):
        load_corrector(str(pipe))
