"""Decides from the size of the silhouettes whether they show a person."""

from __future__ import annotations

from collections.abc import Sequence

from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.pose_filter import Presence
from cardbox_tracker.search.whole_body_config import WholeBodyConfig
from cardbox_tracker.terms.multi_view import MultiViewCost
from cardbox_tracker.terms.term import Frame

# Frames with too much foreground after which it is assumed to be a near person.
_TOO_MUCH_FRAMES = 15
# Factor on the foreground by which it decreases only if the person is elsewhere.
_SUDDEN = 4


class PersonPresence:
    """The presence of the person in the images of all cameras."""

    def __init__(self, cost: MultiViewCost, config: WholeBodyConfig) -> None:
        """Prepare for the cameras of ``cost``."""
        self._cost = cost
        self._limits = config.smallest_person, config.largest_person
        self.forget()

    def forget(self) -> None:
        """Forget the last frames."""
        self._too_much = self._foreground_px = 0
        self._is_sudden = False

    @property
    def is_elsewhere(self) -> bool:
        """Whether the person must be sought anew.

        There has been too much foreground for so long that it is a near person, or most of the
        foreground of somebody who seemed near, such as noise in the whole image, is gone.
        """
        return self._is_too_long_too_much or self._is_sudden

    @property
    def _is_too_long_too_much(self) -> bool:
        # The background model would have learned another light by then.
        return self._too_much > _TOO_MUCH_FRAMES

    def see(self, frames: Sequence[Frame], near: FloatArray) -> tuple[Presence, list[int]]:
        """Return the presence, and the indices of the cameras that show the person.

        The cost has the silhouettes of ``frames``; ``near`` (14,) is the state of the last frame.
        """
        found = []
        for share, frame in zip(self._cost.shares(near), frames, strict=True):
            is_detected = frame.points is not None and frame.points.are_certain
            one = presence_of(*share, *self._limits, is_detected)
            # Others may hide nearly all of a person whose joints are seen.
            is_hidden = is_detected and frame["covered"] is not None
            found.append(Presence.PERSON if is_hidden else one)
        self._too_much = self._too_much + 1 if Presence.TOO_MUCH in found else 0
        if self._is_too_long_too_much:
            found = [Presence.PERSON if one is Presence.TOO_MUCH else one for one in found]
        seeing = [number for number, one in enumerate(found) if one is Presence.PERSON]
        if seeing:
            now_px, before_px = sum(f.foreground_px for f in frames), self._foreground_px
            is_covered = any(frame["covered"] is not None for frame in frames)
            self._is_sudden = before_px > _SUDDEN * now_px and not is_covered
            self._foreground_px = now_px
            return Presence.PERSON, seeing
        return (Presence.TOO_MUCH if Presence.TOO_MUCH in found else Presence.NOBODY), seeing


def presence_of(
    low: float, high: float, smallest: float, largest: float, is_detected: bool = False
) -> Presence:
    """Return the presence from the silhouette's area as shares of the frontal model's.

    ``low`` is where the model is largest, ``high`` where it is smallest; a person has ``smallest``
    to ``largest``. Whom a detector finds may be smaller, and a spoilt silhouette does no harm.
    """
    if high < smallest and not (is_detected and high > 0.0):
        return Presence.NOBODY
    return Presence.TOO_MUCH if low > largest and not is_detected else Presence.PERSON
