"""Parameters of a node, declared from the fields of :mod:`.parameter_fields`.

A wrong value is refused with the reason, and the old value stays.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Generic, TypeVar, get_args

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.node import Node
from rclpy.parameter import Parameter

from cardbox_tracker.common.errors import CardboxError, cut
from cardbox_tracker.common.settings import check, suggestion
from cardbox_tracker.ros.runtime.parameter_fields import NodeParameters, descriptor

T = TypeVar("T", bound=NodeParameters)

_OF_QOS = "qos_overrides."
_LIST_TYPES = {
    list[float]: Parameter.Type.DOUBLE_ARRAY,
    list[str]: Parameter.Type.STRING_ARRAY,
}
_TYPE_TEXTS = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "a text",
    list[float]: "a list of numbers",
    list[str]: "a list of texts",
}


class NotDeclared(ParameterNotDeclaredException):
    """A name that is not declared, with a text, which the exception of rclpy lacks."""

    def __init__(self, text: str) -> None:
        """Keep ``text`` as it is, without the words of the base class."""
        Exception.__init__(self, text)


class LiveParameters(Generic[T]):
    """The declared parameters of a node, always valid; a wrong value raises CardboxError."""

    def __init__(
        self, node: Node, kind: type[T], on_change: Callable[[T], None] | None = None
    ) -> None:
        """Declare the fields of ``kind`` on ``node``; call ``on_change`` after each change."""
        self._node = node
        self._kind = kind
        self._on_change = on_change
        self._specs = kind.specs()
        self._types = kind.types()
        values = {name: self._declare(name) for name in self._specs}
        self.value: T = kind(**values)
        problem = self._problem({})
        if problem:
            raise self._refusal(problem)
        self._warn_of_unknown()
        node.add_pre_set_parameters_callback(self._translate)
        node.add_on_set_parameters_callback(self._validate)
        node.add_post_set_parameters_callback(self._apply)

    def _declare(self, name: str) -> Any:
        spec, type_ = self._specs[name], self._types[name]
        given = _as_type(type_, self._given(name))
        if given is not None and not _is_of(type_, given):
            raise self._refusal(
                f"{name} is '{given}'; expected {_TYPE_TEXTS[type_]}. {name} is {spec.description}"
            )
        if given is None and type_ in _LIST_TYPES:
            self._declare_empty_list(name)
            return []
        default = getattr(self._kind, name) if given is None else given
        try:
            # Its text is clearer than rclpy's.
            spec.check(name, default)
            self._node.declare_parameter(
                name, default, descriptor(spec, type_), ignore_override=True
            )
            return _plain(self._node.get_parameter(name).value)
        except Exception as error:
            raise self._refusal(f"{error}. {name} is {spec.description}") from None

    def _declare_empty_list(self, name: str) -> None:
        """Declare a list with the value []; rclpy alone would take it for a list of bytes.

        An unset list would be simpler, but then a request for all parameters gets no values.
        """
        type_ = self._types[name]
        list_type, described = _LIST_TYPES[type_], descriptor(self._specs[name], type_)
        described.type = list_type.value
        self._node.declare_parameter(name, list_type, ignore_override=True)
        self._node.set_parameters([Parameter(name, list_type, [])])
        self._node.set_descriptor(name, described)

    def _given(self, name: str) -> Any:
        """Return the value of ``name`` from the command line or a file; None without one."""
        any_type = ParameterDescriptor(dynamic_typing=True)
        value = self._node.declare_parameter(name, None, any_type).value
        self._node.undeclare_parameter(name)
        return value

    def _warn_of_unknown(self) -> None:
        """Warn of unknown names at the start, no errors since a file may serve several nodes."""
        # rclpy has no public interface to the given values.
        given = getattr(self._node, "_parameter_overrides", {})
        for name in given:
            if self._node.has_parameter(name) or name.startswith(_OF_QOS):
                continue
            self._node.get_logger().warning(self._unknown(name))

    def _unknown(self, name: str) -> str:
        return (
            f"'{cut(name)}' is not a parameter of node '{self._node.get_name()}' and has no "
            f"effect; {suggestion(name, self._specs)}see 'ros2 param list' or docs/parameters.md "
            "for all names"
        )

    def _refusal(self, problem: str) -> CardboxError:
        return CardboxError(f"parameters of node '{self._node.get_name()}': {problem}")

    def _translate(self, parameters: list[Parameter]) -> list[Parameter]:
        """Replace integers by floats where these are expected."""
        translated = []
        for given in parameters:
            if not self._node.has_parameter(given.name):
                raise NotDeclared(self._unknown(given.name))
            value = _as_type(self._types.get(given.name), given.value)
            # Only the original parameter has the type of an empty list.
            same = value is given.value
            translated.append(given if same else Parameter(given.name, value=value))
        return translated

    def _changed(self, parameters: list[Parameter]) -> dict[str, Any]:
        return {p.name: _plain(p.value) for p in parameters if p.name in self._specs}

    def _validate(self, parameters: list[Parameter]) -> SetParametersResult:
        problem = self._problem(self._changed(parameters))
        return SetParametersResult(successful=not problem, reason=problem)

    def _apply(self, parameters: list[Parameter]) -> None:
        changed = self._changed(parameters)
        if changed:
            self.value = replace(self.value, **changed)
            if self._on_change is not None:
                self._on_change(self.value)

    def _problem(self, changed: Mapping[str, Any]) -> str:
        """Return why the present values with the changed ones are refused; empty if not."""
        try:
            value = replace(self.value, **changed)
            check(value)
            value.check()
        except (ValueError, CardboxError) as error:
            return str(error)
        return ""


def _as_type(type_: Any, value: Any) -> Any:
    """Return an integer as a float or text if ``type_`` is one; return other values unchanged."""
    if type_ in (float, str) and _is_integer(value):
        # ROS reads -p device:=0 as a number.
        return type_(value)
    is_list = isinstance(value, list | tuple | array)
    if type_ == list[float] and is_list and len(value) and all(map(_is_integer, value)):
        return [float(one) for one in value]
    return value


def _is_of(type_: Any, value: Any) -> bool:
    plain = _plain(value)
    if type_ in _LIST_TYPES:
        return isinstance(plain, list) and all(type(one) is get_args(type_)[0] for one in plain)
    return type(plain) is type_


def _is_integer(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _plain(value: Any) -> Any:
    """Return an ``array.array`` of a parameter as a list; return other values unchanged."""
    return value if isinstance(value, bool | int | float | str) else list(value)
