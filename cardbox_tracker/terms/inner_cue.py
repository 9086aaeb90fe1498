"""The cue inside the outline: hands and forearms by their colours.

An outline does not show an arm in front of the torso. The initialization learns the colours of the
person's parts (``BodyModel.appearance``), and the term uses them in five steps:

1. A low-pass filter estimates the brightness of the torso, so that the colours stay comparable.
2. Each pixel in the silhouette's bounding box gets two log-likelihood ratios, of the hand and of
   the forearm, against the part at this place in the last posture: torso, head or legs.
3. The gain of an arm is the mean ratio over its hand times the hand's area, plus the same for the
   forearm. The areas are those at the expected place of the person, so that neither short nor near
   limbs are preferred.
4. A hand gains less where the other forearm covers it, and nothing behind the torso.
5. Whether the forearms of a person without reference postures are bare is learned while tracking
   (:mod:`.inner_cue_sleeves`).

The gain is subtracted from the cost. The term is zero without an image, without a previous posture,
and for a person with unknown colours.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.settings import Settings, setting
from cardbox_tracker.person.appearance import (
    COLOR_STEPS,
    FOREARM,
    GREY_STEPS,
    HAND,
    HEAD,
    LEGS,
    TORSO,
    steps_of_levels,
)
from cardbox_tracker.person.model import MEASURED, BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.inner_cue_arms import (
    ArmGains,
    arms_in_image,
    forearm_of,
    zones_of,
)
from cardbox_tracker.terms.inner_cue_kernels import costs_of_arms, ratio_maps
from cardbox_tracker.terms.inner_cue_sleeves import Sleeves
from cardbox_tracker.terms.term import (
    Frame,
    Image,
    Posed,
    Silhouette,
    Term,
    TermObservation,
)

# Limit of a ratio, since histograms of a few hundred pixels are uncertain.
_LIMIT_NATS = 2.5
# Parts with a smaller Bhattacharyya distance look alike; their ratios are zero.
_ALIKE = 0.05
# Limits of the change of the light.
_DARKEST, _BRIGHTEST = 0.6, 1.6
# Step between pixels of the torso; fewest rows and columns, and fewest pixels in the outline.
_STRIDE, _LEAST_SIDE_PX, _LEAST_PX = 3, 6, 20


@dataclass(frozen=True)
class InnerCue(Settings):
    """Settings of the cue inside the outline."""

    hand: float = setting(
        0.7,
        "weight of a nat of a hand's pixel, in pixels of the outline",
        limits=(0.0, 10.0),
    )
    forearm: float = setting(0.7, "weight of a nat of a forearm's pixel", limits=(0.0, 10.0))
    light: float = setting(
        0.25,
        "weight of a new image in the low-pass filter of the brightness; 0: the brightness is "
        "constant",
        limits=(0.0, 1.0),
    )

    def build(self, person: BodyModel, camera: Camera) -> Term | None:
        """Return the term; None for a person without an appearance."""
        return None if person.appearance is None else InnerCueTerm(self, person, camera)


class InnerCueTerm:
    """The cue for one person with known colours."""

    def __init__(self, config: InnerCue, body: BodyModel, camera: Camera) -> None:
        """Prepare for a body, which must have an appearance, before one camera."""
        if body.appearance is None:
            raise ValueError("the body has no appearance; learn it, or track without this term")
        self.config = config
        self._appearance = body.appearance
        self._brightness = body.appearance.brightness.copy()
        # Areas at the place of the body model, so that a nearer state has no advantage.
        self._px_per_m = float(camera.fx) / body.placement.distance_m
        self._forearm_m = forearm_of(body)
        self._ratios = ratios_of(body.appearance.histograms)
        self._weights = np.array([config.hand, config.forearm])
        self._sleeves: Sleeves | None = None
        if body.source != MEASURED:
            self._sleeves = Sleeves(body.appearance.histograms, self._forearm_m, self._px_per_m)
            self._use(self._sleeves)

    def _use(self, sleeves: Sleeves) -> None:
        """Rate arms as their sleeves probably are."""
        self._ratios = ratios_of(sleeves.histograms)
        self._weights = np.array([self.config.hand * sleeves.hand_weight, self.config.forearm])

    def observe(self, frame: Frame) -> TermObservation | None:
        """Return the term's observation; None without an image or a last posture."""
        before = frame.before
        if before is None:
            # Tracking starts again, possibly in another light.
            self._brightness = self._appearance.brightness.copy()
            return None
        image = None if frame.image is None else self._comparable(frame.image)
        if image is None:
            return None
        zones = zones_of(before)
        self._follow_light(image, frame.silhouette, zones)
        u0, v0, width, height = cv2.boundingRect(frame.silhouette)
        maps = self._maps(image, frame.silhouette, zones, (u0, v0, width, height))
        if self._sleeves is not None and self._sleeves.see(maps[0], (u0, v0), before):
            self._use(self._sleeves)
        return InnerCueObservation(
            ArmGains(maps, (u0, v0), self._weights, self._px_per_m, self._forearm_m),
            np.array([arms_in_image(before, arm)[0] for arm in (0, 1)]),
        )

    def _comparable(self, image: Image) -> Image | None:
        """Return the image (H, W, channels) with the learned channels; None if it lacks colours."""
        if image.ndim == 2:
            return image[..., None] if self._appearance.is_grey else None
        if self._appearance.is_grey:
            return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)[..., None]
        return image

    def _follow_light(self, image: Image, silhouette: Silhouette, zones: FloatArray) -> None:
        """Update the torso's brightness from the chest, below the head."""
        chest = chest_levels(image, silhouette, zones) if self.config.light > 0 else None
        if chest is None:
            return
        learned = self._appearance.brightness
        now = np.clip(chest, _DARKEST * learned, _BRIGHTEST * learned)
        self._brightness += self.config.light * (now - self._brightness)

    def _maps(
        self,
        image: Image,
        silhouette: Silhouette,
        zones: FloatArray,
        box: tuple[int, int, int, int],
    ) -> NDArray[np.float32]:
        """Return ratios (2, h, w) of hand and forearm in ``box`` (u, v, width, height), nats."""
        u0, v0, width, height = box
        maps = np.empty((2, max(height, 1), max(width, 1)), np.float32)
        part = (slice(v0, v0 + maps.shape[1]), slice(u0, u0 + maps.shape[2]))
        # Small copies have one type of array, so that the kernel is compiled only once; the pixels
        # of a message, for example, are read-only.
        ratio_maps(
            np.array(image[part], order="C"),
            np.array(silhouette[part], order="C"),
            steps_of_levels(self._brightness, self._appearance.brightness),
            GREY_STEPS if self._appearance.is_grey else COLOR_STEPS,
            self._ratios,
            zones - (u0, v0, 0, 0, v0, v0),
            maps,
        )
        for one in maps:
            cv2.blur(one, (3, 3), one)
        return maps


def chest_levels(image: Image, silhouette: Silhouette, zones: FloatArray) -> FloatArray | None:
    """Return the median (channels,) over the chest, below the head; None if it is not visible.

    The image is (H, W, channels), ``zones`` (6,) are those of :func:`~.inner_cue_arms.zones_of`.
    """
    u, v, half_width, half_height, hips, _ = zones.tolist()
    top, bottom = max(int(v + 1.6 * half_height), 0), int(hips - 0.1 * (hips - v))
    left, right = max(int(u - 1.2 * half_width), 0), int(u + 1.2 * half_width)
    if min(bottom - top, right - left) < _LEAST_SIDE_PX:
        return None
    some = (slice(top, bottom, _STRIDE), slice(left, right, _STRIDE))
    chest = image[some][silhouette[some] > 0]
    return None if len(chest) < _LEAST_PX else np.asarray(np.median(chest, axis=0))


def ratios_of(histograms: FloatArray) -> NDArray[np.float32]:
    """Return log-likelihood ratios by zone (torso, head, below), hand or forearm, and bin, nats."""
    # Shirt and trousers meet at the hips, so both are expected there.
    below = 0.5 * histograms[TORSO] + 0.5 * histograms[LEGS]
    ratios = np.zeros((3, 2, histograms.shape[1]), np.float32)
    for zone, other in enumerate((histograms[TORSO], histograms[HEAD], below)):
        for part, own in enumerate((histograms[HAND], histograms[FOREARM])):
            if -np.log(np.sum(np.sqrt(own * other))) >= _ALIKE:
                ratios[zone, part] = np.clip(np.log(own / other), -_LIMIT_NATS, _LIMIT_NATS)
    return ratios


@dataclass(frozen=True, eq=False)
class InnerCueObservation(TermObservation):
    """The cue of one frame."""

    gains: ArmGains  #: gains of arms in this frame
    before: FloatArray  #: elbow and hand of each arm in the previous frame, (2, 1, 2, 3)

    def rate(self, posed: Posed) -> FloatArray:
        """Rate the arms that count; the outline determines the trunk."""
        costs = np.zeros(len(posed.states))
        of = posed.states, posed.parts, posed.body, self.before
        costs_of_arms(*of, *self.gains.arguments, costs)
        return costs
