"""Check of a captured silhouette against the requested reference posture.

The silhouette is compared with rendered outlines of people of mean proportions and several statures
in each reference posture, aligned at the head. So a wrong posture is reported at its capture, while
the person still stands there. :mod:`.reference_checks` makes finer checks of all three references.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.measuring.config import InitializationConfig
from cardbox_tracker.measuring.outline import filled
from cardbox_tracker.measuring.references import (
    COARSE_PX,
    POSTURE_TEXT,
    Silhouette,
    lateral_m,
    rounded_down,
)
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import REFERENCE_NAMES, reference_posture
from cardbox_tracker.person.proportions import sizes_of_stature

LEAST_IOU, CLEARLY = 0.60, 0.10
"""Least IoU with the requested posture, and IoU by which another posture must be better."""

STATURES_M = (1.3, 1.45, 1.6, 1.75, 1.9)
"""Statures of the rendered people."""


FITS, NEARLY, FAR = "fits", "nearly", "far"
"""A capture would be accepted without a warning, or almost; or another posture is shown."""

_SOME_IOU = 0.40


class _Outline(NamedTuple):
    """A rendered person in a posture on the grid, above the hips."""

    name: str  #: reference posture
    mask: NDArray[np.bool_]  #: (h, w); the first row has the top of the head
    column: int  #: middle of head and chest in ``mask``


class LiveFit:
    """Compares silhouettes of one camera with the reference postures."""

    def __init__(self, camera: Camera, config: InitializationConfig) -> None:
        """Draw the outlines of people at the distance of ``config``."""
        self.camera, self.config = camera, config
        self._cell = max(1, camera.width // COARSE_PX)
        grid = camera.scaled(camera.width // self._cell, camera.height // self._cell)
        # The canvas is larger than the image, so that no outline is cut off.
        wide = replace(
            grid.with_pitch(config.camera_pitch_rad),
            width=3 * grid.width,
            height=3 * grid.height,
            cx=grid.cx + grid.width,
            cy=grid.cy + grid.height,
        )
        self._outlines = [
            _outline(name, stature_m, wide, config)
            for stature_m in STATURES_M
            for name in REFERENCE_NAMES
        ]

    def __call__(self, name: str, silhouette: Silhouette) -> str:
        """Return ``fits``, ``nearly`` or ``far`` for a reference's name and a silhouette (H, W)."""
        ious = self.ious(silhouette)
        if ious[name] < _SOME_IOU or max(ious.values()) - ious[name] >= CLEARLY:
            return FAR
        return FITS if ious[name] >= LEAST_IOU else NEARLY

    def ious(self, silhouette: Silhouette) -> dict[str, float]:
        """Return the IoU of the best stature with each reference posture, by name."""
        half = self._cell // 2
        # Holes are filled at full resolution, because narrow parts break on the grid.
        seen = filled(silhouette)[half :: self._cell, half :: self._cell] > 0
        ious = dict.fromkeys(REFERENCE_NAMES, 0.0)
        if not seen.any():
            return ious
        crown = int(np.argmax(seen.any(axis=1)))
        column = _middle_column(seen)
        for outline in self._outlines:
            iou = _iou(seen[crown:], outline.mask, column - outline.column)
            ious[outline.name] = max(ious[outline.name], iou)
        return ious


def check_asked(
    name: str, silhouette: Silhouette, camera: Camera, config: InitializationConfig
) -> str:
    """Return a warning if no posture fits a silhouette (H, W), 0 or 255, else an empty text.

    ``check_reference`` has accepted it. Raises InitializationError, with the name, if another
    reference posture than ``name`` fits better, unless ``config`` has no ``check_postures``.
    """
    if not config.check_postures:
        return ""
    ious = LiveFit(camera, config).ious(silhouette)
    likest = max(ious, key=lambda other: ious[other])
    if ious[likest] >= LEAST_IOU and ious[likest] - ious[name] >= CLEARLY:
        raise InitializationError(
            f"reference '{name}': it looks like '{likest}' (IoU of the outline "
            f"{rounded_down(ious[name])} with '{name}', {rounded_down(ious[likest])} with "
            f"'{likest}'); {POSTURE_TEXT[name]}",
            "Not this posture",
        )
    if ious[name] < LEAST_IOU:
        return (
            f"; warning: the silhouette does not look like '{name}' (IoU of the outline "
            f"{rounded_down(ious[name])}, expected {LEAST_IOU:.2f} or more): check the silhouette "
            f"and the distance ({config.distance_m:g} m), and {POSTURE_TEXT[name]}"
        )
    return ""


def _outline(name: str, stature_m: float, camera: Camera, config: InitializationConfig) -> _Outline:
    body = BodyModel.of(
        sizes_of_stature(stature_m),
        distance_m=config.distance_m,
        hip_height_m=0.0,
        camera_pitch_rad=config.camera_pitch_rad,
        side_turn=config.side_turn,
    )
    drawn = render(cardbox_patches(body, reference_posture(name, config.side_turn)), camera) > 0
    hips = camera.reference_to_optical(np.array([-config.distance_m, 0.0, 0.0]))
    crown = int(np.argmax(drawn.any(axis=1)))
    mask = drawn[crown : max(crown + 1, round(float(camera.project(hips)[1])))]
    return _Outline(name, mask, _middle_column(drawn))


def _middle_column(mask: NDArray[np.bool_]) -> int:
    """Return the middle column of head and chest."""
    plain = Camera(mask.shape[1], mask.shape[0], 1.0, 1.0, 0.0, 0.0)
    return round(lateral_m(mask.astype(np.uint8), plain, 1.0))


def _iou(seen: NDArray[np.bool_], drawn: NDArray[np.bool_], shift: int) -> float:
    """Return the IoU of ``seen`` and ``drawn`` translated to the right by ``shift``."""
    rows = min(len(seen), len(drawn))
    first, last = max(0, -shift), min(drawn.shape[1], seen.shape[1] - shift)
    there = seen[:rows]
    both = np.count_nonzero(there[:, first + shift : last + shift] & drawn[:rows, first:last])
    either = np.count_nonzero(there) + np.count_nonzero(drawn[:rows]) - both
    return both / either if either else 0.0
