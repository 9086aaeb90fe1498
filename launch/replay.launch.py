"""A recording: played with its original stamps, through the same nodes as live.

    ros2 launch cardbox_tracker replay.launch.py bag:=BAG person_distance_m:=2.0

The bag's image and CameraInfo topics are found by themselves where it has one of each. With
pause_at:="[6.5, 9.5, 12.5]" the recording stands still at those times, so that a reference posture
can be captured (initializer/capture_front) before play_bag/resume.
"""

from pathlib import Path

import yaml
from ament_index_python.packages import get_package_share_directory
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

from cardbox_tracker.recordings.bag_reader import BagReader


def _is_true(text: str) -> bool:
    return text.lower() == "true"


SHARE = Path(get_package_share_directory("cardbox_tracker"))
COMPRESSED = "/compressed"
# The node's parameters of the same names: default, type, meaning.
ARGUMENTS = {
    "rate": ("1.0", float, "speed; 2 plays twice as fast"),
    "loop": ("false", _is_true, "play again and again"),
    "start_s": ("0.0", float, "time to begin at, from the bag's start"),
    "duration_s": ("0.0", float, "play this long; 0: to the end of the bag"),
}


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(
        [
            DeclareLaunchArgument("bag", description="rosbag2 folder or .mcap file"),
            DeclareLaunchArgument("pause_at", default_value="[]", description="times to pause, s"),
            *(
                DeclareLaunchArgument(name, default_value=default, description=text)
                for name, (default, _, text) in ARGUMENTS.items()
            ),
            OpaqueFunction(function=_find_topics),
            OpaqueFunction(function=_in_one_process),
            # Before play_bag, since it sets the environment and declares what play_bag uses too.
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(str(SHARE / "launch" / "nodes.launch.py"))
            ),
            OpaqueFunction(function=_play_bag),
        ]
    )


def _find_topics(context: LaunchContext) -> list[object]:
    """Take the topics from the bag, unless they are given."""
    given = context.launch_configurations
    found: dict[str, str] = {}
    with BagReader(given["bag"]) as bag:
        if "image" not in given:
            topic = bag.image_topic()
            found["image"] = topic.removesuffix(COMPRESSED)
            found["image_transport"] = "compressed" if topic.endswith(COMPRESSED) else "raw"
        if "camera_info" not in given:
            found["camera_info"] = bag.camera_info_topic()
    return [SetLaunchConfiguration(name, value) for name, value in found.items()]


def _is_single(context: LaunchContext) -> bool:
    return context.launch_configurations.get("single_process", "false").lower() == "true"


def _parameters(context: LaunchContext) -> dict[str, object]:
    given = context.launch_configurations
    parameters = {name: kind(given[name]) for name, (_, kind, _) in ARGUMENTS.items()}
    parameters["bag"] = given["bag"]
    # The tracker compiles at its first start; the recording is not to be over by then.
    parameters["wait_for_topics"] = ["keypoints"]
    # ROS has no empty list of a known type.
    times = given["pause_at"].strip("[] ")
    if times:
        parameters["pause_at"] = [float(time) for time in times.split(",")]
    return parameters


def _in_one_process(context: LaunchContext) -> list[object]:
    if not _is_single(context):
        return []
    return [
        SetLaunchConfiguration("source", "play_bag"),
        SetLaunchConfiguration("source_parameters", yaml.safe_dump(_parameters(context))),
    ]


def _play_bag(context: LaunchContext) -> list[object]:
    if _is_single(context):
        return []
    # Keeps launch from reading a text as a number or as nothing.
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
