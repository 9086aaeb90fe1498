"""Dataclass fields that become parameters of a node, and how ROS describes them.

A field of :func:`parameter` has a description, a unit, a range or choices, and the effect of a
change while the node runs. A field of :func:`shared` takes most of these from a core setting.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any, ClassVar, get_type_hints

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

from cardbox_tracker.common.settings import Setting, settings_of

NEXT_IMAGE, RESTARTS = "next image", "restarts tracking"
"""Effects of a live change: it holds from the next image on, or tracking starts again."""
AT_START = "only at the start"
"""Effect of a parameter that cannot be changed while the node runs."""


@dataclass(frozen=True)
class ParameterSpec(Setting):
    """Description, range and behaviour of one parameter."""

    effect: str = NEXT_IMAGE  #: when a change takes effect

    @property
    def read_only(self) -> bool:
        """True if the parameter can only be given at the start."""
        return self.effect == AT_START


def parameter(
    default: Any,
    description: str,
    *,
    unit: str = "",
    limits: tuple[float, float] | None = None,
    choices: tuple[str, ...] = (),
    effect: str = NEXT_IMAGE,
) -> Any:
    """Return a dataclass field that :class:`LiveParameters` can declare; lists default to empty."""
    spec = ParameterSpec(description, unit, limits, choices, effect == RESTARTS, effect)
    if isinstance(default, list):
        return field(default_factory=list, metadata={"setting": spec})
    return field(default=default, metadata={"setting": spec})


at_start = partial(parameter, effect=AT_START)
"""A :func:`parameter` that cannot be changed while the node runs."""


def shared(kind: Any, name: str, **changes: Any) -> Any:
    """Return a field like a core setting; ``changes`` are arguments of :func:`parameter`."""
    core = settings_of(kind)[name]
    given = {
        "default": getattr(kind, name),
        "description": core.description,
        "unit": core.unit,
        "limits": core.limits,
        "choices": core.choices,
        "effect": _effect(core),
    }
    return parameter(**(given | changes))


def _effect(core: Setting) -> str:
    return RESTARTS if core.restarts else NEXT_IMAGE


@dataclass(frozen=True)
class NodeParameters:
    """Base of the parameter dataclasses; every own field is made by :func:`parameter`.

    A class may also inherit settings of the core, all of which are parameters then.
    """

    #: effect of a change of inherited settings that is not that of the core, by name
    effects: ClassVar[Mapping[str, str]] = MappingProxyType({})

    def check(self) -> None:
        """Raise ValueError if values contradict each other; ranges are checked before."""

    @classmethod
    def specs(cls) -> dict[str, ParameterSpec]:
        """Return the specification of every parameter by name, the own ones first."""
        known = settings_of(cls)
        own = {name: one for name, one in known.items() if isinstance(one, ParameterSpec)}
        return own | {
            name: ParameterSpec(**vars(one), effect=cls.effects.get(name, _effect(one)))
            for name, one in known.items()
            if name not in own
        }

    @classmethod
    def types(cls) -> dict[str, Any]:
        """Return the Python type of every parameter by name."""
        hints = get_type_hints(cls)
        return {name: hints[name] for name in cls.specs()}


def descriptor(spec: ParameterSpec, type_: Any) -> ParameterDescriptor:
    """Return the ROS descriptor of a parameter, so that tools can show and check it."""
    unit = f" [{spec.unit}]" if spec.unit else ""
    message = ParameterDescriptor(
        description=f"{spec.description}{unit}",
        read_only=spec.read_only,
        additional_constraints=f"one of: {spec.range_text}" if spec.choices else "",
    )
    if spec.limits is not None:
        lowest, highest = spec.limits
        if type_ is int:
            limits = IntegerRange(from_value=int(lowest), to_value=int(highest))
            message.integer_range = [limits]
        else:
            limits = FloatingPointRange(from_value=float(lowest), to_value=float(highest))
            message.floating_point_range = [limits]
    return message


_TYPE_NAMES = {list[str]: "list of str", list[float]: "list of float"}


def yaml_value(value: Any) -> str:
    """Return a parameter's value as YAML that the ROS parser reads as the right type."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        text = repr(value)
        # YAML 1.1 takes 1e-05 for a text.
        return f"{value:.10f}".rstrip("0") if "e" in text else text
    if isinstance(value, str):
        return f'"{value}"'
    return str(value)


def default_of(kind: type[NodeParameters], name: str) -> Any:
    """Return the default of the parameter ``name``; lists are empty."""
    return getattr(kind, name, [])


def type_name(type_: Any) -> str:
    """Return the name of a parameter's type."""
    return _TYPE_NAMES.get(type_) or str(type_.__name__)


def details(spec: ParameterSpec) -> str:
    """Return unit, allowed values and effect of a parameter, as far as it has them."""
    parts = [spec.unit, spec.range_text, spec.effect if spec.read_only else f"live: {spec.effect}"]
    return "; ".join(part for part in parts if part)
