"""Two cameras that see one person: from their images to joint states, TF and markers.

    ros2 launch cardbox_tracker two_cameras.launch.py \
        first_device:=/dev/video0 first_calibration_file:=$HOME/first.yaml \
        second_device:=/dev/video2 second_calibration_file:=$HOME/second.yaml \
        extrinsics_file:=$HOME/camchain.yaml

The person faces the first camera in the reference postures. Without devices, start your own
drivers, which publish cam0/image_raw, cam0/camera_info and the same topics for cam1. Play a
recording of both with replay.launch.py and cameras:="[cam0, cam1]".
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import SetLaunchConfiguration

from cardbox_tracker.ros.runtime.launch_arguments import Argument
from cardbox_tracker.ros.runtime.launching import Typed, node, with_nodes

ORDER = ("first", "second")
ARGUMENTS = {
    "first": Argument("cam0", "namespace of the camera that the person faces", name=True),
    "second": Argument("cam1", "namespace of the other camera", name=True),
    "first_device": Argument("", "V4L2 device of the first camera; empty: your own driver"),
    "second_device": Argument("", "V4L2 device of the second camera; empty: your own driver"),
    "first_calibration_file": Argument("", "camera_calibration YAML of the first camera", Path),
    "second_calibration_file": Argument("", "camera_calibration YAML of the second camera", Path),
    "width": Argument("640", "width to ask the devices for, px", int, limits=(32, 8192)),
    "height": Argument("480", "height to ask the devices for, px", int, limits=(32, 8192)),
    "rate_hz": Argument("0.0", "images a second; 0: 15", float, limits=(0.0, 240.0)),
}
# Arguments that are parameters of the node camera.
OF_BOTH = ("width", "height", "rate_hz")


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(with_nodes(__file__, ARGUMENTS, _check, _cameras))


def _check(typed: Typed, given: dict[str, str]) -> list[object]:
    names = [str(typed[one]) for one in ORDER]
    if not all(names) or len(set(names)) < len(names):
        raise ValueError(
            f"launch arguments first and second are '{names[0]}' and '{names[1]}'; expected two "
            "different namespaces"
        )
    devices = [typed[f"{one}_device"] for one in ORDER]
    if any(devices) and (devices[0] == devices[1] or not all(devices)):
        raise ValueError(
            f"launch arguments first_device and second_device are '{devices[0]}' and "
            f"'{devices[1]}'; expected two different devices, or none"
        )
    return [SetLaunchConfiguration("cameras", f"[{', '.join(names)}]")]


def _cameras(typed: Typed, given: dict[str, str]) -> list[object]:
    return [
        node(
            "camera",
            {name: typed[name] for name in OF_BOTH}
            | {
                "device": typed[f"{one}_device"],
                "calibration_file": typed[f"{one}_calibration_file"],
                "frame_id": f"{typed[one]}_optical_frame",
            },
            below=str(typed[one]),
        )
        for one in ORDER
        if typed[f"{one}_device"]
    ]
