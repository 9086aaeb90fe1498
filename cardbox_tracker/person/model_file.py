"""Reads and writes the YAML file of a body model: atomic writing, validation on reading.

The topic ``body_model`` carries the same text.
"""

from __future__ import annotations

import os
import textwrap
from typing import Any

from cardbox_tracker.common.errors import BodyModelError, cut, quoted
from cardbox_tracker.common.files import foreign, saved_file
from cardbox_tracker.common.small_yaml import SmallYamlError, parse_small_yaml, read_small_text
from cardbox_tracker.person.appearance import Appearance
from cardbox_tracker.person.model import (
    CAMERA_HEIGHT,
    CAMERA_ROLL,
    CONSTANTS,
    MEASURED,
    PROPORTIONS,
    BodyModel,
)
from cardbox_tracker.person.sizes import SIZE_NAMES, SIZES

FORMAT = "cardbox_body_model/1"
_UNITS = {"length": "m", "angle": "rad"}
_TOP_KEYS = ("format", "units", *CONSTANTS, "side_turn", "sizes")
# This key is optional: older files and bodies given by hand do not have it.
_APPEARANCE = "appearance"
# Without these keys, the person was measured and all values are known.
_SOURCE, _UNKNOWN = "source", "unknown"
# A body that is measured while it is tracked live has these keys.
_VERSION, _STAMP = "version", "stamp_ns"
_CAMERA = CAMERA_ROLL, CAMERA_HEIGHT
# A body of a usual stature has this key.
_STATURE_STDDEV = "stature_stddev"
_OPTIONAL = (_APPEARANCE, _SOURCE, _UNKNOWN, _VERSION, _STAMP, *_CAMERA, _STATURE_STDDEV)
_HEADERS = {
    MEASURED: "# A person measured by cardbox_tracker: what does not change while they are "
    "tracked.",
    PROPORTIONS: "# A person from the proportions of people, not measured: less exact.",
}
_LINE_LENGTH = 96


def dumps_body_model(model: BodyModel) -> str:
    """Return the YAML text of ``model``; equal models give equal texts."""
    lines = [
        _HEADERS[model.source],
        f"format: {FORMAT}",
        "units: {length: m, angle: rad}",
    ]
    if model.source != MEASURED:
        lines.append(f"{_SOURCE}: {model.source}")
    if model.unknown:
        lines.append("# guesses, which are fitted to a few images of a person")
        lines.append(f"{_UNKNOWN}: [{', '.join(model.unknown)}]")
    if model.stature_stddev:
        deviation = yaml_number(model.stature_stddev)
        lines.append(f"{_STATURE_STDDEV}: {deviation}  # of the stature, relative, which is usual")
    if model.version:
        lines += [f"{_VERSION}: {model.version}", f"{_STAMP}: {model.stamp_ns}"]
    for name, (_, _, _, meaning) in CONSTANTS.items():
        lines.append(f"{name}: {yaml_number(model.constants[name])}  # {meaning}")
    if model.camera_pose.roll_rad:
        roll = yaml_number(model.camera_pose.roll_rad)
        lines.append(f"{CAMERA_ROLL}: {roll}  # how far the camera is turned clockwise")
    if model.camera_pose.height_m is not None:
        height = yaml_number(model.camera_pose.height_m)
        lines.append(f"{CAMERA_HEIGHT}: {height}  # of the camera above the floor")
    lines.append(f"side_turn: {model.side_turn}  # the way the person turned in the side reference")
    lines.append("sizes:")
    for size, value in zip(SIZES, model.sizes, strict=True):
        lines.append(f"  {size.name}: {yaml_number(value)}  # {size.description}")
    if model.appearance is not None:
        lines.append("# colours of hand, forearm, torso, head and legs, compressed")
        lines.append(f"{_APPEARANCE}: |")
        lines += [f"  {line}" for line in textwrap.wrap(model.appearance.to_text(), _LINE_LENGTH)]
    return "\n".join(lines) + "\n"


def yaml_number(value: float) -> str:
    """Return all digits of ``value`` as a YAML 1.1 number: 1.0e-05, since 1e-05 is a text."""
    mantissa, e, exponent = repr(float(value)).partition("e")
    return f"{mantissa}.0{e}{exponent}" if e and "." not in mantissa else mantissa + e + exponent


def loads_body_model(text: str, source: str = "body model") -> BodyModel:
    """Parse YAML of :func:`dumps_body_model`; BodyModelError names ``source`` and the wrong key."""
    try:
        data = parse_small_yaml(text)
    except SmallYamlError as error:
        raise BodyModelError(f"{source}: {error}") from None
    try:
        return _from_mapping(data)
    except BodyModelError as error:
        raise BodyModelError(
            f"{source}: {error}. 'cardbox initialize' or the initializer node writes a valid file"
        ) from None


def load_body_model(path: str | os.PathLike[str]) -> BodyModel:
    """Read a body model file; raise BodyModelError if it cannot be read or is none."""
    expected = "the body model that 'cardbox initialize' or the initializer node wrote"
    with foreign(path, BodyModelError, expected):
        text = read_small_text(path)
    return loads_body_model(text, source=os.fspath(path))


def save_body_model(model: BodyModel, path: str | os.PathLike[str]) -> None:
    """Write ``model`` to ``path`` atomically; raise BodyModelError if that fails."""
    with saved_file(path, BodyModelError) as file:
        file.write(dumps_body_model(model).encode())


def _from_mapping(data: object) -> BodyModel:
    if not isinstance(data, dict):
        raise BodyModelError("expected a mapping with the keys " + ", ".join(_TOP_KEYS))
    _check_keys(data, _TOP_KEYS, "", optional=_OPTIONAL)
    if data["format"] != FORMAT:
        raise BodyModelError(f"format is {quoted(data['format'])}; this version reads '{FORMAT}'")
    if not isinstance(data["units"], dict):
        raise BodyModelError(
            f"units is {quoted(data['units'])}; expected {{length: m, angle: rad}}"
        )
    _check_keys(data["units"], tuple(_UNITS), "units.")
    for kind, unit in _UNITS.items():
        if data["units"][kind] != unit:
            raise BodyModelError(
                f"units.{kind} is {quoted(data['units'][kind])}; expected '{unit}': convert the "
                "values"
            )
    sizes = data["sizes"]
    if not isinstance(sizes, dict):
        raise BodyModelError(
            f"sizes is {quoted(sizes)}; expected a mapping of the {len(SIZES)} sizes"
        )
    _check_keys(sizes, SIZE_NAMES, "sizes.")
    return BodyModel.of(
        sizes=[_number(sizes[name], f"sizes.{name}") for name in SIZE_NAMES],  # type: ignore[arg-type]
        **{name: _number(data[name], name) for name in CONSTANTS},
        **{name: _number(data[name], name) for name in (*_CAMERA, _STATURE_STDDEV) if name in data},
        side_turn=data["side_turn"],
        appearance=_appearance(data[_APPEARANCE]) if _APPEARANCE in data else None,
        source=data.get(_SOURCE, MEASURED),
        unknown=_names(data.get(_UNKNOWN, [])),
        version=_whole(data.get(_VERSION, 0), _VERSION),
        stamp_ns=_whole(data.get(_STAMP, 0), _STAMP),
    )


def _whole(value: object, key: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**63:
        raise BodyModelError(f"'{key}' is {quoted(value)}; expected a whole number from 0 on")
    return value


def _names(value: object) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
        raise BodyModelError(f"{_UNKNOWN} is {quoted(value)}; expected a list such as [distance_m]")
    return tuple(value)


def _appearance(value: object) -> Appearance:
    if not isinstance(value, str):
        raise BodyModelError(
            f"{_APPEARANCE} is of type {type(value).__name__}; expected a text in base64"
        )
    return Appearance.from_text(value)


def _check_keys(
    mapping: dict[Any, Any],
    expected: tuple[str, ...],
    prefix: str,
    optional: tuple[str, ...] = (),
) -> None:
    known = (*expected, *optional)
    for key in mapping:
        if key not in known:
            raise BodyModelError(
                f"unknown key '{prefix}{cut(str(key), 60)}'; known are {', '.join(known)}"
            )
    for key in expected:
        if key not in mapping:
            raise BodyModelError(f"missing key '{prefix}{key}'")


def _number(value: object, key: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise BodyModelError(
            f"'{key}' is {quoted(value)}; expected a plain number in the unit of the file, such as "
            "0.27"
        )
    try:
        return float(value)
    except OverflowError:
        raise BodyModelError(f"'{key}' is too large; expected a value in metres or rad") from None
