"""A recording, played with its original stamps through the same nodes as live images.

    ros2 launch cardbox_tracker replay.launch.py bag:=BAG person_distance_m:=2.0

The image and CameraInfo topics are found automatically if the bag has one of each. With
cameras:="[left, right]" they are looked up in these namespaces. With
pause_at:="[6.5, 9.5, 12.5]" the player pauses at those times, so that a reference posture can be
captured (initializer/capture_front) before play_bag/resume.
"""

import runpy
import subprocess
import sys
from pathlib import Path

import yaml
from ament_index_python.packages import get_package_prefix, get_package_share_directory
from launch import LaunchContext, LaunchDescription
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
    check_names,
    shares_process,
    values,
)

SHARE = Path(get_package_share_directory("cardbox_tracker"))
# All but 'bag' are parameters of the node play_bag with the same names.
ARGUMENTS = {
    "bag": Argument(None, "rosbag2 folder or .mcap file"),
    "pause_at": Argument("[]", "times to pause at, s from the bag's start", list),
    "rate": Argument("1.0", "speed; 2 plays twice as fast", float, limits=(0.01, 100.0)),
    "loop": Argument("false", "play again and again", bool),
    "start_s": Argument("0.0", "time to begin at, from the bag's start", float, limits=(0.0, 1e6)),
    "duration_s": Argument(
        "0.0", "play this long; 0: to the end of the bag", float, limits=(0.0, 1e6)
    ),
}
# Arguments of the included launch file are also arguments of this one.
NODES = runpy.run_path(str(SHARE / "launch" / "nodes.launch.py"))["ARGUMENTS"]


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=a.default, description=a.meaning)
                for name, a in ARGUMENTS.items()
            ),
            # Wrong arguments must be found before the first node starts.
            OpaqueFunction(function=_check),
            OpaqueFunction(function=_find_topics),
            OpaqueFunction(function=_in_one_process),
            # It comes before play_bag, because it sets the environment and declares arguments.
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(str(SHARE / "launch" / "nodes.launch.py"))
            ),
            OpaqueFunction(function=_play_bag),
        ]
    )


def _check(context: LaunchContext) -> list[object]:
    check_names(__file__, {*ARGUMENTS, *NODES}, sys.argv)
    values(ARGUMENTS, context.launch_configurations)
    return []


def _find_topics(context: LaunchContext) -> list[object]:
    """Take the topics from the bag, unless they are given.

    A process of play_bag finds them, because launch cannot import the packages that read bags.
    """
    given = context.launch_configurations
    wanted = [name for name in ("image", "camera_info") if name not in given]
    if not wanted:
        return []
    # With several cameras, the topics and the nodes are in the cameras' namespaces.
    cameras = [name.strip(" /") for name in given.get("cameras", "").strip(" []").split(",")]
    place = given.get("namespace", "").strip("/")
    below = [f"--below={place}/{name}".replace("=/", "=") for name in cameras if name]
    program = Path(get_package_prefix("cardbox_tracker")) / "lib" / "cardbox_tracker" / "play_bag"
    found = subprocess.run(
        [str(program), given["bag"], *below, "--find-topics", *wanted],
        capture_output=True,
        text=True,
        check=False,
    )
    if found.returncode != 0:
        raise RuntimeError(found.stderr.strip())
    return [
        SetLaunchConfiguration(name, topic) for name, topic in yaml.safe_load(found.stdout).items()
    ]


def _parameters(context: LaunchContext) -> dict[str, object]:
    parameters: dict[str, object] = dict(values(ARGUMENTS, context.launch_configurations))
    # The tracker compiles at its first start, and the recording must not end before.
    parameters["wait_for_topics"] = ["keypoints"]
    if not parameters["pause_at"]:
        # An empty list has no type in ROS, so it is left out.
        del parameters["pause_at"]
    return parameters


def _in_one_process(context: LaunchContext) -> list[object]:
    if not shares_process(context.launch_configurations):
        return []
    return [
        SetLaunchConfiguration("source", "play_bag"),
        SetLaunchConfiguration("source_parameters", yaml.safe_dump(_parameters(context))),
    ]


def _play_bag(context: LaunchContext) -> list[object]:
    if shares_process(context.launch_configurations):
        return []
    # Without a type, launch would read a text as a number or as nothing.
    parameters = {
        name: ParameterValue(value, value_type=str) if isinstance(value, str) else value
        for name, value in _parameters(context).items()
    }
    return [
        Node(
            package="cardbox_tracker",
            executable="play_bag",
            name="play_bag",
            namespace=LaunchConfiguration("namespace"),
            parameters=[
                [LaunchConfiguration("config_dir"), "/play_bag.yaml"],
                parameters,
            ],
            output="screen",
        )
    ]
