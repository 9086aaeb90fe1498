"""Calls functions around compiled code with arrays as they are described, line by line.

``test_kernels.py`` runs this program, because what such an array may cause ends a process. A line
of the input is JSON: ``call``, ``size``, ``numbers``, and ``arrays``, each with the keys of
:func:`array_of`. The answer is a line: empty if the function returned or refused the arrays in
words, else the error; and how many of the arrays it took.
"""

from __future__ import annotations

import json
import os
import sys
import traceback
from collections.abc import Callable, Iterator
from functools import cache, partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.given_arrays import depth_from, image_from, silhouette_from
from cardbox_tracker.camera.view import OtherCamera
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.image_points import POINT_NAMES, ImagePoints
from cardbox_tracker.person.appearance import PARTS, Appearance, bins_of
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.search.config import PRESETS
from cardbox_tracker.segmentation.absorption import StillRegions
from cardbox_tracker.segmentation.background import SilhouetteExtractor, segment_foreground
from cardbox_tracker.segmentation.chroma import ChromaModel, ChromaScore
from cardbox_tracker.segmentation.empty_scene import BackgroundLearner, BackgroundModel
from cardbox_tracker.segmentation.light import LightFollower
from cardbox_tracker.segmentation.regions import clean_silhouette, find_regions
from cardbox_tracker.segmentation.shadows import decide_shadows
from cardbox_tracker.segmentation.window import Window, window_of
from cardbox_tracker.terms.compiled import CompiledSilhouette
from cardbox_tracker.terms.depth import Depth
from cardbox_tracker.terms.inner_cue import InnerCue
from cardbox_tracker.terms.kernel_arguments import body_tuple
from cardbox_tracker.terms.outline import Outline, signed_distances
from cardbox_tracker.terms.term import Frame, Posed
from cardbox_tracker.terms.whole_body import WholeBodyCost
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.person_region import PersonRegion, StillThings
from cardbox_tracker.tracking.precompile import quickest
from cardbox_tracker.tracking.tracked_camera import TrackedCamera
from cardbox_tracker.tracking.tracker import Tracker

CAMERA = Camera(48, 32, 50.0, 50.0, 23.5, 15.5)
SIZE = (CAMERA.height, CAMERA.width)
BODY = BodyModel()
STATE = BODY.reference_state()
POSABLE = body_tuple(BODY, CAMERA)
# It lies on its side.
BESIDE = OtherCamera(CAMERA, Extrinsics.of_vectors((0.0, 0.0, 1.5), (0.1, 0.0, 0.0)))
CONTENTS = ("person", "mask", "one", "any", "special", "unit")
LAYOUTS = ("C", "F", "strided", "reversed", "read-only", "unaligned")
TYPES = ("?", "u1", "i1", "u2", ">u2", "i4", "f2", "f4", ">f4", "f8")

Take = Callable[..., Any]


def array_of(shape: tuple[int, ...], kind: str, content: str, seed: int, layout: str) -> np.ndarray:
    """Return an array of random content, in one of ``LAYOUTS``."""
    rng = np.random.default_rng(seed)
    if content == "person":
        values = np.zeros(shape)
        middle = tuple(slice(length // 4, length - length // 3) for length in shape[:2])
        values[middle] = 255
    elif content in ("mask", "one"):
        values = rng.integers(0, 2, shape) * (255.0 if content == "mask" else 1.0)
    elif content == "any":
        values = rng.uniform(-300, 300, shape) if rng.random() < 0.5 else rng.uniform(0, 255, shape)
    elif content == "special":
        values = rng.choice([np.nan, np.inf, -np.inf, 1e300, -1e9, 0.0, 1.0, 255.0], shape)
    else:
        values = rng.uniform(0, 1, shape)
    with np.errstate(all="ignore"):
        array = np.asarray(values).astype(kind)
    if layout == "F":
        return np.asfortranarray(array)
    if layout == "strided":
        return np.repeat(array, 2, axis=-1)[..., ::2] if array.ndim else array
    if layout == "reversed":
        return np.ascontiguousarray(array[::-1])[::-1] if array.ndim else array
    if layout == "unaligned":
        data = np.zeros(array.nbytes + 1, np.uint8)
        moved = data[1:].view(array.dtype).reshape(shape)
        moved[...] = array
        return moved
    array.setflags(write=layout != "read-only")
    return array


def taker(queue: Iterator[dict[str, Any]], size: tuple[int, int]) -> Take:
    """Return what makes the next described array.

    The shape and type that a function expects hold unless the description has others.
    """

    def take(
        kind: str = "u1", shape: tuple[int, ...] | None = None, more: tuple[int, ...] = ()
    ) -> np.ndarray:
        one = next(queue)
        given = one["shape"] if one["shape"] is not None else (*(shape or size), *more)
        kind = one["type"] or kind
        return array_of(tuple(given), kind, one["content"], one["seed"], one["layout"])

    return take


def window(numbers: Iterator[int]) -> Window | None:
    edges = [next(numbers) for _ in range(4)]
    return None if edges[0] < 0 else Window(*edges)


@cache
def terms() -> SimpleNamespace:
    """What is made once for the body and the camera."""
    looks = Appearance(np.zeros((len(PARTS), bins_of(3)), np.uint8), np.full(3, 128.0))
    colored = BODY.with_values(appearance=looks)
    return SimpleNamespace(
        region=PersonRegion(BODY, CAMERA),
        silhouette=CompiledSilhouette(BODY, CAMERA),
        whole=WholeBodyCost(BODY, CAMERA, WholeBodyCostConfig()),
        depth=Depth().build(BODY, CAMERA),
        inner=InnerCue().build(colored, CAMERA),
        tracker=Tracker(colored, CAMERA, quickest(PRESETS["default"]().with_depth())),
        beside=TrackedCamera(BODY, CAMERA, PRESETS["default"]().with_depth(), BESIDE),
        things=StillThings(),
    )


def score_chroma(take: Take, numbers: Iterator[int]) -> None:
    small = (3, *(max(length // 2, 1) for length in take.size))  # type: ignore[attr-defined]
    score = ChromaScore(ChromaModel(take("f4", small), take("f4", small)), 3.0, 2.0, 0.5, True)
    score(take("u1", small), take.size, window(numbers))  # type: ignore[attr-defined]


def find_still(take: Take, _: Iterator[int]) -> None:
    regions = StillRegions(15)
    for _image in range(3):
        regions.add(take(), take(), 1.0)


def follow_light(take: Take, _: Iterator[int]) -> None:
    light = LightFollower(take("f4"))
    for _image in range(2):
        light.follow(take())
        light.exclude(take())


def extract(take: Take, numbers: Iterator[int]) -> None:
    small = (3, *(max(length // 2, 1) for length in take.size))  # type: ignore[attr-defined]
    chroma = ChromaModel(take("f4", small), take("f4", small)) if next(numbers) % 2 else None
    extractor = SilhouetteExtractor(BackgroundModel(take("f4"), take("f4"), chroma))
    for _ in range(2):
        extractor(take(more=(3,)))
        extractor(take())


def learn_background(take: Take, _: Iterator[int]) -> None:
    learner = BackgroundLearner()
    for _image in range(2):
        learner.add(take(more=(3,)))
    SilhouetteExtractor(learner.model())(take(more=(3,)))


def decide(take: Take, numbers: Iterator[int]) -> None:
    part = window(numbers)
    sides = None if part is None else (part.bottom - part.top, part.right - part.left)
    colored = None
    if next(numbers) % 2:
        colored = take("u1", sides if sides is None or min(sides) >= 0 else None)
    decide_shadows(take(), take("f4"), take("f4"), colored, 0.6, 0.1, part)


def compare_things(take: Take, _: Iterator[int]) -> None:
    things = terms().things
    things.learn(image_from(take(more=(3,))), take())
    things.compare(image_from(take(more=(3,))))


def select_person(take: Take, numbers: Iterator[int]) -> None:
    image = image_from(take("u1", SIZE, (3,)), size=SIZE) if next(numbers) % 2 else None
    state = STATE if next(numbers) % 2 else None
    terms().region.select(take("u1", SIZE), state, bool(next(numbers) % 2), image)


def frame_of(**channels: np.ndarray) -> Frame:
    return Frame(CAMERA, channels, 20, 100)


def rate(take: Take, _: Iterator[int]) -> None:
    seen = terms().silhouette.observe(frame_of(silhouette=take("u1", SIZE)))
    seen.postures(np.where(np.isfinite(found := take("f8", (3, 12))), found, 0.0))
    seen.polygons(np.abs(take("f8", (3, 2, 4, 3))))


def rate_bodies(take: Take, _: Iterator[int]) -> None:
    whole = terms().whole
    whole.see(take("u1", SIZE), STATE)
    whole.bodies(STATE + 0.01 * np.arange(3)[:, None])
    whole.fix_torso(STATE)
    whole.pairs(np.tile(STATE, (3, 1)))
    whole.bearing()


def rate_depth(take: Take, _: Iterator[int]) -> None:
    states, depth_m = take("f8", (2, 14)), depth_from(take("f4", SIZE), size=SIZE)
    silhouette = silhouette_from(take("u1", SIZE), size=SIZE)
    seen = terms().depth.observe(frame_of(silhouette=silhouette, depth_m=depth_m))
    seen.rate(Posed(POSABLE, states))


def measure_outline(take: Take, numbers: Iterator[int]) -> None:
    silhouette = silhouette_from(take("u1", SIZE), size=SIZE)
    signed_distances(silhouette, float(next(numbers) - 20))
    Outline(silhouette, CAMERA, (0.2, 0.1 * next(numbers))).residuals(Posed(POSABLE, STATE[None]))


def rate_colors(take: Take, _: Iterator[int]) -> None:
    silhouette = silhouette_from(take("u1", SIZE), size=SIZE)
    image = image_from(take("u1", SIZE, (3,)), size=SIZE)
    frame = frame_of(silhouette=silhouette, image=image)
    seen = terms().inner.observe(frame.changed(before=Posed(POSABLE, STATE[None])))
    seen.rate(Posed(POSABLE, STATE[None]))


def turn_upright(take: Take, numbers: Iterator[int]) -> None:
    count = len(POINT_NAMES)
    points = ImagePoints(take("f8", (count, 2)), take("f8", (count,)))
    before = STATE if next(numbers) % 2 else None
    seen = Observation(take("u1", SIZE), take("u1", SIZE, (3,)), take("f4", SIZE), points=points)
    frame = terms().beside.frame(seen, before, bool(next(numbers) % 2))
    for term in terms().beside.terms:
        observation = term.observe(frame)
        posed = Posed(POSABLE, STATE[None])
        if observation is not None:
            observation.rate(posed), observation.residuals(posed), observation.evidence(posed)


def track(take: Take, numbers: Iterator[int]) -> None:
    mask, image = take("u1", SIZE), take("u1", SIZE, (3,))
    depth_m = take("f4", SIZE) if next(numbers) % 2 else None
    points = None
    if next(numbers) % 2:
        count = len(POINT_NAMES)
        points = ImagePoints(take("f8", (count, 2)), take("f8", (count,)))
    terms().tracker.track(Observation(mask, image, depth_m, points=points))


def track_any_size(take: Take, numbers: Iterator[int]) -> None:
    height, width = take.size  # type: ignore[attr-defined]
    camera = Camera(width, height, *2 * [max(height, width)], (width - 1) / 2, (height - 1) / 2)
    preset = PRESETS["default" if next(numbers) % 2 else "paper"]()
    tracker = Tracker(BODY, camera, quickest(preset.with_depth()))
    for _image in range(2):
        tracker.track(Observation(take(), take(more=(3,)), take("f4")))


CALLS: dict[str, Callable[[Take, Iterator[int]], Any]] = {
    "silhouette_from": lambda take, _: silhouette_from(take()),
    "image_from": lambda take, _: image_from(take(more=(3,))),
    "depth_from": lambda take, _: depth_from(take("f4")),
    "find_regions": lambda take, _: find_regions(take()),
    "clean_silhouette": lambda take, numbers: clean_silhouette(
        take(), 0.01, 0.01 * next(numbers), None
    ),
    "window_of": lambda take, _: window_of(take()),
    "segment_foreground": lambda take, _: segment_foreground(
        take("f4"), take("f4"), take("f4"), 0.5
    ),
    "decide_shadows": decide,
    "ChromaScore": score_chroma,
    "StillRegions": find_still,
    "LightFollower": follow_light,
    "SilhouetteExtractor": extract,
    "BackgroundLearner": learn_background,
    "StillThings": compare_things,
    "PersonRegion": select_person,
    "CompiledSilhouette": rate,
    "WholeBodyCost": rate_bodies,
    "DepthTerm": rate_depth,
    "outlines": measure_outline,
    "InnerCueTerm": rate_colors,
    "TrackedCamera": turn_upright,
    "Tracker": track,
    "Tracker of any size": track_any_size,
}


def answer(described: dict[str, Any], queue: Iterator[dict[str, Any]]) -> str:
    """Call a function; return the text of an error that is no refusal."""
    size = tuple(described["size"])
    take: Any = partial(taker(queue, size))
    take.size = size
    try:
        CALLS[described["call"]](take, iter(described["numbers"]))
    except (CardboxError, ValueError) as error:
        return "" if 0 < len(str(error)) < 2000 else f"a refusal of {len(str(error))} characters"
    except Exception:
        return traceback.format_exc()
    return ""


def main() -> None:
    """Answer until the input ends."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        described = json.loads(line)
        queue = iter(described["arrays"])
        error = answer(described, queue)
        taken = len(described["arrays"]) - len(list(queue))
        print(json.dumps((error, taken)), file=answers, flush=True)


if __name__ == "__main__":
    np.seterr(all="ignore")
    main()
