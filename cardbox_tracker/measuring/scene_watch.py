"""The camera over the floor and the distances of people, found while they are seen.

What all images of a film show (:mod:`.scene_camera`), live images show more and more surely: tries
come in intervals that double, beside the images, and count from the first image after them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from functools import partial
from typing import Generic, TypeVar

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.measuring.scene_camera import FoundCamera, Picture, degrees_of, scene_camera
from cardbox_tracker.person.proportions import USUAL_STATURE_M
from cardbox_tracker.terms.term import Image

MOST_PICTURES = 12
"""Images in which edges of the room are sought."""

# Images with the points of a person that count, and that show enough for a first try, which comes
# after this time, s.
_MOST_SIGHTS, _LEAST_SIGHTS, _FIRST_S = 200, 10, 1.0

T = TypeVar("T")


class Spread(Generic[T]):
    """A few items spread evenly over however many there are.

    Attributes:
        items: at least half of the number asked for, if there were so many.
    """

    def __init__(self, most: int) -> None:
        self._most, self._every, self._seen = most, 1, 0
        self.items: list[T] = []

    def add(self, make: Callable[[], T | None]) -> None:
        """Take the next item, which is made only if it is due; None lets the one after it be."""
        if self._seen % self._every == 0:
            item = make()
            if item is None:
                return
            self.items.append(item)
        self._seen += 1
        if len(self.items) > self._most:
            del self.items[1::2]
            self._every *= 2


class SceneWatch:
    """Looks for camera and distances while images come.

    Attributes:
        remarks: contradictions in what was found last, in words.
        news: the pitch that was found last, in words; empty before, or if it is given.
    """

    def __init__(
        self,
        camera: Camera,
        statures_m: Sequence[float | None],
        pitch: tuple[float, float] | None = None,
        beside: Executor | None = None,
        is_level: bool = False,
    ) -> None:
        """Begin before a working camera, with the statures of people by number.

        The last stature is also that of further people. ``pitch`` is mean and standard deviation of
        one that is given, rad; ``beside`` makes the tries. Images are known to be upright if
        ``is_level``.
        """
        self._camera, self._statures_m, self._pitch = camera, statures_m, pitch
        self._roll_rad = 0.0 if is_level else None
        self._beside = beside
        self._people: list[Spread[tuple[float, ImagePoints]]] = []
        self._pictures = Spread[Picture](MOST_PICTURES)
        self._tried: Future[FoundCamera] | None = None
        self._begin_s: float | None = None
        self._wait_s = _FIRST_S
        self.remarks: tuple[str, ...] = ()
        self.news = ""

    def see(
        self, time_s: float, points: Sequence[ImagePoints | None], image: Image | None
    ) -> FoundCamera | None:
        """Take an image with the points of each person; return what was found since, once."""
        self._people += [Spread(_MOST_SIGHTS) for _ in range(len(self._people), len(points))]
        for person, one in zip(self._people, points, strict=False):
            if one is not None and not one.is_empty:
                person.add(lambda one=one: (time_s, one))  # type: ignore[misc]
        if image is not None:
            self._pictures.add(lambda: (time_s, image))
        is_enough = any(len(one.items) >= _LEAST_SIGHTS for one in self._people)
        if self._begin_s is None and is_enough:
            self._begin_s = time_s
        is_due = self._begin_s is not None and time_s - self._begin_s >= self._wait_s
        if self._tried is None and is_due:
            self._wait_s *= 2.0
            people = [list(one.items) for one in self._people]
            statures_m = [self._given_m(number) for number in range(1, len(people) + 1)]
            given = people, list(self._pictures.items), self._camera, statures_m, self._pitch
            look = partial(scene_camera, *given, self._roll_rad)
            if self._beside is None:
                return self._found(look())
            self._tried = self._beside.submit(look)
        if self._tried is None or not self._tried.done():
            return None
        tried, self._tried = self._tried, None
        return self._found(tried.result())

    def _given_m(self, number: int) -> float | None:
        return self._statures_m[min(number, len(self._statures_m)) - 1]

    def stature_m(self, number: int) -> float:
        """Return the stature of a person, from 1 on; the mean of people if it is not given."""
        return self._given_m(number) or USUAL_STATURE_M

    def _found(self, found: FoundCamera) -> FoundCamera:
        self.remarks, turned = found.remarks, math.degrees(found.camera.roll_rad.mean)
        if turned:
            self.remarks += (
                f"the camera is turned clockwise about its axis by {turned:.0f} degrees; start the "
                f"nodes with camera_roll_deg:={turned:.0f}",
            )
        if self._pitch is None and found.sources:
            pitch, sources = found.camera.pitch_rad, " and ".join(found.sources)
            self.news = f"camera pitch {degrees_of(pitch)}, found from {sources}"
        return found
