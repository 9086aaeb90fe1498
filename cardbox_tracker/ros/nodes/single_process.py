"""All nodes in one process, served by one executor: ``cardbox_nodes``.

    cardbox_nodes [--with camera | --with play_bag] --ros-args --params-file NODES.yaml

Nothing differs for other nodes: the same names, topics and services. Silhouettes are handed over
inside the process, so that no other has to be woken; in exchange the nodes share one core.

Parameters are given by node in a YAML file, as ``config/cardbox_nodes.yaml`` has them, or without a
namespace as ``-p tracker:preset:=paper``; remappings by node as
``-r background:image_raw:=/camera/image_raw``.
"""

from __future__ import annotations

import argparse
import sys
import threading
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.utilities import try_shutdown

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.ros.nodes.background_node import BackgroundNode
from cardbox_tracker.ros.nodes.camera_node import CameraNode
from cardbox_tracker.ros.nodes.initializer_node import InitializerNode
from cardbox_tracker.ros.nodes.play_bag_node import PlayBagNode
from cardbox_tracker.ros.nodes.tracker_node import TrackerNode
from cardbox_tracker.ros.runtime.intra_process import IntraProcess
from cardbox_tracker.ros.runtime.node import CardboxNode, own_arguments, run

_STOP_S = 5.0
SOURCES = ("camera", "play_bag")


class AllNodes:
    """The nodes of one camera, in the order of the data."""

    def __init__(self, source: str | None) -> None:
        """Create them, with the ``source`` of images if it is one of ``SOURCES``.

        Raises:
            CardboxError: one of them cannot start.
        """
        self.nodes: list[CardboxNode] = []
        self._player: PlayBagNode | None = None
        self._playing: threading.Thread | None = None
        # The tracker is handed a silhouette before the initializer is.
        kinds: list[Callable[..., CardboxNode]] = [BackgroundNode, TrackerNode, InitializerNode]
        if source == "camera":
            kinds.append(CameraNode)
        try:
            intra_process = IntraProcess()
            for kind in kinds:
                self.nodes.append(kind(intra_process=intra_process))
                _check_cameras(self.nodes[-1])
            if source == "play_bag":
                self._player = PlayBagNode()
        except Exception:
            self.close()
            raise

    def work(self) -> None:
        """Serve all nodes until they are told to stop."""
        executor = SingleThreadedExecutor()
        for node in self.nodes:
            executor.add_node(node)
        if self._player is not None:
            # In a thread of its own, so that it keeps the time of the recording.
            self._playing = threading.Thread(target=partial(_play, self._player), daemon=True)
            self._playing.start()
        executor.spin()

    def close(self) -> None:
        """Release what the nodes hold, the source first."""
        if self._playing is not None:
            # The player ends with ROS; a thread that used ROS afterwards would abort the process.
            try_shutdown()
            self._playing.join(timeout=_STOP_S)
        if self._player is not None:
            self._player.close()
        for node in reversed(self.nodes):
            node.close()


def _check_cameras(node: Any) -> None:
    """Refuse several cameras: there is one background here, which would serve one of them."""
    cameras = getattr(node.parameters.value, "cameras", ())
    if cameras:
        raise CardboxError(
            f"the parameter cameras of {node.get_name()} is [{', '.join(cameras)}]; expected none "
            "in cardbox_nodes, whose one process cannot keep up with several cameras: start each "
            "node by itself, a background for each camera, as two_cameras.launch.py, stereo.launch"
            ".py and replay.launch.py cameras:=[...] do"
        )


def _play(player: PlayBagNode) -> None:
    try:
        player.play()
    except CardboxError as error:
        player.diagnostics.problem(str(error))
    except ExternalShutdownException:
        pass
    except Exception:
        # As in every node, exceptions while ROS shuts down are expected.
        if player.context.ok():
            raise


def source_from(arguments: Sequence[str]) -> str | None:
    """Return the source asked for on the command line (without ROS arguments)."""
    parser = argparse.ArgumentParser(
        prog="cardbox_nodes",
        description="background, initializer and tracker in one process.",
        epilog="Parameters of one node: --ros-args -p tracker:preset:=paper, or a YAML file with "
        "--params-file; the bag of play_bag: -p play_bag:bag:=BAG.",
    )
    parser.add_argument(
        "--with", dest="source", choices=SOURCES, help="also the source of the images"
    )
    source: str | None = parser.parse_args(arguments).source
    return source


def main(args: list[str] | None = None) -> int:
    """Run the nodes; the exit code is 0 unless one could not start."""
    command_line = list(sys.argv) if args is None else ["cardbox_nodes", *args]
    source = source_from(own_arguments(command_line))
    return run(partial(AllNodes, source), command_line, AllNodes.work)


if __name__ == "__main__":
    sys.exit(main())
