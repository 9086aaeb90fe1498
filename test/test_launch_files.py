"""Launch files in a Python without the package's dependencies, as ``ros2 launch`` runs them.

Where launch is not installed, stand-ins of its actions are carried out in its order.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import yaml

from cardbox_tracker.recordings.bag_writer import BagWriter

ROOT = Path(__file__).resolve().parents[1]
# What only the virtual environment has.
NOT_THERE = ("rosbags", "numpy", "cv2", "numba", "matplotlib", "tqdm", "lz4")
NODES = ["background", "initializer", "tracker"]


class Action:
    """Remembers what it was made with."""

    def __init__(self, *words: Any, **options: Any) -> None:
        self.words, self.options = words, options


def action(name: str) -> type[Action]:
    return type(name, (Action,), {})


class LaunchConfiguration(Action):
    def perform(self, context: Any) -> str:
        return str(context.launch_configurations[self.words[0]])


class Context:
    def __init__(self, given: dict[str, str]) -> None:
        self.launch_configurations = dict(given)


def stand_ins(prefix: Path) -> dict[str, dict[str, Any]]:
    """Names by module; ``prefix`` is where the package is installed."""
    actions = (
        *("DeclareLaunchArgument", "IncludeLaunchDescription", "LogInfo", "OpaqueFunction"),
        *("SetEnvironmentVariable", "SetLaunchConfiguration"),
    )
    return {
        "ament_index_python.packages": {
            "PackageNotFoundError": KeyError,
            "get_package_prefix": lambda name: str(prefix),
            "get_package_share_directory": lambda name: str(ROOT),
        },
        "launch": {"LaunchContext": Context, "LaunchDescription": action("LaunchDescription")},
        "launch.actions": {name: action(name) for name in actions},
        "launch.launch_description_sources": {
            "PythonLaunchDescriptionSource": action("PythonLaunchDescriptionSource")
        },
        "launch.substitutions": {
            "EnvironmentVariable": action("EnvironmentVariable"),
            "LaunchConfiguration": LaunchConfiguration,
        },
        "launch_ros.actions": {"Node": action("Node")},
        "launch_ros.parameter_descriptions": {"ParameterValue": action("ParameterValue")},
        "launch_ros.ros_adapters": {"get_ros_node": lambda context: None},
        "rclpy.parameter": {"Parameter": action("Parameter")},
        "rclpy.parameter_client": {"AsyncParameterClient": action("AsyncParameterClient")},
        "rclpy.qos": {"DurabilityPolicy": None, "QoSProfile": None},
        "std_msgs.msg": {"String": None},
    }


@pytest.fixture
def launch(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Callable[..., list[str]]]:
    """Return a function that carries out a launch file and returns the nodes it starts.

    Each node has a process of its own, unless ``single_process`` is given.
    """
    program = tmp_path / "lib" / "cardbox_tracker" / "play_bag"
    program.parent.mkdir(parents=True)
    program.write_text(
        f'#!/bin/sh\nPYTHONPATH="{ROOT}" exec "{sys.executable}" -m '
        'cardbox_tracker.start play_bag "$@"\n'
    )
    program.chmod(0o755)
    for name in [n for n in sys.modules if n.partition(".")[0] == "cardbox_tracker"]:
        monkeypatch.delitem(sys.modules, name)
    for name in NOT_THERE:
        monkeypatch.setitem(sys.modules, name, None)
    for name, values in stand_ins(tmp_path).items():
        for end in range(name.count(".") + 1):
            parent = ".".join(name.split(".")[: end + 1])
            if parent == name or parent not in stand_ins(tmp_path):
                monkeypatch.setitem(sys.modules, parent, ModuleType(parent))
        sys.modules[name].__dict__.update(values)
    apart = {"single_process": "false"}
    yield lambda name, **given: started(
        load(name).generate_launch_description(), Context(apart | given)
    )
    for name in [n for n in sys.modules if n.partition(".")[0] == "cardbox_tracker"]:
        del sys.modules[name]


def load(name: str) -> ModuleType:
    path = ROOT / "launch" / f"{name}.launch.py"
    spec = importlib.util.spec_from_file_location(f"{name}_launch", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


RUNNING: list[Action] = []


def started(description: Action, context: Context) -> list[Action]:
    RUNNING.clear()
    carry_out(description.words[0], context)
    return list(RUNNING)


def carry_out(actions: list[Action], context: Context) -> None:
    given = context.launch_configurations
    for one in actions:
        kind = type(one).__name__
        if kind == "DeclareLaunchArgument":
            default = one.options["default_value"]
            given.setdefault(one.words[0], default)
            assert given[one.words[0]] is not None
        elif kind == "SetLaunchConfiguration":
            given[one.words[0]] = one.words[1]
        elif kind == "OpaqueFunction":
            carry_out(one.options["function"](context), context)
        elif kind == "IncludeLaunchDescription":
            name = Path(one.words[0].words[0]).name.removesuffix(".launch.py")
            carry_out(load(name).generate_launch_description().words[0], context)
        elif kind == "Node":
            RUNNING.append(one)


def executables(nodes: list[Action]) -> list[str]:
    return [node.options["executable"] for node in nodes]


def recording(folder: Path, images: int = 1) -> Path:
    from cardbox_tracker.camera.camera import Camera

    with BagWriter(folder / "bag") as bag:
        bag.write_camera_info("/eye/camera_info", 1, "eye", Camera(4, 3, 5.0, 5.0, 1.5, 1.0))
        for number in range(images):
            bag.write_image(f"/eye/{number}", 1, "eye", np.zeros((3, 4), np.uint8), "mono8")
    return folder / "bag"


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """Made before ``launch`` takes away what it is made with."""
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    return recording(tmp_path)


def test_replay_finds_the_topics_in_a_process_that_can_read_bags(
    bag: Path, launch: Callable[..., Any]
) -> None:
    nodes = launch("replay", bag=str(bag), pause_at="[1, 2.5]", publish_tf="false")
    assert executables(nodes) == [*NODES, "play_bag"]
    names = dict(nodes[0].options["remappings"])
    assert names["image_raw"] == "/eye/0"
    assert names["camera_info"] == "/eye/camera_info"
    assert nodes[-1].options["parameters"][1]["pause_at"] == [1.0, 2.5]


def test_a_replay_has_a_queue_where_live_nodes_take_the_newest(launch: Callable[..., Any]) -> None:
    given = {"image": "/eye/0", "camera_info": "/c", "publish_tf": "false"}
    replay = launch("replay", bag="/nowhere", namespace="room", **given)
    queues = {"background": "/eye/0", "tracker": "/room/silhouette"}
    for node in replay[:-1]:
        topic = queues.get(node.options["executable"])
        found = {k: v for k, v in parameters_of(node).items() if k.startswith("qos_overrides")}
        assert found == ({f"qos_overrides.{topic}.subscription.depth": 5} if topic else {})
    for node in launch("nodes", **given):
        assert not any(name.startswith("qos_overrides") for name in parameters_of(node))


def test_the_parameters_of_one_process_are_removed_at_the_end(
    launch: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    at_end: list[Any] = []
    monkeypatch.setattr("atexit.register", lambda call, **given: at_end.append((call, given)))
    (node,) = launch("nodes", single_process="true", publish_tf="false")
    words = node.options["arguments"]
    file = Path(words[words.index("--params-file") + 1])
    assert file.is_file()
    ((call, given),) = at_end
    call(**given)
    assert not file.exists()


def test_replay_says_why_a_bag_cannot_be_played(launch: Callable[..., Any]) -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    with pytest.raises(RuntimeError, match="/nowhere/bag") as caught:
        launch("replay", bag="/nowhere/bag")
    assert "Traceback" not in str(caught.value)
    assert RUNNING == []


@pytest.fixture
def bag_of_two(tmp_path: Path) -> Path:
    """Compressed images of two cameras; made before ``launch`` takes away what it is made with."""
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    from cardbox_tracker.camera.camera import Camera

    with BagWriter(tmp_path / "two") as bag:
        for name in ("left", "right"):
            bag.write_camera_info(f"/{name}/info", 1, name, Camera(4, 3, 5.0, 5.0, 1.5, 1.0))
            bag.write_compressed(f"/{name}/image_raw/compressed", 1, name, b"")
    return tmp_path / "two"


def test_replay_finds_the_topics_of_several_cameras_below_their_namespaces(
    bag_of_two: Path, launch: Callable[..., Any]
) -> None:
    nodes = launch("replay", bag=str(bag_of_two), cameras="[left, right]", publish_tf="false")
    assert executables(nodes) == ["background", *NODES, "play_bag"]
    for node in nodes[:2]:
        names = dict(node.options["remappings"])
        assert (names["image_raw"], names["camera_info"]) == ("image_raw", "info")
        assert parameters_of(node)["image_transport"] == "compressed"
    for cameras, expected in (("[left, middle]", "0 image topics .*/middle/"), ("", "/left/")):
        with pytest.raises(RuntimeError, match=expected):
            launch("replay", bag=str(bag_of_two), cameras=cameras)
        assert RUNNING == []


def test_topics_that_are_given_are_not_looked_for(launch: Callable[..., Any]) -> None:
    nodes = launch("replay", bag="/nowhere", image="/i", camera_info="/c", publish_tf="false")
    assert dict(nodes[0].options["remappings"])["image_raw"] == "/i"


def test_live_starts_the_camera_with_typed_values(launch: Callable[..., Any]) -> None:
    nodes = launch("live", width="320", loop="True", publish_tf="false")
    assert executables(nodes) == [*NODES, "camera"]
    parameters = nodes[-1].options["parameters"][1]
    assert (parameters["width"], parameters["loop"]) == (320, True)


@pytest.mark.parametrize(
    ("name", "given", "expected"),
    [
        ("nodes", {}, ["cardbox_nodes"]),
        ("live", {}, ["cardbox_nodes"]),
        ("nodes", {"cameras": "[]"}, ["cardbox_nodes"]),
        ("nodes", {"cameras": "[left, right]"}, ["background", *NODES]),
        ("two_cameras", {}, ["background", *NODES]),
        ("nodes", {"silhouettes": "detector"}, ["initializer", "tracker", "detector"]),
    ],
)
def test_nodes_share_a_process_by_default_where_they_can(
    name: str, given: dict[str, str], expected: list[str], launch: Callable[..., Any]
) -> None:
    assert load("nodes").ARGUMENTS["single_process"].default == "auto"
    nodes = launch(name, single_process="auto", publish_tf="false", **given)
    assert executables(nodes) == expected


def test_in_one_process_each_node_keeps_its_own_parameters(
    launch: Callable[..., Any], tmp_path: Path
) -> None:
    for name in NODES:
        own = {"/**": {"ros__parameters": {"shared": name}}}
        own[f"/left/{name}"] = {"ros__parameters": {"own": name}}
        own[f"/right/{name}"] = {"ros__parameters": {"own": "another's"}}
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(own))
    given = {"config_dir": str(tmp_path), "namespace": "/left/", "publish_tf": "false"}
    (node,) = launch("nodes", single_process="true", **given)
    file = Path(node.options["arguments"][node.options["arguments"].index("--params-file") + 1])
    read = yaml.safe_load(file.read_text())
    file.unlink()
    for name in NODES:
        parameters = read[f"/**/{name}"]["ros__parameters"]
        assert (parameters["shared"], parameters["own"]) == (name, name)
    (tmp_path / "tracker.yaml").write_text("left: {tracker: {ros__parameters: {own: 1}}}")
    with pytest.raises(ValueError, match=r"tracker.yaml .*ros__parameters.*single_process:=false"):
        launch("nodes", single_process="true", **given)


def test_live_leaves_the_rate_of_a_file_to_the_camera(launch: Callable[..., Any]) -> None:
    nodes = launch("live", file=__file__, publish_tf="false")
    assert nodes[-1].options["parameters"][1]["rate_hz"] == 0.0


def namespaces(nodes: list[Action]) -> list[str]:
    """The part of each node's namespace below that of all."""
    parts = [node.options["namespace"] for node in nodes]
    return [
        "".join(p for p in part if isinstance(p, str)) if type(part) is list else ""
        for part in parts
    ]


def parameters_of(node: Action) -> dict[str, Any]:
    own = node.options["parameters"][1]
    return {k: v.words[0] if isinstance(v, Action) else v for k, v in own.items()}


def test_several_cameras_have_a_background_each(launch: Callable[..., Any]) -> None:
    given = {"cameras": "[cam0, /cam1/]", "background_file": "/tmp/empty.npz"}
    nodes = launch("nodes", **given, depth="depth", publish_tf="false")
    assert executables(nodes) == ["background", *NODES]
    assert namespaces(nodes) == ["/cam0", "/cam1", "", ""]
    kept = [parameters_of(node)["background_file"] for node in nodes[:2]]
    assert kept == ["/tmp/empty_cam0.npz", "/tmp/empty_cam1.npz"]
    for node in nodes[2:]:
        assert parameters_of(node)["cameras"] == ["cam0", "cam1"]
    assert parameters_of(nodes[3])["depth"] == "depth"


def test_one_camera_is_told_nothing_of_several(launch: Callable[..., Any]) -> None:
    nodes = launch("nodes", publish_tf="false")
    assert executables(nodes) == NODES
    assert namespaces(nodes) == ["", "", ""]
    assert all("cameras" not in parameters_of(node) for node in nodes)


def test_two_cameras_are_started_with_their_own_devices(
    launch: Callable[..., Any], tmp_path: Path
) -> None:
    calibration = tmp_path / "second.yaml"
    calibration.touch()
    nodes = launch(
        *("two_cameras",),
        first_device="/dev/video0",
        second_device="/dev/video2",
        width="320",
        second_calibration_file=str(calibration),
        publish_tf="false",
    )
    assert executables(nodes) == ["background", *NODES, "camera", "camera"]
    assert namespaces(nodes)[-2:] == ["/cam0", "/cam1"]
    first, second = (parameters_of(node) for node in nodes[-2:])
    assert (first["device"], second["device"]) == ("/dev/video0", "/dev/video2")
    assert (first["calibration_file"], second["calibration_file"]) == ("", str(calibration))
    assert (first["width"], second["frame_id"]) == (320, "cam1_optical_frame")
    own = launch("two_cameras", first="left", second="right", publish_tf="false")
    assert executables(own) == ["background", *NODES]
    assert namespaces(own)[:2] == ["/left", "/right"]


def test_a_stereo_pair_has_depth_unless_it_is_not_wanted(launch: Callable[..., Any]) -> None:
    nodes = launch("stereo", right="r", image_transport="compressed", publish_tf="false")
    assert executables(nodes) == ["background", *NODES, "stereo_depth"]
    assert dict(nodes[-1].options["remappings"])["right/image_raw"] == "r/image_raw"
    transport = nodes[-1].options["parameters"][1]["image_transport"]
    assert transport.words == ("image_transport",)
    assert parameters_of(nodes[3])["depth"] == "depth"
    without = launch("stereo", stereo_depth="false", publish_tf="false")
    assert executables(without) == ["background", *NODES]
    assert parameters_of(without[3])["depth"] == ""


@pytest.mark.parametrize("single_process", ["false", "true"])
def test_the_detector_has_a_process_of_its_own(
    launch: Callable[..., Any], single_process: str
) -> None:
    given = {"single_process": single_process, "camera_info": "/eye/info", "publish_tf": "false"}
    alone = executables(launch("nodes", **given))
    nodes = launch("nodes", detector="true", image="/eye/image", **given)
    assert executables(nodes) == [*alone, "detector"]
    assert parameters_of(nodes[-1])["publish_silhouette"] is False
    assert dict(nodes[-1].options["remappings"])["image_raw"] == "/eye/image"
    if single_process == "true":
        assert "tracker:camera_info:=/eye/info" in nodes[0].options["arguments"]
    else:
        assert parameters_of(nodes[2])["keypoints"] == "detector/keypoints"
        assert dict(nodes[2].options["remappings"]) == {"camera_info": "/eye/info"}


def test_silhouettes_of_the_detector_take_the_place_of_the_background(
    launch: Callable[..., Any],
) -> None:
    given = {"cameras": "[left, right]", "camera_info": "info", "publish_tf": "false"}
    nodes = launch("nodes", silhouettes="detector", **given)
    assert executables(nodes) == ["initializer", "tracker", "detector", "detector"]
    assert namespaces(nodes) == ["", "", "/left", "/right"]
    assert all(parameters_of(node)["publish_silhouette"] for node in nodes[2:])
    names = dict(nodes[1].options["remappings"])
    assert names == {"left/camera_info": "left/info", "right/camera_info": "right/info"}
    for wrong in ({"single_process": "true"}, {"within_m": "2.0", "depth": "depth"}):
        with pytest.raises(Exception, match="silhouettes is detector"):
            launch("nodes", silhouettes="detector", **wrong)


@pytest.mark.parametrize(
    ("more", "is_told"),
    [
        ({}, False),
        ({"stature": "1.75"}, True),
        ({"statures": "[1.75, 1.62]", "people": "2"}, True),
        ({"silhouettes": "detector"}, True),
        ({"silhouettes": "detector", "cameras": "[left, right]"}, True),
    ],
)
def test_the_tracker_is_told_of_distance_and_pitch_if_nobody_is_measured(
    more: dict[str, str], is_told: bool, launch: Callable[..., Any]
) -> None:
    given = {"person_distance_m": "2.5", "camera_pitch_deg": "5.0"}
    nodes = launch("nodes", **more, **given, single_process="false", publish_tf="false")
    by_name = {node.options["name"]: parameters_of(node) for node in nodes}
    for node, expected in (("initializer", True), ("tracker", is_told)):
        assert ({"person_distance_m", "camera_pitch_deg"} <= by_name[node].keys()) is expected


def test_points_of_another_detector_can_be_given(launch: Callable[..., Any]) -> None:
    nodes = launch("nodes", keypoints="/yolo/detections", publish_tf="false")
    assert executables(nodes) == NODES
    assert parameters_of(nodes[2])["keypoints"] == "/yolo/detections"
    assert parameters_of(launch("nodes", publish_tf="false")[2])["keypoints"] == ""


@pytest.mark.parametrize("single_process", ["false", "true"])
def test_what_uses_the_posture_is_started_where_it_is_asked_for(
    launch: Callable[..., Any], single_process: str
) -> None:
    arm = str(ROOT / "config" / "example_arm.urdf")
    given = {"single_process": single_process, "publish_tf": "false"}
    alone = executables(launch("nodes", **given))
    nodes = launch("nodes", rula="true", robot_file=arm, **given)
    assert executables(nodes) == [*alone, "rula", "retarget"]
    assert parameters_of(nodes[-1]) == {"robot_file": arm}


def test_a_joint_map_goes_to_the_robot_that_it_is_for(launch: Callable[..., Any]) -> None:
    config = ROOT / "config"
    both = {
        "robot_file": str(config / "example_arm.urdf"),
        "joint_map_file": str(config / "example_joint_map.yaml"),
    }
    nodes = launch("nodes", **both, publish_tf="false")
    assert parameters_of(nodes[-1]) == both
    with pytest.raises(Exception, match=r"joint_map_file is .*expected it with robot_file"):
        launch("nodes", joint_map_file=both["joint_map_file"])
    assert RUNNING == []


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"first": ""}, "two different namespaces"),
        ({"second": "cam0"}, "two different namespaces"),
        ({"first_device": "/dev/video0"}, "two different devices"),
        ({"single_process": "true"}, "cameras"),
        ({"extrinsics_file": "/nowhere.yaml"}, "a file that exists"),
    ],
)
def test_what_two_cameras_cannot_be_is_said_before_anything_runs(
    given: dict[str, str], expected: str, launch: Callable[..., Any]
) -> None:
    with pytest.raises(Exception, match=expected):
        launch("two_cameras", **given)
    assert RUNNING == []


@pytest.mark.parametrize(
    ("name", "argument", "value", "expected"),
    [
        ("live", "width", "abc", "a whole number from 32 to 8192"),
        ("live", "width", "5", "a whole number from 32 to 8192"),
        ("live", "loop", "yes", "true or false"),
        ("live", "rate_hz", "nan", "a number from 0 to 240"),
        ("live", "rviz", "yes", "true or false"),
        ("live", "single_process", "1", "auto or true or false"),
        ("live", "preset", "papers", "paper or default"),
        ("live", "config_dir", "/nowhere", "a folder"),
        ("live", "file", "/nowhere.mp4", "a file that exists"),
        ("live", "calibration_file", "/nowhere.yaml", "a file that exists"),
        ("live", "cameras", "[left, right]", "nothing: live.launch.py has one camera"),
        ("nodes", "rula", "yes", "true or false"),
        ("nodes", "robot_file", "/nowhere.urdf", "a file that exists"),
        ("nodes", "joint_map_file", "/nowhere.yaml", "a file that exists"),
        ("nodes", "rep155_id", "1st", "a letter, then"),
        ("nodes", "person_distance_m", "-1", "a number from 0.3 to 20"),
        ("nodes", "image_transport", "jpeg", "raw or compressed"),
        ("nodes", "cameras", "[cam 0, cam1]", "a list of different names"),
        ("nodes", "cameras", "[a, a]", "a list of different names"),
        ("stereo", "left", "1st", "a letter, then"),
        ("two_cameras", "width", "5", "a whole number from 32 to 8192"),
        ("replay", "pause_at", "[1, x]", "a list of numbers"),
        ("replay", "rate", "fast", "a number from 0.01 to 100"),
    ],
)
def test_a_wrong_argument_is_named_before_anything_runs(
    name: str, argument: str, value: str, expected: str, launch: Callable[..., Any]
) -> None:
    given = {"bag": "/nowhere", "image": "/i", "camera_info": "/c"} if name == "replay" else {}
    with pytest.raises(Exception, match=f"{argument} is '.*expected {expected}"):
        launch(name, **given, **{argument: value})
    assert RUNNING == []


@pytest.mark.parametrize(
    ("started", "given", "expected"),
    [
        (("cardbox_tracker", "live.launch.py"), "devise:=x", "'devise'; .* device"),
        (("cardbox_tracker", "live.launch.py"), "person_distance:=2", "person_distance_m"),
        (("cardbox_tracker", "nodes.launch.py"), "xyz:=1", "'xyz'; .*background_file"),
        (("launch/stereo.launch.py",), "lefd:=a", "mean left"),
        (("cardbox_tracker", "two_cameras.launch.py"), "first_devise:=x", "mean first_device"),
        (("cardbox_tracker", "replay.launch.py"), "lop:=true", "mean loop"),
    ],
)
def test_a_misspelt_argument_is_named_before_anything_runs(
    started: tuple[str, ...],
    given: str,
    expected: str,
    launch: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "argv", ["ros2", "launch", *started, "rviz:=false", given])
    name = Path(started[-1]).name.removesuffix(".launch.py")
    with pytest.raises(Exception, match=expected) as refused:
        launch(name, bag="/nowhere", image="/i", camera_info="/c")
    assert f"{name}.launch.py" in str(refused.value)
    assert RUNNING == []


@pytest.mark.parametrize("started", [("my_robot", "live.launch.py"), ("my.launch.py",)])
def test_another_launch_file_has_arguments_of_its_own(
    started: tuple[str, ...], launch: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["ros2", "launch", *started, "robot:=mine"])
    assert executables(launch("live", robot="mine", publish_tf="false")) == [*NODES, "camera"]


def test_arguments_are_what_the_parameters_of_the_same_name_are() -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    from lab.tools.parameter_docs import NODES as PARAMETERS

    compared = 0
    for name, of in (("live", "camera"), ("replay", "play_bag"), ("nodes", "")):
        with pytest.MonkeyPatch.context() as patch:
            for module, values in stand_ins(ROOT).items():
                if module.startswith(("launch", "ament")):
                    for parent in {module.partition(".")[0], module}:
                        stand_in = ModuleType(parent)
                        stand_in.__dict__.update(stand_ins(ROOT).get(parent, values))
                        patch.setitem(sys.modules, parent, stand_in)
            loaded = load(name)
        given = {of: tuple(loaded.ARGUMENTS)} if of else loaded.GIVEN
        for node, arguments in given.items():
            specs, types = PARAMETERS[node].specs(), PARAMETERS[node].types()
            for argument in arguments:
                mine, spec = loaded.ARGUMENTS[argument], specs[argument]
                kind = getattr(types[argument], "__origin__", types[argument])
                assert mine.kind is kind or (mine.kind, kind) == (Path, str), argument
                assert set(mine.choices) == set(spec.choices), argument
                if spec.limits is not None:
                    # A parameter may have one more value, for what is not given.
                    assert mine.limits is not None, argument
                    lowest, highest = mine.limits
                    assert spec.limits[0] <= lowest < highest <= spec.limits[1], argument
                compared += 1
    assert compared > 15
