"""Doubt whether a tracked person faces the camera, from hair where the face was.

The outline of a back is that of a front. In colour images of a person whose colours were learned,
pixels are hair if their colour is clearly more probable for the head as a whole than for skin. The
share of hair between forehead and cheeks is compared with its usual value, which is known after a
second with the face: more by a quarter, and a third in all, shows the back of the head.

Bald heads, hair in the colour of the skin, necks shaved to the height of the ears and grey images
show nothing. A person who leans forward shows the top of the head, so nothing is said meanwhile.
``docs/research.md#deviations-and-loss`` has figures.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.common.health import WATCHES
from cardbox_tracker.person.appearance import COLOR_STEPS, HAND, HEAD, steps_of_levels
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import PITCH, YAW
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.inner_cue import chest_levels, zones_of
from cardbox_tracker.terms.term import Frame, Image, Posed, Silhouette

# Grid from the forehead to the cheeks, as shares of the half axes of the head's ellipse; fewest of
# its pixels that count.
_ACROSS, _DOWN, _LEAST_PX = np.linspace(-0.6, 0.6, 8), np.linspace(-0.3, 0.2, 6), 12
# Log-likelihood ratio of skin and head below which a colour is hair.
_HAIR_NATS = -0.7
# Least usual share of hair, so that a back has a third in all.
_LEAST_USUAL = 0.07
# Time between samples, and time constants of the present share and of the usual one, s.
_EVERY_S, _NOW_S, _USUAL_S = 0.2, 0.5, 4.0
# Time with the face after which the usual share is known, and the longest that a sample
# stands for, s; largest change of the usual share by a sample.
_KNOWN_S, _USUAL_CHANGE = 1.0, 0.1
# Yaw of a person who faces the camera, and lean that shows the top of the head, rad.
_FACING_RAD, _LEAN_RAD = np.radians(30.0), np.radians(6.0)
# Height above its middle that an upright head reaches, as a share of the ellipse's half axis.
_TOP = 0.65
# Weight of a sample in the low-pass filter of the torso's brightness.
_LIGHT = 0.5


class Facing:
    """Doubt about one person before a camera; ``shows_back`` says if hair is where the face was."""

    def __init__(self, body: BodyModel) -> None:
        """Prepare for a person, whose appearance may be missing."""
        appearance = body.appearance
        self._appearance = None if appearance is None or appearance.is_grey else appearance
        if self._appearance is not None:
            histograms = self._appearance.histograms
            self._is_hair = np.log(histograms[HAND] / histograms[HEAD]) < _HAIR_NATS
        self.forget()

    def forget(self) -> None:
        """Expect a person who faces the camera."""
        self.shows_back = False
        self._now: float | None = None
        self._usual = self._elapsed_s = self._known_s = 0.0
        if self._appearance is not None:
            self._brightness = self._appearance.brightness

    def see(self, frame: Frame, posed: Posed) -> None:
        """Compare the head of a person, one state, in a frame with the learned colours.

        A grey image, or none, shows nothing; certain points of a detector tell the back better.
        """
        state = posed.states[0]
        if frame.points is not None and frame.points.are_certain:
            self.shows_back, self._now = False, None
            return
        if self._appearance is None or frame.image is None or frame.image.ndim != 3:
            return
        self._elapsed_s += frame.interval_s
        zones = zones_of(posed)
        if state[PITCH] > _LEAN_RAD or _is_low(zones, frame.silhouette):
            self.shows_back, self._now = False, None
            return
        if self._elapsed_s < _EVERY_S:
            return
        hair = self._hair(frame.image, frame.silhouette, zones)
        if hair is not None:
            self._add(hair, abs(float(state[YAW])) < _FACING_RAD)
        self._elapsed_s = 0.0

    def _add(self, hair: float, is_frontal: bool) -> None:
        """Judge by another share of hair; ``is_frontal`` is whether the tracked yaw is small."""
        passed_s = min(self._elapsed_s, _KNOWN_S)
        before = hair if self._now is None else self._now
        self._now = now = before + (1.0 - float(np.exp(-passed_s / _NOW_S))) * (hair - before)
        is_known = self._known_s >= _KNOWN_S
        if is_known:
            excess = now - max(self._usual, _LEAST_USUAL)
            self.shows_back = WATCHES["back"].is_beyond(excess, self.shows_back)
        is_usual = not is_known or abs(now - self._usual) < _USUAL_CHANGE
        if is_frontal and is_usual and not self.shows_back:
            self._known_s += passed_s
            self._usual += passed_s / min(self._known_s, _USUAL_S) * (hair - self._usual)

    def _hair(self, image: Image, silhouette: Silhouette, zones: FloatArray) -> float | None:
        """Return the share of hair in the face's place; None if it is hardly in the silhouette."""
        appearance = self._appearance
        assert appearance is not None
        chest = chest_levels(image, silhouette, zones)
        if chest is not None:
            self._brightness = self._brightness + _LIGHT * (chest - self._brightness)
        u, v, half_width, half_height = zones[:4].tolist()
        columns = np.rint(u + half_width * _ACROSS).astype(np.intp)
        rows = np.rint(v + half_height * _DOWN).astype(np.intp)
        height, width = silhouette.shape
        columns = columns[(columns >= 0) & (columns < width)]
        rows = rows[(rows >= 0) & (rows < height)]
        place = np.ix_(rows, columns)
        pixels = image[place][silhouette[place] > 0]
        if len(pixels) < _LEAST_PX:
            return None
        bins = np.zeros(len(pixels), np.intp)
        steps = steps_of_levels(self._brightness, appearance.brightness)
        for channel, of_level in enumerate(steps):
            bins = bins * COLOR_STEPS + of_level[pixels[:, channel]]
        return float(np.mean(self._is_hair[bins]))


def _is_low(zones: FloatArray, silhouette: Silhouette) -> bool:
    """Return whether the head is lower than the model's, as of a lean, which is often missed."""
    u, v, _, half_height = zones[:4].tolist()
    row, column = round(v - _TOP * half_height), round(u)
    height, width = silhouette.shape
    return 0 <= row < height and 0 <= column < width and not silhouette[row, column]
