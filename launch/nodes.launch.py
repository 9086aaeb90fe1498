"""The nodes that process images: background, initializer, tracker, and TF and RViz.

The other launch files include it; start it alone together with your own camera driver:

    ros2 launch cardbox_tracker nodes.launch.py image:=/camera/image_raw \
        camera_info:=/camera/camera_info person_distance_m:=2.0
"""

import atexit
import sys
import tempfile
from pathlib import Path

import yaml
from ament_index_python.packages import (
    PackageNotFoundError,
    get_package_prefix,
    get_package_share_directory,
)
from launch import LaunchContext, LaunchDescription
from launch.actions import LogInfo, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import EnvironmentVariable, LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.ros_adapters import get_ros_node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from cardbox_tracker.common.errors import reason_of
from cardbox_tracker.ros.runtime.launch_arguments import (
    Argument,
    check_names,
    parameters_in,
    shares_process,
    values,
)
from cardbox_tracker.ros.runtime.launching import declared, node

SHARE = Path(get_package_share_directory("cardbox_tracker"))
PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
ARGUMENTS = {
    "namespace": Argument("", "namespace of all nodes, one per camera"),
    "config_dir": Argument(str(SHARE / "config"), "folder of the nodes' YAML files"),
    "image": Argument("image_raw", "topic of the images (without /compressed)"),
    "camera_info": Argument("camera_info", "topic of their CameraInfo"),
    "image_transport": Argument(
        *("raw", "raw, or compressed for the topic IMAGE/compressed"),
        choices=("raw", "compressed"),
    ),
    "person_distance_m": Argument(
        *("", "level distance from the camera to the person; empty: 2 m, or found", float),
        limits=(0.3, 20.0),
    ),
    "camera_pitch_deg": Argument(
        *("", "how far the camera looks down; empty: it is level, or found", float),
        limits=(-80.0, 80.0),
    ),
    "side_turn": Argument(
        *("left", "direction in which the person turns for the side reference: left or right"),
        choices=("left", "right"),
    ),
    "background_file": Argument(
        "", "background: read if it fits the camera, written when it is learned"
    ),
    "model_file": Argument("", "body model: read if it exists, written by every initialization"),
    "stature": Argument(
        *("0.0", "height of a person who is not measured, who is tracked at once", float),
        limits=(0.0, 2.2),
    ),
    "statures": Argument(
        *("", "heights of several people who are not measured, such as [1.75, 1.62]", list),
        limits=(1.1, 2.2),
    ),
    "people": Argument("0", "number of people; 0: one", int, limits=(0, 6)),
    "preset": Argument(
        "default", "tracker settings: paper or default", choices=("paper", "default")
    ),
    "rep155_id": Argument(
        "", "also publish /humans/bodies/ID/... after REP-155, for this ID", name=True
    ),
    "cameras": Argument(
        *("", "namespaces of several cameras of one person, such as [left, right]"),
        kind=list,
        name=True,
    ),
    "extrinsics_file": Argument("", "poses of the cameras, a file of Kalibr or aniposelib", Path),
    "measure_distance": Argument("true", "two cameras or depth measure person_distance_m", bool),
    "depth": Argument("", "topic of depth images of the (first) camera"),
    "within_m": Argument(
        *("0.0", "with depth: nearer pixels are the person; 0: learn a background", float),
        limits=(0.0, 20.0),
    ),
    "detector": Argument("false", "start the node detector: 2D points for the tracker", bool),
    "silhouettes": Argument(
        *(
            "background",
            "source of the silhouettes: background, or detector without an empty scene",
        ),
        choices=("background", "detector"),
    ),
    "keypoints": Argument("", "2D points of another detector: a topic, or a table FILE.csv"),
    "hands": Argument("false", "with detector: look at hands, see the tracker's parameter", bool),
    "rula": Argument("false", "start the node rula: RULA scores of the posture", bool),
    "robot_file": Argument("", "start the node retarget with this robot arm, a URDF", Path),
    "joint_map_file": Argument(
        "",
        "with robot_file: map of joints; empty: the hand is followed by inverse kinematics",
        Path,
    ),
    "single_process": Argument(
        "auto",
        "all nodes in one process, for least latency: true, false, or auto, which is true for one "
        "camera with a node background",
        choices=("auto", "true", "false"),
    ),
    "publish_tf": Argument("true", "start robot_state_publisher", bool),
    "rviz": Argument("false", "start RViz", bool),
}
# Launch arguments that are parameters, by node.
GIVEN = {
    "background": ("image_transport", "background_file", "within_m", "depth"),
    "initializer": (
        *("person_distance_m", "camera_pitch_deg", "side_turn", "model_file"),
        *("cameras", "extrinsics_file", "measure_distance", "depth", "hands"),
    ),
    "tracker": (
        "preset",
        *("stature", "statures", "people", "person_distance_m", "camera_pitch_deg"),
        "rep155_id",
        "cameras",
        "extrinsics_file",
        "depth",
        "keypoints",
        "hands",
    ),
    "detector": ("image_transport", "people"),
}
# Nodes of cardbox_nodes; the detector always has a process of its own.
TOGETHER = ("background", "initializer", "tracker")
# Nodes that each camera has.
OF_A_CAMERA = ("background", "detector")
POINTS = "detector/keypoints"
LAYOUT_TOPICS = ("robot_description", "markers", "keypoints", "overlay", "silhouette")
# robot_state_publisher does not start without a description, so it gets this one at first.
NOBODY = '<robot name="cardbox_person"><link name="camera_level"/></robot>'


def generate_launch_description() -> LaunchDescription:
    profiles = EnvironmentVariable(
        PROFILES, default_value=str(SHARE / "config" / "fastdds_large_images.xml")
    )
    return LaunchDescription(
        [
            *declared(ARGUMENTS),
            # Wrong arguments must be found before the first node starts.
            OpaqueFunction(function=_check),
            # Without this profile Fast DDS loses most large images; the user's profile is kept.
            SetEnvironmentVariable(PROFILES, profiles),
            OpaqueFunction(function=_nodes),
            OpaqueFunction(function=_users),
            OpaqueFunction(function=_robot_state_publisher),
            OpaqueFunction(function=_rviz),
        ]
    )


def _check(context: LaunchContext) -> list[object]:
    check_names(__file__, ARGUMENTS, sys.argv)
    given = context.launch_configurations
    typed = values(ARGUMENTS, given)
    is_single = shares_process(given)
    if typed["cameras"] and is_single:
        raise ValueError(
            "launch argument single_process is true, but cameras are given; expected only one of "
            "the two, because several cameras need more than one core; leave single_process out"
        )
    if typed["within_m"] and (typed["cameras"] or not typed["depth"]):
        raise ValueError(
            f"launch argument within_m is {given['within_m']}; expected it with depth, the topic "
            "of depth images of one camera, and without cameras"
        )
    if typed["silhouettes"] == "detector" and (is_single or typed["within_m"]):
        raise ValueError(
            "launch argument silhouettes is detector; expected it without within_m and without "
            "single_process, because a node background would make silhouettes, too"
        )
    if typed["joint_map_file"] and not typed["robot_file"]:
        raise ValueError(
            f"launch argument joint_map_file is '{given['joint_map_file']}'; expected it with "
            "robot_file, the URDF of the robot whose joints it names"
        )
    if not Path(given["config_dir"]).is_dir():
        raise ValueError(
            f"launch argument config_dir is '{given['config_dir']}'; expected a folder with the "
            f"files of {SHARE / 'config'}"
        )
    return []


def _nodes(context: LaunchContext) -> list[object]:
    given = context.launch_configurations
    remappings = [
        ("image_raw", given["image"]),
        ("image_raw/compressed", f"{given['image']}/compressed"),
        ("camera_info", given["camera_info"]),
    ]
    typed = values(ARGUMENTS, given)
    detects = typed["detector"] or typed["silhouettes"] == "detector"
    if detects and not typed["keypoints"]:
        given["keypoints"] = POINTS
    cameras = typed["cameras"] or [""]
    left_out = [] if detects else ["detector"]
    is_single = shares_process(given)
    if is_single:
        left_out += TOGETHER
    elif typed["silhouettes"] == "detector":
        left_out.append("background")
    # The tracker needs the calibration of the images for which the points are.
    infos = [
        (f"{below}/camera_info".lstrip("/"), _below(below, given["camera_info"]))
        for below in cameras
    ]
    own = {"background": remappings, "detector": remappings, "tracker": infos}
    nodes = [_single_process(context, remappings)] if is_single else []
    return nodes + [
        node(name, _typed(given, name, below), below, remappings=own.get(name, []))
        for name in GIVEN
        if name not in left_out
        for below in (cameras if name in OF_A_CAMERA else [""])
    ]


def _below(camera: str, topic: str) -> str:
    """Return the name of a camera's topic as the tracker sees it."""
    return topic if not camera or topic.startswith("/") else f"{camera}/{topic}"


def _users(context: LaunchContext) -> list[object]:
    """Return the requested nodes that use the posture."""
    typed = values(ARGUMENTS, context.launch_configurations)
    found = [node("rula", {})] if typed["rula"] else []
    if typed["robot_file"]:
        names = ("robot_file", "joint_map_file")
        # An empty argument leaves the value of retarget.yaml.
        found.append(node("retarget", {name: typed[name] for name in names if typed[name]}))
    return found


def _typed(given: dict[str, str], node: str, camera: str = "") -> dict[str, object]:
    """Return the launch arguments that are parameters of ``node``, in the parameters' types."""
    typed = values(ARGUMENTS, given)
    if node == "background" and not typed["within_m"]:
        # The background node needs depth only to cut out the person by it.
        typed["depth"] = ""
    kept = typed["background_file"]
    if camera and isinstance(kept, str) and kept:
        # Each camera has its own background.
        path = Path(kept)
        typed["background_file"] = str(path.with_name(f"{path.stem}_{camera}{path.suffix}"))
    is_guessed = typed["stature"] or typed["statures"] or typed["keypoints"]
    if node == "tracker" and not is_guessed:
        # The body that the initializer measures has them.
        typed["person_distance_m"] = typed["camera_pitch_deg"] = None
    # An empty list has no type in ROS, so it is left out.
    found: dict[str, object] = {
        name: typed[name] for name in GIVEN[node] if typed[name] not in (None, [])
    }
    if node == "detector":
        found["publish_silhouette"] = typed["silhouettes"] == "detector"
    return found | _queue(given, node, camera)


def _queue(given: dict[str, str], node: str, camera: str) -> dict[str, object]:
    """Return the queue of a replay, which loses no image while a node works; live has none."""
    ending = "/compressed" * (given["image_transport"] == "compressed")
    topics = {"background": f"{given['image']}{ending}", "tracker": "silhouette"}
    if "bag" not in given or node not in topics:
        return {}
    place = "/".join(part for part in (given["namespace"].strip("/"), camera) if part)
    topic = topics[node] if topics[node].startswith("/") else f"/{place}/{topics[node]}"
    return {f"qos_overrides.{topic.replace('//', '/')}.subscription.depth": 5}


def _single_process(context: LaunchContext, remappings: list[tuple[str, str]]) -> Node:
    """Return one process with all nodes and the source of images that the launch file chose."""
    given = context.launch_configurations
    parameters = {name: _typed(given, name) for name in TOGETHER}
    source = given.get("source", "")
    if source:
        parameters[source] = yaml.safe_load(given["source_parameters"])
    place = f"/{given['namespace'].strip('/')}".rstrip("/")
    sections = {}
    for name, own in parameters.items():
        # In one process, a file for all nodes would apply to each of them.
        kept = _kept(Path(given["config_dir"]) / f"{name}.yaml", f"{place}/{name}")
        sections[f"/**/{name}"] = {"ros__parameters": {**kept, **own}}
    with tempfile.NamedTemporaryFile("w", suffix=".yaml", prefix="cardbox_", delete=False) as file:
        yaml.safe_dump(sections, file)
    atexit.register(Path(file.name).unlink, missing_ok=True)
    rules = [word for old, new in remappings for word in ("-r", f"background:{old}:={new}")]
    rules += ["-r", f"tracker:camera_info:={given['camera_info']}"]
    return Node(
        package="cardbox_tracker",
        executable="cardbox_nodes",
        namespace=LaunchConfiguration("namespace"),
        arguments=[
            *(["--with", source] if source else []),
            *("--ros-args", "--params-file", file.name, *rules),
        ],
        output="screen",
    )


def _kept(path: Path, node: str) -> dict[str, object]:
    """Return the parameters of ``node`` in a file of the folder config_dir."""
    try:
        return parameters_in(yaml.safe_load(path.read_text(encoding="utf-8")), node)
    except (OSError, yaml.YAMLError, ValueError) as error:
        raise ValueError(
            f"{path} is no file of parameters: {reason_of(error)}; expected the form of "
            f"{SHARE / 'config' / path.name}; with single_process:=false the node reads the file"
        ) from None


def _robot_state_publisher(context: LaunchContext) -> list[object]:
    if not _wanted(context, "publish_tf"):
        return []
    if not _installed("robot_state_publisher"):
        return [_hint("robot_state_publisher", "so there is no TF of the person")]
    body_id = LaunchConfiguration("rep155_id").perform(context)
    described = [_described(context, "robot_state_publisher", "")]
    if body_id:
        name = f"robot_state_publisher_{body_id}"
        described.append(_described(context, name, f"/humans/bodies/{body_id}/"))
    return described


def _described(context: LaunchContext, name: str, place: str) -> Node:
    """Return a robot_state_publisher for the joint states and the description below ``place``."""
    _pass_on_description(context, name, f"{place}robot_description")
    return Node(
        package="robot_state_publisher",
        executable="robot_state_publisher",
        name=name,
        namespace=LaunchConfiguration("namespace"),
        # When a recording starts over, its stamps go back.
        parameters=[
            {
                "robot_description": ParameterValue(NOBODY, value_type=str),
                "ignore_timestamp": True,
                # robot_state_publisher drops joint states above this rate.
                "publish_frequency": 200.0,
            }
        ],
        remappings=[
            ("joint_states", f"{place}joint_states"),
            # Its own copy of the description would compete with the initializer's.
            ("robot_description", f"{name}/robot_description"),
        ],
        output="screen",
    )


def _pass_on_description(context: LaunchContext, name: str, topic: str) -> None:
    """Set each description on ``topic`` as a parameter of the robot_state_publisher ``name``.

    robot_state_publisher accepts a new description as a parameter but does not subscribe to it.
    """
    node = get_ros_node(context)
    namespace = LaunchConfiguration("namespace").perform(context).strip("/")
    prefix = f"/{namespace}" if namespace else ""
    client = AsyncParameterClient(node, f"{prefix}/{name}")
    waiting: list[str] = []

    def send() -> None:
        # The timer tries again if robot_state_publisher is not running yet.
        if waiting and client.services_are_ready():
            client.set_parameters([Parameter("robot_description", value=waiting.pop())])

    def receive(message: String) -> None:
        waiting[:] = [message.data]
        send()

    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    full = topic if topic.startswith("/") else f"{prefix}/{topic}"
    node.create_subscription(String, full, receive, latched)
    node.create_timer(0.5, send)


def _rviz(context: LaunchContext) -> list[object]:
    if not _wanted(context, "rviz"):
        return []
    if not _installed("rviz2"):
        return [_hint("rviz2", "so RViz is not started")]
    layout = SHARE / "config" / "cardbox.rviz"
    return [
        Node(
            package="rviz2",
            executable="rviz2",
            name="rviz",
            namespace=LaunchConfiguration("namespace"),
            arguments=["-d", str(layout)] if layout.exists() else ["-f", "camera_level"],
            # The layout has absolute names, which are remapped into the namespace.
            remappings=[(f"/{topic}", topic) for topic in LAYOUT_TOPICS],
            output="log",
        )
    ]


def _wanted(context: LaunchContext, name: str) -> bool:
    return values(ARGUMENTS, context.launch_configurations)[name] is True


def _installed(package: str) -> bool:
    try:
        get_package_prefix(package)
    except PackageNotFoundError:
        return False
    return True


def _hint(package: str, consequence: str) -> LogInfo:
    debian = package.replace("_", "-")
    return LogInfo(
        msg=f"{package} is not installed, {consequence}; 'sudo apt install ros-jazzy-{debian}'"
    )
