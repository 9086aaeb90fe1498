"""All nodes in one process, served by one executor: ``cardbox_nodes``.

    cardbox_nodes [--with camera | --with play_bag] --ros-args --params-file NODES.yaml

Names, topics and services are the same as with separate processes. Silhouettes are passed inside
the process, which is faster than DDS, but the nodes share one core.
"""

from __future__ import annotations

import argparse
import sys
import threading
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.utilities import try_shutdown

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.ros.nodes.background_node import BackgroundNode
from cardbox_tracker.ros.nodes.initializer_node import InitializerNode
from cardbox_tracker.ros.nodes.tracker_node import TrackerNode
from cardbox_tracker.ros.runtime.node import CardboxNode, IntraProcess, own_arguments, run

if TYPE_CHECKING:
    from cardbox_tracker.ros.nodes.play_bag_node import PlayBagNode

_STOP_S = 5.0
SOURCES = ("camera", "play_bag")


class AllNodes:
    """The nodes of one camera, in the order of the data."""

    def __init__(self, source: str | None) -> None:
        self.nodes: list[CardboxNode] = []
        self._player: PlayBagNode | None = None
        self._playing: threading.Thread | None = None
        # The tracker subscribes first, so it gets a silhouette before the initializer.
        kinds: list[Callable[..., CardboxNode]] = [BackgroundNode, TrackerNode, InitializerNode]
        if source == "camera":
            from cardbox_tracker.ros.nodes.camera_node import CameraNode

            kinds.append(CameraNode)
        try:
            intra_process = IntraProcess()
            for kind in kinds:
                self.nodes.append(kind(intra_process=intra_process))
                _check_cameras(self.nodes[-1])
            if source == "play_bag":
                # Without a bag, the start does not wait for the readers of bags.
                from cardbox_tracker.ros.nodes.play_bag_node import PlayBagNode

                self._player = PlayBagNode()
        except Exception:
            self.close()
            raise

    def work(self) -> None:
        """Spin all nodes until they are told to stop."""
        executor = SingleThreadedExecutor()
        for node in self.nodes:
            executor.add_node(node)
        if self._player is not None:
            # A separate thread lets the player keep the time of the recording.
            self._playing = threading.Thread(target=partial(_play, self._player), daemon=True)
            self._playing.start()
        executor.spin()

    def close(self) -> None:
        """Release the resources of the nodes, the source first."""
        if self._playing is not None:
            # The player ends with ROS; a thread that used ROS afterwards would abort the process.
            try_shutdown()
            self._playing.join(timeout=_STOP_S)
        if self._player is not None:
            self._player.close()
        for node in reversed(self.nodes):
            node.close()


def _check_cameras(node: Any) -> None:
    """Refuse several cameras, because this process has a background node for one camera."""
    cameras = getattr(node.parameters.value, "cameras", ())
    if cameras:
        raise CardboxError(
            f"the parameter cameras of {node.get_name()} is [{', '.join(cameras)}]; expected none "
            "in cardbox_nodes, because one process is too slow for several cameras: start the "
            "nodes separately, a background for each camera, as two_cameras.launch.py, "
            "stereo.launch.py and replay.launch.py cameras:=[...] do"
        )


def _play(player: PlayBagNode) -> None:
    try:
        player.play()
    except CardboxError as error:
        player.diagnostics.problem(str(error))
    except ExternalShutdownException:
        pass
    except Exception:
        # Exceptions while ROS shuts down are expected.
        if player.context.ok():
            raise


def source_from(arguments: Sequence[str]) -> str | None:
    """Return the source given on the command line (without ROS arguments)."""
    parser = argparse.ArgumentParser(
        prog="cardbox_nodes",
        description="background, initializer and tracker in one process.",
        epilog="Parameters of one node: --ros-args -p tracker:preset:=paper, or a YAML file with "
        "--params-file; the bag of play_bag: -p play_bag:bag:=BAG. The help of each node, such as "
        "'tracker --help', lists its parameters and topics.",
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
