"""Compilation of all kernels into the cache on disk, so that tracking starts without delay.

The installation, the tests and the tracker's node run all of it before their work begins. Commands
that track a film with the preset ``default`` need only a part, which several processes compile.
"""

from __future__ import annotations

import gc
import json
import logging
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import Any

import numba
import numpy as np
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.camera.view import OtherCamera
from cardbox_tracker.common import compiling
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.processes import cores, shared_calls
from cardbox_tracker.common.progress import progress_bar
from cardbox_tracker.detectors.image_points import POINT_NAMES, ImagePoints, LegPoints
from cardbox_tracker.person.appearance import PARTS, Appearance, bins_of
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.search.config import PRESETS, TrackerConfig
from cardbox_tracker.segmentation import background
from cardbox_tracker.terms.compiled import CompiledSilhouette
from cardbox_tracker.tracking import person_region
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.tracker import Tracker

FILM_KERNELS = Path(__file__).with_name("film_kernels.json")
"""Arguments of each kernel that ``cardbox demo`` calls, by module; those that take longest first.

An argument is a list of arguments or an array: its dimensions, ``r`` if it is read-only, its type.
``python -m lab.tools.film_kernels`` writes it; a kernel that is not in it is compiled when called.
"""

_LOG = logging.getLogger(__name__)


def compile_for_films() -> None:
    """Compile what films need with the preset ``default`` on all cores, unless it has been done.

    What has been compiled is loaded beside, by a thread, while images are read.
    """
    if compiling.FOLDER is None:
        return
    done = compiling.FOLDER / f"films-numba-{numba.__version__}"
    listed = json.loads(FILM_KERNELS.read_text(encoding="utf-8"))
    if done.exists():
        Thread(target=_load, args=(listed,), daemon=True).start()
        return
    # Copies of this process then need not load these.
    cpu_target.typing_context.refresh()
    cpu_target.target_context.refresh()
    try:
        # A copy would wait forever for another thread that compiles in this process.
        with progress_bar("compile, the first time only") as show, global_compiler_lock:
            for fraction in shared_calls(compile_each, [*listed.items()], cores()):
                show(fraction)
        done.touch()
    except (CardboxError, OSError) as error:
        _LOG.warning("the first images wait for code that could not be compiled: %s", error)


def _load(listed: Mapping[str, Mapping[str, Sequence[Any]]]) -> None:
    # The call that needs the code finds the fault.
    with suppress(*compiling.DAMAGED, MemoryError):
        for part in listed.items():
            compile_each(part)


def compile_each(part: tuple[str, Mapping[str, Sequence[Any]]]) -> None:
    """Compile kernels of one module in :data:`FILM_KERNELS`; most call the same other ones."""
    name, kernels = part
    module = import_module(f"cardbox_tracker.{name}")
    # The search for garbage would take a sixth of the time; it follows.
    gc.disable()
    try:
        for function, arguments in kernels.items():
            kernel = getattr(module, function)
            kernel.compile(tuple(kernel.typeof_pyval(_example(one)) for one in arguments))
    finally:
        gc.enable()


def _example(argument: str | Sequence[Any]) -> Any:
    """Return a value of the type of an argument in :data:`FILM_KERNELS`."""
    if not isinstance(argument, str):
        return tuple(_example(one) for one in argument)
    array = np.zeros((0,) * int(argument[0]), argument[-2:])
    array.setflags(write="r" not in argument)
    return array if array.ndim else array[()]


def compile_all(
    presets: Sequence[str] = tuple(PRESETS),
    *,
    several_cameras: bool = True,
    points: bool = True,
) -> None:
    """Track a drawn person with each of ``presets``, which compiles all their kernels.

    Compiled code that is damaged is made again. ``several_cameras`` and ``points`` say whether a
    further camera, where a preset allows it, and points of a detector are tracked, too.
    """
    try:
        if "default" in presets:
            compile_for_films()
        _call_all(presets, several_cameras, points)
    except compiling.DAMAGED:
        compiling.discard()
        _call_all(presets, several_cameras, points)


def _call_all(presets: Sequence[str], several_cameras: bool, points: bool) -> None:
    background.warm_up()
    person_region.warm_up()
    body = BodyModel()
    camera = Camera(96, 72, 99.0, 99.0, 47.5, 35.5)
    beside = OtherCamera(camera, Extrinsics(np.eye(3), np.array([0.1, 0.0, 0.0])))
    silhouette = render(cardbox_patches(body, reference_posture("front")), camera)
    CompiledSilhouette(body, camera).warm_up()
    px, scores = np.full((len(POINT_NAMES), 2), 36.0), np.ones(len(POINT_NAMES))
    some = ImagePoints(px, scores, legs=LegPoints(px[:8], scores[:8]))
    found = (None, None, some, some) if points else (None, None)
    for name in presets:
        # Images with and without colour, since terms that use them are compiled for both.
        for shape in (silhouette.shape, (*silhouette.shape, 3)):
            channels = shape[2] if len(shape) == 3 else 1
            looks = Appearance(
                np.zeros((len(PARTS), bins_of(channels)), np.uint8), np.full(channels, 128.0)
            )
            config = quickest(PRESETS[name]())
            image = np.full(shape, 128, np.uint8)
            is_several = several_cameras and config.has_several_views
            for others in ((), (beside,)) if is_several else ((),):
                person = body.with_values(appearance=looks)
                tracker = Tracker(person, camera, config, others=others)
                for given in found:
                    one = Observation(silhouette, image, points=given)
                    tracker.track([one] * (1 + len(others)))


def quickest(config: TrackerConfig) -> TrackerConfig:
    """Return ``config`` with the smallest number of states that its filter allows."""
    if config.filter == "hierarchical":
        return config.with_particles(2)
    return config.changed({"whole_body": {"effort": 0.25}})


if __name__ == "__main__":
    compile_all()
