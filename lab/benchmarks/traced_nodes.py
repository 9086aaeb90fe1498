"""A node that notes when each image passes a hand-over.

    python lab/benchmarks/traced_nodes.py FILE.json NODE [ARGUMENT...]

The program runs the executable ``NODE`` of the package. At its end it writes the times since the
epoch, ns, by the image's stamp and by the name of the hand-over.
"""

from __future__ import annotations

import atexit
import json
import sys
import time
from collections.abc import Callable
from importlib import import_module
from typing import Any

from cardbox_tracker.ros.messages.conversions import stamp_ns
from cardbox_tracker.ros.nodes.background_node import BackgroundNode
from cardbox_tracker.ros.nodes.camera_images import CameraImages, SilhouetteOutputs
from cardbox_tracker.ros.nodes.tracker_node import TrackerNode
from cardbox_tracker.ros.nodes.tracker_outputs import TrackerOutputs
from cardbox_tracker.start import NODES

HeaderOf = Callable[..., Any]

# Methods whose begin is noted, and where the header is in their first argument.
_HAND_OVERS: dict[str, tuple[type, str, HeaderOf]] = {
    "received": (CameraImages, "on_image", lambda message: message.header),
    "converted": (BackgroundNode, "_on_image", lambda header: header),
    "cut out": (SilhouetteOutputs, "send", lambda header: header),
    "delivered": (TrackerNode, "_on_input", lambda lead: lead.message.header),
    "tracked": (TrackerOutputs, "publish", lambda seen: seen.header),
}


def trace() -> dict[int, dict[str, int]]:
    """Note the hand-overs of this process from now on; return the notes, which grow."""
    noted: dict[int, dict[str, int]] = {}
    for name, (owner, method, header_of) in _HAND_OVERS.items():
        setattr(owner, method, _noting(getattr(owner, method), name, header_of, noted))
    return noted


def _noting(
    call: Callable[..., Any], name: str, header_of: HeaderOf, noted: dict[int, dict[str, int]]
) -> Callable[..., Any]:
    def method(self: Any, first: Any, *rest: Any) -> Any:
        noted.setdefault(stamp_ns(header_of(first).stamp), {})[name] = time.time_ns()
        return call(self, first, *rest)

    return method


def _write(path: str, noted: dict[int, dict[str, int]]) -> None:
    with open(path, "w", encoding="ascii") as file:
        json.dump(noted, file)


def main() -> int:
    """Run the node of the command line, and return its exit code."""
    path, name, *arguments = sys.argv[1:]
    atexit.register(_write, path, trace())
    sys.argv = [name, *arguments]
    node = import_module(NODES[name])
    return int(node.main())


if __name__ == "__main__":
    sys.exit(main())
