"""Metric scale of a person from a second camera or from depth images.

One camera cannot separate a small person nearby from a large person far away. Scaling the body
about the first camera's centre does not change that camera's image, but changes the image of the
second camera and the depths; the best fit to these gives the true scale.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.view import OtherCamera, View
from cardbox_tracker.common.errors import BodyModelError, CameraError, InitializationError
from cardbox_tracker.measuring.config import InitializationConfig, InitializationResult
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.depth import Depth, DepthTerm
from cardbox_tracker.terms.kernel_arguments import body_tuple
from cardbox_tracker.terms.term import DepthImage, Frame, Posed
from cardbox_tracker.terms.whole_body import WholeBodyCost
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig

_MOST, _STEP = 2.0, 0.005
# Largest share of differing pixels of a fit.
_LARGEST_SHARE = 0.5
# Least number of the person's pixels with a known depth.
_FEWEST_DEPTHS = 100
_TERM = Depth()

SCALE_REFERENCES = ("front", "arms")
"""Reference postures that need silhouettes of the second camera, or depth images."""

Measure = Callable[[InitializationConfig, bool], InitializationResult]
"""Function that measures a person with the first camera at the distance of the settings.

Its second argument is False in the first call, and True in the last one at the final distance.
"""


class DepthReference(NamedTuple):
    """Silhouette and depth of a reference posture."""

    silhouette: NDArray[np.uint8]  #: (H, W), 0 or 255
    depth_m: DepthImage  #: (H, W), metres along the optical axis; 0 if unknown


def measured_at_scale(
    measure: Measure,
    config: InitializationConfig,
    camera: Camera,
    scale: Callable[[BodyModel, Camera], float],
) -> InitializationResult:
    """Measure a person with the first camera, and the distance with a second one or depth images.

    The search starts at the distance of ``config``; ``scale`` is :func:`measured_scale` or
    :func:`depth_scale`, given its references. Raises what ``measure`` and ``scale`` do.
    """
    guessed = measure(config, False).body
    found = scale(guessed, camera.with_pitch(config.camera_pitch_rad))
    # The measurement is repeated because sizes that no outline shows depend on the scale.
    return measure(replace(config, distance_m=found * config.distance_m), True)


def measured_scale(
    body: BodyModel,
    camera: Camera,
    other: OtherCamera,
    references: Mapping[str, NDArray[np.uint8]],
) -> float:
    """Return the factor by which size and distance of ``body`` must be multiplied.

    ``camera``, with its pitch, has measured it at an assumed distance; ``references`` are
    silhouettes (H, W), 0 or 255, of the ``other`` camera by the names of the postures. Raises
    InitializationError if the body does not fit them at any scale.
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
    """Return the factor by which size and distance of ``body`` must be multiplied.

    The visible surface of the model is compared with the depth images, see
    :mod:`cardbox_tracker.terms.depth`. Raises InitializationError if these do not show the person.
    """
    frames = {
        name: Frame(
            camera,
            {"silhouette": seen.silhouette, "depth_m": seen.depth_m},
            len(seen.silhouette),
            1,
        )
        for name, seen in references.items()
    }
    for name, (silhouette, depth_m) in references.items():
        known = int(np.count_nonzero((silhouette > 0) & (depth_m > 0)))
        if known < _FEWEST_DEPTHS:
            raise InitializationError(
                f"reference '{name}': the depth images have {known} pixels of the person; expected "
                f"{_FEWEST_DEPTHS} or more: check that they have the view of the camera, or give "
                "the distance"
            )
    best, share = _best_scale(body, lambda there: _off_surface(there, camera, frames))
    if share > _LARGEST_SHARE:
        raise InitializationError(
            "the depth images do not agree with the silhouettes at any distance: check that they "
            "belong to the camera of the silhouettes, and are in metres or millimetres; or give "
            "the distance"
        )
    return best


def scaled(body: BodyModel, scale: float) -> BodyModel:
    """Return ``body`` with sizes and place multiplied by ``scale``, or raise BodyModelError."""
    place = body.placement
    sizes: FloatArray = scale * body.sizes
    return body.with_values(
        sizes=sizes,
        distance_m=scale * place.distance_m,
        hip_height_m=scale * place.hip_height_m,
        lateral_m=scale * place.lateral_m,
    )


def _best_scale(body: BodyModel, share: Callable[[BodyModel], float | None]) -> tuple[float, float]:
    """Return the scale of ``body`` with the least share, and the share; 1 and 1 without any."""
    rated: dict[float, float] = {}
    for scale in np.exp(np.arange(-np.log(_MOST), np.log(_MOST), _STEP)).tolist():
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
    """Return the mean share of differing pixels; None if the body is not before that camera."""
    try:
        view = View.of(there, camera, other)
    except CameraError:
        return None
    cost = WholeBodyCost(view.body, view.camera, WholeBodyCostConfig(weight=0.0))
    shares = []
    for name, silhouette in references.items():
        state = there.reference_state(name)
        seen = view.states(state)
        cost.see(view.upright(silhouette, is_mask=True), seen)
        shares.append(float(cost.bodies(seen[None]).ratings[0]) if cost.silhouette_px else 1.0)
    return float(np.mean(shares))


def _off_surface(body: BodyModel, camera: Camera, frames: Mapping[str, Frame]) -> float:
    """Return the mean share of the visible surface that differs from the depth images."""
    term = DepthTerm(_TERM, body, camera)
    posable = body_tuple(body, camera, WholeBodyCostConfig())
    shares = []
    for name, frame in frames.items():
        seen = term.observe(frame)
        if seen is not None:
            posed = Posed(posable, body.reference_state(name)[None])
            shares.append(float(seen.rate(posed)[0]) / term.body_px)
    return float(np.mean(shares)) + _TERM.expected
