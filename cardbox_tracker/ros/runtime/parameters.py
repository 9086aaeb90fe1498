"""Parameters of a node declared from one dataclass: the single source of types and defaults.

A field made by :func:`parameter` carries its description, unit, range or choices, and whether it
can change while it runs. :class:`LiveParameters` declares all of them on a node and keeps a
validated instance: a wrong value is refused with the reason and the old one stays.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any, Generic, TypeVar, get_type_hints

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import ParameterUninitializedException
from rclpy.node import Node
from rclpy.parameter import Parameter

from cardbox_tracker.errors import CardboxError

T = TypeVar("T", bound="NodeParameters")

_LIST_TYPES = {
    list[float]: Parameter.Type.DOUBLE_ARRAY,
    list[int]: Parameter.Type.INTEGER_ARRAY,
    list[str]: Parameter.Type.STRING_ARRAY,
}


@dataclass(frozen=True)
class ParameterSpec:
    """What is known of one parameter besides its name, type and default.

    Attributes:
        description: what it does, one sentence.
        unit: its unit; empty for a plain number or a text.
        minimum: smallest allowed value; None without a limit.
        maximum: largest allowed value; None without a limit.
        choices: the allowed texts; empty if any text is.
        read_only: True if it can only be given at the start.
    """

    description: str
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    read_only: bool = False

    @property
    def range_text(self) -> str:
        """The allowed values in words, or an empty text."""
        if self.choices:
            return " | ".join(choice or '""' for choice in self.choices)
        if self.minimum is None or self.maximum is None:
            return ""
        return f"{_short(self.minimum)} to {_short(self.maximum)}"


def _short(value: float) -> str:
    return str(int(value)) if float(value).is_integer() else f"{value:g}"


def parameter(
    default: Any,
    description: str,
    *,
    unit: str = "",
    limits: tuple[float, float] | None = None,
    choices: tuple[str, ...] = (),
    read_only: bool = False,
) -> Any:
    """Return a dataclass field that :class:`LiveParameters` can declare; lists default to empty."""
    lowest, highest = limits or (None, None)
    spec = ParameterSpec(description, unit, lowest, highest, choices, read_only)
    if isinstance(default, list):
        return field(default_factory=list, metadata={"spec": spec})
    return field(default=default, metadata={"spec": spec})


@dataclass(frozen=True)
class NodeParameters:
    """Base of the parameter dataclasses; every field is made by :func:`parameter`."""

    def check(self) -> None:
        """Raise ValueError where values do not go together; ranges are checked before."""

    @classmethod
    def specs(cls) -> dict[str, ParameterSpec]:
        """Return the specification of every parameter by name, in order."""
        return {entry.name: entry.metadata["spec"] for entry in fields(cls)}

    @classmethod
    def types(cls) -> dict[str, Any]:
        """Return the Python type of every parameter by name."""
        hints = get_type_hints(cls)
        return {entry.name: hints[entry.name] for entry in fields(cls)}


class LiveParameters(Generic[T]):
    """The declared parameters of one node; :attr:`value` is always a valid set.

    Raises:
        CardboxError: a value given at the start is refused; the text says which and why.
    """

    def __init__(
        self, node: Node, kind: type[T], on_change: Callable[[T], None] | None = None
    ) -> None:
        """Declare every field of ``kind`` on ``node``; ``on_change`` gets each accepted new set."""
        self._node = node
        self._kind = kind
        self._on_change = on_change
        self._specs = kind.specs()
        values = {name: self._declare(name, type_) for name, type_ in kind.types().items()}
        self.value: T = kind(**values)
        problem = self._problem(self.value)
        if problem:
            raise CardboxError(f"parameters of node '{node.get_name()}': {problem}")
        node.add_on_set_parameters_callback(self._validate)
        node.add_post_set_parameters_callback(self._apply)

    def _declare(self, name: str, type_: Any) -> Any:
        default: Any = _LIST_TYPES.get(type_)
        if default is None:
            default = getattr(self._kind, name)
        try:
            self._node.declare_parameter(name, default, descriptor(self._specs[name], type_))
            return _plain(self._node.get_parameter(name).value)
        except ParameterUninitializedException:
            return []
        except Exception as error:
            raise CardboxError(
                f"parameters of node '{self._node.get_name()}': {error}. {name} is "
                f"{self._specs[name].description}"
            ) from None

    def _changed(self, parameters: list[Parameter]) -> dict[str, Any]:
        return {p.name: _plain(p.value) for p in parameters if p.name in self._specs}

    def _validate(self, parameters: list[Parameter]) -> SetParametersResult:
        changed = self._changed(parameters)
        if not changed:
            return SetParametersResult(successful=True)
        problem = self._problem(replace(self.value, **changed))
        return SetParametersResult(successful=not problem, reason=problem)

    def _apply(self, parameters: list[Parameter]) -> None:
        changed = self._changed(parameters)
        if changed:
            self.value = replace(self.value, **changed)
            if self._on_change is not None:
                self._on_change(self.value)

    def _problem(self, value: T) -> str:
        for name, spec in self._specs.items():
            given = getattr(value, name)
            if spec.choices and given not in spec.choices:
                return f"{name} is '{given}'; expected one of {', '.join(spec.choices)}"
        try:
            value.check()
        except (ValueError, CardboxError) as error:
            return str(error)
        return ""


def descriptor(spec: ParameterSpec, type_: Any) -> ParameterDescriptor:
    """Return the ROS descriptor of a parameter, so that tools can show and check it."""
    unit = f" [{spec.unit}]" if spec.unit else ""
    message = ParameterDescriptor(
        description=f"{spec.description}{unit}",
        read_only=spec.read_only,
        additional_constraints=f"one of: {spec.range_text}" if spec.choices else "",
    )
    if spec.minimum is not None and spec.maximum is not None:
        if type_ is int:
            limits = IntegerRange(from_value=int(spec.minimum), to_value=int(spec.maximum))
            message.integer_range = [limits]
        else:
            message.floating_point_range = [
                FloatingPointRange(from_value=float(spec.minimum), to_value=float(spec.maximum))
            ]
    return message


def _plain(value: Any) -> Any:
    """Arrays of parameters arrive as ``array.array``; everything else as it is."""
    return value if isinstance(value, bool | int | float | str) else list(value)
