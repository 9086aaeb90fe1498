"""``cardbox initialize``: measure a person from three spans of a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.depth_image import median_depth
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.person_choice import PersonChoice
from cardbox_tracker.measuring.config import InitializationConfig, InitializationResult, fit_text
from cardbox_tracker.measuring.measure import initialize_body
from cardbox_tracker.measuring.references import average_silhouette
from cardbox_tracker.measuring.scale import (
    SCALE_REFERENCES,
    DepthReference,
    depth_scale,
    measured_at_scale,
    measured_scale,
)
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.recordings.measured_scene import frames_of
from cardbox_tracker.recordings.recording import Recording
from cardbox_tracker.recordings.silhouettes import RecordedFrame, SilhouetteSource, TimeSpan

# Further images of one posture add no information.
_MOST_IMAGES = 20


def initialize_from_recording(
    source: SilhouetteSource,
    spans: Mapping[str, TimeSpan],
    config: InitializationConfig,
    progress: Callable[[float], None] | None = None,
    choice: PersonChoice | None = None,
) -> InitializationResult:
    """Measure the person who holds the reference postures in ``spans`` (by reference name).

    Of several people whom a detector finds, ``choice`` means one in each span. Raises CardboxError
    if a span has no image, and InitializationError if the references are unusable or show other
    postures, or the model does not fit them.
    """
    references, images = _references(source, spans, choice)
    return initialize_body(references, source.camera, config, progress, images)


def initialize_at_scale(
    recording: Recording,
    spans: Mapping[str, TimeSpan],
    config: InitializationConfig,
    progress: Callable[[float], None] | None = None,
    choice: PersonChoice | None = None,
) -> InitializationResult:
    """Measure the person with the first camera, and the distance with depth or the second camera.

    The search for the distance begins at that of ``config``. Raises as
    :func:`initialize_from_recording`, also if there are no depth images, or what measures the
    distance does not fit the person.
    """
    scale: Callable[[BodyModel, Camera], float]
    if recording.measures_depth:
        seen = {
            name: _depth_reference(recording, spans[name], name, choice)
            for name in SCALE_REFERENCES
        }
        scale = partial(depth_scale, references=seen)
    else:
        other = recording.sources[1]
        held = {name: _held(other, spans[name], name, choice) for name in SCALE_REFERENCES}
        shown = {name: average_silhouette([f.silhouette for f in held[name]]) for name in held}
        scale = partial(measured_scale, other=recording.others[0], references=shown)

    references, images = _references(recording.first, spans, choice)
    camera = recording.first.camera

    def measure(at: InitializationConfig, is_last: bool) -> InitializationResult:
        return initialize_body(references, camera, at, progress if is_last else None, images)

    return measured_at_scale(measure, config, camera, scale)


def _references(
    source: SilhouetteSource, spans: Mapping[str, TimeSpan], choice: PersonChoice | None
) -> tuple[dict[str, NDArray[np.uint8]], dict[str, list[NDArray[np.uint8]]]]:
    """Return the silhouette of each reference, and some of its images."""
    references, images = {}, {}
    for name, span in spans.items():
        frames = _held(source, span, name, choice)
        references[name] = average_silhouette([frame.silhouette for frame in frames])
        every = -(-len(frames) // _MOST_IMAGES)
        images[name] = [frame.image for frame in frames[::every]]
    return references, images


def _held(
    source: SilhouetteSource, span: TimeSpan, name: str, choice: PersonChoice | None
) -> list[RecordedFrame]:
    """Return the frames of a span with the silhouette of one person."""
    frames = source.held(span, name)
    if choice is None:
        return frames
    chosen = frames_of(choice.scaled(*source.scale), frames, source.camera)
    if not chosen:
        raise CardboxError(f"nobody is seen in the {name} span {span} s; leave --person out")
    return chosen


def _depth_reference(
    recording: Recording, span: TimeSpan, name: str, choice: PersonChoice | None
) -> DepthReference:
    silhouettes, depths_m = [], []
    own = None
    if choice is not None:
        own = {one.stamp_ns: one for one in _held(recording.first, span, name, choice)}
    for taken in recording.frames(span.start_s):
        if taken.time_s > span.end_s:
            break
        frame = taken.frames[0] if own is None else own.get(taken.stamp_ns)
        if frame is not None and taken.depth_m is not None:
            silhouettes.append(frame.silhouette)
            depths_m.append(taken.depth_m)
    if not depths_m:
        raise CardboxError(
            f"no depth image lies in the {name} span {span} s of the recording; give a span in "
            "seconds from its start, another depth topic, or --distance"
        )
    kept = slice(None, None, -(-len(depths_m) // _MOST_IMAGES))
    return DepthReference(average_silhouette(silhouettes), median_depth(depths_m[kept]))


def describe(result: InitializationResult) -> str:
    """Return the body sizes and the fit as text."""
    body, placement = result.body, result.body.placement
    return (
        f"{body}\n"
        f"mid-hip {100 * abs(placement.hip_height_m):.1f} cm "
        f"{'above' if placement.hip_height_m > 0 else 'below'} the camera, "
        f"{placement.distance_m:.3g} m away from it\n"
        f"{fit_text(result)}"
    )
