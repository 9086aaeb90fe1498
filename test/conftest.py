"""What all tests share."""

from __future__ import annotations

import pytest
from hypothesis import settings

from cardbox_tracker.estimation.precompile import compile_all

# How long an example takes says nothing of the program on a busy machine.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


@pytest.fixture(scope="session", autouse=True)
def _compiled_kernels() -> None:
    """Compile once, before nodes of several tests would do so at the same time."""
    compile_all()
