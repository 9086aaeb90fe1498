"""Inputs of RULA and REBA that no image shows, and limits that the papers leave open."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, fields
from typing import NamedTuple

from cardbox_tracker.common.settings import Settings, setting, settings_of

MEASURED, DECLARED, MIXED = "measured", "declared", "mixed"
"""Origins of a part score; tables and the grand score are mixed."""
NOT_SEEN = "declared, not seen"
WRISTS = "left_wrist", "right_wrist"
"""Parts that share the declared input ``wrist``."""

_DECLARED = "declared, since it is not measured"


@dataclass(frozen=True)
class ErgonomicConfig(Settings):
    """What no image shows, of both methods.

    Raises:
        ValueError: a value is out of its range; the text names it.
    """

    shoulders_raised: bool = setting(False, f"the shoulders are raised; {_DECLARED}")
    arms_supported: bool = setting(
        False, f"the arms are supported, or the person leans; {_DECLARED}"
    )
    trunk_twisted: bool = setting(
        False,
        "the trunk is twisted against the hips; declared, since torso_yaw is where the whole "
        "person faces",
    )


@dataclass(frozen=True)
class RulaConfig(ErgonomicConfig):
    """Settings of RULA.

    Raises:
        ValueError: a value is out of its range; the text names it.
    """

    neck: int = setting(
        1,
        "score of the neck: 1 for 0 to 10 degrees of flexion, 2 to 20, 3 beyond, 4 in extension; 1 "
        "more each if twisted, bent aside; declared for images without points of a face",
        limits=(1, 6),
    )
    wrist: int = setting(
        1,
        "score of the wrists: 1 neutral, 2 to 15 degrees, 3 beyond; 1 more if bent aside; declared "
        "for images in which a hand is not measured",
        limits=(1, 4),
    )
    wrist_twist: int = setting(
        1, f"1 in the middle of the range, 2 at or near its end; {_DECLARED}", limits=(1, 2)
    )
    legs: int = setting(
        1, f"1 if legs and feet are supported and balanced, else 2; {_DECLARED}", limits=(1, 2)
    )
    arm_muscle_use: int = setting(
        0, "1 if the arms' posture is held for a minute or repeated 4 times in one", limits=(0, 1)
    )
    arm_load: int = setting(
        0,
        "load on the arms: 0 below 2 kg now and then, 1 for 2 to 10 kg now and then, 2 for 2 to 10 "
        "kg held or repeated, 3 beyond or with shocks",
        limits=(0, 3),
    )
    body_muscle_use: int = setting(0, "as arm_muscle_use, of neck, trunk and legs", limits=(0, 1))
    body_load: int = setting(0, "as arm_load, of neck, trunk and legs", limits=(0, 3))


@dataclass(frozen=True)
class RebaConfig(ErgonomicConfig):
    """Settings of REBA.

    Raises:
        ValueError: a value is out of its range; the text names it.
    """

    neck: int = setting(
        1,
        "score of the neck: 1 for 0 to 20 degrees of flexion, 2 beyond or in extension; 1 more if "
        "twisted or bent aside; declared for images without points of the face",
        limits=(1, 3),
    )
    legs: int = setting(
        1,
        "score of the legs: 1 if both feet carry weight, walking or sitting, 2 if one does or the "
        "posture is unstable; 1 more with knees bent by 30 to 60 degrees, 2 beyond; declared for "
        "images that do not show both legs",
        limits=(1, 4),
    )
    wrist: int = setting(
        1,
        "score of the wrists: 1 to 15 degrees, 2 beyond; 1 more if bent aside or twisted; declared "
        "for images in which a hand is not measured",
        limits=(1, 3),
    )
    load: int = setting(
        0, "0 below 5 kg, 1 for 5 to 10 kg, 2 above; 1 more with shocks", limits=(0, 3)
    )
    coupling: int = setting(0, "handles: 0 good, 1 fair, 2 poor, 3 unacceptable", limits=(0, 3))
    activity: int = setting(
        0,
        "1 each if a part of the body is held for longer than a minute, if a small motion is "
        "repeated more than 4 times in one, if the posture changes widely and fast",
        limits=(0, 3),
    )
    arms_supported: bool = setting(
        False, f"the arms are supported, the person leans, or gravity helps; {_DECLARED}"
    )


DECLARED_PARTS = {"wrist_twist": 2, "legs": 2}
"""Highest score of each part that no image shows."""

_INPUTS: dict[type[Settings], tuple[str, ...]] = {
    RulaConfig: (
        *("neck", "wrist", "wrist_twist", "legs", "arm_load", "arm_muscle_use"),
        *("body_load", "body_muscle_use", "shoulders_raised", "arms_supported", "trunk_twisted"),
    ),
    RebaConfig: (
        *("neck", "legs", "wrist", "load", "coupling", "activity"),
        *("shoulders_raised", "arms_supported", "trunk_twisted"),
    ),
}


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


def _kind_of(config: ErgonomicConfig) -> type[Settings]:
    """Return the class of settings; a node's parameters are a subclass."""
    return next(kind for kind in _INPUTS if isinstance(config, kind))


def declared(
    config: ErgonomicConfig, measured: Collection[str] = frozenset()
) -> tuple[Declared, ...]:
    """Return the inputs that are declared, without parts that are ``measured``."""
    kind = _kind_of(config)
    known, defaults = settings_of(kind), {one.name: one.default for one in fields(config)}
    found = []
    for name in _INPUTS[kind]:
        if all(part in measured for part in (WRISTS if name == "wrist" else (name,))):
            continue
        value = getattr(config, name)
        text = str(value) if type(value) is int else ("no", "yes")[value]
        found.append(Declared(name, text, value == defaults[name], known[name].description))
    return tuple(found)
