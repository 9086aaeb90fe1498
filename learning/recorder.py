"""A corrector that keeps what the learned parts see, for their training."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.config import PRESETS, TrackerConfig
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.filtering import correction, loss
from cardbox_tracker.estimation.filtering.corrector import Corrector, Result
from cardbox_tracker.vision.camera import Camera


@dataclass
class Seen:
    """Inputs of the learned parts in one image.

    Attributes:
        features: of the corrector, (2, F).
        found_m: keypoints before the correction, (6, 3), metres in the optical frame.
        evidence: of the chance of loss, (E,).
        result_features: of the deviations, (2, G).
        result_m: keypoints after the correction, (6, 3), metres in the optical frame.
        state: the corrected state, (14,).
        stddev: deviations of the state from the spread of the particles, (14,).
    """

    features: FloatArray
    found_m: FloatArray
    evidence: FloatArray
    result_features: FloatArray = field(default_factory=lambda: np.empty((2, 0)))
    result_m: FloatArray = field(default_factory=lambda: np.empty((6, 0)))
    state: FloatArray = field(default_factory=lambda: np.empty(0))
    stddev: FloatArray = field(default_factory=lambda: np.empty(0))


class Recorder:
    """A :class:`~cardbox_tracker.estimation.filtering.corrector.Corrector`.

    Attributes:
        latest: inputs in the last image; None before the first one, and after they were taken.
    """

    def __init__(self, cost: WholeBodyCost, camera: Camera, inner: Corrector | None) -> None:
        """Prepare for the body of ``cost`` before ``camera``; ``inner`` makes the corrections."""
        self._cost, self._camera, self._inner = cost, camera, inner
        self.latest: Seen | None = None

    def __call__(self, found: Result) -> FloatArray:
        """Return the keypoints as ``inner`` corrects them."""
        features = correction.inputs_of(found, self._cost, self._camera)
        evidence = np.array(list(loss.features_of_loss(found.search.evidence).values()))
        self.latest = Seen(features, found.keypoints_m.copy(), evidence)
        return found.keypoints_m if self._inner is None else self._inner(found)

    def chances_of_error(self) -> None:
        """Leave the chances to the filter."""

    def deviations(self, corrected: Result) -> None:
        """Keep the result; the deviations stay those of the filter."""
        assert self.latest is not None
        self.latest.result_features = correction.features_of_result(corrected)
        self.latest.result_m = corrected.keypoints_m.copy()
        self.latest.state, self.latest.stddev = corrected.state.copy(), corrected.stddev.copy()

    def take(self) -> Seen | None:
        """Return the inputs in the last image, once."""
        latest, self.latest = self.latest, None
        return latest


def uncorrected(cost: WholeBodyCost, camera: Camera, cameras: int) -> Recorder:
    """Return a recorder that corrects nothing; see the setting ``corrector``."""
    del cameras
    return Recorder(cost, camera, None)


def learned(cost: WholeBodyCost, camera: Camera, cameras: int) -> Recorder:
    """Return a recorder of the package's corrector; see the setting ``corrector``."""
    return Recorder(cost, camera, correction.learned(cost, camera, cameras))


def recording_config(has_depth: bool, is_corrected: bool) -> TrackerConfig:
    """Return the preset ``default`` with a recorder; results are never called lost."""
    preset = PRESETS["default"]()
    name = "learned" if is_corrected else "uncorrected"
    whole_body = replace(preset.whole_body, corrector=f"learning.recorder:{name}", lost_from=1.0)
    config = replace(preset, whole_body=whole_body, lost_iou=0.0)
    return config.with_depth() if has_depth else config
