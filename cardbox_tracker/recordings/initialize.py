"""``cardbox initialize``: measure a person from three spans of a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from cardbox_tracker.estimation.initialization.config import (
    InitializationConfig,
    InitializationResult,
    fit_text,
)
from cardbox_tracker.estimation.initialization.measure import initialize_body
from cardbox_tracker.estimation.initialization.references import average_silhouette
from cardbox_tracker.estimation.initialization.scale import (
    SECOND_REFERENCES,
    measured_with_second,
)
from cardbox_tracker.recordings.cameras import CameraSources
from cardbox_tracker.recordings.silhouettes import SilhouetteSource, TimeSpan

# More of one posture look alike.
_MOST_IMAGES = 20


def initialize_from_recording(
    source: SilhouetteSource,
    spans: Mapping[str, TimeSpan],
    config: InitializationConfig,
    progress: Callable[[float], None] | None = None,
) -> InitializationResult:
    """Measure the person who holds the reference postures in ``spans`` (by reference name).

    Raises:
        CardboxError: a span has no image.
        InitializationError: the references are unusable, show other postures than they should, or
            the model does not fit them.
    """
    references, images = {}, {}
    for name, span in spans.items():
        frames = source.held(span, name)
        references[name] = average_silhouette([frame.silhouette for frame in frames])
        every = -(-len(frames) // _MOST_IMAGES)
        images[name] = [frame.image for frame in frames[::every] if frame.image is not None]
    return initialize_body(references, source.camera, config, progress, images)


def initialize_from_cameras(
    sources: CameraSources,
    spans: Mapping[str, TimeSpan],
    config: InitializationConfig,
    progress: Callable[[float], None] | None = None,
) -> InitializationResult:
    """Measure the person with the first camera, and the distance with the second one.

    The distance of ``config`` is only where the search begins.

    Raises:
        CardboxError: a span has no image.
        InitializationError: as :func:`initialize_from_recording`, or the second camera does not
            show that person.
    """
    first, second = sources.sources[:2]
    references = {
        name: average_silhouette([frame.silhouette for frame in second.held(spans[name], name)])
        for name in SECOND_REFERENCES
    }

    def measure(at: InitializationConfig, is_last: bool) -> InitializationResult:
        return initialize_from_recording(first, spans, at, progress if is_last else None)

    return measured_with_second(measure, config, first.camera, sources.others[0], references)


def describe(result: InitializationResult) -> str:
    """Return the sizes and the fit, as text for a person."""
    body, placement = result.body, result.body.placement
    return (
        f"{body}\n"
        f"mid-hip {100 * abs(placement.hip_height_m):.1f} cm "
        f"{'above' if placement.hip_height_m > 0 else 'below'} the camera, "
        f"{placement.distance_m:.3g} m away from it\n"
        f"{fit_text(result)}"
    )
