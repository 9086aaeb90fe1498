"""A robot is read from its URDF; what is damaged or too large is refused in words."""

from __future__ import annotations

import math
import os
import resource
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.applications.retargeting.arm import ArmFollower
from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.robot import load_robot, parse_robot
from cardbox_tracker.common.errors import CardboxError

PROMISE = "Any damaged or hostile input is read or refused with a reason"


ROBOT = load_robot(Path(__file__).parents[3] / "config" / "example_arm.urdf")
URDF = """<robot name="r">
<link name="a"/><link name="b"/><link name="c"/>
<joint name="turns" type="continuous"><parent link="a"/><child link="b"/></joint>
<joint name="slides" type="prismatic"><parent link="b"/><child link="c"/>
<limit lower="0.1" upper="0.4" velocity="0.2" effort="1"/></joint>
</robot>"""


def test_a_robot_is_read() -> None:
    robot = parse_robot(URDF)
    assert robot.links == ("a", "b", "c")
    assert [one.name for one in robot.path("b")] == ["turns"]
    lower, upper, speed = robot.limits_of(("slides", "turns"))
    assert lower == pytest.approx([0.1, -math.pi])
    assert upper == pytest.approx([0.4, math.pi])
    assert speed.tolist() == [0.2, math.inf]


@pytest.mark.parametrize(("upper", "is_asked"), [("1.7", False), ("90", True), ("1e9", False)])
def test_limits_that_seem_to_be_degrees_are_told(upper: str, is_asked: bool) -> None:
    limit = f'type="revolute"><limit lower="0" upper="{upper}" velocity="1"/>'
    robot = parse_robot(URDF.replace('type="continuous">', limit))
    assert ("are these degrees?" in robot.table({"turns": "arm"}, 1.0)) == is_asked


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            '<link name="a"/>',
            "<xacro:arm xmlns:xacro='http://www.ros.org/wiki/xacro'/>",
            "xacro FILE > robot.urdf",
        ),
        ('upper="0.4"', 'upper="${top}"', "xacro FILE > robot.urdf"),
        ("<robot", "<!DOCTYPE r [<!ENTITY a 'b'>]><robot", "defines entities"),
        ("</robot>", "", "expected the URDF"),
        ('upper="0.4"', 'upper="inf"', "slides.* 0.1 to inf"),
        ('upper="0.4"', 'upper="0"', "slides.* 0.1 to 0.0"),
        (
            'lower="0.1" upper="0.4"',
            'lower="x" upper="0.4"',
            "the lower of the limit of the joint slides is 'x'",
        ),
        ('<parent link="b"/>', "", "slides has no parent"),
        ('<child link="c"/>', '<child link="b"/>', "b has two parents"),
        ('<parent link="a"/>', '<parent link="c"/>', "its own ancestor"),
    ],
)
def test_what_is_no_robot_is_told(old: str, new: str, expected: str) -> None:
    with pytest.raises(CardboxError, match=expected):
        parse_robot(URDF.replace(old, new))


@pytest.mark.parametrize("encoding", ["ISO-8859-1", "UTF-16", "utf-8"])
def test_a_robot_is_read_by_its_own_encoding(tmp_path: Path, encoding: str) -> None:
    text = f'<?xml version="1.0" encoding="{encoding}"?><!-- Ärmchen -->{URDF}'
    (tmp_path / "arm.urdf").write_bytes(text.encode(encoding))
    assert list(load_robot(tmp_path / "arm.urdf").joints) == ["turns", "slides"]


@pytest.mark.parametrize("encoding", ["UTF-16", "utf-8"])
def test_entities_are_refused_in_any_encoding(tmp_path: Path, encoding: str) -> None:
    text = f'<?xml version="1.0" encoding="{encoding}"?><!DOCTYPE r [<!ENTITY a "b">]>{URDF}'
    (tmp_path / "arm.urdf").write_bytes(text.encode(encoding))
    with pytest.raises(CardboxError, match="defines entities"):
        load_robot(tmp_path / "arm.urdf")


def test_what_cannot_move_is_told() -> None:
    """A limit without lower and upper is 0 to 0; one of such joints makes no robot useless."""
    still = URDF.replace('lower="0.1" upper="0.4" ', "")
    assert list(parse_robot(still).joints) == ["turns"]
    with pytest.raises(CardboxError, match="the limits of slides are equal, or missing, which is"):
        parse_robot(still.replace("continuous", "fixed"))


def test_names_of_joints_and_links_are_apart_and_a_floating_base_stays() -> None:
    text = URDF.replace(
        '<link name="a"/>',
        '<link name="w"/><link name="a"/><joint name="c" type="floating"><parent link="w"/>'
        '<child link="a"/></joint>',
    )
    robot = parse_robot(text)
    assert list(robot.joints) == ["turns", "slides"]
    assert [one.name for one in robot.path("c")] == ["c", "turns", "slides"]


def test_a_joint_with_hardly_a_range_stays() -> None:
    text = URDF.replace('upper="0.4"', 'upper="0.100000000001"')
    assert list(parse_robot(text).joints) == ["turns"]


def test_who_mimics_a_mimic_follows_its_leader() -> None:
    """With c = 3 b + 0.5 and b = 2 a - 1, c is 6 a - 2.5."""
    text = chain(3)
    for joint, mimic in (
        ("j1", "<mimic joint='j0' multiplier='2' offset='-1'/>"),
        ("j2", "<mimic joint='j1' multiplier='3' offset='0.5'/>"),
    ):
        text = text.replace(
            f"name='{joint}' type='revolute'>", f"name='{joint}' type='revolute'>{mimic}"
        )
    found = parse_robot(text).all_joints["l3"]
    assert (found.mimics, found.multiplier, found.offset) == ("j0", 6.0, -2.5)


def test_what_a_robot_lacks_is_told(tmp_path: Path) -> None:
    with pytest.raises(CardboxError, match=r"joint 'wheel'; .*shoulder_roll"):
        ROBOT.limits_of(("wheel",))
    with pytest.raises(CardboxError, match=r"link 'foot'; .*base_link"):
        ROBOT.path("foot")
    with pytest.raises(CardboxError, match="No such file"):
        load_robot(tmp_path / "missing.urdf")


def chain(count: int, kind: str = "revolute", more: str = "") -> str:
    """Return a robot of ``count`` joints in a row, each 0.1 m from the one before."""
    links = "".join(f"<link name='l{i}'/>" for i in range(count + 1))
    joints = "".join(
        f"<joint name='j{i}' type='{kind}'><parent link='l{i}'/><child link='l{i + 1}'/>"
        f"<origin xyz='0 0 0.1'/><axis xyz='{'1 0 0' if i % 2 else '0 1 0'}'/>"
        "<limit lower='-1' upper='1' velocity='1' effort='1'/></joint>"
        for i in range(count)
    )
    return f"<robot name='r'>{links}{joints}{more}</robot>"


BOMB = "".join(f"<!ENTITY e{i} '{f'&e{i - 1};' * 10 if i else 'x' * 10}'>" for i in range(10))
TOO_LARGE = {
    "nested 5,000 deep": ("<a>" * 5000 + "</a>" * 5000, "32 levels"),
    "nested 5,000 deep in a robot": (chain(2, more="<a>" * 5000 + "</a>" * 5000), "32 levels"),
    "300 joints": (chain(300), "128 degrees"),
    "20,000 joints": (chain(20_000), "128 degrees"),
    "20,000 fixed joints": (chain(20_000, "fixed"), "1000 joints"),
    "30 floating joints": (chain(30, "floating"), "128 degrees"),
    "a million elements": (chain(2, more="<a/>" * 10**6), "100000 elements"),
    "an entity bomb": (f"<!DOCTYPE r [{BOMB}]><robot name='&e9;'/>", "defines entities"),
    "an outside entity": ("<!DOCTYPE r [<!ENTITY e SYSTEM 'file:///etc/passwd'>]><r/>", "entities"),
    "an outside grammar": ("<!DOCTYPE r SYSTEM 'http://localhost/r.dtd'><r/>", "entities"),
}


@pytest.mark.promise(PROMISE)
@pytest.mark.parametrize("name", TOO_LARGE)
def test_what_is_too_large_is_refused_at_once(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    text, words = TOO_LARGE[name]
    built = "cardbox_tracker.applications.retargeting.robot._robot"
    monkeypatch.setattr(built, lambda _: pytest.fail("it was built"))
    with pytest.raises(CardboxError, match=f"arm.urdf .*{words}"):
        parse_robot(text, "arm.urdf")


@pytest.mark.promise("No input fills memory, disk or log, or holds up a program")
def test_only_a_file_of_some_size_is_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("/dev/zero")
    with (tmp_path / "huge").open("wb") as file:
        file.truncate(10**10)
    for name, words in (("pipe", "a pipe"), ("link", "a device"), ("huge", "16 MB"), (".", "dir")):
        with pytest.raises(CardboxError, match=words):
            load_robot(tmp_path / name)


def test_what_a_large_robot_takes_is_bounded() -> None:
    robot = parse_robot(chain(128))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert len(ArmFollower(robot, RetargetConfig()).joints) == 128
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000


def follower(text: str) -> ArmFollower:
    return ArmFollower(parse_robot(text, "arm.urdf"), RetargetConfig())


ARM = chain(4)
ORIGIN, ROOT, LIMIT = "0 0 0.1", "'l0'", "upper='1'"
LIMITS = "<limit lower='-1' upper='1' velocity='1' effort='1'/>"
IMPOSSIBLE = {
    "an origin that is nan": (ORIGIN, "0 0 nan", "xyz of the origin of the joint j0"),
    "an arm of 10^100 m": (ORIGIN, "0 0 1e100", "three finite numbers"),
    "an arm in millimetres": (ORIGIN, "0 0 100", "200 m long"),
    "an arm without length": (ORIGIN, "0 0 0", "0 m long"),
    "a missing limit": (LIMITS, "", "no limit"),
    "a limit of nan": (LIMIT, "upper='nan'", "limits -1.0 to nan"),
    "an infinite limit": (LIMIT, "upper='inf'", "limits -1.0 to inf"),
    "a limit of 10^308": (LIMIT, "upper='1e308'", "limits -1.0 to 1e[+]308"),
    "a speed of nan": ("velocity='1'", "velocity='nan'", "the speed nan"),
    "a cycle": (f"<parent link={ROOT}/>", "<parent link='l4'/>", "own ancestor"),
    "its own parent": (f"<parent link={ROOT}/>", "<parent link='l1'/>", "own ancestor"),
    "two roots": ("</robot>", "<link name='l9'/></robot>", "no joint leads to"),
    "a missing link": ("<link name='l2'/>", "", "a link that the description lacks"),
    "a link twice": (
        "<link name='l2'/>",
        "<link name='l2'/><link name='l2'/>",
        "two links have one name",
    ),
    "commas between angles": (
        f"<origin xyz='{ORIGIN}'",
        f"<origin rpy='0,0,1' xyz='{ORIGIN}'",
        "rpy of the origin of the joint j0 is '0,0,1'.*spaces between",
    ),
    "a factor that is no number": (
        LIMITS,
        f"{LIMITS}<mimic joint='j1' offset='a'/>",
        "offset of the mimic",
    ),
    "its own leader": (LIMITS, f"{LIMITS}<mimic joint='j0'/>", "j0 mimic each other"),
    "a name with a NUL": ("l0", "l\0", "not XML"),
}


@pytest.mark.promise(PROMISE)
@pytest.mark.parametrize("name", IMPOSSIBLE)
def test_what_cannot_be_is_refused_in_words(name: str) -> None:
    old, new, words = IMPOSSIBLE[name]
    assert old in ARM
    with pytest.raises(CardboxError, match=words):
        follower(ARM.replace(old, new))


def test_no_mesh_is_opened(tmp_path: Path) -> None:
    """A mesh is a pipe, which nobody writes to: opening it would last for ever."""
    os.mkfifo(tmp_path / "mesh.stl")
    files = (f"file://{tmp_path}/mesh.stl", "package://../../../dev/zero", "http://localhost/m.dae")
    shapes = "".join(
        f"<{what}><geometry><mesh filename='{file}'/></geometry></{what}>"
        for file in files
        for what in ("visual", "collision")
    )
    plain = follower(ARM)
    drawn = follower(ARM.replace("<link name='l1'/>", f"<link name='l1'>{shapes}</link>"))
    assert drawn.kinematics.reach_m == plain.kinematics.reach_m == pytest.approx(0.2)


JUNK = st.sampled_from(
    [
        *("nan", "inf", "-1e308", "", "x", "'", "<", "&#0;", "]]>", "<!--", "<joint/>", "universe"),
        *("l0", "l4", "j0", "fixed", "floating", "planar", "continuous", "prismatic", "mimic"),
    ]
)


@pytest.mark.promise(PROMISE)
@given(st.lists(st.tuples(st.integers(0, len(ARM)), st.integers(0, 12), JUNK), max_size=4))
def test_a_damaged_description(places: list[tuple[int, int, str]]) -> None:
    text = ARM
    for begin, length, junk in places:
        text = text[:begin] + junk + text[begin + length :]
    try:
        robot = parse_robot(text)
    except CardboxError as error:
        assert 0 < len(str(error)) < 2000
    else:
        assert robot.joints
