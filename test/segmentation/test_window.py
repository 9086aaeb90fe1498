"""Windows around foreground."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cardbox_tracker.segmentation.window import Window, window_of


@given(arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 30)), fill=st.just(False)))
@settings(max_examples=60, deadline=None)
def test_a_window_has_all_pixels(pixels: np.ndarray) -> None:
    before = 255 * pixels.astype(np.uint8)
    window = window_of(before)
    if not pixels.any():
        assert window.is_empty and window.grown(5, before.shape).is_empty
        return
    rows, columns = np.nonzero(pixels)
    assert (window.top, window.bottom) == (rows.min(), rows.max() + 1)
    assert columns.min() - window.left < 8 and window.right - columns.max() - 1 < 8
    grown = window.grown(3, before.shape)
    assert grown.joined(window) == grown == grown.joined(Window(0, 0, 0, 0))
    assert grown.left % 8 == 0 and (grown.right % 8 == 0 or grown.right == before.shape[1])
