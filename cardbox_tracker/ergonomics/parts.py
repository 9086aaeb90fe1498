"""The part scores of RULA that follow from the posture, and the inputs that are declared."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import NamedTuple

from cardbox_tracker.ergonomics.config import RulaConfig
from cardbox_tracker.ergonomics.rula import RulaScores
from cardbox_tracker.ergonomics.tables import ScoreArray
from cardbox_tracker.settings import settings_of

MEASURED, DECLARED, MIXED = "measured", "declared", "mixed"
"""Origins of a part score; tables and the grand score are mixed."""

NECK = "neck"
"""Part that is measured only where a detector gives points of the face."""


class Part(NamedTuple):
    """A part score.

    Attributes:
        name: column of the tables.
        words: the same for people.
        highest: highest score; the lowest one is 1.
        of: returns it among all scores of a posture.
    """

    name: str
    words: str
    highest: int
    of: Callable[[RulaScores], ScoreArray]


PARTS: tuple[Part, ...] = (
    Part("left_upper_arm", "upper arm, left", 6, lambda scores: scores.left.upper_arm),
    Part("right_upper_arm", "upper arm, right", 6, lambda scores: scores.right.upper_arm),
    Part("left_lower_arm", "lower arm, left", 3, lambda scores: scores.left.lower_arm),
    Part("right_lower_arm", "lower arm, right", 3, lambda scores: scores.right.lower_arm),
    Part("trunk", "trunk", 6, lambda scores: scores.trunk),
    Part(NECK, "neck", 6, lambda scores: scores.neck),
    Part("left_table_a", "table A, left", 9, lambda scores: scores.left.table_a),
    Part("right_table_a", "table A, right", 9, lambda scores: scores.right.table_a),
    Part("table_b", "table B", 9, lambda scores: scores.table_b),
)
"""Table A rates upper arm, lower arm and wrist, table B neck, trunk and legs; both without load and
muscle use."""

DECLARED_PARTS = {"wrist": 4, "wrist_twist": 2, "legs": 2}
"""Highest score of each part that no image shows."""

DECLARED_INPUTS = (
    *("neck", "wrist", "wrist_twist", "legs", "arm_load", "arm_muscle_use"),
    *("body_load", "body_muscle_use", "shoulders_raised", "arms_supported", "trunk_twisted"),
)
"""Settings that stand for inputs which are declared; the others are limits of angles."""


class Declared(NamedTuple):
    """A declared input.

    Attributes:
        name: of the setting.
        value: a score, or ``yes`` or ``no``.
        is_default: whether it is the value that holds without a declaration.
        description: its meaning.
    """

    name: str
    value: str
    is_default: bool
    description: str

    @property
    def words(self) -> str:
        """Name and value."""
        return f"{self.name.replace('_', ' ')} {self.value}"

    def __str__(self) -> str:
        """Return name and value, and whether it is the default."""
        return f"{self.words} (default)" if self.is_default else self.words


def declared(config: RulaConfig) -> tuple[Declared, ...]:
    """Return the declared inputs, ordered as ``DECLARED_INPUTS``."""
    known, defaults = settings_of(RulaConfig), {one.name: one.default for one in fields(config)}
    found = []
    for name in DECLARED_INPUTS:
        value = getattr(config, name)
        text = str(value) if type(value) is int else ("no", "yes")[value]
        found.append(Declared(name, text, value == defaults[name], known[name].description))
    return tuple(found)


def limits(config: RulaConfig) -> dict[str, str]:
    """Return the limits of angles by name, degrees."""
    names = [name for name in settings_of(RulaConfig) if name not in DECLARED_INPUTS]
    return {name.removesuffix("_deg"): f"{getattr(config, name):g}" for name in names}
