"""The package holds together: metadata agree, what is declared exists, the core knows no ROS."""

from __future__ import annotations

import ast
import importlib
import re
import runpy
import shutil
import subprocess
import sys
import tarfile
import xml.etree.ElementTree as ElementTree
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import setuptools

import cardbox_tracker

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ROOT / "cardbox_tracker"
CORE = (
    *("common", "person", "camera", "segmentation", "detectors", "terms", "search"),
    *("measuring", "tracking"),
)
CORE_FILES = sorted(path for folder in CORE for path in (SOURCES / folder).rglob("*.py"))
OUTER = ("recordings", "applications", "ros", "commands")
MESSAGES = (
    "builtin_interfaces",
    "diagnostic_msgs",
    "geometry_msgs",
    "rcl_interfaces",
    "rosgraph_msgs",
    "sensor_msgs",
    "std_msgs",
    "std_srvs",
    "trajectory_msgs",
    "visualization_msgs",
)
ROS = ("rclpy", "rosbags", "launch", "launch_ros", "ament_index_python", *MESSAGES)

# What setup.py requires, but rosdep has no key for.
WITHOUT_KEY = {"av", "rosbags"}

# Folders of a checkout that are not installed.
CHECKOUT = ("lab",)


@cache
def setup_arguments() -> dict[str, Any]:
    """What setup.py says."""
    caught: dict[str, Any] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(setuptools, "setup", lambda **values: caught.update(values))
        patch.chdir(ROOT)
        runpy.run_path(str(ROOT / "setup.py"))
    return caught


@cache
def package_xml() -> ElementTree.Element:
    return ElementTree.parse(ROOT / "package.xml").getroot()


@cache
def imported_by(path: Path) -> set[str]:
    """Full names of the modules that a file imports, wherever in it."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            assert node.module is not None
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


def declared(*left_out: str) -> set[str]:
    """Distributions that setup.py requires, in small letters, without version and extra."""
    arguments = setup_arguments()
    extras = arguments["extras_require"].items()
    lists = [arguments["install_requires"], *(v for k, v in extras if k not in left_out)]
    return {re.split(r"[\[<>=!~; ]", line)[0].lower() for lines in lists for line in lines}


def test_versions_agree() -> None:
    version = cardbox_tracker.__version__
    assert re.fullmatch(r"\d+\.\d+\.\d+", version)
    assert setup_arguments()["version"] == version
    assert package_xml().findtext("version") == version
    released = [heading.split()[0] for heading in changelog_headings() if heading != FORTHCOMING]
    assert released[0] == version


FORTHCOMING = "Forthcoming"


def changelog_headings() -> list[str]:
    text = (ROOT / "CHANGELOG.rst").read_text(encoding="utf-8")
    return [
        heading
        for heading, line in re.findall(r"^(\S.*)\n(-+)$", text, re.MULTILINE)
        if len(heading) == len(line)
    ]


def test_the_changelog_has_the_form_of_rep_132() -> None:
    first, *rest = changelog_headings()
    versions = rest if first == FORTHCOMING else [first, *rest]
    assert versions, "no version was released"
    for heading in versions:
        assert re.fullmatch(r"\d+\.\d+\.\d+ \(\d{4}-\d{2}-\d{2}\)", heading)


@pytest.mark.filterwarnings("ignore:nodes.Node.traverse:DeprecationWarning")
def test_catkin_reads_changelog_and_manifest() -> None:
    changelog = pytest.importorskip("catkin_pkg.changelog", reason="catkin_pkg is not installed")
    package = pytest.importorskip("catkin_pkg.package", reason="catkin_pkg is not installed")
    versions = list(changelog.get_changelog_from_path(str(ROOT)).foreach_version())
    # What is forthcoming is no version yet.
    headings = [heading.split()[0] for heading in changelog_headings() if heading != FORTHCOMING]
    assert [version for version, _, _ in versions] == headings
    assert all(content for _, _, content in versions)
    warnings: list[str] = []
    assert package.parse_package(str(ROOT / "package.xml"), warnings=warnings).name
    assert warnings == []


def test_names_and_licence_agree() -> None:
    arguments, xml = setup_arguments(), package_xml()
    assert arguments["name"] == xml.findtext("name") == cardbox_tracker.__name__
    assert arguments["license"] == xml.findtext("license") == "Apache-2.0"
    licence = (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert "Apache License" in licence
    assert "Version 2.0" in licence
    maintainer = xml.find("maintainer")
    assert maintainer is not None
    assert arguments["maintainer"] == maintainer.text
    assert arguments["maintainer_email"] == maintainer.get("email")
    assert xml.findtext("export/build_type") == "ament_python"
    urls = {url.get("type"): url.text for url in xml.findall("url")}
    assert set(urls) == {"website", "repository", "bugtracker"}
    assert arguments["url"] == urls["website"]
    assert set(arguments["project_urls"].values()) == {urls["repository"], urls["bugtracker"]}


@pytest.mark.parametrize(
    "script", setup_arguments()["entry_points"]["console_scripts"], ids=lambda s: s.split()[0]
)
def test_every_executable_is_a_function(script: str) -> None:
    _, target = script.split(" = ")
    module, function = target.split(":")
    if ".ros." in module:
        pytest.importorskip("rclpy", reason="rclpy is not installed")
    assert callable(getattr(importlib.import_module(module), function))


def installed_data(folder: Path, *, in_wheel: bool) -> list[str]:
    """Install the data of setup.py in ``folder``, as pip and colcon do; return the files."""
    arguments = setup_arguments()
    distribution = setuptools.Distribution(
        {name: arguments[name] for name in ("name", "version", "cmdclass")}
    )
    if in_wheel:
        distribution.get_command_obj("bdist_wheel")
    command = distribution.get_command_obj("install_data")
    command.install_dir = str(folder)
    command.data_files = []
    command.ensure_finalized()
    command.run()
    files = [path for path in folder.rglob("*") if path.is_file()]
    assert sorted(command.get_outputs()) == sorted(map(str, files))
    return sorted(path.relative_to(folder).as_posix() for path in files)


@pytest.mark.filterwarnings("ignore:setup.py install is deprecated")
def test_ros2_run_finds_what_pip_installs(tmp_path: Path) -> None:
    """It looks for executables in lib/cardbox_tracker, where colcon puts them."""
    scripts = setup_arguments()["entry_points"]["console_scripts"]
    names = sorted(script.split(" = ")[0] for script in scripts)
    found = installed_data(tmp_path / "an environment", in_wheel=True)
    assert found == [f"lib/cardbox_tracker/{name}" for name in names]
    assert installed_data(tmp_path / "colcon", in_wheel=False) == []
    program = tmp_path / "an environment" / "bin" / "tracker"
    program.parent.mkdir()
    program.write_text('#!/bin/sh\nprintf "%s," "$@"\nexit 3\n')
    program.chmod(0o755)
    words = [str(program.parents[1] / "lib" / "cardbox_tracker" / "tracker"), "a b", "--ros-args"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.stdout, done.returncode) == ("a b,--ros-args,", 3)


def test_every_node_of_the_design_is_an_executable() -> None:
    scripts = setup_arguments()["entry_points"]["console_scripts"]
    names = {script.split(" = ")[0] for script in scripts}
    assert names >= {"cardbox", "background", "initializer", "tracker", "camera", "play_bag"}


def test_installed_data_exist_and_none_is_forgotten() -> None:
    installed = [name for _, names in setup_arguments()["data_files"] for name in names]
    assert all((ROOT / name).is_file() for name in installed)
    for folder in ("config", "launch"):
        there = {
            f"{folder}/{path.name}"
            for path in (ROOT / folder).iterdir()
            if path.is_file() and not path.name.startswith(".")
        }
        assert there <= set(installed)
        assert there
    assert "package.xml" in installed
    assert "resource/cardbox_tracker" in installed


def test_data_inside_the_package_are_installed_with_it() -> None:
    patterns = setup_arguments()["package_data"]
    installed = {
        path
        for package, names in patterns.items()
        for name in names
        for path in (ROOT / package.replace(".", "/")).glob(name)
    }
    files = {
        path for path in SOURCES.rglob("*") if path.is_file() and "__pycache__" not in str(path)
    }
    assert {path for path in files if path.suffix != ".py"} == installed
    assert all(patterns.values())


@pytest.mark.slow
def test_a_wheel_made_of_the_sdist_has_all_files_of_the_package(tmp_path: Path) -> None:
    tree = tmp_path / "tree"
    ignored = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for name in ("cardbox_tracker", "config", "launch", "resource"):
        shutil.copytree(ROOT / name, tree / name, ignore=ignored)
    for name in ("setup.py", "setup.cfg", "pyproject.toml", "package.xml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, tree)
    build_in(tree, "sdist")
    (sdist,) = (tree / "dist").glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        archive.extractall(tmp_path, filter="data")
    unpacked = tmp_path / sdist.name.removesuffix(".tar.gz")
    build_in(unpacked, "bdist_wheel")
    (wheel,) = (unpacked / "dist").glob("*-py3-none-any.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if name.startswith("cardbox_tracker/")}
    expected = {
        path.relative_to(tree).as_posix()
        for path in (tree / "cardbox_tracker").rglob("*")
        if path.is_file()
    }
    assert names == expected


def build_in(folder: Path, command: str) -> None:
    words = [sys.executable, "setup.py", "--quiet", command]
    subprocess.run(words, cwd=folder, check=True, capture_output=True)


def test_every_folder_is_a_package() -> None:
    folders = {p.parent for p in SOURCES.rglob("*.py")}
    names = {".".join(folder.relative_to(ROOT).parts) for folder in folders}
    assert set(setup_arguments()["packages"]) == names


@pytest.mark.parametrize("path", CORE_FILES, ids=lambda p: str(p.relative_to(SOURCES)))
def test_the_core_knows_neither_ros_nor_what_uses_it(path: Path) -> None:
    forbidden = (*ROS, *(f"cardbox_tracker.{name}" for name in OUTER))
    found = [
        name
        for name in imported_by(path)
        if any(name == other or name.startswith(f"{other}.") for other in forbidden)
    ]
    assert found == []


def test_the_rule_for_the_core_would_find_an_offender(tmp_path: Path) -> None:
    offender = tmp_path / "offender.py"
    imports = ("from cardbox_tracker.ros import qos", "import rclpy.node")
    offender.write_text("\n    ".join(("def late():", *imports)))
    assert set(imported_by(offender)) == {
        "cardbox_tracker.ros",
        "cardbox_tracker.ros.qos",
        "rclpy.node",
    }


def test_recordings_are_handled_without_rclpy() -> None:
    """What 'cardbox initialize' and 'cardbox track' import, other than in functions."""
    for folder in ("recordings", "applications"):
        for path in (SOURCES / folder).rglob("*.py"):
            assert not [n for n in imported_by(path) if n.split(".")[0] in ("rclpy", *MESSAGES)]


def test_a_module_imports_no_private_name_of_another_one_and_nothing_of_a_checkout() -> None:
    for path in SOURCES.rglob("*.py"):
        for name in imported_by(path):
            assert name.split(".")[0] not in CHECKOUT, f"{path} imports {name}"
            last = name.split(".")[-1]
            assert not last.startswith("_") or last.startswith("__"), f"{path} imports {name}"


def outside(folder: Path) -> set[str]:
    """Return the packages that the Python files of a folder import from elsewhere."""
    files = folder.rglob("*.py")
    names = {name.split(".")[0] for path in files for name in imported_by(path)}
    return names - set(sys.stdlib_module_names) - {"cardbox_tracker", *CHECKOUT}


def test_what_is_imported_is_declared() -> None:
    distributions = {
        "ai_edge_litert": "ai-edge-litert",
        "cv2": "opencv-python-headless",
        "PIL": "pillow",
        "rerun": "rerun-sdk",
        "rerun_cli": "rerun-sdk",
        "yaml": "pyyaml",
    }
    from_ros = {"rclpy", "ament_index_python", "launch", "launch_ros", *MESSAGES}
    in_xml = {element.text for element in package_xml().findall("exec_depend")}
    # A user installs the package without what its tests need.
    of_users = {SOURCES: declared("test"), ROOT / "launch": declared("test")}
    for folder, known in (of_users | {ROOT / name: declared() for name in CHECKOUT}).items():
        for name in sorted(outside(folder)):
            if name in from_ros:
                assert name in in_xml, f"{name} is not in package.xml"
            else:
                assert distributions.get(name, name).lower() in known, f"{name} is not in setup.py"


def test_what_launch_files_start_is_declared() -> None:
    in_xml = {element.text for element in package_xml().findall("exec_depend")}
    for path in (ROOT / "launch").glob("*.py"):
        started = set(re.findall(r'package="(\w+)"', path.read_text(encoding="utf-8")))
        assert started <= in_xml | {"cardbox_tracker"}, path.name


def test_what_tests_import_is_declared() -> None:
    keys = {"PIL": "python3-pil", "yaml": "python3-yaml", "cv2": "python3-opencv"}
    in_xml = {
        element.text
        for kind in ("exec_depend", "test_depend")
        for element in package_xml().findall(kind)
    }
    for name in sorted(outside(ROOT / "test") - WITHOUT_KEY):
        assert in_xml & {name, keys.get(name, f"python3-{name}")}, f"{name} is not in package.xml"


def test_what_pip_requires_rosdep_requires() -> None:
    keys = {
        "opencv-python-headless": "python3-opencv",
        "pillow": "python3-pil",
        "pyyaml": "python3-yaml",
    }
    in_xml = {element.text for element in package_xml().findall("exec_depend")}
    for line in setup_arguments()["install_requires"]:
        name = re.split(r"[<>=]", line)[0].lower()
        if name not in WITHOUT_KEY:
            assert keys.get(name, f"python3-{name}") in in_xml


def test_ci_runs_make_test_and_nothing_else() -> None:
    lines = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("#!")
    commands = [line for line in lines[1:] if line.strip() and not line.startswith(("#", "set "))]
    assert commands == ['cd "$(dirname "$0")/.."', "exec make test"]
    assert (ROOT / ".ci" / "run").stat().st_mode & 0o111
