"""The whole-body filter's model of one person before one camera, as argument of the kernels."""

from __future__ import annotations

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.kinematics import girdle_of
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import BOTTOM, FOREARM, HEAD, HEIGHT, NECK, WAIST, shape_of
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.kernel_arguments import BodyTuple, intrinsics_of, place_of
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig

# Overlap of neck and head, as a fraction of the head's height: an outline has no gap below the jaw.
_NECK_INTO_HEAD = 0.25


def body_tuple(
    body: BodyModel, camera: Camera, config: WholeBodyCostConfig | None = None
) -> BodyTuple:
    """Return the fields of :class:`~.kernel_arguments.Body` of a body before a camera."""
    config = config or WholeBodyCostConfig()
    parts, _ = shape_of(body.sizes, config.neck_to_head)
    drawn = _drawn_parts(parts, config)
    return parts, drawn, girdle_of(body), place_of(body), intrinsics_of(camera)


def _drawn_parts(parts: FloatArray, config: WholeBodyCostConfig) -> FloatArray:
    """Return the parts (6, 6) whose outlines are drawn."""
    drawn = parts.copy()
    drawn[WAIST, BOTTOM] -= config.waist_extension_m
    drawn[WAIST, HEIGHT] += config.waist_extension_m
    into_m = _NECK_INTO_HEAD * parts[HEAD, HEIGHT]
    drawn[NECK, HEIGHT] += into_m
    drawn[FOREARM, HEIGHT] += config.fingers_m
    return drawn
