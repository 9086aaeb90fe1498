"""Write ``config/<node>.yaml`` and ``docs/parameters.md`` from the parameter dataclasses.

python -m lab.tools.parameter_docs [ROOT] [--check]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from cardbox_tracker.common.settings import settings_below
from cardbox_tracker.ros.nodes.background_node import BackgroundParameters
from cardbox_tracker.ros.nodes.camera_node import CameraParameters
from cardbox_tracker.ros.nodes.detector_node import DetectorParameters
from cardbox_tracker.ros.nodes.initializer_parameters import InitializerParameters
from cardbox_tracker.ros.nodes.play_bag_node import PlayBagParameters
from cardbox_tracker.ros.nodes.retarget_node import RetargetParameters
from cardbox_tracker.ros.nodes.rula_node import RulaParameters
from cardbox_tracker.ros.nodes.stereo_depth_node import StereoDepthParameters
from cardbox_tracker.ros.nodes.teleoperation_node import TeleoperationParameters
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.ros.runtime.parameter_fields import (
    NodeParameters,
    default_of,
    details,
    type_name,
    yaml_value,
)
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.terms.depth import Depth
from cardbox_tracker.terms.inner_cue import InnerCue

_GENERATED = (
    "made by 'python -m lab.tools.parameter_docs'; edit the settings and ros/nodes/*_parameters.py"
)
NODES: dict[str, type[NodeParameters]] = {
    "background": BackgroundParameters,
    "initializer": InitializerParameters,
    "tracker": TrackerParameters,
    "camera": CameraParameters,
    "play_bag": PlayBagParameters,
    "stereo_depth": StereoDepthParameters,
    "detector": DetectorParameters,
    "rula": RulaParameters,
    "retarget": RetargetParameters,
    "teleoperation": TeleoperationParameters,
}
"""Node name to its parameters."""
APART = ("detector", "rula", "retarget", "teleoperation")
"""Nodes that are no part of ``cardbox_nodes``."""


def config_text(kind: type[NodeParameters]) -> str:
    """Return the YAML file of one node, with every parameter at its default."""
    lines = [f"# {kind.__doc__}", f"# {_GENERATED}", "/**:", *_section(kind)]
    return "\n".join(lines) + "\n"


def all_config_text() -> str:
    """Return the YAML file of ``cardbox_nodes``: all nodes, each in any namespace."""
    lines = ["# All nodes in one process (cardbox_nodes).", f"# {_GENERATED}"]
    for node, kind in NODES.items():
        if node not in APART:
            lines += [f"/**/{node}:", *_section(kind)]
    return "\n".join(lines) + "\n"


def _section(kind: type[NodeParameters]) -> list[str]:
    lines = ["  ros__parameters:"]
    for name, spec in kind.specs().items():
        value = default_of(kind, name)
        lines.append(f"    # {spec.description} ({details(spec)})")
        # The ROS parser does not take an empty list, so it is shown as a comment.
        lines.append(f"    # {name}: []" if value == [] else f"    {name}: {yaml_value(value)}")
    return lines


def markdown_text() -> str:
    """Return the page that describes the parameters of all nodes."""
    lines = [
        "# Parameters",
        "",
        f"<!-- {_GENERATED} -->",
        "",
        "Set them in `config/<node>.yaml`, with `--ros-args -p name:=value`, or, where live, with",
        '`ros2 param set`; "live" says when a change takes effect. A wrong value is refused with',
        "the reason, and the old one stays. A whole number is taken for a float.",
        "[Topics](topics.md) says how to override the QoS of topics.",
    ]
    described: dict[tuple[str, str], str] = {}
    for node, kind in NODES.items():
        lines += ["", f"## {node}", "", f"{kind.__doc__}", ""]
        lines += ["| name | default | allowed | live | effect |", "|---|---|---|---|---|"]
        types = kind.types()
        for name, spec in kind.specs().items():
            first = described.setdefault((name, spec.description), node)
            description = spec.description if first == node else f"as of `{first}`"
            value = default_of(kind, name)
            default = f"`{yaml_value(value)}`"
            if value == []:
                default += f" ({type_name(types[name])})"
            live = "no" if spec.read_only else spec.effect
            lines.append(f"| `{name}` | {default} | {_allowed(spec)} | {live} | {description} |")
    return "\n".join([*lines, *_settings_section()]) + "\n"


def _allowed(spec: Any) -> str:
    """Return the allowed values of a parameter or setting with their unit."""
    return f"{spec.range_text.replace(' | ', ', ')} {spec.unit}".strip()


def _settings_section() -> list[str]:
    """Return the lines about the settings of the core that a file can give."""
    lines = [
        *("", "## Settings of the tracker in a file", ""),
        "`cardbox track` takes any of these as `--set NAME=VALUE`. Its option `--settings` and the",
        "parameter `settings_file` of the tracker take a YAML file, in which each part before a",
        "dot is a level of its own:",
        "",
        *("```yaml", "whole_body:", "  effort: 0.5", "  smoothing: 0.2", "```", ""),
        "`torso`, `arm`, `strategy`, `cycles`, `average` and `torso_beside_arms` are of the preset",
        "`paper`, `whole_body` of the preset `default`; those of the other preset are refused.",
        "",
        "| name | default | allowed | effect |",
        "|---|---|---|---|",
    ]
    return lines + list(_settings_rows(TrackerConfig(terms=(InnerCue(), Depth()))))


def _settings_rows(settings: Any) -> Iterator[str]:
    for name, value, spec in settings_below(settings):
        yield f"| `{name}` | `{yaml_value(value)}` | {_allowed(spec)} | {spec.description} |"


def files() -> dict[str, str]:
    """Return every generated file: path below the repository to its text."""
    texts = {f"config/{node}.yaml": config_text(kind) for node, kind in NODES.items()}
    texts["config/cardbox_nodes.yaml"] = all_config_text()
    return {**texts, "docs/parameters.md": markdown_text()}


def main(args: list[str] | None = None) -> int:
    """Write the files, or with ``--check`` only compare; 1 if they differ."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("root", nargs="?", type=Path, default=Path("."))
    parser.add_argument("--check", action="store_true", help="only compare")
    given = parser.parse_args(args)
    stale = []
    for name, text in files().items():
        path = given.root / name
        if path.exists() and path.read_text(encoding="utf-8") == text:
            continue
        stale.append(name)
        if not given.check:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
    print("\n".join(f"{'differs' if given.check else 'written'}: {name}" for name in stale))
    return 1 if stale and given.check else 0


if __name__ == "__main__":
    sys.exit(main())
