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

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.appearance import (
    COLOR_STEPS,
    FOREARM,
    GREY_STEPS,
    HAND,
    HEAD,
    LEGS,
    TORSO,
    steps_of_levels,
)
from cardbox_tracker.body.model import MEASURED, BodyModel
from cardbox_tracker.body.posture import N_STATE
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.inner_cue_arms import N_TORSO, ArmView, torsos_of
from cardbox_tracker.estimation.cost.inner_cue_kernels import ratio_maps
from cardbox_tracker.estimation.cost.inner_cue_sleeves import Sleeves
from cardbox_tracker.estimation.cost.terms import (
    ARMS,
    ArmCosts,
    Frame,
    Image,
    Silence,
    Silhouette,
    Term,
    TermObservation,
    TorsoCosts,
)
from cardbox_tracker.settings import Settings, setting
from cardbox_tracker.vision.camera import Camera

# Limit of a ratio, since histograms of a few hundred pixels are uncertain.
_LIMIT_NATS = 2.5
# Parts with a smaller Bhattacharyya distance look alike; their ratios are zero.
_ALIKE = 0.05
# Limits of the change of the light.
_DARKEST, _BRIGHTEST = 0.6, 1.6
# Step between pixels of the torso; fewest rows and columns, and fewest pixels in the outline.
_STRIDE, _LEAST_SIDE_PX, _LEAST_PX = 3, 6, 20

_OTHER = {"left": "right", "right": "left"}


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

    def build(self, body: BodyModel, camera: Camera) -> Term:
        """Return the term, which is zero for a body without an appearance."""
        return Silence() if body.appearance is None else InnerCueTerm(self, body, camera)


_SILENCE = Silence()


class InnerCueTerm:
    """The cue for one person with known colours."""

    def __init__(self, config: InnerCue, body: BodyModel, camera: Camera) -> None:
        """Prepare for one body and one camera, and compile the kernels if necessary.

        Raises:
            ValueError: ``body`` has no appearance.
        """
        if body.appearance is None:
            raise ValueError("the body has no appearance; learn it, or track without this term")
        self.config = config
        self._appearance = body.appearance
        self._brightness = body.appearance.brightness.copy()
        self._arms = ArmView.of(body, camera, np.array([config.hand, config.forearm]))
        self._sleeves: Sleeves | None = None
        self._ratios = ratios_of(body.appearance.histograms)
        self._warm_up(camera)
        if body.source != MEASURED:
            self._sleeves = Sleeves(body.appearance.histograms, self._arms)
            self._use(self._sleeves)

    def _use(self, sleeves: Sleeves) -> None:
        """Rate arms as their sleeves probably are."""
        self._ratios = ratios_of(sleeves.histograms)
        weights = np.array([self.config.hand * sleeves.hand_weight, self.config.forearm])
        self._arms = replace(self._arms, weights=weights)

    def _warm_up(self, camera: Camera) -> None:
        """Run every kernel once, so that no live image waits for the compiler."""
        shape = (camera.height, camera.width)
        image = np.zeros(shape if self._appearance.is_grey else (*shape, 3), np.uint8)
        observation = self.observe(
            Frame(np.full(shape, 255, np.uint8), 1, 1, image, np.zeros(N_STATE))
        )
        observation.arms_beside(np.zeros(4))("left", np.zeros((1, 4)))
        self._brightness = self._appearance.brightness.copy()

    def observe(self, frame: Frame) -> TermObservation:
        """Return the term's observation, which is zero without an image or a last posture."""
        if frame.posture is None:
            # Tracking starts again, possibly in another light.
            self._brightness = self._appearance.brightness.copy()
            return _SILENCE
        image = None if frame.image is None else self._comparable(frame.image)
        if image is None:
            return _SILENCE
        zones = self._arms.zones(frame.posture)
        self._follow_light(image, frame.silhouette, zones)
        u0, v0, width, height = cv2.boundingRect(frame.silhouette)
        maps = self._maps(image, frame.silhouette, zones, (u0, v0, width, height))
        if self._sleeves is not None and self._sleeves.see(maps[0], (u0, v0), frame.posture):
            self._use(self._sleeves)
        before = frame.posture[None]
        others = {
            side: self._arms.project(torsos_of(before), before[:, joints], side)[0]
            for side, joints in ARMS.items()
        }
        return InnerCueObservation(self._arms, maps, (u0, v0), others)

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

    Args:
        image: (H, W, channels).
        silhouette: (H, W), 0 or 255.
        zones: (6,), see :meth:`~.inner_cue_arms.ArmView.zones`.
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
class InnerCueObservation:
    """The cue of one frame; see :class:`~cardbox_tracker.estimation.cost.terms.TermObservation`.

    Attributes:
        view: the person before the camera.
        maps: ratios of hand and forearm, (2, h, w), nats.
        corner: column and row of the image where the maps begin.
        others: elbow and hand of each arm in the previous frame, (1, 2, 3).
    """

    view: ArmView
    maps: NDArray[np.float32]
    corner: tuple[int, int]
    others: dict[str, FloatArray]

    def torsos_beside(self, arms: FloatArray | None) -> TorsoCosts:
        """Return zero costs, because the outline determines the torso."""
        return _SILENCE.postures

    def arms_beside(self, torso: FloatArray) -> ArmCosts:
        """Rate arms by the image at their place; the other arm has its last place."""
        torsos = np.zeros((1, N_TORSO))
        torsos[0, : len(torso)] = torso

        def costs(side: str, arms: FloatArray) -> FloatArray:
            points, hidden = self.view.project(torsos, arms, side)
            other = self.others[_OTHER[side]]
            return -self.view.gains(points, hidden, other, self.maps, self.corner)

        return costs

    def postures(self, postures: FloatArray) -> FloatArray:
        """Rate both arms."""
        torsos = torsos_of(postures)
        seen = {s: self.view.project(torsos, postures[:, joints], s) for s, joints in ARMS.items()}
        left, right = (
            self.view.gains(*seen[side], seen[_OTHER[side]][0], self.maps, self.corner)
            for side in ARMS
        )
        return -(left + right)
