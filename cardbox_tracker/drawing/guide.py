"""What a person who is to be measured sees: themselves, the posture asked for, and words."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import REFERENCE_NAMES, TORSO_Y, reference_posture
from cardbox_tracker.drawing.guidance import Asked, draw_guidance
from cardbox_tracker.drawing.overlay import ImageArray
from cardbox_tracker.estimation.initialization.config import InitializationConfig
from cardbox_tracker.estimation.initialization.guidance import Step
from cardbox_tracker.estimation.initialization.live_fit import LiveFit
from cardbox_tracker.estimation.initialization.references import MIN_PERSON_FRACTION, lateral_m
from cardbox_tracker.estimation.initialization.standing import at_height_of
from cardbox_tracker.vision.camera import Camera

Silhouette = NDArray[np.uint8]

_SCALE = 2
# What is not the person is so much darker.
_DARKER = 2


class Guide:
    """Draws steps of the guidance for one camera.

    Attributes:
        camera: the working camera.
        config: distance and turn of the person, pitch of the camera.
    """

    def __init__(self, camera: Camera, config: InitializationConfig) -> None:
        """Draw for people before ``camera`` as ``config`` says."""
        self.camera, self.config = camera, config
        self._fit = LiveFit(camera, config)

    def draw(
        self, step: Step, silhouette: Silhouette, image: ImageArray | None, mirror: bool
    ) -> ImageArray:
        """Return a step as a picture, bgr: see :func:`.guidance.draw_guidance`.

        Args:
            step: what to do.
            silhouette: (H, W), 0 or 255, of the camera's size.
            image: what it is cut out of, (H, W) or (H, W, 3) bgr; without it, the silhouette.
            mirror: show it as a mirror would.
        """
        picture = silhouette
        if image is not None:
            picture = image.copy()
            picture[silhouette == 0] //= _DARKER
        asked = self._asked(step.name, silhouette) if step.name in REFERENCE_NAMES else None
        return draw_guidance(
            picture, step.words, step.mood, step.left_s, asked, scale=_SCALE, mirror=mirror
        )

    def _asked(self, name: str, silhouette: Silhouette) -> Asked:
        """Return the outline of somebody of mean size where the person stands, or in the middle."""
        config = self.config
        body = BodyModel.of(
            distance_m=config.distance_m,
            camera_pitch_rad=config.camera_pitch_rad,
            side_turn=config.side_turn,
        )
        posture = reference_posture(name, config.side_turn)
        if np.count_nonzero(silhouette) >= MIN_PERSON_FRACTION * silhouette.size:
            body = at_height_of(silhouette, body, self.camera)
            posture[TORSO_Y] = lateral_m(silhouette, self.camera, config.distance_m)
        view = self.camera.with_pitch(config.camera_pitch_rad)
        return Asked(body, view, posture, self._fit(name, silhouette))
