"""A camera, live: from its images to joint states, TF and markers.

    ros2 launch cardbox_tracker live.launch.py device:=/dev/video0 \
        calibration_file:=$HOME/camera.yaml person_distance_m:=2.0 camera_pitch_deg:=5.0

Keep the scene empty at the start, then call initializer/initialize and follow initializer/status.
For several cameras, start it once per camera, each with its own namespace and device.
"""

from pathlib import Path

from launch import LaunchDescription

from cardbox_tracker.ros.runtime.launch_arguments import Argument
from cardbox_tracker.ros.runtime.launching import Typed, with_source

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


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(with_source(__file__, ARGUMENTS, "camera", _check))


def _check(typed: Typed, given: dict[str, str]) -> list[object]:
    # With the argument cameras, nodes.launch.py would wait for cameras that are not started here.
    cameras = given.get("cameras", "")
    if cameras.strip(" []"):
        raise ValueError(
            f"launch argument cameras is '{cameras}'; expected nothing: live.launch.py has one "
            "camera; two_cameras.launch.py starts two"
        )
    return []
