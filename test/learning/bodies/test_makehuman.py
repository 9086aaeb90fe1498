from __future__ import annotations

import gzip
import json
from pathlib import Path

import numpy as np
import pytest

from learning.bodies.makehuman import Phenotype, draw_phenotype, person
from learning.bodies.rigged import INDEX

CENTRE = {"spine-4": 9, "spine-2": 10, "spine-1": 12, "neck": 14, "head": 15, "head-2": 16}
SIDE = {
    "clavicle": (0.5, 13, 0),
    "shoulder": (2, 13, 0),
    "elbow": (4, 11, 0),
    "hand": (6, 9, 0),
    "upper-leg": (1, 8, 0),
    "knee": (1, 4, 0),
    "ankle": (1, 1, 0),
    "toe-3-1": (1, 0, 1),
}
AVERAGE = "averagemuscle-averageweight"


@pytest.fixture
def assets(tmp_path: Path) -> Path:
    """A person of three triangles (head, foot, a finger), 16 decimetres tall; cubes are points."""
    cubes: dict[str, tuple[float, ...]] = {name: (0, up, 0) for name, up in CENTRE.items()}
    for side, out in (("l", 1), ("r", -1)):
        cubes |= {f"{side}-{name}": (out * x, y, z) for name, (x, y, z) in SIDE.items()}
        for finger, ahead in enumerate((0.3, 0.1, -0.1, -0.3), start=2):
            cubes[f"{side}-finger-{finger}-1"] = (7 * out, 8, ahead)
    skin = [(0, 16, 0), (0.1, 16, 0), (0, 16, 0.1), (1, 0, 0), (1.1, 0, 0), (1, 0, 0.1)]
    skin += [(7, 8, 0), (7.1, 8, 0), (7, 8, 0.1)]
    lines = [f"v {x} {y} {z}" for x, y, z in [*skin, *cubes.values()]]
    lines += ["g body", "f 1/1 2/2 3/3", "f 4 5 6", "f 7 8 9", "g joint-head", "f 10 11 12"]
    folders = ("3dobjs", "mesh_metadata", "rigs/standard", "targets/macrodetails/height")
    for folder in folders:
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "3dobjs/base.obj").write_text("\n".join(lines))
    spans = {f"joint-{name}": [[len(skin) + n] * 2] for n, name in enumerate(cubes)}
    groups = tmp_path / "mesh_metadata/basemesh_vertex_groups.json"
    groups.write_text(json.dumps(spans))
    bones = {"Head": (0, 1, 2), "LeftFoot": (3, 4), "LeftToeBase": (5,), "LThumb": (6, 7, 8)}
    weights = {bone: [[row, 1.0] for row in rows] for bone, rows in bones.items()} | {"Hips": []}
    rig = tmp_path / "rigs/standard/weights.cmu_mb.json"
    rig.write_text(json.dumps({"weights": weights}))
    # An old person is 2 dm taller at the head; all other targets are empty.
    for age in ("young", "old"):
        taller = "# comment\n" + "".join(f"{row} 0 2 0\n" for row in range(3)) * (age == "old")
        files = {f"caucasian-male-{age}": taller, f"universal-male-{age}-{AVERAGE}": ""}
        for name, text in files.items():
            path = tmp_path / f"targets/macrodetails/{name}.target.gz"
            path.write_bytes(gzip.compress(text.encode()))
    return tmp_path


def test_a_person_has_the_wanted_stature_and_level_arms(assets: Path) -> None:
    body = person(assets, Phenotype(stature_m=1.6), "someone")
    assert (body.sex, len(body.vertices), body.faces.shape) == ("male", 9, (3, 3))
    assert body.stature_m == pytest.approx(1.6, abs=1e-5)
    posed = body.in_t_pose()
    arm = 0.2 * np.sqrt(2)
    expected = [[0, 0.2, 1.3], [0, 0.2 + arm, 1.3], [0, 0.2 + 2.5 * arm, 1.3]]
    assert posed.keypoints[:3] == pytest.approx(np.array(expected), abs=1e-5)
    assert body.part[[0, 3, 5, 6]].tolist() == [
        INDEX[name] for name in ("head", "left_foot", "left_foot", "left_hand")
    ]


def test_targets_mix_by_their_amounts(assets: Path) -> None:
    half_old = person(assets, Phenotype(age=1.5, stature_m=1.7), "someone")
    # The head rises by 1 of the 16 decimetres, so that the body needs no other scale.
    assert half_old.in_t_pose().keypoints[0, 2] == pytest.approx(1.3, abs=1e-5)


def test_drawn_people_have_plausible_statures() -> None:
    rng = np.random.default_rng(0)
    people = [draw_phenotype(rng) for _ in range(200)]
    adults = [one for one in people if one.age >= 1]
    assert 0.05 < 1 - len(adults) / len(people) < 0.22
    assert all(1.4 < one.stature_m < 2.0 for one in adults)
    assert all(one.stature_m > 1.0 for one in people)
    assert all(sum(one.origins) == pytest.approx(1) for one in people)
