"""Several terms as one: costs add up, whatever is asked; frames with other foreground."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.detection.image_points import POINT_NAMES, ImagePoints
from cardbox_tracker.estimation.cost.terms import ArmCosts, Frame, SumOfTerms, TorsoCosts

Array = NDArray[np.float64]


class Scaled:
    """Costs that show who was asked for what."""

    def __init__(self, factor: float) -> None:
        self.factor = factor

    def torsos_beside(self, arms: Array | None) -> TorsoCosts:
        extra = 0.0 if arms is None else arms[4]
        return lambda torsos: self.factor * (torsos[:, 0] + extra)

    def arms_beside(self, torso: Array) -> ArmCosts:
        sign = {"left": 1.0, "right": -1.0}
        return lambda side, arms: self.factor * (sign[side] * arms[:, 1] + torso[2])

    def postures(self, postures: Array) -> Array:
        return self.factor * postures[:, 11]


POSTURES = np.arange(36.0).reshape(3, 12)


def test_costs_add_up() -> None:
    total = SumOfTerms((Scaled(1.0), Scaled(10.0), Scaled(100.0)))
    for arms, extra in ((None, 0.0), (POSTURES[0], 4.0)):
        costs = total.torsos_beside(arms)(POSTURES[:, :4])
        assert costs.tolist() == [111 * (v + extra) for v in (0, 12, 24)]
    rate = total.arms_beside(POSTURES[0, :4])
    assert rate("left", POSTURES[:, 4:8]).tolist() == [111 * (v + 2) for v in (5, 17, 29)]
    assert rate("right", POSTURES[:, 8:]).tolist() == [111 * (2 - v) for v in (9, 21, 33)]
    assert total.postures(POSTURES).tolist() == [111 * v for v in (11, 23, 35)]


def test_a_single_term_is_itself() -> None:
    alone, term = SumOfTerms((Scaled(3.0),)), Scaled(3.0)
    expected = term.torsos_beside(None)(POSTURES[:, :4])
    np.testing.assert_array_equal(alone.torsos_beside(None)(POSTURES[:, :4]), expected)
    np.testing.assert_array_equal(alone.postures(POSTURES), term.postures(POSTURES))


def test_particles_are_not_written_to() -> None:
    total = SumOfTerms((Scaled(1.0), Scaled(2.0)))
    before = POSTURES.copy()
    total.postures(POSTURES)
    total.torsos_beside(None)(POSTURES[:, :4])
    np.testing.assert_array_equal(POSTURES, before)


def test_a_frame_with_other_foreground_is_the_same_but_for_that() -> None:
    image = np.zeros((4, 6), np.uint8)
    points = ImagePoints(np.zeros((len(POINT_NAMES), 2)), np.ones(len(POINT_NAMES)))
    depth_m = np.ones((4, 6), np.float32)
    frame = Frame(image, 3, 7, image + 1, np.zeros(14), depth_m, 0.04, 123, points)
    other = frame.with_foreground(5)
    assert other.foreground_px == 5
    for name in (field.name for field in fields(Frame) if field.name != "foreground_px"):
        assert getattr(other, name) is getattr(frame, name)
        assert getattr(frame, name) is not field_default(name)


def field_default(name: str) -> object:
    """The default of a field of frames, which would hide that it is left out."""
    return next(field.default for field in fields(Frame) if field.name == name)
