"""Draw the guidance while a person is measured: ``python -m lab.tools.screenshots OUT.jpg``.

The person is synthetic; the same seed gives the same picture.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import cv2
import numpy as np

from cardbox_tracker.applications.drawing.guidance import Guide
from cardbox_tracker.applications.drawing.overlay import ImageArray
from cardbox_tracker.applications.simulation.motions import timeline
from cardbox_tracker.applications.simulation.session import synthesize_session
from cardbox_tracker.common.files import write_file
from cardbox_tracker.measuring.config import InitializationConfig
from cardbox_tracker.measuring.guidance import Prompt, short_words
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.silhouettes import SilhouetteSource, TimeSpan

_QUALITY = 82
_WIDTH_PX = 1200
# Reference, seconds before it is held, and seconds of the count-down. The person is on the way to
# the posture or in it, so that the outline has several colours.
_GUIDED = (("front", -0.3, 1), ("side", 0.9, 3), ("arms", 0.45, 2))
_SETTLED_S = 0.3


def guidance(seed: int = 0) -> ImageArray:
    """Return the mirrored guidance (H, W, 3) before each reference is captured, side by side."""
    segments = {segment.name: segment for segment in reversed(timeline("bow"))}
    empty, shown = segments["empty"], []
    with tempfile.TemporaryDirectory() as folder:
        synthesize_session(Path(folder) / "session", "bow", seed)
        with BagReader(Path(folder) / "session") as bag:
            span = TimeSpan(empty.start_s + _SETTLED_S, empty.end_s - _SETTLED_S)
            source = SilhouetteSource(bag, span)
            guide = Guide(source.camera, InitializationConfig(2.0))
            for name, before_s, left_s in _GUIDED:
                frame = next(source.frames(segments[name].start_s - before_s))
                step = Prompt(name, short_words(name, guide.config.side_turn), left_s)
                shown.append(guide.draw(step, frame.silhouette, frame.image, mirror=True))
    gap = np.full((len(shown[0]), 8, 3), 255, np.uint8)
    row = np.hstack([part for image in shown for part in (gap, image)][1:])
    factor = min(1.0, _WIDTH_PX / row.shape[1])
    small = cv2.resize(row, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.uint8)


def main() -> None:
    """Write the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", type=Path, metavar="OUT.jpg")
    output = parser.parse_args().output
    data = cv2.imencode(".jpg", guidance(), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1]
    write_file(output, data.tobytes())


if __name__ == "__main__":
    main()
