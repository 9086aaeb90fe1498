"""Draws the guidance of the measurement: the person, the posture to take, and words."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import REFERENCE_NAMES, TORSO_Y, reference_posture
from cardbox_tracker.drawing.guidance import Asked, draw_guidance
from cardbox_tracker.drawing.overlay import ImageArray
from cardbox_tracker.estimation.initialization.config import InitializationConfig
from cardbox_tracker.estimation.initialization.guidance import Prompt
from cardbox_tracker.estimation.initialization.live_fit import LiveFit
from cardbox_tracker.estimation.initialization.references import MIN_PERSON_FRACTION, lateral_m
from cardbox_tracker.estimation.initialization.standing import at_height_of
from cardbox_tracker.vision.camera import Camera

Silhouette = NDArray[np.uint8]

_SCALE = 2
# Factor of the brightness outside the person.
_DARKER = 2


class Guide:
    """Draws prompts of the guidance for one camera.

    Attributes:
        camera: camera at the working resolution.
        config: settings with distance and turn of the person and pitch of the camera.
    """

    def __init__(self, camera: Camera, config: InitializationConfig) -> None:
        """Prepare the guidance for a person before ``camera``."""
        self.camera, self.config = camera, config
        self._fit = LiveFit(camera, config)

    def draw(
        self, prompt: Prompt, silhouette: Silhouette, image: ImageArray | None, mirror: bool
    ) -> ImageArray:
        """Return a prompt as a picture, bgr: see :func:`.guidance.draw_guidance`.

        Args:
            prompt: what to do.
            silhouette: (H, W), 0 or 255, of the camera's size.
            image: image of the silhouette, (H, W) or (H, W, 3) bgr; None to show the silhouette.
            mirror: show a mirror image.
        """
        picture = silhouette
        if image is not None:
            picture = image.copy()
            picture[silhouette == 0] //= _DARKER
        asked = self._asked(prompt.name, silhouette) if prompt.name in REFERENCE_NAMES else None
        return draw_guidance(
            picture, prompt.words, prompt.mood, prompt.left_s, asked, scale=_SCALE, mirror=mirror
        )

    def _asked(self, name: str, silhouette: Silhouette) -> Asked:
        """Return the outline of a person of mean size, at the person's place or in the middle."""
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
