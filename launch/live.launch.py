"""A camera, live: from its images to joint states, TF and markers.

    ros2 launch cardbox_tracker live.launch.py device:=/dev/video0 \
        calibration_file:=$HOME/camera.yaml person_distance_m:=2.0 camera_pitch_deg:=5.0

Keep the scene empty at the start, then call initializer/initialize and follow initializer/status.
For several cameras, start it once per camera, each with its own namespace and device.
"""

import runpy
import sys
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

from cardbox_tracker.ros.runtime.launch_arguments import (
    Argument,
    check_names,
    shares_process,
    values,
)

SHARE = Path(get_package_share_directory("cardbox_tracker"))
# Arguments that are parameters of the node camera.
ARGUMENTS = {
    "device": Argument("/dev/video0", "V4L2 device"),
    "file": Argument("", "video file to play instead of a device", Path),
    "calibration_file": Argument("", "YAML file of camera_calibration", Path),
    "horizontal_fov_deg": Argument(
        *("0.0", "field of view to assume without a calibration file, such as 60", float),
        limits=(0.0, 170.0),
    ),
    "width": Argument("640", "width to ask the device for, px", int, limits=(32, 8192)),
    "height": Argument("480", "height to ask the device for, px", int, limits=(32, 8192)),
    "rate_hz": Argument(
        *("0.0", "images a second; 0: the file's own rate, and 15 of a device", float),
        limits=(0.0, 240.0),
    ),
    "loop": Argument("false", "play the file again and again", bool),
    "frame_id": Argument("camera_optical_frame", "name of the camera's optical frame"),
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
            OpaqueFunction(function=_in_one_process),
            # It comes first, because it sets the environment and declares shared arguments.
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(str(SHARE / "launch" / "nodes.launch.py"))
            ),
            OpaqueFunction(function=_camera),
        ]
    )


def _check(context: LaunchContext) -> list[object]:
    check_names(__file__, {*ARGUMENTS, *NODES}, sys.argv)
    values(ARGUMENTS, context.launch_configurations)
    # With the argument cameras, nodes.launch.py would wait for cameras that are not started here.
    cameras = context.launch_configurations.get("cameras", "")
    if cameras.strip(" []"):
        raise ValueError(
            f"launch argument cameras is '{cameras}'; expected nothing: live.launch.py has one "
            "camera; two_cameras.launch.py starts two"
        )
    return []


def _parameters(context: LaunchContext) -> dict[str, object]:
    return dict(values(ARGUMENTS, context.launch_configurations))


def _in_one_process(context: LaunchContext) -> list[object]:
    if not shares_process(context.launch_configurations):
        return []
    return [
        SetLaunchConfiguration("source", "camera"),
        SetLaunchConfiguration("source_parameters", yaml.safe_dump(_parameters(context))),
    ]


def _camera(context: LaunchContext) -> list[object]:
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
            executable="camera",
            name="camera",
            namespace=LaunchConfiguration("namespace"),
            parameters=[[LaunchConfiguration("config_dir"), "/camera.yaml"], parameters],
            output="screen",
        )
    ]
