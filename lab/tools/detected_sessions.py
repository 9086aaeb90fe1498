"""Recorded sessions with truth, seen by their first camera and the installed detector."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.recordings.recording import FrameSet, Recording, RecordingRequest
from lab.evaluation.session import RecordedSession, load_session
from lab.evaluation.tracking import silhouettes_of

FloatArray = NDArray[np.float64]


def first_camera_of(folder: Path) -> RecordedSession:
    """Return a session of which only the first camera is used.

    Raises:
        CardboxError: the folder is no session.
    """
    session = load_session(folder)
    cameras = session.truth.cameras[:1]
    return load_session(folder, cameras) if cameras else session


def source_of(session: RecordedSession) -> str:
    """Return the origin of a session, such as the repository of its film.

    Sessions whose truth names no origin were rendered, and count as one origin.
    """
    return session.truth.source.split(",")[0] or "rendered"


@contextmanager
def opened(session: RecordedSession) -> Iterator[Recording]:
    """Open a session with its silhouettes and the detector's points.

    Raises:
        CardboxError: the session cannot be read, or the detector is not installed.
    """
    silhouettes, cameras = silhouettes_of(session), session.truth.cameras
    with RecordingRequest(
        session.bag, silhouettes, cameras, points=Detector.installed()
    ).open() as found:
        yield found


def motions(session: RecordedSession, source: Recording, most: int | None) -> Iterator[FrameSet]:
    """Yield the images of the motions, at most ``most``."""
    offset_s = (session.truth.start_ns - source.first.start_ns) / 1e9
    return islice(source.frames(session.start_s + offset_s), most)


def source_weights(sources: Sequence[str], counts: Sequence[int]) -> FloatArray:
    """Return weights (n,) of the samples of sessions, with the same sum for each source.

    Args:
        sources: origin of each session.
        counts: number of samples of each session; they sum to n. The weights do so, too.
    """
    given, numbers = np.array(sources), np.array(counts, np.int64)
    weights = np.zeros(len(counts))
    for source in dict.fromkeys(sources):
        weights[given == source] = 1.0 / max(int(numbers[given == source].sum()), 1)
    found: FloatArray = np.repeat(weights, numbers)
    return found * (len(found) / max(float(found.sum()), 1e-12))
