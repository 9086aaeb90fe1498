"""Accuracy of the measured sizes of people (experiment 8).

Two quantities are separate: the errors of the 18 sizes of many random people, each measured once,
and the spread of the sizes of one person over seeds of the search. The references are drawn without
sensor noise, with angles that differ by some degrees from the reference posture, as people's do.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.simulation.renderer import Renderer
from cardbox_tracker.applications.simulation.session import session_camera
from cardbox_tracker.measuring.config import InitializationConfig
from cardbox_tracker.measuring.measure import initialize_body
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_JOINTS, REFERENCE_NAMES, reference_posture
from cardbox_tracker.person.sizes import DEFAULT_SIZES, SIZE_LIMITS, SIZE_NAMES, SUBSETS
from lab.experiments.parallel import Call

FloatArray = NDArray[np.float64]
Arrays = dict[str, NDArray[Any]]

DISTANCE_M = 2.4
"""Distance at which the longest arms fit into the image when stretched."""

POSTURE_MISS_DEG = 2.0
"""Standard deviation of each angle from the reference posture."""

ROUNDS = 60
"""Length of the curves of cost against rounds; a shorter search keeps its last cost."""


def random_body(rng: np.random.Generator, distance_m: float = 2.0) -> BodyModel:
    """Return a person of random stature (1.55 to 1.9 m) and proportions."""
    stature = rng.uniform(0.9, 1.1)
    sizes = DEFAULT_SIZES * stature * rng.normal(1.0, 0.07, len(DEFAULT_SIZES))
    return BodyModel.of(
        np.clip(sizes, SIZE_LIMITS[:, 0], SIZE_LIMITS[:, 1]),
        distance_m=distance_m,
        hip_height_m=-0.51 * distance_m / 2.0,
    )


def person_calls(bodies: int, seed: int) -> list[Call]:
    """Return calls that measure ``bodies`` random people, each once with a seed of its own."""
    return [Call(measure, (seed, body, body)) for body in range(bodies)]


def seed_calls(seeds: int, seed: int) -> list[Call]:
    """Return calls that measure one person, of the default sizes, with ``seeds`` seeds."""
    return [Call(measure, (seed, -1, number)) for number in range(seeds)]


def measure(seed: int, person: int, search_seed: int) -> Arrays:
    """Measure one person.

    Args:
        seed: of the evaluation.
        person: number of a random person, or -1 for the one of default sizes.
        search_seed: of the search.

    Returns:
        ``true_m`` and ``found_m``, the sizes (18,); ``iou`` (3,); ``rounds`` (3,); ``cost`` of the
        first pass, relative to its start, by subset and round (3, ROUNDS + 1); ``search_s``.
    """
    rng = np.random.default_rng([seed, person + 1])
    if person < 0:
        body = BodyModel.of(
            DEFAULT_SIZES, distance_m=DISTANCE_M, hip_height_m=-0.51 * DISTANCE_M / 2.0
        )
    else:
        body = random_body(rng, DISTANCE_M)
    camera = session_camera()
    renderer = Renderer(camera, rng)
    references = {}
    for name in REFERENCE_NAMES:
        posture = reference_posture(name)
        posture[1:] += rng.normal(0.0, np.radians(POSTURE_MISS_DEG), N_JOINTS - 1)
        references[name] = renderer.silhouette(body, posture)
    # Without these limits the initialization would refuse some people.
    config = InitializationConfig(
        distance_m=DISTANCE_M, min_iou=0.0, least_iou=0.0, check_postures=False, seed=search_seed
    )
    start = time.process_time()
    result = initialize_body(references, camera, config)
    search_s = time.process_time() - start
    curves = np.empty((len(SUBSETS), ROUNDS + 1))
    for curve, subset in zip(curves, SUBSETS, strict=True):
        costs = np.array(result.costs_px[subset][0][: ROUNDS + 1])
        curve[:] = costs[-1] / costs[0]
        curve[: len(costs)] = costs / costs[0]
    return {
        "true_m": body.sizes,
        "found_m": result.body.sizes,
        "iou": np.array([result.iou[name] for name in REFERENCE_NAMES]),
        "rounds": np.array([result.rounds[subset] for subset in SUBSETS]),
        "cost": curves,
        "search_s": np.array(search_s),
    }


def summarize_measuring(
    people: Sequence[Arrays], seeds: Sequence[Arrays]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the results of experiment 8, and the duration of a search, seconds.

    Args:
        people: results of :func:`measure`, one for each person.
        seeds: the same for each seed.
    """
    persons, searches = _stack(people), _stack(seeds)
    error_m = persons["found_m"] - persons["true_m"]
    scatter_m = searches["found_m"]
    names = list(SIZE_NAMES)

    def by_size(values: FloatArray) -> dict[str, float]:
        return dict(zip(names, values.tolist(), strict=True))

    curves = {
        subset: {
            f"percentile_{percent}": np.percentile(persons["cost"][:, i], percent, axis=0).tolist()
            for percent in (10, 50, 90)
        }
        for i, subset in enumerate(SUBSETS)
    }
    results = {
        "bodies": len(people),
        "seeds": len(seeds),
        "distance_m": DISTANCE_M,
        "posture_miss_deg": POSTURE_MISS_DEG,
        "mean_abs_error_m": by_size(np.abs(error_m).mean(axis=0)),
        "bias_m": by_size(error_m.mean(axis=0)),
        "std_error_m": by_size(error_m.std(axis=0, ddof=1)),
        "spread_of_people_m": by_size(persons["true_m"].std(axis=0, ddof=1)),
        "std_over_seeds_m": by_size(scatter_m.std(axis=0, ddof=1)),
        "mean_iou": dict(zip(REFERENCE_NAMES, persons["iou"].mean(axis=0).tolist(), strict=True)),
        "mean_rounds": dict(zip(SUBSETS, persons["rounds"].mean(axis=0).tolist(), strict=True)),
        "relative_cost_by_round": curves,
    }
    search_s = persons["search_s"]
    timing = {
        "median_s": float(np.median(search_s)),
        "p95_s": float(np.percentile(search_s, 95)),
    }
    return results, timing


def _stack(measured: Sequence[Arrays]) -> Arrays:
    return {name: np.array([arrays[name] for arrays in measured]) for name in measured[0]}
