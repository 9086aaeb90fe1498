"""The scale of a person from a second camera or from depth images: how far away, and how large.

One camera's outline is the same for a small person who is near and a large one who is far. Scaled
about the first camera's centre, the body stays as it is in its image, but moves through the other
camera's, and through measured depths; where it fits there, it has its true size.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import TORSO_Y, reference_posture
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.errors import BodyModelError, CameraError, InitializationError
from cardbox_tracker.estimation.cost.depth import Depth, DepthTerm
from cardbox_tracker.estimation.cost.terms import DepthImage, Frame
from cardbox_tracker.estimation.cost.view import OtherCamera, View
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.estimation.initialization.config import (
    InitializationConfig,
    InitializationResult,
)
from cardbox_tracker.vision.camera import Camera

_LEAST, _MOST, _STEP = 0.5, 2.0, 0.005
# A silhouette that differs from the body by more than this share of its pixels is another posture.
_LARGEST_SHARE = 0.5
# A person whose depth is known at fewer pixels is not measured by it.
_FEWEST_DEPTHS = 100
_TERM = Depth()

SCALE_REFERENCES = ("front", "arms")
"""Reference postures of which another camera's silhouettes, or depth images, are needed."""

Measure = Callable[[InitializationConfig, bool], InitializationResult]
"""Measures a person with the first camera at the distance of the settings that it is given.

It is called with False, then with True at the distance that was found.
"""


class DepthReference(NamedTuple):
    """What was measured of a reference posture.

    Attributes:
        silhouette: (H, W), 0 or 255.
        depth_m: (H, W), metres along the optical axis; 0 where it is not known.
    """

    silhouette: NDArray[np.uint8]
    depth_m: DepthImage


def measured_with_second(
    measure: Measure,
    config: InitializationConfig,
    camera: Camera,
    other: OtherCamera,
    references: Mapping[str, NDArray[np.uint8]],
) -> InitializationResult:
    """Measure a person with one camera, and how far away they are with another.

    Args:
        measure: with the first camera.
        config: settings; their distance is only where the search begins.
        camera: the first camera, whatever its pitch.
        other: the other camera.
        references: its silhouettes, as for :func:`measured_scale`.

    Raises:
        InitializationError: as ``measure``, or the second camera does not show that person.
    """
    pitched = camera.with_pitch(config.camera_pitch_rad)
    guessed = measure(config, False).body
    scale = measured_scale(guessed, pitched, other, references)
    return _measured_again(measure, config, scale)


def measured_with_depth(
    measure: Measure,
    config: InitializationConfig,
    camera: Camera,
    references: Mapping[str, DepthReference],
) -> InitializationResult:
    """Measure a person with one camera, and how far away they are with depth images.

    Args:
        measure: with that camera.
        config: settings; their distance is only where the search begins.
        camera: whose pixels the depth images have, whatever its pitch.
        references: as for :func:`depth_scale`.

    Raises:
        InitializationError: as ``measure``, or the depth images do not show that person.
    """
    pitched = camera.with_pitch(config.camera_pitch_rad)
    guessed = measure(config, False).body
    return _measured_again(measure, config, depth_scale(guessed, pitched, references))


def _measured_again(
    measure: Measure, config: InitializationConfig, scale: float
) -> InitializationResult:
    # What no outline shows is taken from the proportions of people of that size.
    return measure(replace(config, distance_m=scale * config.distance_m), True)


def measured_scale(
    body: BodyModel,
    camera: Camera,
    other: OtherCamera,
    references: Mapping[str, NDArray[np.uint8]],
) -> float:
    """Return how many times larger, and farther away, ``body`` is than it was measured.

    Args:
        body: measured before ``camera`` at a distance that was assumed.
        camera: the first camera, pitched as it stands.
        other: another camera.
        references: silhouettes (H, W) of the other camera, 0 or 255, by the names of the reference
            postures ``front`` and ``arms``.

    Raises:
        InitializationError: the body fits the other camera's silhouettes at no scale.
    """
    best, share = _best_scale(body, lambda there: _share(there, camera, other, references))
    if share > _LARGEST_SHARE:
        raise InitializationError(
            "the second camera does not show the person of the first one at any distance: check "
            "that it sees the person in the reference postures, and its extrinsics; or give the "
            "distance"
        )
    return best


def depth_scale(body: BodyModel, camera: Camera, references: Mapping[str, DepthReference]) -> float:
    """Return how many times larger, and farther away, ``body`` is than it was measured.

    The model's visible surface is compared with the measured one, see
    :mod:`cardbox_tracker.estimation.cost.depth`.

    Args:
        body: measured before ``camera`` at a distance that was assumed.
        camera: whose pixels the depth images have, pitched as it stands.
        references: by the names of the reference postures ``front`` and ``arms``.

    Raises:
        InitializationError: the depth images do not show the person.
    """
    frames = {
        name: Frame(seen.silhouette, len(seen.silhouette), 1, depth_m=seen.depth_m)
        for name, seen in references.items()
    }
    for name, (silhouette, depth_m) in references.items():
        known = int(np.count_nonzero((silhouette > 0) & (depth_m > 0)))
        if known < _FEWEST_DEPTHS:
            raise InitializationError(
                f"reference '{name}': the depth images know {known} pixels of the person; expected "
                f"{_FEWEST_DEPTHS} or more: check that they show what the camera shows, or give "
                "the distance"
            )
    best, share = _best_scale(body, lambda there: _off_surface(there, camera, frames))
    if share > _LARGEST_SHARE:
        raise InitializationError(
            "the depth images show the person at no distance at which the silhouettes do: check "
            "that they are of the camera that measures, in metres or millimetres; or give the "
            "distance"
        )
    return best


def scaled(body: BodyModel, scale: float) -> BodyModel:
    """Return ``body`` larger and farther away, so that it looks the same.

    Raises:
        BodyModelError: no person is of that size, or nobody stands there.
    """
    place = body.placement
    sizes: FloatArray = scale * body.sizes
    return body.with_values(
        sizes=sizes,
        distance_m=scale * place.distance_m,
        hip_height_m=scale * place.hip_height_m,
        lateral_m=scale * place.lateral_m,
    )


def _best_scale(body: BodyModel, share: Callable[[BodyModel], float | None]) -> tuple[float, float]:
    """Return the scale of ``body`` with the least share, and that; 1 and 1 if all are None."""
    rated: dict[float, float] = {}
    for scale in np.exp(np.arange(np.log(_LEAST), np.log(_MOST), _STEP)).tolist():
        try:
            found = share(scaled(body, scale))
        except BodyModelError:
            continue
        if found is not None:
            rated[scale] = found
    best: float = min(rated, key=lambda scale: rated[scale], default=1.0)
    return best, rated.get(best, 1.0)


def _share(
    there: BodyModel,
    camera: Camera,
    other: OtherCamera,
    references: Mapping[str, NDArray[np.uint8]],
) -> float | None:
    """Mean share of the silhouettes' pixels that differ; None of nobody before that camera."""
    try:
        view = View.of(there, camera, other)
    except CameraError:
        return None
    cost = WholeBodyCost(view.body, view.camera, WholeBodyCostConfig(weight=0.0))
    shares = []
    for name, silhouette in references.items():
        state = _held(name, there)
        seen = view.states(state)
        cost.see(view.upright(silhouette, is_mask=True), seen)
        shares.append(float(cost.bodies(seen[None])[0][0]) if cost.silhouette_px else 1.0)
    return float(np.mean(shares))


def _off_surface(body: BodyModel, camera: Camera, frames: Mapping[str, Frame]) -> float:
    """Mean share of the visible surface that is not where the depth images have it."""
    term = DepthTerm(_TERM, body, camera)
    shares = [
        float(term.observe(frame).postures(_held(name, body)[None])[0]) / term.body_px
        for name, frame in frames.items()
    ]
    return float(np.mean(shares)) + _TERM.expected


def _held(name: str, body: BodyModel) -> FloatArray:
    """Return the state (14,) of somebody who holds a reference posture."""
    state = np.append(reference_posture(name), [0.0, 0.0])
    state[TORSO_Y] = body.placement.lateral_m
    return state
