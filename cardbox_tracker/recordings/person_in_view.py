"""Silhouettes of a recording against a scene that is learned while the person is in view."""

from __future__ import annotations

from dataclasses import dataclass

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.point_table import PointTable
from cardbox_tracker.recordings.image_recording import ImageRecording
from cardbox_tracker.recordings.silhouettes import SilhouetteSource
from cardbox_tracker.segmentation.learning import Learning, PersonInViewLearning

# A standing person sways too slowly to be seen in images at a higher rate than the live nodes'.
_LEARNING_HZ = 15.0


@dataclass(frozen=True)
class PersonInView:
    """Segmentation against the scene around the person, learned from the whole recording."""


class PersonInViewSource(SilhouetteSource):
    """One camera of a recording without an empty scene, whose person steps aside at some time."""

    def __init__(
        self,
        bag: ImageRecording,
        camera: str | None = None,
        points: Detector | PointTable | None = None,
    ) -> None:
        """Learn the scene from the first images that show all of it, each part at its own time.

        See :class:`SilhouetteSource`. Raises CardboxError if the person hides a part of the scene
        in all images.
        """
        self._open(bag, bag.working_size, camera, learning=PersonInViewLearning)
        self._find_points(points, camera)
        learning = self._pipeline.learning
        every = max(1, round(1e9 / (_LEARNING_HZ * self.period_ns())))
        for number, prepared in enumerate(self.images()):
            if number % every == 0:
                learning.add(prepared.image)
            if learning.has_enough():
                break
        if not learning.has_enough():
            raise CardboxError(self._missing(learning))
        self._pipeline.finish_learning()

    def _missing(self, learning: Learning) -> str:
        """Return which part of the scene was not seen, and the remedy."""
        needed_s = learning.images / _LEARNING_HZ
        if learning.count < learning.images:
            what = f"{self.path} has less than {needed_s:.0f} s"
        else:
            hidden = learning.values()["hidden by the person (% of the image)"]
            what = f"the person hides {hidden} % of {self.path} all the time"
        return (
            f"{what}, so the scene behind them is unknown. Film someone who steps aside by twice "
            f"their width for {2 * needed_s:.0f} s, or leaves the image; for this recording give "
            "--detector mediapipe, which needs no scene, or --background T0:T1 if nobody is in "
            "view for a while"
        )
