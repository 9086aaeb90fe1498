"""``cardbox calibrate-extrinsics``: the extrinsics of a recording's cameras, from a person."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from typing import NamedTuple

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.pairing import MOST_CAMERAS, side_by_side
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.measuring.config import InitializationConfig
from cardbox_tracker.measuring.references import average_silhouette
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.initialize import initialize_from_recording
from cardbox_tracker.recordings.silhouettes import RecordedFrame, SilhouetteSource, TimeSpan
from cardbox_tracker.tracking.camera_calibration import (
    CalibratedCamera,
    MovingFrame,
    calibrated_camera,
)

# Images are paired if their stamps differ by at most this.
_TOLERANCE_NS = 50_000_000


class CalibratedCameras(NamedTuple):
    """The calibration of a recording's cameras."""

    body: BodyModel  #: the person, measured by the first camera
    cameras: dict[str, Camera]  #: working cameras by name, the first camera first
    found: dict[str, CalibratedCamera]  #: calibration of each further camera by name


def calibrate_recording(
    path: str | os.PathLike[str],
    cameras: Sequence[str],
    background: TimeSpan,
    references: Mapping[str, TimeSpan],
    motion: TimeSpan,
    config: InitializationConfig,
    progress: Callable[[float], None] | None = None,
) -> CalibratedCameras:
    """Estimate the poses of further cameras in the optical frame of the first one.

    The person faces the first of the namespaces ``cameras`` in the ``references`` ``front``,
    ``side`` and ``arms``. Nobody is in an image of the span ``background``; in ``motion`` the
    person moves, from the posture ``front`` on. Raises CardboxError if the recording or a span is
    unusable, or no pose fits.
    """
    names = [camera.strip("/") for camera in cameras]
    if not 2 <= len(set(names)) == len(names) <= MOST_CAMERAS:
        raise CardboxError(
            f"the cameras are {', '.join(names) or 'none'}; expected two to {MOST_CAMERAS} "
            "different namespaces, such as cam0 cam1"
        )
    with ExitStack() as stack:
        sources = [
            SilhouetteSource(stack.enter_context(BagReader(path)), background, camera=name)
            for name in names
        ]
        first = sources[0]
        body = initialize_from_recording(first, references, config).body
        found = {}
        for number, (name, other) in enumerate(zip(names[1:], sources[1:], strict=True)):
            pairs = {
                what: (
                    average_silhouette([f.silhouette for f in first.held(span, what)]),
                    average_silhouette([f.silhouette for f in other.held(span, what)]),
                )
                for what, span in references.items()
            }
            done = number / len(names[1:])
            found[name] = calibrated_camera(
                body,
                (first.camera, other.camera),
                pairs,
                _moving(first, other, motion),
                config.side_turn,
                config.seed,
                None if progress is None else partial(_part, progress, done, len(names[1:])),
            )
    return CalibratedCameras(
        body, dict(zip(names, (s.camera for s in sources), strict=True)), found
    )


def _part(progress: Callable[[float], None], done: float, parts: int, fraction: float) -> None:
    progress(done + fraction / parts)


def _moving(first: SilhouetteSource, other: SilhouetteSource, span: TimeSpan) -> list[MovingFrame]:
    def stamp_ns(frame: RecordedFrame) -> int:
        return frame.stamp_ns

    moving = []
    streams = [first.frames(*span), other.frames(*span)]
    for one, two in side_by_side(streams, stamp_ns, _TOLERANCE_NS):
        if one is not None and two is not None:
            moving.append(MovingFrame((one.silhouette, two.silhouette), (one.image, two.image)))
    return moving
