"""Range check for the numbers of a body model."""

from __future__ import annotations

import math

from cardbox_tracker.errors import BodyModelError


def check_range(name: str, value: float, lowest: float, highest: float, unit: str) -> None:
    """Refuse a value that is not finite or lies outside ``lowest`` to ``highest``.

    Raises:
        BodyModelError: the value is refused; the text gives name, value, unit, range and a likely
            wrong unit.
    """
    if not math.isfinite(value):
        raise BodyModelError(f"{name} is {value}; expected a finite number of {unit}")
    if not lowest <= value <= highest:
        hint = ""
        if unit == "m" and lowest <= value / 100 <= highest and value > 1:
            hint = " (is it given in centimetres?)"
        elif unit == "m" and lowest <= value / 1000 <= highest and value > 10:
            hint = " (is it given in millimetres?)"
        raise BodyModelError(
            f"{name} is {value:g} {unit}; expected {lowest:g} to {highest:g} {unit}{hint}"
        )
