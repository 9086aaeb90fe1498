"""Figures of the low-pass: values that follow by hand."""

from __future__ import annotations

import numpy as np

from lab.tools.low_pass import Measured, figures, report, report_lags


def test_errors_and_accelerations_count_where_the_reference_is() -> None:
    stamps_ns = np.arange(8) * 100_000_000
    stamps_ns[5:] += 300_000_000
    true_m = np.zeros((8, 6, 3))
    found_m = true_m.copy()
    # Both hands move with 2 m/s² for three images, then jump where no reference is.
    found_m[:3, [2, 5], 0] = np.array([0.0, 0.01, 0.04])[:, None]
    found_m[3:, :, 1] = 7.0
    true_m[3:] = np.nan
    shape_cm, place_cm, hands = figures(found_m, true_m, stamps_ns)
    np.testing.assert_allclose([shape_cm, place_cm], 2 * (1 + 4) / 18)
    np.testing.assert_allclose(hands, 2.0)


def test_the_table_has_a_recording_and_its_reference_beside_each_other() -> None:
    measured = Measured(np.full((4, 4), 1.25), np.full((4, 4), 0.5), np.full((4, 3), 2.0))
    lines = report({"a": measured}).splitlines()
    assert lines[2:] == [
        "| a |" + " 1.25 / 1.25 / 1.2, 1 % |" * 4,
        "| its reference |" + " 0.50 / 0.50 / 0.5 |  |" * 2,
    ]
    assert report_lags({"a": measured}).splitlines()[2] == "| a |" + " 2.00 / 2.00 / 2.0 |" * 4
