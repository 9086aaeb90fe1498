"""Words about parameters for files, documents and the help of the nodes."""

from __future__ import annotations

from typing import Any

from cardbox_tracker.ros.runtime.parameter_fields import NodeParameters, ParameterSpec

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
    parts = [
        spec.unit,
        spec.range_text,
        spec.effect if spec.read_only else f"live: {spec.effect}",
    ]
    return "; ".join(part for part in parts if part)
