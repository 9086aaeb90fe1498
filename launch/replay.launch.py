"""A recording: played with its original stamps, through the same nodes as live.

    ros2 launch cardbox_tracker replay.launch.py bag:=BAG person_distance_m:=2.0

The bag's picture and CameraInfo topics are found by themselves where it has one of each. With
pause_at:="[6.5, 9.5, 12.5]" the recording stands still at those times, so that a reference posture
can be captured (initializer/capture_front) before play_bag/resume.
"""

from pathlib import Path

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

from cardbox_tracker.ros.bag_reader import BagReader

SHARE = Path(get_package_share_directory("cardbox_tracker"))
COMPRESSED = "/compressed"
# The node's parameters of the same names: default, type, meaning.
ARGUMENTS = {
    "rate": ("1.0", float, "speed; 2 plays twice as fast"),
    "loop": ("false", bool, "play again and again"),
    "start_s": ("0.0", float, "begin so long after the bag's start"),
    "duration_s": ("0.0", float, "play so much of the bag; 0 is all"),
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


def _play_bag(context: LaunchContext) -> list[object]:
    given = {
        name: ParameterValue(LaunchConfiguration(name), value_type=kind)
        for name, (_, kind, _) in ARGUMENTS.items()
    }
    given["bag"] = ParameterValue(LaunchConfiguration("bag"), value_type=str)
    # ROS has no empty list of a known type.
    times = LaunchConfiguration("pause_at").perform(context).strip("[] ")
    if times:
        given["pause_at"] = [float(time) for time in times.split(",")]
    return [
        Node(
            package="cardbox_tracker",
            executable="play_bag",
            name="play_bag",
            namespace=LaunchConfiguration("namespace"),
            parameters=[[LaunchConfiguration("config_dir"), "/play_bag.yaml"], given],
            output="screen",
        )
    ]
