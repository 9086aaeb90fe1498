"""The files that other programs read: CI, pre-commit and Docker name what there is."""

from __future__ import annotations

import re
import shlex
import subprocess
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import pytest
import yaml

from cardbox_tracker.commands.main import build_parser

ROOT = Path(__file__).resolve().parents[1]
TOOLS = {"python", "ruff", "mypy", "pytest"}


def read_yaml(name: str) -> Any:
    return yaml.safe_load((ROOT / name).read_text(encoding="utf-8"))


def jobs() -> dict[str, Any]:
    return dict(read_yaml(".github/workflows/ci.yml")["jobs"])


def hooks() -> list[dict[str, Any]]:
    return [
        hook for repo in read_yaml(".pre-commit-config.yaml")["repos"] for hook in repo["hooks"]
    ]


def dockerfile() -> list[str]:
    """Return the instructions, continuation lines joined, without comments."""
    text = (ROOT / "Dockerfile").read_text(encoding="utf-8")
    text = re.sub(r"(?m)^#.*\n", "", text).replace("\\\n", " ")
    return [" ".join(line.split()) for line in text.splitlines() if line.strip()]


def test_ci_runs_its_script_on_the_python_of_jazzy_and_the_oldest() -> None:
    test = jobs()["test"]
    assert {"run": ".ci/run"} in test["steps"]
    assert (ROOT / ".ci" / "run").is_file()
    versions = test["strategy"]["matrix"]["python"]
    assert versions == ["3.11", "3.12"]
    setup = (ROOT / "setup.py").read_text(encoding="utf-8")
    assert f'python_requires=">={versions[0]}"' in setup
    for version in versions:
        assert f'"Programming Language :: Python :: {version}"' in setup


@pytest.mark.parametrize(
    ("name", "value"), [("licence", "Apache-2.0"), ("ros", "Jazzy"), ("python", "3.11 to 3.14")]
)
def test_badges_say_what_package_xml_and_setup_py_say(name: str, value: str) -> None:
    badge = ElementTree.parse(ROOT / "docs" / "images" / "badges" / f"{name}.svg").getroot()
    assert any((text.text or "").endswith(value) for text in badge.iter())
    said = (ROOT / "setup.py").read_text("utf-8") + (ROOT / "package.xml").read_text("utf-8")
    if name == "python":
        versions = re.findall(r"Python :: (3\.\d+)\"", said)
        assert value == f"{versions[0]} to {versions[-1]}"
    else:
        assert re.search(value, said, re.IGNORECASE)


@pytest.mark.parametrize("hook", hooks(), ids=lambda hook: hook["id"])
def test_hooks_run_what_make_setup_installs(hook: dict[str, Any]) -> None:
    assert hook["language"] == "system"
    program, *words = shlex.split(hook["entry"])
    assert program.removeprefix(".venv/bin/") in TOOLS
    if words[:1] == ["-m"]:
        assert (ROOT / (words[1].replace(".", "/") + ".py")).is_file()


def test_hooks_lint_as_make_lint_does() -> None:
    entries = " ".join(hook["entry"] for hook in hooks())
    for command in re.findall(r"\$\(BIN\)/((?:ruff|mypy)[a-z ]*)", (ROOT / "Makefile").read_text()):
        assert f".venv/bin/{command.strip()}" in entries


def test_the_image_is_made_of_what_is_there() -> None:
    lines = dockerfile()
    assert lines[0] == "FROM ros:jazzy"
    for line in lines:
        if line.startswith("COPY "):
            assert (ROOT / line.split()[1]).exists(), line
    text = "\n".join(lines)
    (skipped,) = re.findall(r'--skip-keys "([^"]*)"', text)
    xml = ElementTree.parse(ROOT / "package.xml").getroot()
    assert set(skipped.split()) <= {element.text for element in xml.findall("exec_depend")}
    for module in re.findall(r"python -m (cardbox_tracker[\w.]*)", text):
        assert (ROOT / (module.replace(".", "/") + ".py")).is_file()


def test_the_image_does_not_take_in_what_is_built() -> None:
    ignored = (ROOT / ".dockerignore").read_text(encoding="utf-8").split()
    assert {".git", ".venv", "build"} <= set(ignored)
    for needed in ("cardbox_tracker", "config", "launch", "resource", "setup.py", "setup.cfg"):
        assert needed not in ignored


def test_rosdoc2_finds_its_settings_and_the_documents() -> None:
    """In the form that it asks for: two sections, and a folder beside package.xml."""
    xml = ElementTree.parse(ROOT / "package.xml").getroot()
    name = xml.findtext("export/rosdoc2")
    assert name is not None
    about, settings = yaml.safe_load_all((ROOT / name).read_text(encoding="utf-8"))
    assert about == {"type": "rosdoc2 config", "version": 1}
    assert settings["settings"] == {"never_run_doxygen": True}
    (builder,) = settings["builders"]
    assert (ROOT / builder["sphinx"]["user_doc_dir"] / "topics.md").is_file()


def test_the_example_is_made_by_commands_that_there_are() -> None:
    text = (ROOT / "Makefile").read_text(encoding="utf-8").replace("\\\n", " ")
    (recipe,) = re.findall(r"(?ms)^example: setup\n(.*?)^\n", text)
    commands = re.findall(r"\$\(BIN\)/cardbox (.*)", recipe)
    assert [words.split()[0] for words in commands] == ["synthesize", "initialize", "track"]
    for words in commands:
        build_parser().parse_args(shlex.split(words))
    assert "/example/" in (ROOT / ".gitignore").read_text(encoding="utf-8").split()


def test_the_citation_is_of_this_version() -> None:
    cited = read_yaml("CITATION.cff")
    xml = ElementTree.parse(ROOT / "package.xml").getroot()
    assert cited["cff-version"] == "1.2.0"
    assert {"message", "title", "authors"} <= set(cited)
    assert cited["version"] == xml.findtext("version")
    assert cited["license"] == xml.findtext("license")
    assert cited["title"] == xml.findtext("name")
    assert cited["repository-code"] == xml.findtext("url[@type='repository']")


def test_make_docs_builds_with_the_extra() -> None:
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert "--fail-on-warning --nitpicky" in text
    (names,) = re.findall(r"extra == \.\(([a-z|]+)\)", text)
    assert "docs" in names.split("|")
    setup = (ROOT / "setup.py").read_text(encoding="utf-8")
    for name in names.split("|"):
        assert f'"{name}": ' in setup


def test_make_dist_installs_neither_ros_nor_the_tools_of_the_tests() -> None:
    words = ["make", "--dry-run", "dist", "VENV=build/no_venv"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    (installed,) = re.findall(r"pip .*install (.*)", done.stdout)
    assert re.fullmatch(r"--quiet 'setuptools[^ ]*'", installed)
    assert "bdist_wheel" in done.stdout
