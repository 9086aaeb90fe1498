"""The solver of least squares: by hand, for any linear problem, and compiled as in Python."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.common.compiling import borrowing_kernel, kernel
from cardbox_tracker.common.least_squares import (
    Equations,
    Floats,
    Residuals,
    Rules,
    Solution,
    minimize,
    minimize_compiled,
    pseudo_huber,
    rules_of,
)

SEEDS = st.integers(0, 2**32 - 1)


def line(values: Floats) -> Residuals:
    """The unknown should be 3, with a deviation of 0.5."""
    return Residuals((values - 3.0) / 0.5, np.full((len(values), 1, 1), 2.0))


@borrowing_kernel
def _write_valley(values: Floats, scale: float, residuals: Floats) -> None:
    residuals[0] = scale * (values[1] - values[0] ** 2)
    residuals[1] = 1.0 - values[0]


@kernel
def solved_valley(start: Floats, rules: Rules, ends: tuple[int, float]) -> Equations:
    return minimize_compiled(_write_valley, (10.0, 2, 1e-7), start, rules, ends)


def valley(values: Floats) -> Residuals:
    """Rosenbrock's function, whose least value 0 is at (1, 1)."""
    x, y = values.T
    jacobian = np.zeros((len(values), 2, 2))
    jacobian[:, 0, 0], jacobian[:, 0, 1], jacobian[:, 1, 0] = -20.0 * x, 10.0, -1.0
    return Residuals(np.stack([10.0 * (y - x**2), 1.0 - x], axis=1), jacobian)


def test_a_residual_and_a_prior_meet_where_their_variances_say() -> None:
    """Inverse variances of 4 at 3 and of 12 at 1 give 1.5, with 9 and 3 of the cost."""
    found = minimize({"line": line}, np.zeros((1, 1)), rules_of(1, mean=1.0, inverse=12.0), 3)
    assert found.values == pytest.approx(1.5)
    assert found.information == pytest.approx(16.0)
    assert found.costs["line"] == pytest.approx(9.0)
    assert found.costs["prior"] == pytest.approx(3.0)
    assert found.total == pytest.approx(12.0)


@pytest.mark.parametrize(
    ("rule", "expected"),
    [({"largest": 0.25}, 0.25), ({"high": 2.0}, 2.0), ({"low": 4.0}, 4.0), ({"damping": 4.0}, 1.5)],
)
def test_a_step_keeps_its_rules(rule: dict[str, float], expected: float) -> None:
    found = minimize({"line": line}, np.zeros((1, 1)), rules_of(1, **rule), 1)
    # A step of 3 with an inverse variance of 4, against a damping of 4, is half as long.
    assert found.values == pytest.approx(expected)


def test_what_no_residual_depends_on_stays() -> None:
    start = np.array([[0.5, -7.0]])
    found = minimize(
        {"none": lambda _: None, "x": lambda x: Residuals(x[:, :1], np.eye(1, 2)[None])},
        start,
        rules_of(2),
        2,
    )
    np.testing.assert_allclose(found.values, [[0.0, -7.0]], atol=1e-12)


def test_an_outlier_pulls_a_robust_mean_less() -> None:
    """Ten readings of 0 and one of 100: their mean is 9.1, and sqrt(1 + x^2)'s slope is limited."""
    readings = np.array([*[0.0] * 10, 100.0])

    def robust(values: Floats) -> Residuals:
        return pseudo_huber(values - readings, np.ones((1, 11, 1)), 1.0)

    found = minimize({"readings": robust}, np.full((1, 1), 9.0), rules_of(1), 100)
    # 10 x / sqrt(1 + x^2) = 1
    assert found.values == pytest.approx(1.0 / np.sqrt(99.0), rel=1e-3)


@settings(max_examples=50, deadline=None)
@given(seed=SEEDS, rows=st.integers(1, 8), size=st.integers(1, 6))
def test_a_step_solves_any_linear_problem(seed: int, rows: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    jacobian, wanted = rng.normal(size=(rows, size)), rng.normal(size=rows)
    mean, inverse = rng.normal(size=size), rng.uniform(0.1, 10.0, size)
    found = minimize(
        {"rows": lambda x: Residuals(x @ jacobian.T - wanted, jacobian[None].repeat(2, axis=0))},
        rng.normal(size=(2, size)),
        rules_of(size, mean=mean, inverse=inverse),
        1,
    )
    information = jacobian.T @ jacobian + np.diag(inverse)
    best = np.linalg.solve(information, jacobian.T @ wanted + inverse * mean)
    np.testing.assert_allclose(found.values, [best, best], atol=1e-8)
    np.testing.assert_allclose(found.information, [information] * 2, atol=1e-12)


@settings(max_examples=50, deadline=None)
@given(seed=SEEDS, steps=st.integers(0, 30))
def test_compiled_fits_are_those_in_python_and_never_cost_more(seed: int, steps: int) -> None:
    start = np.random.default_rng(seed).uniform(-1.5, 1.5, (3, 2))
    rules = rules_of(2, low=-1.2, high=np.array([0.8, 2.0]), largest=0.5)
    found = minimize({"valley": valley}, start, rules, steps, 1e-6)
    compiled = Solution(solved_valley(start, rules, (steps, 1e-6)), ["valley"])
    np.testing.assert_allclose(compiled.values, found.values, atol=1e-3)
    begun = (valley(np.clip(start, rules[3], rules[4])).values ** 2).sum(axis=1)
    assert (found.total <= np.maximum(begun, (valley(start).values ** 2).sum(axis=1))).all()


def test_arrays_of_another_shape_are_refused() -> None:
    """Compiled code would read beyond their end."""
    wrong = {"odd": lambda values: Residuals(values, np.ones((1, 1, 3)))}
    with pytest.raises(ValueError, match="Jacobian of odd"):
        minimize(wrong, np.zeros((1, 2)), rules_of(2), 1)
    with pytest.raises(ValueError, match="shape"):
        minimize({"line": line}, np.zeros((1, 1)), rules_of(3), 1)
