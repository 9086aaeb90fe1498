"""What the launch files share.

They run under the system's Python, see :mod:`.launch_arguments`, so this module imports only what
``ros2 launch`` has.
"""

from __future__ import annotations

import runpy
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import yaml
from launch.actions import (
    DeclareLaunchArgument,
    IncludeLaunchDescription,
    OpaqueFunction,
    SetLaunchConfiguration,
)
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from cardbox_tracker.ros.runtime.launch_arguments import (
    Argument,
    Value,
    check_names,
    shares_process,
    values,
)

Typed = dict[str, Value | None]
"""Values of a launch file's own arguments."""
Make = Callable[[Typed, dict[str, str]], list[object]]
"""Makes actions of the values of a file's own arguments and the texts of all."""


def declared(arguments: Mapping[str, Argument]) -> list[object]:
    """Return the actions that declare arguments."""
    return [
        DeclareLaunchArgument(name, default_value=one.default, description=one.meaning)
        for name, one in arguments.items()
    ]


def node(name: str, parameters: Mapping[str, object], below: str = "", **rest: Any) -> Node:
    """Return a node of the package with the parameters of its file and these.

    ``below`` is its namespace in that of all nodes, and ``rest`` further options.
    """
    # Without a type, launch would read a text as a number or as nothing.
    own = {
        name: ParameterValue(value, value_type=str) if isinstance(value, str) else value
        for name, value in parameters.items()
    }
    return Node(
        package="cardbox_tracker",
        executable=name,
        name=name,
        namespace=[LaunchConfiguration("namespace"), *(["/", below] if below else [])],
        parameters=[[LaunchConfiguration("config_dir"), f"/{name}.yaml"], own],
        output="screen",
        **rest,
    )


def with_nodes(
    file: str, arguments: Mapping[str, Argument], prepare: Make, start: Make
) -> list[object]:
    """Return the actions of a launch ``file`` that includes ``nodes.launch.py`` beside it.

    The arguments of that file are also arguments of this one. What ``prepare`` returns is carried
    out before the first node starts, and finds wrong arguments; ``start`` returns further nodes.
    """
    nodes = str(Path(file).with_name("nodes.launch.py"))

    def before(context: Any) -> list[object]:
        check_names(file, {*arguments, *runpy.run_path(nodes)["ARGUMENTS"]}, sys.argv)
        return after(context, prepare)

    def after(context: Any, make: Make = start) -> list[object]:
        given = context.launch_configurations
        return make(values(arguments, given), given)

    return [
        *declared(arguments),
        OpaqueFunction(function=before),
        # It comes first, because it sets the environment and declares shared arguments.
        IncludeLaunchDescription(PythonLaunchDescriptionSource(nodes)),
        OpaqueFunction(function=after),
    ]


def with_source(
    file: str,
    arguments: Mapping[str, Argument],
    name: str,
    prepare: Make,
    parameters: Callable[[Typed], dict[str, object]] = dict,
) -> list[object]:
    """Return :func:`with_nodes` and the node ``name``, the source of the images.

    It is in the process of the others if they share one. ``parameters`` makes the node's parameters
    of the file's own arguments.
    """

    def before(typed: Typed, given: dict[str, str]) -> list[object]:
        found = prepare(typed, given)
        if shares_process(given):
            text = yaml.safe_dump(parameters(typed))
            found += [
                SetLaunchConfiguration("source", name),
                SetLaunchConfiguration("source_parameters", text),
            ]
        return found

    def start(typed: Typed, given: dict[str, str]) -> list[object]:
        return [] if shares_process(given) else [node(name, parameters(typed))]

    return with_nodes(file, arguments, before, start)
