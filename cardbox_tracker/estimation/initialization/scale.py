"""The scale of a person from a second camera: how far away they are, and how large.

One camera's outline is the same for a small person who is near and a large one who is far. Scaled
about the first camera's centre, the body stays as it is in its image, but moves through the other
camera's; where it fits there, it has its true size.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import reference_posture
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.errors import BodyModelError, CameraError, InitializationError
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

SECOND_REFERENCES = ("front", "arms")
"""Reference postures of which the second camera's silhouettes are needed."""


def measured_with_second(
    measure: Callable[[InitializationConfig, bool], InitializationResult],
    config: InitializationConfig,
    camera: Camera,
    other: OtherCamera,
    references: Mapping[str, NDArray[np.uint8]],
) -> InitializationResult:
    """Measure a person with one camera, and how far away they are with another.

    Args:
        measure: measures them with the first camera at the distance of the settings it is given;
            called with False, then with True at the distance found.
        config: settings; their distance is only where the search begins.
        camera: the first camera, whatever its pitch.
        other: the other camera.
        references: its silhouettes, as for :func:`measured_scale`.

    Raises:
        InitializationError: as ``measure``, or the second camera does not show that person.
    """
    guessed = measure(config, False).body
    pitched = camera.with_pitch(config.camera_pitch_rad)
    scale = measured_scale(guessed, pitched, other, references)
    # Again, since what no outline shows is taken from the proportions of people of that size.
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
    rated = {
        scale: share
        for scale in np.exp(np.arange(np.log(_LEAST), np.log(_MOST), _STEP)).tolist()
        if (share := _share(body, scale, camera, other, references)) is not None
    }
    best: float = min(rated, key=lambda scale: rated[scale], default=1.0)
    if rated.get(best, 1.0) > _LARGEST_SHARE:
        raise InitializationError(
            "the second camera does not show the person of the first one at any distance: check "
            "that it sees the person in the reference postures, and its extrinsics; or give the "
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


def _share(
    body: BodyModel,
    scale: float,
    camera: Camera,
    other: OtherCamera,
    references: Mapping[str, NDArray[np.uint8]],
) -> float | None:
    """Mean share of the silhouettes' pixels that differ; None of an impossible body."""
    try:
        there = scaled(body, scale)
        view = View.of(there, camera, other)
    except (BodyModelError, CameraError):
        return None
    cost = WholeBodyCost(view.body, view.camera, WholeBodyCostConfig(weight=0.0))
    shares = []
    for name, silhouette in references.items():
        state = np.append(reference_posture(name), [0.0, 0.0])
        state[0] = there.placement.lateral_m
        seen = view.states(state)
        cost.see(view.upright(silhouette, is_mask=True), seen)
        shares.append(float(cost.bodies(seen[None])[0][0]) if cost.silhouette_px else 1.0)
    return float(np.mean(shares))
