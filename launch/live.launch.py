"""A camera, live: from its pictures to joint states, TF and markers.

    ros2 launch cardbox_tracker live.launch.py device:=/dev/video0 \
        calibration_file:=$HOME/camera.yaml person_distance_m:=2.0 camera_pitch_deg:=5.0

Keep the scene empty at the start, then call initializer/initialize and follow initializer/status.
Several cameras: start it once per camera, each with a namespace and a device of its own.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

SHARE = Path(get_package_share_directory("cardbox_tracker"))
# The node's parameters of the same names: default, type, meaning.
ARGUMENTS = {
    "device": ("/dev/video0", str, "V4L2 device"),
    "file": ("", str, "video file to play instead of a device"),
    "calibration_file": ("", str, "YAML file of camera_calibration"),
    "horizontal_fov_deg": ("0.0", float, "field of view to assume without a calibration file"),
    "width": ("640", int, "width to ask the device for, px"),
    "height": ("480", int, "height to ask the device for, px"),
    "rate_hz": ("15.0", float, "pictures a second"),
    "frame_id": ("camera_optical_frame", str, "name of the camera's optical frame"),
}


def generate_launch_description() -> LaunchDescription:
    given = {
        name: ParameterValue(LaunchConfiguration(name), value_type=kind)
        for name, (_, kind, _) in ARGUMENTS.items()
    }
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=text)
                for name, (default, _, text) in ARGUMENTS.items()
            ),
            # First, since it sets the environment and declares what the camera uses as well.
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(str(SHARE / "launch" / "nodes.launch.py"))
            ),
            Node(
                package="cardbox_tracker",
                executable="camera",
                name="camera",
                namespace=LaunchConfiguration("namespace"),
                parameters=[[LaunchConfiguration("config_dir"), "/camera.yaml"], given],
                output="screen",
            ),
        ]
    )
