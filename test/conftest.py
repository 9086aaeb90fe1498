"""What all tests share."""

from __future__ import annotations

import pytest

from cardbox_tracker.estimation.precompile import compile_all


@pytest.fixture(scope="session", autouse=True)
def _compiled_kernels() -> None:
    """Compile once, before nodes of several tests would do so at the same time."""
    compile_all()
