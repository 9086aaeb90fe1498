"""What the tracker says of its state in the log and in the diagnostics."""

from __future__ import annotations

import math

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import PLACE_NAMES
from cardbox_tracker.estimation.estimate import LOST, NO_PERSON, UNCERTAIN, Estimate
from cardbox_tracker.outputs import METRICS, place_of
from cardbox_tracker.ros.nodes.several_cameras import SeveralCameras
from cardbox_tracker.ros.runtime.node import CardboxNode

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


class TrackerReport:
    """Logs each change of state, and adds state and fit to the diagnostics of ``node``."""

    def __init__(self, node: CardboxNode, cameras: SeveralCameras | None = None) -> None:
        """Report for ``node`` from now on, and for each of its ``cameras`` if it has several."""
        self._node = node
        self._cameras = cameras
        self._body: BodyModel | None = None
        self._state = ""
        self._counts: dict[str, int] = {}
        self._estimate: Estimate | None = None
        node.diagnostics.extra = self.values

    def start(self, body: BodyModel) -> None:
        """Forget the state: tracking starts anew, with ``body``."""
        self._state, self._body = "", body

    def add(self, estimate: Estimate, body: BodyModel) -> None:
        """Take note of the estimate of an image, and of whose ``body`` it is."""
        if body is not self._body:
            self._body = body
            self._node.get_logger().info(f"fitted to the person in the image:\n{body}")
        self._estimate = estimate
        self._counts[estimate.state] = self._counts.get(estimate.state, 0) + 1
        if estimate.state != self._state:
            self._say(estimate.state)
        self._node.diagnostics.advice = self.warnings

    def _say(self, state: str) -> None:
        before, self._state = self._state, state
        reason = _REASONS.get(state)
        if state == UNCERTAIN:
            # It may come and go with every other image.
            text = f"tracking, but {reason}"
            self._node.diagnostics.say("state", text)
        elif before != UNCERTAIN or reason:
            self._node.diagnostics.say("state", f"not tracking: {reason}" if reason else "tracking")

    def warnings(self) -> dict[str, str]:
        """Return what is wrong now, if anything is; it is logged already."""
        reason = _REASONS.get(self._state)
        found = {} if self._cameras is None else self._cameras.warnings()
        if reason is None:
            return found
        return found | {"": reason if self._state == UNCERTAIN else f"no joint states: {reason}"}

    def values(self) -> dict[str, str]:
        """Return the state, how often each occurred, and the figures of the last posture."""
        values = {"state": self._state or "not started"}
        values |= {f"images {state}": str(count) for state, count in self._counts.items()}
        if self._cameras is not None:
            values |= self._cameras.values()
        estimate = self._estimate
        if estimate is None or estimate.posture is None:
            return values
        values |= {metric.label: metric.text(estimate) for metric in METRICS}
        if estimate.posture_stddev is not None:
            angles = estimate.posture_stddev[1:]
            values["largest deviation (deg)"] = f"{math.degrees(float(angles.max())):.1f}"
        places = zip(PLACE_NAMES, place_of(estimate), strict=True)
        return values | {f"{name} (m)": f"{value:.3f}" for name, value in places}
