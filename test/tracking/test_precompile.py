"""After the warm-up nothing is left to compile, for any preset and wherever pixels come from."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from queue import Queue

import numpy as np
import pytest
from numba.core.registry import CPUDispatcher

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.camera.view import OtherCamera
from cardbox_tracker.detectors.image_points import POINT_NAMES, ImagePoints
from cardbox_tracker.person.appearance import Appearance, bins_of
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.search.config import PRESETS
from cardbox_tracker.segmentation.background import SilhouetteExtractor
from cardbox_tracker.segmentation.empty_scene import BackgroundLearner
from cardbox_tracker.tracking import precompile
from cardbox_tracker.tracking.estimate import TRACKING
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.precompile import (
    FILM_KERNELS,
    compile_all,
    compile_each,
    compile_for_films,
)
from cardbox_tracker.tracking.tracker import Tracker

ROOT = Path(__file__).resolve().parents[2]
FRONT = reference_posture("front")
CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)


def compiled() -> dict[str, int]:
    """How many versions of each function there are."""
    return {
        f"{module}.{name}": len(value.signatures)
        for module, imported in sys.modules.items()
        if module.startswith("cardbox_tracker.")
        for name, value in vars(imported).items()
        if isinstance(value, CPUDispatcher)
    }


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("preset", PRESETS)
def test_no_image_waits_for_the_compiler(preset: str, channels: int) -> None:
    compile_all()
    before = compiled()
    assert before["cardbox_tracker.terms.cardbox_kernels.trunk_costs"] > 0
    assert before["cardbox_tracker.terms.inner_cue_kernels.ratio_maps"] > 0
    levels = np.random.default_rng(0).integers(0, 255, (5, bins_of(channels))).astype(np.uint8)
    body = BodyModel.of(appearance=Appearance(levels, np.full(channels, 100.0)))
    person = render(cardbox_patches(body, FRONT), CAMERA)
    shape = (240, 320) if channels == 1 else (240, 320, channels)
    learner = BackgroundLearner()
    for _ in range(2):
        learner.add(np.full(shape, 90, np.uint8))
    extractor = SilhouetteExtractor(learner.model())
    tracker = Tracker(body, CAMERA, PRESETS[preset]())
    received = np.frombuffer(np.where(person > 0, 200, 90).astype(np.uint8).tobytes(), np.uint8)
    for image in (received.reshape(240, 320), received.reshape(240, 320).copy()):
        seen = image if channels == 1 else np.repeat(image[..., None], 3, axis=2)
        seen.setflags(write=image.flags.writeable)
        silhouette = extractor(seen)
        read_only = np.frombuffer(silhouette.tobytes(), np.uint8).reshape(silhouette.shape)
        crowded = silhouette.copy()
        crowded[:60, :60] = 255
        for pixels in (silhouette, np.zeros_like(silhouette), crowded, read_only, read_only):
            estimate = tracker.track(pixels, seen)
        assert estimate.state == TRACKING or preset == "default"
        true_m = CAMERA.reference_to_optical(pose(body.rigid, FRONT).keypoints_m)
        assert np.linalg.norm(estimate.keypoints_m - true_m, axis=1).mean() < 0.05
    assert compiled() == before


def test_nor_does_one_of_several_cameras() -> None:
    compile_all()
    before = compiled()
    assert before["cardbox_tracker.terms.arm_points.add_costs_of_arms"] > 0
    body = BodyModel()
    person = render(cardbox_patches(body, FRONT), CAMERA)
    beside = OtherCamera(CAMERA, Extrinsics(np.eye(3), np.array([0.2, 0.0, 0.0])))
    tracker = Tracker(body, CAMERA, PRESETS["default"](), others=[beside])
    for seen in ([person, person], [None, person], [person, None]):
        estimate = tracker.track([Observation(one) for one in seen])
    assert estimate.keypoints_m is not None
    assert compiled() == before


def test_nor_do_the_first_points_of_a_detector() -> None:
    compile_all()
    before = compiled()
    assert before["cardbox_tracker.common.least_squares._add"] > 0
    body = BodyModel()
    person = render(cardbox_patches(body, FRONT), CAMERA)
    count = len(POINT_NAMES)
    px = np.stack([np.linspace(100.0, 220.0, count), np.full(count, 120.0)], axis=1)
    points = ImagePoints(px, np.ones(count), spatial_m=np.eye(count, 3))
    tracker = Tracker(body.with_values(source="proportions"), CAMERA, PRESETS["default"]())
    for given in (points, points, None):
        assert tracker.track(Observation(person, points=given)).posture is not None
    assert compiled() == before


def test_the_list_for_films_has_arguments_that_kernels_are_called_with() -> None:
    compile_all()
    before = compiled()
    for part in json.loads(FILM_KERNELS.read_text()).items():
        compile_each(part)
    # The warm-up does not call all of them.
    called = {name: count for name, count in compiled().items() if before[name]}
    assert called.items() <= before.items(), "run lab.tools.film_kernels"


def test_what_films_need_is_compiled_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[tuple[str, object]] = []
    monkeypatch.setattr(precompile.compiling, "FOLDER", tmp_path)
    monkeypatch.setattr(precompile, "cores", lambda: 1)
    monkeypatch.setattr(precompile, "compile_each", done.append)
    loaded = Queue[dict[str, object]]()
    monkeypatch.setattr(precompile, "_load", loaded.put)
    for _ in range(2):
        compile_for_films()
    assert done == [*json.loads(FILM_KERNELS.read_text()).items()]
    assert loaded.get(timeout=60.0) == dict(done)
    assert loaded.empty()


IN_COPIES = """
import sys
from pathlib import Path
from cardbox_tracker.tracking import precompile
precompile.FILM_KERNELS, precompile.cores = Path(sys.argv[1]), lambda: 2
precompile.compile_for_films()
"""


def test_two_processes_keep_each_kernel_of_the_list(tmp_path: Path) -> None:
    every = json.loads(FILM_KERNELS.read_text())
    few = {
        name: every[name]
        for name in ("search.mirroring", "terms.arm_points", "common.least_squares")
    }
    (tmp_path / "few.json").write_text(json.dumps(few))
    values = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", IN_COPIES, str(tmp_path / "few.json")]
    subprocess.run(command, env=values, check=True, timeout=300)
    kept = {path.name.split("-")[0].split(".", 1)[1] for path in tmp_path.rglob("*.nbc")}
    assert kept == {kernel for kernels in few.values() for kernel in kernels}
    assert len(list(tmp_path.rglob("films-numba-*"))) == 1
