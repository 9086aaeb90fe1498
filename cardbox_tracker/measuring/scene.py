"""A scene: the camera over the floor and the people before it, and its file.

Each number of the camera has a mean, a standard deviation, and where it comes from. The file of one
film can be given to the next film of the same camera.
"""

from __future__ import annotations

import json
import math
import os
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from cardbox_tracker.common.errors import CardboxError, quoted
from cardbox_tracker.common.files import foreign, write_file
from cardbox_tracker.common.small_yaml import parse_small_yaml, read_small_text
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import dumps_body_model, loads_body_model, yaml_number

FORMAT = "cardbox_scene/1"
ORIGINS = GIVEN, FOUND, USUAL = "given", "found", "usual"
"""Where a number comes from: a user or a file; the images; what most cameras have."""


class Value(NamedTuple):
    """A number of a scene."""

    mean: float  #: its value
    stddev: float  #: its standard deviation
    origin: str = FOUND  #: one of ``ORIGINS``
    by: str = ""  #: what tells it, in words; empty if that is not known


class SceneCamera(NamedTuple):
    """The camera of a scene."""

    fov_rad: Value  #: field of view across the width of the image as it is shown
    pitch_rad: Value  #: downward pitch
    roll_rad: Value  #: clockwise turn about the axis, seen from behind the camera
    height_m: Value | None = None  #: height above the floor; None if nothing shows it


_NUMBERS = {
    "fov_deg": ("fov_rad", 180 / math.pi, (10.0, 160.0), "field of view across the image"),
    "pitch_deg": ("pitch_rad", 180 / math.pi, (-89.0, 89.0), "downward pitch"),
    "roll_deg": ("roll_rad", 180 / math.pi, (-180.0, 180.0), "clockwise roll"),
    "height_m": ("height_m", 1.0, (0.05, 20.0), "height above the floor"),
}


@dataclass(frozen=True)
class Scene:
    """What does not change in a film."""

    camera: SceneCamera  #: the camera
    people: tuple[BodyModel, ...] = ()  #: the body of each person, by number

    def words(self) -> Iterator[str]:
        """Yield each number of the camera with its deviation and origin."""
        for name, value in self._numbers():
            unit = name.rpartition("_")[2].replace("deg", "degrees")
            source = f"{value.origin}: {value.by}" if value.by else value.origin
            number = f"{value.mean:.3g} +- {value.stddev:.2g} {unit} ({source})"
            yield f"{_NUMBERS[name][3]} {number}"

    def numbers(self) -> dict[str, dict[str, float | str]]:
        """Return mean, stddev, origin and what tells it by the names of the file."""
        return {
            name: {key: entry for key, entry in value._asdict().items() if entry != ""}
            for name, value in self._numbers()
        }

    def _numbers(self) -> Iterator[tuple[str, Value]]:
        for name, (attribute, factor, *_) in _NUMBERS.items():
            value: Value | None = getattr(self.camera, attribute)
            if value is not None:
                yield name, value._replace(mean=factor * value.mean, stddev=factor * value.stddev)


def dumps_scene(scene: Scene) -> str:
    """Return the YAML text of a scene; equal scenes give equal texts."""
    lines = [
        "# A scene measured by cardbox_tracker; people are body models.",
        f"format: {FORMAT}",
        "camera:",
    ]
    for name in scene.numbers():
        attribute, factor, *_ = _NUMBERS[name]
        value: Value = getattr(scene.camera, attribute)
        mean, stddev = (_written(number, factor) for number in value[:2])
        entries = f"mean: {mean}, stddev: {stddev}, origin: {value.origin}"
        if value.by:
            entries += f", by: {json.dumps(value.by)}"
        lines.append(f"  {name}: {{{entries}}}  # {_NUMBERS[name][3]}")
    lines.append("people:" if scene.people else "people: []")
    for body in scene.people:
        lines += ["  - |", textwrap.indent(dumps_body_model(body), "    ").rstrip()]
    return "\n".join(lines) + "\n"


def _written(value: float, factor: float) -> str:
    """Return a number with few digits, or all, that gives the same value when it is read."""
    number = float(factor * value)
    near = (round(number, digits) for digits in range(6, 17))
    tried = *near, number, math.nextafter(number, -math.inf), math.nextafter(number, math.inf)
    # Some radians are between those of any degrees; then what is read is written so again.
    read = value if any(one / factor == value for one in tried) else number / factor
    return yaml_number(next(one for one in tried if one / factor == read))


def save_scene(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write a scene atomically; raise CardboxError if the file cannot be written."""
    write_file(path, dumps_scene(scene))


def load_scene(path: str | os.PathLike[str]) -> Scene:
    """Read a scene; CardboxError says what is wrong if it cannot be read or is none."""
    with foreign(path, CardboxError, "a file OUT.scene.yaml that 'cardbox track' has written"):
        return loads_scene(read_small_text(path))


def loads_scene(text: str) -> Scene:
    """Return the scene of a text of :func:`dumps_scene`; ValueError if it is none."""
    data = parse_small_yaml(text)
    keys = {"format", "camera", "people"}
    if not isinstance(data, dict) or set(data) != keys:
        raise ValueError(f"expected a mapping of {', '.join(sorted(keys))}")
    if data["format"] != FORMAT:
        raise ValueError(f"format is {quoted(data['format'])}; this version reads '{FORMAT}'")
    camera, people = data["camera"], data["people"]
    if not isinstance(camera, dict) or not {"fov_deg", "pitch_deg", "roll_deg"} <= set(camera):
        raise ValueError("camera lacks fov_deg, pitch_deg or roll_deg")
    if unknown := set(camera) - set(_NUMBERS):
        raise ValueError(f"camera has the unknown key {quoted(unknown.pop())}")
    if not isinstance(people, list) or not all(isinstance(one, str) for one in people):
        raise ValueError("people is no list of body models")
    values = {_NUMBERS[name][0]: _value_of(name, given) for name, given in camera.items()}
    bodies = (loads_body_model(text, f"person {n}") for n, text in enumerate(people, 1))
    return Scene(SceneCamera(**values), tuple(bodies))


def _value_of(name: str, given: Any) -> Value:
    _, factor, (lowest, highest), _ = _NUMBERS[name]
    is_value = isinstance(given, dict) and set(given) | {"by"} == set(Value._fields)
    numbers = (given["mean"], given["stddev"]) if is_value else ()
    if not is_value or not all(
        isinstance(one, int | float) and not isinstance(one, bool) for one in numbers
    ):
        raise ValueError(f"camera.{name} is no mapping of the numbers mean and stddev and origin")
    mean, stddev = map(float, numbers)
    if not lowest <= mean <= highest or not 0.0 <= stddev <= highest - lowest:
        raise ValueError(
            f"camera.{name} is {mean:g} +- {stddev:g}; expected {lowest:g} to {highest:g}, and a "
            f"deviation from 0 on, up to {highest - lowest:g}"
        )
    if given["origin"] not in ORIGINS:
        raise ValueError(f"camera.{name}.origin is none of {', '.join(ORIGINS)}")
    by = given.get("by", "")
    if not isinstance(by, str):
        raise ValueError(f"camera.{name}.by is no text")
    return Value(mean / factor, stddev / factor, given["origin"], by)
