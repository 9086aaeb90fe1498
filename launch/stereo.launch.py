"""A rectified stereo pair: from both images and stereo depth to joint states.

    ros2 launch cardbox_tracker stereo.launch.py

A driver, or play_bag with a recording, publishes the images and CameraInfo of both cameras in the
namespaces left and right; P of the right CameraInfo has their distance.
"""

from launch import LaunchDescription
from launch.actions import SetLaunchConfiguration
from launch.substitutions import LaunchConfiguration

from cardbox_tracker.ros.runtime.launch_arguments import Argument
from cardbox_tracker.ros.runtime.launching import Typed, node, with_nodes

ARGUMENTS = {
    "left": Argument("left", "namespace of the left camera", name=True),
    "right": Argument("right", "namespace of the right camera", name=True),
    "stereo_depth": Argument("true", "measure depth in the pair; false: silhouettes only", bool),
}
# Topics of the node stereo_depth below the namespace of each camera.
TOPICS = ("image_raw", "image_raw/compressed", "camera_info")


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(with_nodes(__file__, ARGUMENTS, _check, _stereo_depth))


def _check(typed: Typed, given: dict[str, str]) -> list[object]:
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


def _stereo_depth(typed: Typed, given: dict[str, str]) -> list[object]:
    if not typed["stereo_depth"]:
        return []
    remappings = [
        (f"{side}/{topic}", f"{typed[side]}/{topic}")
        for side in ("left", "right")
        for topic in TOPICS
    ]
    # The background nodes and this node subscribe to the same images.
    parameters = {"image_transport": LaunchConfiguration("image_transport")}
    return [node("stereo_depth", parameters, remappings=remappings)]
