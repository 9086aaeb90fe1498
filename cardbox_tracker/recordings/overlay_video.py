"""Writer of the overlay video of ``cardbox track --video``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from cardbox_tracker.drawing.overlay import draw_overlay, readable_scale
from cardbox_tracker.drawing.video import video_file
from cardbox_tracker.errors import BagError
from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.recordings.recording import Recording
from cardbox_tracker.recordings.silhouettes import RecordedFrame

# Rate of a video of a single image.
_USUAL_HZ = 15.0


@contextmanager
def overlay_video(
    path: Path, recording: Recording
) -> Iterator[Callable[[RecordedFrame, Estimate, Tracker], None]]:
    """Context of an observer that draws each estimate over the image of the first camera.

    The video has the rate, the size and the aspect ratio of the recorded images; small images are
    enlarged to at least 640 px along the longer side.

    Raises:
        CardboxError: the file cannot be written, or its suffix is not .mp4 or .avi.
    """
    with video_file(path, _rate(recording)) as add:

        def observe(frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
            picture = recording.first.full_picture(frame)
            scale = readable_scale(picture)
            add(draw_overlay(picture, tracker.body, tracker.camera, estimate, scale))

        yield observe


def _rate(recording: Recording) -> float:
    """Return the images a second, Hz, as exactly as a video can have them."""
    try:
        return round(1e9 / max(1, recording.first.period_ns()), 2)
    except BagError:
        return _USUAL_HZ
