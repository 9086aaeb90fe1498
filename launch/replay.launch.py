"""A recording, played with its original stamps through the same nodes as live images.

    ros2 launch cardbox_tracker replay.launch.py bag:=BAG person_distance_m:=2.0

The image and CameraInfo topics are found automatically if the bag has one of each. With
cameras:="[left, right]" they are looked up in these namespaces. With
pause_at:="[6.5, 9.5, 12.5]" the player pauses at those times, so that a reference posture can be
captured (initializer/capture_front) before play_bag/resume.
"""

import subprocess
from pathlib import Path

import yaml
from ament_index_python.packages import get_package_prefix
from launch import LaunchDescription
from launch.actions import SetLaunchConfiguration

from cardbox_tracker.ros.runtime.launch_arguments import Argument
from cardbox_tracker.ros.runtime.launching import Typed, with_source

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


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(
        with_source(__file__, ARGUMENTS, "play_bag", _find_topics, _parameters)
    )


def _find_topics(typed: Typed, given: dict[str, str]) -> list[object]:
    """Take the topics from the bag, unless they are given.

    A process of play_bag finds them, because launch cannot import the packages that read bags.
    """
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


def _parameters(typed: Typed) -> dict[str, object]:
    # The tracker compiles at its first start, and the recording must not end before.
    parameters: dict[str, object] = {**typed, "wait_for_topics": ["keypoints"]}
    if not parameters["pause_at"]:
        # An empty list has no type in ROS, so it is left out.
        del parameters["pause_at"]
    return parameters
