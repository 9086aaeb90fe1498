"""A rectified stereo pair: from both images and stereo depth to joint states.

    ros2 launch cardbox_tracker stereo.launch.py

A driver, or play_bag with a recording, publishes the images and CameraInfo of both cameras in the
namespaces left and right; P of the right CameraInfo has their distance.
"""

import runpy
import sys
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

from cardbox_tracker.ros.runtime.launch_arguments import Argument, check_names, values

SHARE = Path(get_package_share_directory("cardbox_tracker"))
ARGUMENTS = {
    "left": Argument("left", "namespace of the left camera", name=True),
    "right": Argument("right", "namespace of the right camera", name=True),
    "stereo_depth": Argument("true", "measure depth in the pair; false: silhouettes only", bool),
}
# Topics of the node stereo_depth below the namespace of each camera.
TOPICS = ("image_raw", "image_raw/compressed", "camera_info")
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
            # It comes first, because it sets the environment and declares shared arguments.
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(str(SHARE / "launch" / "nodes.launch.py"))
            ),
            OpaqueFunction(function=_stereo_depth),
        ]
    )


def _check(context: LaunchContext) -> list[object]:
    check_names(__file__, {*ARGUMENTS, *NODES}, sys.argv)
    typed = values(ARGUMENTS, context.launch_configurations)
    left, right = typed["left"], typed["right"]
    if not left or not right or left == right:
        raise ValueError(
            f"launch arguments left and right are '{left}' and '{right}'; expected two different "
            "namespaces"
        )
    return [
        SetLaunchConfiguration("cameras", f"[{left}, {right}]"),
        *([SetLaunchConfiguration("depth", "depth")] if typed["stereo_depth"] else []),
    ]


def _stereo_depth(context: LaunchContext) -> list[object]:
    typed = values(ARGUMENTS, context.launch_configurations)
    if not typed["stereo_depth"]:
        return []
    return [
        Node(
            package="cardbox_tracker",
            executable="stereo_depth",
            name="stereo_depth",
            namespace=LaunchConfiguration("namespace"),
            remappings=[
                (f"{side}/{topic}", f"{typed[side]}/{topic}")
                for side in ("left", "right")
                for topic in TOPICS
            ],
            parameters=[
                [LaunchConfiguration("config_dir"), "/stereo_depth.yaml"],
                # The background nodes and this node subscribe to the same images.
                {"image_transport": LaunchConfiguration("image_transport")},
            ],
            output="screen",
        )
    ]
