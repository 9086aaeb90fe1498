"""A person who turned round is doubted if hair is seen where the face was."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.detectors.image_points import POINT_NAMES, ImagePoints
from cardbox_tracker.person.appearance import HAND, HEAD, TORSO, Appearance, bins_of
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import PITCH, YAW, reference_posture
from cardbox_tracker.person.skeleton import KeypointState
from cardbox_tracker.search.config import PRESETS
from cardbox_tracker.terms.inner_cue import zones_of
from cardbox_tracker.terms.kernel_arguments import body_tuple
from cardbox_tracker.terms.term import Frame, Posed
from cardbox_tracker.tracking.estimate import UNCERTAIN
from cardbox_tracker.tracking.facing import Facing
from cardbox_tracker.tracking.precompile import quickest
from cardbox_tracker.tracking.tracker import Tracker

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
# Colours in the middle of their bins, which are 256 / 12 levels wide: bgr.
SKIN, HAIR, SHIRT = (139, 160, 203), (32, 32, 53), (117, 117, 117)
BODY = BodyModel.of()
STATE = BODY.reference_state()
POSABLE = body_tuple(BODY, CAMERA)
ZONES = zones_of(Posed(POSABLE, STATE[None]))
INTERVAL_S = 0.2


def appearance(hair: tuple[int, ...] = HAIR) -> Appearance:
    """Hands of skin, a torso in the shirt's grey, and a head of three parts skin, one part hair."""
    histograms = np.full((5, bins_of(3)), 0.1 / bins_of(3))

    def add(part: int, colour: tuple[int, ...], share: float) -> None:
        blue, green, red = (int(level * 12 / 256) for level in colour)
        histograms[part, (blue * 12 + green) * 12 + red] += 0.9 * share

    add(HAND, SKIN, 1.0)
    add(HEAD, SKIN, 0.75)
    add(HEAD, hair, 0.25)
    for part in range(5):
        if part not in (HAND, HEAD):
            add(part, SHIRT, 1.0)
    assert TORSO not in (HAND, HEAD)
    return Appearance.of(histograms, np.array(SHIRT, float))


def seen(hair: float, light: float = 1.0, hair_colour: tuple[int, ...] = HAIR) -> Frame:
    """The person, with hair in a share of the face's columns, the first of eight."""
    image = np.empty((240, 320, 3), np.uint8)
    image[:] = SHIRT
    u, v, half_width, half_height = ZONES[:4]
    top, bottom = int(v - half_height), int(v + half_height)
    image[top:bottom] = SKIN
    # Eight columns between -0.6 and 0.6: a border in the middle between two of them.
    border = u + half_width * (-0.6 + (8 * hair - 0.5) * 1.2 / 7)
    image[top:bottom, : round(border)] = hair_colour
    image = np.clip(np.rint(light * image), 0, 255).astype(np.uint8)
    silhouette = np.full((240, 320), 255, np.uint8)
    channels = {"silhouette": silhouette, "image": image}
    return Frame(CAMERA, channels, 200, 1, interval_s=INTERVAL_S)


def having(frame: Frame, **channels: object) -> Frame:
    """The frame with other channels; None for one that is missing."""
    both = {**frame.channels, **channels}
    return frame.changed(channels={name: one for name, one in both.items() if one is not None})


def facing(**values: object) -> Facing:
    values = {"appearance": appearance()} | values
    return Facing(BODY.with_values(**values))


def see(asked: Facing, frame: Frame, seconds: float, state: np.ndarray = STATE) -> list[bool]:
    found = []
    for _ in range(round(seconds / INTERVAL_S)):
        asked.see(frame, Posed(POSABLE, state[None]))
        found.append(asked.shows_back)
    return found


@pytest.mark.parametrize("hair", [0.0, 0.25, 0.5, 1.0])
@pytest.mark.parametrize("light", [0.8, 1.0, 1.2])
def test_the_share_of_hair_does_not_depend_on_the_light(hair: float, light: float) -> None:
    asked, frame = facing(), seen(hair, light)
    assert frame.image is not None
    assert asked._hair(frame.image, frame.silhouette, ZONES) == hair
    empty = np.zeros_like(frame.silhouette)
    assert asked._hair(frame.image, empty, ZONES) is None


def test_a_back_is_told_within_a_second_and_forgotten_when_the_face_is_seen() -> None:
    asked = facing()
    assert not any(see(asked, seen(0.0), 5.0))
    back = see(asked, seen(1.0), 4.0)
    # A low-pass filter of 0.5 s exceeds 0.32 after 0.5 * ln(1 / 0.68) = 0.19 s.
    assert back[0] and all(back)
    face = see(asked, seen(0.0), 4.0)
    # It falls below 0.22 after 0.5 * ln(1 / 0.22) = 0.76 s.
    assert face[:3] == [True] * 3
    assert not any(face[3:])


def test_the_usual_share_of_a_person_with_a_fringe_is_no_back() -> None:
    asked = facing()
    assert not any(see(asked, seen(0.5), 5.0))
    # An eighth more is less than a quarter.
    assert not any(see(asked, seen(0.625), 5.0))
    assert see(asked, seen(1.0), 2.0)[-1]


@pytest.mark.parametrize(("face_s", "is_known"), [(0.4, False), (1.4, True)])
def test_the_usual_share_is_known_after_a_second(face_s: float, is_known: bool) -> None:
    asked = facing()
    see(asked, seen(0.0), face_s)
    assert any(see(asked, seen(1.0), 0.6)) == is_known


@pytest.mark.parametrize(("seconds", "is_back"), [(20.0, True), (60.0, False)])
def test_a_slow_turn_is_told_and_hair_that_looks_darker_by_and_by_is_not(
    seconds: float, is_back: bool
) -> None:
    asked = facing()
    see(asked, seen(0.0), 5.0)
    shares = np.linspace(0.0, 1.0, round(seconds / INTERVAL_S))
    # Columns are few, so their mean over four images has the share.
    columns = np.floor(8 * shares + np.resize([0.0, 0.5, 0.25, 0.75], len(shares)))
    told = [see(asked, seen(number / 8), INTERVAL_S)[0] for number in columns]
    assert any(told) == is_back


def test_hair_above_the_forehead_and_a_beard_do_not_count() -> None:
    asked, face, back = facing(), seen(0.0), seen(1.0)
    assert face.image is not None and back.image is not None
    rows = np.arange(240)[:, None, None]
    middle = np.abs(rows - ZONES[1]) < 0.4 * ZONES[3]
    image = np.where(middle, face.image, back.image)
    assert asked._hair(image, face.silhouette, ZONES) == 0.0


@pytest.mark.parametrize(("share", "is_hair"), [(0.3, False), (0.5, True)])
def test_a_colour_is_hair_if_it_is_twice_as_probable_for_the_head(
    share: float, is_hair: bool
) -> None:
    dark = (96, 96, 96)
    histograms = appearance().histograms.copy()
    bin_ = (4 * 12 + 4) * 12 + 4
    histograms[HAND, bin_], histograms[HEAD, bin_] = 0.2, share
    frame = seen(1.0, hair_colour=dark)
    asked = facing(appearance=Appearance.of(histograms, np.array(SHIRT, float)))
    assert frame.image is not None
    assert asked._hair(frame.image, frame.silhouette, ZONES) == is_hair


def test_who_was_never_seen_from_the_front_is_not_doubted() -> None:
    assert not any(see(facing(), seen(1.0), 10.0))
    turned = STATE.copy()
    turned[YAW] = np.radians(50.0)
    asked = facing()
    see(asked, seen(0.0), 5.0, turned)
    assert not any(see(asked, seen(1.0), 5.0, turned))


@pytest.mark.parametrize("hair", [SKIN, (160, 160, 203)])
def test_hair_in_the_colour_of_skin_or_none_shows_nothing(hair: tuple[int, int, int]) -> None:
    asked = facing(appearance=appearance(SKIN))
    see(asked, seen(0.0), 5.0)
    assert not any(see(asked, seen(1.0, hair_colour=hair), 5.0))


def test_grey_images_missing_ones_and_unknown_colours_show_nothing() -> None:
    face, back = seen(0.0), seen(1.0)
    assert back.image is not None
    grey = having(back, image=back.image[..., 0].copy())
    for frame in (grey, having(back, image=None)):
        asked = facing()
        see(asked, face, 5.0)
        assert not any(see(asked, frame, 5.0))
    unknown = facing(appearance=None)
    see(unknown, face, 5.0)
    assert not any(see(unknown, back, 5.0))


def test_a_head_that_is_lower_than_the_models_is_no_back() -> None:
    """The tracked lean is zero, but the outline ends below the top of the model's head."""
    asked = facing()
    see(asked, seen(0.0), 5.0)
    back = seen(1.0)
    low = back.silhouette.copy()
    low[: int(ZONES[1] - 0.5 * ZONES[3])] = 0
    assert not any(see(asked, having(back, silhouette=low), 5.0))
    low[: int(ZONES[1] - 0.5 * ZONES[3])] = 255
    assert see(asked, having(back, silhouette=low), 2.0)[-1]


def test_who_leans_forward_shows_the_top_of_the_head() -> None:
    asked, leaning = facing(), STATE.copy()
    see(asked, seen(0.0), 5.0)
    leaning[PITCH] = np.radians(10.0)
    assert not any(see(asked, seen(1.0), 5.0, leaning))
    assert see(asked, seen(1.0), 1.0)[-1]


def test_points_of_a_detector_are_trusted_instead() -> None:
    asked, back = facing(), seen(1.0)
    see(asked, seen(0.0), 5.0)
    assert see(asked, back, 1.0)[-1]
    points = ImagePoints(
        np.full((len(POINT_NAMES), 2), 100.0, np.float32), np.ones(len(POINT_NAMES), np.float32)
    )
    assert not any(see(asked, having(back, points=points), 1.0))


def test_a_person_who_left_may_be_another_one() -> None:
    asked = facing()
    see(asked, seen(0.0), 5.0)
    assert see(asked, seen(1.0), 1.0)[-1]
    asked.forget()
    assert not any(see(asked, seen(1.0), 5.0))


def test_nothing_is_tracking_while_a_back_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    camera = Camera(96, 72, 90.0, 90.0, 47.5, 35.5)
    mask = render(cardbox_patches(BODY, reference_posture("front")), camera)
    tracker = Tracker(BODY, camera, quickest(PRESETS["default"]()))
    before = [tracker.track(mask) for _ in range(3)][-1]
    assert before.keypoint_states is not None
    # An outline alone may leave a hand in doubt.
    sides = [0, 1, 3, 4]
    assert [before.keypoint_states[i] for i in sides] == [KeypointState.TRACKED] * 4
    monkeypatch.setattr(Facing, "see", lambda self, frame, posed: setattr(self, "shows_back", True))
    after = tracker.track(mask)
    assert after.state == UNCERTAIN
    assert after.keypoints_m is not None
    assert after.keypoint_states is not None
    assert [after.keypoint_states[i] for i in sides] == [KeypointState.UNCERTAIN] * 4
    assert KeypointState.TRACKED not in after.keypoint_states
    # Nobody in view: the next person is expected to face the camera.
    tracker.track(np.zeros_like(mask))
    assert tracker._facing is not None
    assert not tracker._facing.shows_back


def test_the_paper_has_no_such_doubt() -> None:
    camera = Camera(96, 72, 90.0, 90.0, 47.5, 35.5)
    assert Tracker(BODY, camera, PRESETS["paper"]())._facing is None
