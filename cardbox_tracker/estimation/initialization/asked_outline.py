"""Whether a silhouette looks like the posture that was asked for, before anybody is measured.

It is compared with the outlines of people of mean proportions and several statures, who stand where
the silhouette's head is, in each reference posture. That tells a wrong posture at the moment of the
capture, while the person still stands there; what is finer is left to :mod:`.reference_checks`,
which knows all three references.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.cardbox import cardbox_patches
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import REFERENCE_NAMES, TORSO_Y, reference_posture
from cardbox_tracker.body.proportions import sizes_of_stature
from cardbox_tracker.errors import InitializationError
from cardbox_tracker.estimation.initialization.config import InitializationConfig
from cardbox_tracker.estimation.initialization.outline import filled
from cardbox_tracker.estimation.initialization.references import POSTURE_TEXT, lateral_m
from cardbox_tracker.estimation.initialization.standing import at_height_of
from cardbox_tracker.estimation.initialization.wording import rounded_down
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.rasterisation import render

Silhouette = NDArray[np.uint8]

# Nine synthetic people, 1.40 to 1.94 m, have 0.63 to 0.89 with the posture that they hold, and 0.60
# at most with another one.
LEAST_IOU, CLEARLY = 0.60, 0.10

STATURES_M = (1.3, 1.45, 1.6, 1.75, 1.9)
"""Of the people whose outlines are compared."""


def outline_ious(
    silhouette: Silhouette, camera: Camera, config: InitializationConfig
) -> dict[str, float]:
    """Return the overlap (IoU) with each reference posture, by name, of the best stature.

    Args:
        silhouette: (H, W), 0 or 255, of the camera's size.
        camera: working camera.
        config: distance, pitch and the turn of the side reference.
    """
    view = camera.with_pitch(config.camera_pitch_rad)
    seen = filled(silhouette) > 0
    ious = dict.fromkeys(REFERENCE_NAMES, 0.0)
    for stature_m in STATURES_M:
        body = BodyModel.of(
            sizes_of_stature(stature_m),
            distance_m=config.distance_m,
            camera_pitch_rad=config.camera_pitch_rad,
            side_turn=config.side_turn,
        )
        body = at_height_of(silhouette, body, view)
        hips = view.reference_to_optical(
            np.array([-config.distance_m, 0.0, body.placement.hip_height_m])
        )
        row = int(np.clip(view.project(hips)[1], 1, view.height))
        for name in REFERENCE_NAMES:
            posture = reference_posture(name, config.side_turn)
            posture[TORSO_Y] = lateral_m(silhouette, view, config.distance_m)
            drawn = render(cardbox_patches(body, posture), view)[:row] > 0
            union = np.count_nonzero(drawn | seen[:row])
            iou = np.count_nonzero(drawn & seen[:row]) / union if union else 0.0
            ious[name] = max(ious[name], iou)
    return ious


def check_asked(
    name: str, silhouette: Silhouette, camera: Camera, config: InitializationConfig
) -> str:
    """Refuse a silhouette that shows another reference posture than ``name``.

    Args:
        name: ``front``, ``side`` or ``arms``.
        silhouette: usable (H, W), 0 or 255, of the camera's size.
        camera: working camera.
        config: see :func:`outline_ious`; without ``check_postures`` nothing is said.

    Returns:
        A warning for the person if it looks like none of them, else nothing.

    Raises:
        InitializationError: the text names the posture that it looks like.
    """
    if not config.check_postures:
        return ""
    ious = outline_ious(silhouette, camera, config)
    likest = max(ious, key=lambda other: ious[other])
    if ious[likest] >= LEAST_IOU and ious[likest] - ious[name] >= CLEARLY:
        raise InitializationError(
            f"reference '{name}': it looks like '{likest}' (outline's IoU "
            f"{rounded_down(ious[name])} with '{name}', {rounded_down(ious[likest])} with "
            f"'{likest}'); {POSTURE_TEXT[name]}",
            "Not this posture",
        )
    if ious[name] < LEAST_IOU:
        return (
            f"; warning: it looks little like '{name}' (outline's IoU {rounded_down(ious[name])}, "
            f"expected {LEAST_IOU:.2f} or more): check the silhouette and the distance "
            f"({config.distance_m:g} m), and {POSTURE_TEXT[name]}"
        )
    return ""
