"""The cue inside the outline: hands and forearms by their colours.

An outline does not show an arm in front of the torso. The initialization learns the colours of the
person's parts (``BodyModel.appearance``), and the term uses them in five steps:

1. A low-pass filter estimates the brightness of the torso, so that the colours stay comparable.
2. Each pixel in the silhouette's bounding box gets two log-likelihood ratios, of the hand and of
   the forearm, against the part at this place in the last posture: torso, head or legs.
3. The gain of an arm is the mean ratio over its hand times the hand's area, plus the same for the
   forearm. The areas are those at the expected place of the person, so that neither short nor near
   limbs are preferred.
4. A hand behind the torso gains nothing.
5. Whether the forearms of a person without reference postures are bare is learned while tracking
   (:class:`Sleeves`).

The gain is subtracted from the cost. The term is zero without an image, without a previous posture,
and for a person with unknown colours.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

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
from cardbox_tracker.terms import inner_cue_kernels as kernels
from cardbox_tracker.terms.inner_cue_kernels import costs_of_arms, ratio_maps
from cardbox_tracker.terms.term import Frame, Image, Posed, Silhouette, Term, TermObservation

# Weight of a nat over the area of a forearm; neighbouring pixels and successive images are alike.
_WEIGHT = 0.1
# Added to each ratio, nats: an arm that is not found shows the shirt, whatever it wears.
_TOWARDS_BARE = 0.2
# Logarithm of the odds before the first image: whoever is not known more often shows the forearms.
_FIRST = 1.0
# Limit of the logarithm of the odds, so that a jacket that is taken off is noticed.
_MOST = 3.0
# Share of a hand's weight that is lost beside bare forearms.
_LOST = 0.5
# Change of the chance that is worth new ratios.
_STEP = 0.01


class Sleeves:
    """The chance that the forearms of a person who was not measured are bare.

    Both skin and shirt are possible at first, so the forearm's histogram is their mixture by this
    chance. Each image changes it: the log-likelihood ratio of skin against the part behind, over
    the forearms of the last posture, is added to the logarithm of the odds. Bare skin gains as much
    as a hand would, so a hand weighs less, the more probably forearms are bare.

    Attributes:
        log_odds: logarithm of the odds of bare forearms against sleeves.
    """

    def __init__(
        self, histograms: FloatArray, forearm_m: tuple[float, float], px_per_m: float
    ) -> None:
        """Prepare for a person with ``histograms`` (5, bins), probabilities of bins for each part.

        ``forearm_m`` are length and width; ``px_per_m`` is the scale at the expected place.
        """
        self._histograms, self._forearm_m, self._px_per_m = histograms.copy(), forearm_m, px_per_m
        forearm_px = forearm_m[0] * forearm_m[1] * px_per_m**2
        self._weights = np.array([0.0, _WEIGHT / forearm_px])
        self.log_odds, self._told = _FIRST, 0.0

    @property
    def bare(self) -> float:
        """The chance that the forearms are bare, 0 to 1."""
        return float(1.0 / (1.0 + np.exp(-self.log_odds)))

    @property
    def hand_weight(self) -> float:
        """Factor on the weight of a hand, 0 to 1."""
        return 1.0 - _LOST * self.bare

    @property
    def histograms(self) -> FloatArray:
        """Probability of each bin for each part, (5, bins), with forearms as they probably are."""
        self._told = self.bare
        histograms = self._histograms.copy()
        skin, shirt = histograms[HAND], histograms[TORSO]
        histograms[FOREARM] = self._told * skin + (1.0 - self._told) * shirt
        return histograms

    def see(self, skin: NDArray[np.float32], corner: tuple[int, int], posed: Posed) -> bool:
        """Learn from one image; return whether ``histograms`` have changed.

        ``skin`` (h, w) has log-likelihood ratios of the hand against the part behind, nats, and
        begins at the column and row ``corner``; 0 where both are alike. The person has one state.
        """
        inclined = np.where(skin != 0.0, skin + np.float32(_TOWARDS_BARE), np.float32(0.0))
        maps = np.stack([inclined, inclined])
        gains = ArmGains(maps, corner, self._weights, self._px_per_m, self._forearm_m)
        for arm in (0, 1):
            points, hidden = arms_in_image(posed, arm)
            self.log_odds += float(gains(points, hidden)[0])
        self.log_odds = float(np.clip(self.log_odds, -_MOST, _MOST))
        return abs(self.bare - self._told) > _STEP


def arms_in_image(posed: Posed, arm: int) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return column, row, px/m of elbow and hand, (N, 2, 3), and if the hand is behind, (N,)."""
    points, hidden = np.empty((len(posed), 2, 3)), np.empty(len(posed), np.bool_)
    kernels.project_arms(posed.states, arm, posed.body, points, hidden)
    return points, hidden


def forearm_of(person: BodyModel) -> tuple[float, float]:
    """Return length, including the fist, and width of a person's forearm, m."""
    return person.size("forearm_length"), person.size("forearm_width")


def zones_of(posed: Posed) -> FloatArray:
    """Return the places of head and torso of the first state, (6,), px, see ``torso_zones``."""
    zones = np.empty(6)
    kernels.torso_zones(posed.states[0], posed.body, zones)
    return zones


@dataclass(frozen=True, eq=False)
class ArmGains:
    """The gains of arms in one image."""

    maps: NDArray[np.float32]  #: log-likelihood ratios of hand and forearm, (2, h, w), nats
    corner: tuple[int, int]  #: column and row of the image where the maps begin
    weights: FloatArray  #: weight of a nat of hand and forearm, px of the outline, (2,)
    px_per_m: float  #: scale at the expected place of the person
    forearm_m: tuple[float, float]  #: length, including the fist, and width of the forearm

    def __call__(self, points: FloatArray, hidden: NDArray[np.bool_]) -> FloatArray:
        """Return the gains (N,), px, of arms with the results of :func:`arms_in_image`."""
        gains = np.empty(len(points))
        kernels.arm_gains(points, hidden, *self.arguments, gains)
        return gains

    @cached_property
    def arguments(self) -> tuple[kernels.Maps, kernels.Forearm, FloatArray]:
        """The same for the kernels."""
        return (self.maps, *self.corner), (*self.forearm_m, self.px_per_m), self.weights


# Limit of a ratio, since histograms of a few hundred pixels are uncertain.
_LIMIT_NATS = 2.5
# Parts with a smaller Bhattacharyya distance look alike; their ratios are zero.
_ALIKE = 0.05
# Limits of the change of the light.
_DARKEST, _BRIGHTEST = 0.6, 1.6
# Step between pixels of the torso, and fewest pixels in the outline.
_STRIDE, _LEAST_PX = 3, 20


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
        """Prepare for ``histograms`` (5, bins), a forearm, m, and the expected place's scale."""
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
            ArmGains(maps, (u0, v0), self._weights, self._px_per_m, self._forearm_m)
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

    The image is (H, W, channels), ``zones`` (6,) are those of :func:`zones_of`.
    """
    u, v, half_width, half_height, hips, _ = zones.tolist()
    top, bottom = max(int(v + 1.6 * half_height), 0), max(int(hips - 0.1 * (hips - v)), 0)
    left, right = max(int(u - 1.2 * half_width), 0), max(int(u + 1.2 * half_width), 0)
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

    def rate(self, posed: Posed) -> FloatArray:
        """Rate the arms that count; the outline determines the trunk."""
        costs = np.zeros(len(posed.states))
        costs_of_arms(posed.states, posed.parts, posed.body, *self.gains.arguments, costs)
        return costs
