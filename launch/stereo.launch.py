"""A rectified stereo pair: from both images, and the depth between them, to joint states.

    ros2 launch cardbox_tracker stereo.launch.py

A driver, or play_bag with a recording, publishes the images and CameraInfo of both cameras below
left and right; P of the right CameraInfo says how far apart they are.
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
    "stereo_depth": Argument("true", "measure depth in the pair; false: outlines alone", bool),
}
# Topics of the pair as the node stereo_depth has them, below the namespace of each camera.
TOPICS = ("image_raw", "image_raw/compressed", "camera_info")
# Arguments of the launch file that is included, and thus of this one.
NODES = runpy.run_path(str(SHARE / "launch" / "nodes.launch.py"))["ARGUMENTS"]


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=a.default, description=a.meaning)
                for name, a in ARGUMENTS.items()
            ),
            # What is wrong has to be found before the first node runs.
            OpaqueFunction(function=_check),
            # First, since it sets the environment and declares what the others use as well.
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
                # Of nodes.launch.py: the backgrounds and this node take the same images.
                {"image_transport": LaunchConfiguration("image_transport")},
            ],
            output="screen",
        )
    ]
