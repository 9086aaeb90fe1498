"""Compiled solution of small linear systems; numba's own linear algebra would need SciPy."""

from __future__ import annotations

from math import sqrt

from cardbox_tracker.common.compiling import borrowing_kernel
from cardbox_tracker.terms.kernel_arguments import Floats


@borrowing_kernel
def solve(matrix: Floats, right: Floats) -> None:
    """Solve a linear system in place by a Cholesky decomposition; ``right`` (n,) is the solution.

    The matrix (n, n) is symmetric and positive definite; its lower triangle is overwritten.
    """
    n = right.shape[0]
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = sqrt(max(total, 1e-12)) if i == j else total / matrix[j, j]
    for i in range(n):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]


@borrowing_kernel
def write_normal(jacobian: Floats, residuals: Floats, matrix: Floats, right: Floats) -> None:
    """Write the normal equations, (m, m) and (m,), of residuals (n,) with a Jacobian (n, m)."""
    count, size = jacobian.shape
    for j in range(size):
        right[j] = 0.0
        for i in range(count):
            right[j] += jacobian[i, j] * residuals[i]
        for k in range(j + 1):
            matrix[j, k] = 0.0
            for i in range(count):
                matrix[j, k] += jacobian[i, j] * jacobian[i, k]
            matrix[k, j] = matrix[j, k]
