"""Texts about the state of tracking, for the log and the diagnostics."""

from __future__ import annotations

import math
from collections.abc import Mapping

from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.skeleton import PLACE_NAMES
from cardbox_tracker.recordings.outputs import METRICS, place_of
from cardbox_tracker.tracking.estimate import LOST, NO_PERSON, UNCERTAIN, Estimate

_REASONS = {
    NO_PERSON: "nobody is in the image",
    LOST: (
        "the person was lost (the model does not fit the silhouette); call tracker/reset when they "
        "stand in the front reference posture, or initialize again if it is another person"
    ),
    UNCERTAIN: (
        "the posture may be wrong (several postures fit the silhouette, or none fits it well); "
        "look at the overlay, and let a robot wait until tracking_state is tracking again"
    ),
}


class TrackingReport:
    """Collects the estimates of a tracker, and describes its state in words and numbers."""

    def __init__(self) -> None:
        """Begin without an estimate."""
        self._body: BodyModel | None = None
        self._state = ""
        self._counts: dict[str, int] = {}
        self._estimate: Estimate | None = None

    def start(self, body: BodyModel) -> None:
        """Begin again with ``body``."""
        self._state, self._body = "", body

    def add(self, estimate: Estimate, body: BodyModel) -> dict[str, str]:
        """Add the estimate of an image and the ``body`` to which it belongs.

        Returns:
            Texts about changes, by kind.
        """
        news = {}
        if body is not self._body:
            self._body = body
            news["body"] = f"fitted to the person in the image:\n{body}"
        self._estimate = estimate
        self._counts[estimate.state] = self._counts.get(estimate.state, 0) + 1
        before, self._state = self._state, estimate.state
        reason = _REASONS.get(estimate.state)
        if estimate.state == before:
            return news
        if estimate.state == UNCERTAIN:
            news["state"] = f"tracking, but {reason}"
        elif before != UNCERTAIN or reason:
            # The state may change between tracking and uncertain with each image.
            news["state"] = f"not tracking: {reason}" if reason else "tracking"
        return news

    def warnings(self) -> dict[str, str]:
        """Return texts about present problems, by kind."""
        reason = _REASONS.get(self._state)
        if reason is None:
            return {}
        return {"": reason if self._state == UNCERTAIN else f"no joint states: {reason}"}

    def values(self, cameras: Mapping[str, str]) -> dict[str, str]:
        """Return the state, the number of images with each state, and values of the last posture.

        ``cameras`` are further values, which precede those of the posture.
        """
        values = {"state": self._state or "not started"}
        values |= {f"images {state}": str(count) for state, count in self._counts.items()}
        values |= cameras
        estimate = self._estimate
        if estimate is None or estimate.posture is None:
            return values
        values |= {metric.label: metric.text(estimate) for metric in METRICS}
        if estimate.posture_stddev is not None:
            angles = estimate.posture_stddev[1:]
            values["largest deviation (deg)"] = f"{math.degrees(float(angles.max())):.1f}"
        places = zip(PLACE_NAMES, place_of(estimate), strict=True)
        return values | {f"{name} (m)": f"{value:.3f}" for name, value in places}
