"""Extrinsics: their files, what cameras publish, and the choice between them."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.extrinsics_files import (
    choose,
    load_extrinsics,
    of_rectified_pair,
    of_transforms,
    save_camchain,
    transforms_of,
)
from cardbox_tracker.camera.view import OtherCamera
from cardbox_tracker.common.errors import CameraError
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.tracking.session import Session


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def random_pose(rng: np.random.Generator) -> Extrinsics:
    return Extrinsics.of_vectors(rng.normal(0, 1, 3), rng.normal(0, 2, 3))


def matrix(pose: Extrinsics) -> list[list[float]]:
    rows = np.column_stack([pose.rotation, pose.translation_m]).tolist()
    return [*rows, [0.0, 0.0, 0.0, 1.0]]


def assert_same(one: Extrinsics, other: Extrinsics) -> None:
    np.testing.assert_allclose(matrix(one), matrix(other), atol=1e-9)


def test_a_chain_of_kalibr_is_taken_from_any_first_camera(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    steps = [random_pose(rng) for _ in range(2)]
    chain: dict[str, Any] = {"cam0": {"rostopic": "/left/image_raw/compressed"}}
    chain |= {f"cam{i}": {"T_cn_cnm1": matrix(step)} for i, step in enumerate(steps, 1)}
    file = tmp_path / "camchain.yaml"
    file.write_text(yaml.safe_dump(chain), encoding="utf-8")
    first = load_extrinsics(file, ["left", "cam1", "cam2"])
    assert_same(first["cam1"], steps[0])
    assert_same(first["cam2"], steps[1].after(steps[0]))
    assert_same(load_extrinsics(file, ["cam2", "cam0"])["cam0"], first["cam2"].inverse())
    with pytest.raises(CameraError, match=r"right; .*cam0, cam1, cam2, left"):
        load_extrinsics(file, ["left", "right"])


def test_a_namespace_that_is_the_key_of_another_camera_is_that_of_the_topic(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    step = random_pose(rng)
    chain: dict[str, Any] = {"cam0": {"rostopic": "/cam1/image_raw"}}
    chain |= {"cam1": {"rostopic": "/cam0/image_raw", "T_cn_cnm1": matrix(step)}}
    file = tmp_path / "camchain.yaml"
    file.write_text(yaml.safe_dump(chain), encoding="utf-8")
    assert_same(load_extrinsics(file, ["cam1", "cam0"])["cam0"], step)


@pytest.mark.parametrize("unit", [1.0, 1000.0])
def test_a_group_of_aniposelib_may_be_in_millimetres(
    tmp_path: Path, rng: np.random.Generator, unit: float
) -> None:
    poses = [Extrinsics.of_vectors(rng.normal(0, 1, 3), [i, 0.5, 2.0]) for i in range(2)]
    text = ""
    for name, pose in zip("ab", poses, strict=True):
        turn = cv2.Rodrigues(pose.rotation)[0].ravel().tolist()
        moved = (unit * pose.translation_m).tolist()
        text += f'[cam_{name}]\nname = "{name}"\nrotation = {turn}\ntranslation = {moved}\n'
    file = tmp_path / "group.TOML"
    file.write_text(text + "[metadata]\nadjusted = false\n", encoding="utf-8")
    assert_same(load_extrinsics(file, ["a", "b"])["b"], poses[1].after(poses[0].inverse()))


def test_a_rotation_vector_of_more_than_a_turn_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "group.toml"
    file.write_text("[a]\nrotation = [0, 45, 0]\ntranslation = [1, 0, 0]\n", encoding="utf-8")
    with pytest.raises(CameraError, match=r"is 45 rad long; .*degrees"):
        load_extrinsics(file, ["a", "b"])


@pytest.mark.parametrize("unit", [1.0, 1000.0])
@pytest.mark.parametrize("ending", ["yml", "xml", "json"])
def test_what_stereo_calibrate_of_opencv_finds_is_the_pose_of_the_second_camera(
    tmp_path: Path, rng: np.random.Generator, ending: str, unit: float
) -> None:
    pose, file = random_pose(rng), tmp_path / f"stereo.{ending}"
    storage = cv2.FileStorage(str(file), cv2.FileStorage_WRITE)
    storage.write("K1", np.eye(3))
    storage.write("R", pose.rotation)
    storage.write("T", unit * pose.translation_m[:, None])
    storage.release()
    assert_same(load_extrinsics(file, ["a", "b"])["b"], pose)
    with pytest.raises(CameraError, match=r"R and T.*Kalibr"):
        load_extrinsics(file, ["a", "b", "c"])


MOVED = np.array(matrix(Extrinsics(np.eye(3), np.array([-0.12, 0.0, 0.0]))))


def chain_of(step: np.ndarray) -> str:
    """Return a camchain of two cameras with any matrix between them."""
    return f"cam0: {{}}\ncam1: {{T_cn_cnm1: {step.tolist()}}}\n".replace("nan", ".nan")


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("x.yaml", "cam0: {}\ncam1: {}\n", "cam1 .*T_cn_cnm1"),
        ("x.yaml", "cam0: {}\ncam1: {T_cn_cnm1: [[1, 2], [3, 4]]}\n", "4 x 4"),
        ("x.yaml", f"cam0: {{}}\ncam1: {{T_cn_cnm1: {np.ones((3, 4)).tolist()}}}\n", "rotation"),
        ("x.yaml", chain_of(np.diag([1.0, 1.0, -1.0, 1.0])), "rotation"),
        ("x.yaml", chain_of(np.diag([2.0, 2.0, 2.0, 1.0])), "rotation"),
        ("x.yaml", chain_of(MOVED.T), "transposed"),
        ("x.yaml", chain_of(np.eye(4) * np.nan), "finite"),
        ("x.yaml", "cam0: [", "pars"),
        ("x.yaml", "R: [1, 2]\nT: [0, 0, 1]\n", "of another type, size or range"),
        ("x.yaml", "- 1", "none"),
        ("x.toml", "cam = 1", "none"),
        ("x.toml", '[a]\nname = "cam0"\nrotation = [1]\ntranslation = [0, 0, 0]', "three numbers"),
        ("missing.yaml", None, "No such file"),
    ],
)
def test_a_file_that_is_none_says_what_is_expected(
    tmp_path: Path, name: str, text: str | None, said: str
) -> None:
    if text is not None:
        (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(CameraError, match=said):
        load_extrinsics(tmp_path / name, ["cam0", "cam1"])


def info(x_m: float = 0.0, turn: np.ndarray | None = None) -> SimpleNamespace:
    p = np.array([(250.0, 0, 160, -250.0 * x_m), (0, 250, 120, 0), (0, 0, 1, 0)])
    return SimpleNamespace(p=p.ravel(), r=(np.eye(3) if turn is None else turn).ravel())


def test_a_rectified_pair_has_its_baseline_in_p(rng: np.random.Generator) -> None:
    found = of_rectified_pair(info(), info(0.12), "right")
    assert found is not None
    np.testing.assert_allclose(found.centre_m, [0.12, 0.0, 0.0], atol=1e-12)
    np.testing.assert_array_equal(found.rotation, np.eye(3))
    assert of_rectified_pair(info(), info(), "right") is None
    with pytest.raises(CameraError, match=r"right's CameraInfo: .*rotation"):
        of_rectified_pair(info(), info(0.12, np.full((3, 3), 7.0)), "right")
    # Images that are not rectified stand as R says.
    left, right = (random_pose(rng).rotation for _ in range(2))
    found = of_rectified_pair(info(turn=left), info(0.12, right), "right")
    assert found is not None
    point = rng.normal(0, 1, 3)
    there = right.T @ (left @ point - [0.12, 0.0, 0.0])
    np.testing.assert_allclose(found.rotation @ point + found.translation_m, there, atol=1e-12)


def stamped(parent: str, child: str, pose: Extrinsics) -> SimpleNamespace:
    """``pose`` brings points of the child into the parent."""
    angle = np.linalg.norm(vector := cv2.Rodrigues(pose.rotation)[0].ravel())
    x, y, z = np.sin(angle / 2) * vector / angle
    xyz = dict(zip("xyz", pose.translation_m.tolist(), strict=True))
    return SimpleNamespace(
        header=SimpleNamespace(frame_id=parent),
        child_frame_id=child,
        transform=SimpleNamespace(
            translation=SimpleNamespace(**xyz),
            rotation=SimpleNamespace(x=x, y=y, z=z, w=np.cos(angle / 2)),
        ),
    )


def test_transforms_are_followed_in_both_directions(rng: np.random.Generator) -> None:
    a, b = random_pose(rng), random_pose(rng)
    message = SimpleNamespace(transforms=[stamped("/base", "one", a), stamped("base", "two", b)])
    found = of_transforms(transforms_of(message), "one", "two")
    assert found is not None
    assert_same(found, b.inverse().after(a))
    assert of_transforms(transforms_of(message), "one", "three") is None


def test_sources_have_an_order_and_have_to_agree() -> None:
    one = Extrinsics(np.eye(3), np.array([-0.12, 0.0, 0.0]), "P of right's CameraInfo")
    near = Extrinsics.of_vectors([0.0, 0.01, 0.0], [-0.13, 0.0, 0.0], "file")
    assert choose([None, one, near], "left", "right") is one
    far = Extrinsics.of_vectors([0.0, np.radians(2.0), 0.0], [-0.12, 0.0, 0.0], "file")
    with pytest.raises(CameraError, match=r"2\.0 degrees"):
        choose([one, None, far], "left", "right")
    with pytest.raises(CameraError, match="--extrinsics FILE"):
        choose([None, None, None], "left", "right")


def test_a_pose_that_is_no_more_than_a_placeholder_is_refused() -> None:
    """No two cameras stand at the same place, whatever their direction."""
    at_first = Extrinsics(np.diag((-1.0, 1.0, -1.0)), np.zeros(3), "rig.yaml")
    with pytest.raises(CameraError, match=r"rig\.yaml.*same place.*placeholder.*--extrinsics"):
        choose([at_first], "left", "right")
    camera = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
    with pytest.raises(CameraError, match="same place"):
        Session([BodyModel()], camera, others=[OtherCamera(camera, at_first)])


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@pytest.mark.parametrize("source", ["P", "/tf_static", "file"])
def test_cameras_in_millimetres_are_told(source: str) -> None:
    there = Extrinsics(np.eye(3), np.array([-120.0, 0.0, 0.0]), source)
    found = [there if name == source else None for name in ("P", "/tf_static", "file")]
    with pytest.raises(CameraError, match=rf"120 m from left \({source}\).*millimetres"):
        choose(found, "left", "right")


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@pytest.mark.parametrize(
    ("part", "values"),
    [
        ("rotation", {"x": np.nan}),
        ("rotation", {"x": 0.0, "y": 0.0, "z": 0.0, "w": 0.0}),
        ("rotation", {"w": np.inf}),
        ("translation", {"x": np.nan}),
        ("translation", {"z": 1e300}),
    ],
)
def test_a_transform_that_is_not_rigid_is_left_out(
    part: str, values: dict[str, float], rng: np.random.Generator
) -> None:
    good, bad = (stamped("left", name, random_pose(rng)) for name in ("right", "third"))
    for axis, value in values.items():
        setattr(getattr(bad.transform, part), axis, value)
    found = transforms_of(SimpleNamespace(transforms=[bad, good]))
    assert [one.child for one in found] == ["right"]
    assert of_transforms(found, "left", "third") is None


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@pytest.mark.timeout(30)
def test_cycles_of_transforms_end(rng: np.random.Generator) -> None:
    pose = random_pose(rng)
    ring = [stamped(f"f{i}", f"f{(i + 1) % 1000}", pose) for i in range(1000)]
    found = transforms_of(SimpleNamespace(transforms=[*ring, stamped("f0", "f0", pose)]))
    assert of_transforms(found, "f0", "f1") is not None
    assert of_transforms(found, "f0", "elsewhere") is None


@pytest.mark.parametrize(
    ("text", "reason"),
    [("a: &a [1]\nb: *a\n", "alias"), ("a: 1\n" * 20_000, "64 kB")],
)
def test_a_file_that_stands_for_more_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "chain.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(CameraError, match=reason):
        load_extrinsics(path, ["cam0", "cam1"])


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "chain.yaml")
    with pytest.raises(CameraError, match="a pipe or a device"):
        load_extrinsics(tmp_path / "chain.yaml", ["cam0", "cam1"])


def test_a_camchain_that_is_written_is_read(tmp_path: Path, rng: np.random.Generator) -> None:
    camera = Camera(320, 240, 300.0, 301.0, 160.0, 119.0)
    names = ["cam0", "/left/colour", "cam9"]
    poses = {name: random_pose(rng) for name in names[1:]}
    file = tmp_path / "extrinsics.yaml"
    save_camchain(file, dict.fromkeys(names, camera), poses)
    found = load_extrinsics(file, names)
    for name in names[1:]:
        assert_same(found[name], poses[name])
