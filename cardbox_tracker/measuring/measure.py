"""Measure the 18 body sizes from three silhouettes (paper, "Offline Model Initialization").

In three steps, O1 (front), O2 (side) and O3 (arms), M hypotheses of a subset of the sizes are drawn
around the best one, A + N(0, sigma_alpha^2 E), and the hypothesis with the lowest cost is kept,
until the accuracy is reached. Extensions to the paper:

- References in a wrong posture are refused by name.
- Shoulder breadth, upper arm, forearm and the height of the shoulder joints are measured before
  the search (:mod:`.skeleton`), because an outline does not determine them.
- In ``arms``, the shoulder joints are higher by the lift of the girdle.
- sigma_alpha starts at the paper's 5 cm and shrinks after each round without improvement; the
  accuracy is reached when it falls below 2 mm.
- Angles and place of the reference posture are estimated together with the sizes, with a prior
  standard deviation of a few degrees around the requested angles.
- A weak prior keeps sizes that an outline hardly shows, such as the height of the chin, near the
  proportions of a person of that stature.
- The three steps are repeated once, since each depends on the results of the others.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.given_arrays import image_from, silhouette_from
from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.common.settings import settings_or
from cardbox_tracker.measuring.config import InitializationConfig, InitializationResult, check_fit
from cardbox_tracker.measuring.outline import filled
from cardbox_tracker.measuring.part_colors import SHRINK, can_learn, learn_appearance
from cardbox_tracker.measuring.reference_checks import check_postures
from cardbox_tracker.measuring.references import (
    POSTURE_TEXT,
    Silhouette,
    check_references,
    lateral_m,
)
from cardbox_tracker.measuring.shoulders import GIRDLE_RISE
from cardbox_tracker.measuring.skeleton import measure_skeleton
from cardbox_tracker.measuring.stature import SHOULDER_TO_HIP, stature_m
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import (
    LEFT_ARM,
    N_JOINTS,
    PITCH,
    REFERENCE_NAMES,
    RIGHT_ARM,
    ROLL,
    TORSO_Y,
    reference_posture,
)
from cardbox_tracker.person.proportions import sizes_of_stature
from cardbox_tracker.person.sizes import (
    N_SIZES,
    SIZE_INDEX,
    SIZE_LIMITS,
    SIZE_NAMES,
    SUBSETS,
    FloatArray,
)
from cardbox_tracker.terms.compiled import CompiledSilhouette
from cardbox_tracker.terms.term import Image

STEPS = (("O1", "front"), ("O2", "side"), ("O3", "arms"))
"""Subset of the sizes and its reference, in the order of the paper."""

# Standard deviations among people of one stature: of lengths along bones, of breadths and depths
# (ANSUR II, 2012, rounded), and the least one.
_LENGTH_SCATTER, _BREADTH_SCATTER, _LEAST_SCATTER_M = 0.06, 0.20, 0.015
_ALONG_BONES = np.array(
    [name.endswith(("length", "height", "drop", "breadth")) for name in SIZE_NAMES]
)
# Sizes that are measured before the search.
_BONES = [
    SIZE_INDEX[name]
    for name in ("shoulder_breadth", "shoulder_drop", "upper_arm_length", "forearm_length")
]
_BREADTH, _DROP, _UPPER_ARM, _FOREARM = _BONES
_TORSO_TOP = [SIZE_INDEX["waist_height"], SIZE_INDEX["torso_height"]]
# Standard deviation of the angles of a reference posture.
_LOOSE_ANGLE_RAD = np.radians(5.0)
# Noise of the place of a reference posture in each round.
_PLACE_NOISE_M = 0.02
# Initial noise of the sizes (paper), and noise at which a step ends, m.
_SIGMA_ALPHA_M, _ACCURACY_M = 0.05, 0.002
# Cost of one standard deviation of a size, as a fraction of the silhouette's pixels.
_PRIOR = 0.003


def initialize_body(
    references: Mapping[str, Silhouette],
    camera: Camera,
    config: InitializationConfig | None = None,
    progress: Callable[[float], None] | None = None,
    images: Mapping[str, Sequence[Image]] | None = None,
) -> InitializationResult:
    """Measure a person and learn the person's colours.

    ``references`` are silhouettes (H, W) of ``front``, ``side`` and ``arms``, of the camera's size,
    or masks of any numeric type, see :func:`~cardbox_tracker.camera.given_arrays.silhouette_from`.
    Without ``images``, (H, W, 3) bgr or (H, W), of ``front`` and ``arms``, the body has no
    appearance.

    Raises InitializationError, with the reference and the remedy, if the references are unusable,
    show other postures, or the model does not fit them; and ValueError if arrays are of another
    size, type or range.
    """
    config = settings_or(InitializationConfig(), config)
    references = {
        name: silhouette_from(references[name], f"reference '{name}'")
        for name in REFERENCE_NAMES
        if name in references
    }
    check_references(references)
    silhouette_from(references["front"], "reference 'front'", (camera.height, camera.width))
    images = images and {
        name: [image_from(image, f"image of the reference '{name}'") for image in images[name]]
        for name in images
    }
    camera = camera.with_pitch(config.camera_pitch_rad)
    references = {name: filled(references[name]) for name in REFERENCE_NAMES}
    if config.check_postures:
        check_postures(references, camera, config.distance_m)
    search = _Search(references, camera, config)
    for number in range(2 * len(STEPS)):
        search.step(*STEPS[number % len(STEPS)])
        if progress is not None:
            progress((number + 1) / (2 * len(STEPS)))
    result = search.result()
    check_fit(result, config)
    if images is None or not can_learn(images, references):
        return result
    appearance = learn_appearance(images, references, result.body, camera, config.seed)
    return replace(result, body=result.body.with_values(appearance=appearance))


class _Search:
    """The state of one initialization: sizes, and posture of each reference."""

    def __init__(
        self, references: Mapping[str, Silhouette], camera: Camera, config: InitializationConfig
    ) -> None:
        self._config = config
        self._references = references
        self._rng = np.random.default_rng(config.seed)
        skeleton = measure_skeleton(references, camera, config.distance_m, config.side_turn)
        if skeleton is None:
            raise InitializationError(
                f"reference 'arms': no arms are seen; capture it again: {POSTURE_TEXT['arms']}"
            )
        stature = stature_m(references["front"], skeleton, camera, config.distance_m)
        self._shoulder_height_m = skeleton.shoulder_height_m
        self._hip_height_m = skeleton.shoulder_height_m - SHOULDER_TO_HIP * stature
        sizes = sizes_of_stature(stature)
        sizes[_BREADTH] = skeleton.shoulder_breadth_m
        sizes[_UPPER_ARM], sizes[_FOREARM] = skeleton.upper_arm_m, skeleton.forearm_m
        sizes = np.clip(sizes, SIZE_LIMITS[:, 0], SIZE_LIMITS[:, 1])
        self._initial = self._with_shoulders_in_place(sizes[None])[0]
        self._sizes = self._initial.copy()
        self._scatter = np.maximum(
            np.where(_ALONG_BONES, _LENGTH_SCATTER, _BREADTH_SCATTER) * self._initial,
            _LEAST_SCATTER_M,
        )
        self._start = BodyModel.of(
            self._sizes,
            distance_m=config.distance_m,
            hip_height_m=self._hip_height_m,
            lateral_m=lateral_m(references["front"], camera, config.distance_m),
            camera_pitch_rad=config.camera_pitch_rad,
            side_turn=config.side_turn,
        )
        self._camera = camera
        self._seen = {}
        self._asked = {}
        self._postures = {}
        for name, silhouette in references.items():
            self._seen[name] = CompiledSilhouette(self._start, camera).look(silhouette)
            self._asked[name] = reference_posture(name, config.side_turn)
            self._postures[name] = self._asked[name].copy()
            self._postures[name][TORSO_Y] = lateral_m(silhouette, camera, config.distance_m)
        self._rounds = dict.fromkeys(SUBSETS, 0)
        self._history: dict[str, list[tuple[float, ...]]] = {subset: [] for subset in SUBSETS}

    def step(self, subset: str, name: str) -> None:
        """Estimate one subset of the sizes and the posture of the reference ``name``."""
        config = self._config
        size_mask = np.zeros(N_SIZES)
        size_mask[SUBSETS[subset]] = 1.0
        size_mask[_BONES] = 0.0
        loose = _loose_joints(name)
        posture_noise = np.where(loose, _LOOSE_ANGLE_RAD, 0.0)
        posture_noise[TORSO_Y] = _PLACE_NOISE_M
        sizes, posture = self._sizes, self._postures[name]
        best = float(self._rate(name, sizes[None], posture[None])[0])
        scale = 1.0
        history = [best]
        for _ in range(config.max_rounds):
            self._rounds[subset] += 1
            noise = self._rng.standard_normal((config.hypotheses, N_SIZES + N_JOINTS)) * scale
            hypotheses = np.clip(
                sizes + noise[:, :N_SIZES] * size_mask * _SIGMA_ALPHA_M,
                SIZE_LIMITS[:, 0],
                SIZE_LIMITS[:, 1],
            )
            hypotheses = self._with_shoulders_in_place(hypotheses)
            postures = posture + noise[:, N_SIZES:] * posture_noise
            # Joint limits do not apply, because the feet turn for the side reference, too.
            costs = self._rate(name, hypotheses, postures)
            winner = int(np.argmin(costs))
            if costs[winner] < best:
                best, sizes, posture = float(costs[winner]), hypotheses[winner], postures[winner]
            else:
                scale *= SHRINK
            history.append(best)
            if scale * _SIGMA_ALPHA_M < _ACCURACY_M:
                break
        self._history[subset].append(tuple(history))
        self._sizes, self._postures[name] = sizes, posture

    def _with_shoulders_in_place(self, sizes: FloatArray) -> FloatArray:
        """Return sizes (N, 18) with ``shoulder_drop`` set to the measured shoulder height."""
        placed = sizes.copy()
        drop_m = self._hip_height_m + sizes[:, _TORSO_TOP].sum(axis=1) - self._shoulder_height_m
        placed[:, _DROP] = np.clip(drop_m, *SIZE_LIMITS[_DROP])
        return placed

    def _rate(self, name: str, sizes: FloatArray, postures: FloatArray) -> FloatArray:
        seen = self._seen[name]
        weight_px = _PRIOR * seen.frame.foreground_px
        size_steps = (sizes - self._initial) / self._scatter
        angle_steps = ((postures - self._asked[name]) / _LOOSE_ANGLE_RAD)[:, 1:]
        prior = np.sum(size_steps**2, axis=1) + np.sum(angle_steps**2, axis=1)
        rated: FloatArray = seen.bodies(_sizes_in(name, sizes), postures) + weight_px * prior
        return rated

    def result(self) -> InitializationResult:
        """Return the sizes, rounded to 0.1 mm, and the fit."""
        start = self._start
        body = start.with_values(
            sizes=np.round(self._sizes, 4),
            hip_height_m=round(float(start.placement.hip_height_m), 4),
            lateral_m=round(float(self._postures["front"][TORSO_Y]), 4),
        )
        iou = {}
        for name, silhouette in self._references.items():
            shown = body.with_values(sizes=_sizes_in(name, body.sizes[None])[0])
            fitted = CompiledSilhouette(shown, self._camera).look(silhouette)
            iou[name] = fitted.overlap(self._postures[name])[1]
        return InitializationResult(body, iou, self._rounds, self._history)


def _sizes_in(name: str, sizes: FloatArray) -> FloatArray:
    """Return sizes (N, 18) in a reference; in ``arms`` the girdle lifts the shoulder joints."""
    if name != "arms":
        return sizes
    lifted = sizes.copy()
    drop_m = sizes[:, _DROP] - GIRDLE_RISE * sizes[:, _BREADTH]
    lifted[:, _DROP] = np.maximum(drop_m, SIZE_LIMITS[_DROP, 0])
    return lifted


def _loose_joints(name: str) -> FloatArray:
    """Return 1 for each joint (12,) that is estimated in the reference, else 0."""
    loose = np.zeros(N_JOINTS)
    if name == "side":
        loose[PITCH] = 1.0
        for arm in (LEFT_ARM, RIGHT_ARM):
            loose[arm] = (0.0, 1.0, 0.0, 1.0)
    else:
        loose[ROLL] = 1.0
        for arm in (LEFT_ARM, RIGHT_ARM):
            loose[arm] = (1.0, 0.0, 1.0, 0.0)
    return loose
