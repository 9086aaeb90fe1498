"""Kernels that count no references to arrays neither return arrays nor leave memory behind."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numba.core import types
from numba.core.dispatcher import Dispatcher
from numba.core.runtime import _nrt_python
from numba.core.runtime.nrt import rtsys

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.common.compiling import borrowing_kernel, kernel
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.search.config import PRESETS
from cardbox_tracker.tracking.tracker import Tracker

# Words of annotations without arrays; Any is that of kernels without annotations.
SCALARS = {"None", "bool", "int", "float", "tuple", "Any"}
SCALARS |= {f"np.{kind}" for kind in ("int32", "int64", "uint32", "uint64", "float32")}


def borrowing_kernels() -> Iterator[Any]:
    for name, module in list(sys.modules.items()):
        if name.startswith("cardbox_tracker"):
            for value in vars(module).values():
                if isinstance(value, Dispatcher) and value.targetoptions.get("_nrt") is False:
                    yield value


def has_arrays(kind: types.Type) -> bool:
    parts = kind if isinstance(kind, types.BaseTuple) else ()
    return isinstance(kind, types.Array) or any(has_arrays(part) for part in parts)


def test_borrowing_kernels_return_no_arrays() -> None:
    kernels = set(borrowing_kernels())
    assert len(kernels) > 50
    for one in kernels:
        # Kernels that only others call have no signatures of their own if their code was kept.
        words = re.findall(r"\w+(?:\.\w+)*", str(one.py_func.__annotations__["return"]))
        assert set(words) <= SCALARS, one
        returned = [signature.return_type for signature in one.nopython_signatures]
        assert not any(map(has_arrays, returned)), one


def test_arrays_in_a_tuple_are_found() -> None:
    floats = types.Array(types.float64, 1, "C")
    assert has_arrays(types.Tuple((types.int64, types.Tuple((floats,)))))
    assert not has_arrays(types.UniTuple(types.float64, 2))


def test_numba_refuses_an_allocation() -> None:
    @borrowing_kernel
    def allocate(count: int) -> float:
        total: float = np.empty(count)[0]
        return total

    call = kernel(lambda count: allocate(count))
    with pytest.raises(Exception, match=r"(?s)passed into the function|NRT"):
        call(3)


@pytest.mark.parametrize("preset", PRESETS)
def test_tracking_leaves_no_memory_behind(preset: str) -> None:
    body, camera = BodyModel(), Camera(96, 72, 99.0, 99.0, 47.5, 35.5)
    silhouette = render(cardbox_patches(body, reference_posture("front")), camera)
    was_enabled = _nrt_python.memsys_stats_enabled()
    _nrt_python.memsys_enable_stats()
    try:
        tracker = Tracker(body, camera, PRESETS[preset]())
        held = []
        for _ in range(3):
            for _ in range(4):
                tracker.track(silhouette)
            stats = rtsys.get_allocation_stats()
            held.append(stats.mi_alloc - stats.mi_free)
    finally:
        if not was_enabled:
            _nrt_python.memsys_disable_stats()
    # The tracker keeps a few arrays from frame to frame, as many after each.
    assert held[1] == held[2]
