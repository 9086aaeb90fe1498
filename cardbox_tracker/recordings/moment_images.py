"""Images of the worst moments of a recording, kept while it is tracked."""

from __future__ import annotations

import heapq

import cv2

from cardbox_tracker.drawing.hidden_head import with_hidden_head
from cardbox_tracker.drawing.overlay import draw_overlay
from cardbox_tracker.ergonomics.moments import is_candidate
from cardbox_tracker.ergonomics.recording import RulaRow
from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.recordings.silhouettes import RecordedFrame

MOST_IMAGES = 1200
"""Images that are kept. Each worst moment excludes the images within ``GAP_S``, so this suffices
for up to 39 images a second; about 40 MB."""

_WIDTH_PX = 640
_QUALITY = 80


class MomentImages:
    """The images of the highest scores, with the model drawn over them."""

    def __init__(self, is_head_hidden: bool = True, most: int = MOST_IMAGES) -> None:
        """Keep up to ``most`` images; ``is_head_hidden`` makes the heads unrecognizable."""
        self.is_head_hidden = is_head_hidden
        self._most = most
        # The lowest score comes first, and of equal scores the latest image.
        self._kept: list[tuple[float, int, bytes]] = []

    def add(self, row: RulaRow, frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        """Keep the image of ``row`` if its score is among the highest."""
        if row.scores is None or not is_candidate(row):
            return
        rank = row.scores.mean, -row.stamp_ns
        if len(self._kept) == self._most and rank < self._kept[0][:2]:
            return
        heapq.heappush(self._kept, (*rank, self._drawn(frame, estimate, tracker)))
        if len(self._kept) > self._most:
            heapq.heappop(self._kept)

    def by_stamp(self) -> dict[int, bytes]:
        """Return the images as JPEG by their stamps."""
        return {-negative_ns: jpeg for _, negative_ns, jpeg in self._kept}

    def _drawn(self, frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> bytes:
        picture, camera, body = frame.picture, tracker.camera, tracker.body
        if self.is_head_hidden:
            picture = with_hidden_head(picture, body, camera, estimate, frame.points)
        scale = max(1, round(_WIDTH_PX / picture.shape[1]))
        canvas = draw_overlay(picture, body, camera, estimate, scale)
        _, jpeg = cv2.imencode(".jpg", canvas, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
        return jpeg.tobytes()
