"""What a tracker says of one image.

States: ``tracking``; ``uncertain`` (a posture that may be wrong); ``lost`` (somebody is there, but
the model has not fitted for several frames); ``no_person`` (too few foreground pixels for anybody).
Only ``tracking`` and ``uncertain`` have a posture.
"""

from __future__ import annotations

from dataclasses import dataclass

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray

TRACKING, UNCERTAIN, LOST, NO_PERSON = "tracking", "uncertain", "lost", "no_person"


@dataclass(frozen=True)
class Estimate:
    """What one silhouette says.

    Attributes:
        state: ``tracking``, ``uncertain``, ``lost`` or ``no_person``; the rest is None unless it is
            one of the first two.
        posture: d1..d12, (12,), rad and metres.
        posture_stddev: standard deviation of each joint, (12,): over the particles, weighted by
            fit, or learned of results like this one (``filtering/deviations.py``).
        keypoints_m: shoulder, elbow, hand of the left, then the right arm, (6, 3), metres in the
            optical frame.
        cost_px: equation (2) of the posture.
        iou: intersection over union of model and silhouette, above the hips.
        offset_m: ``torso_x`` and ``torso_z``, (2,): how far the hips are nearer to the camera, and
            higher, than the body model's placement; None if the filter keeps them constant.
        offset_stddev_m: their standard deviations, (2,).
    """

    state: str
    posture: FloatArray | None = None
    posture_stddev: FloatArray | None = None
    keypoints_m: FloatArray | None = None
    cost_px: int | None = None
    iou: float | None = None
    offset_m: FloatArray | None = None
    offset_stddev_m: FloatArray | None = None

    def placed(self, body: BodyModel) -> BodyModel:
        """Return ``body`` where this estimate finds it."""
        if self.offset_m is None:
            return body
        x_m, z_m = self.offset_m.tolist()
        place = body.placement
        return body.with_values(
            distance_m=place.distance_m - x_m, hip_height_m=place.hip_height_m + z_m
        )
