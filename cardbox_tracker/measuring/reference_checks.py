"""Checks that each reference silhouette shows its posture.

:mod:`.references` refuses images without a usable person. This module compares widths and
directions in the silhouettes with those of people in the right postures, and reports references
that are swapped, or show a person who did not turn or did not stretch the arms. The bounds were
chosen on rendered bodies with right and wrong postures.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.measuring.outline import LevelArm, level_arm, row_heights_m, span_m, width_m
from cardbox_tracker.measuring.references import POSTURE_TEXT, Silhouette, rounded_down, rounded_up
from cardbox_tracker.measuring.skeleton import BREADTH_OF_SPAN
from cardbox_tracker.person.posture import REFERENCE_NAMES

MIN_ARMS_TO_FRONT = 1.72
"""Least ratio of the widths of ``arms`` and ``front``."""

MAX_ARMS_TO_FRONT = 3.0
"""Largest ratio of the widths of ``arms`` and ``front``; beyond it the arms touch the body."""

MIN_FRONT_TO_SIDE = 0.95
"""Least ratio of the widths of ``front`` and ``side``."""

MAX_SIDE_SHOULDERS = 0.74
"""Largest ratio of the shoulder widths of ``side`` and ``front``."""

LEAST_SHOULDERS = 0.27
"""Least shoulder width of ``front`` in spans."""

ARM_DROP_DEG = (-8.0, 32.0)
"""Range of the arms' angle below the horizontal in ``arms``; 10 degrees are requested."""

MIN_SPAN_TO_HEAD = 3.3
"""Least ratio of the span and the height of the crown above the arms; bent elbows reduce it."""

MAX_UNEVEN = 0.17
"""Largest difference between the reaches of the arms in spans."""

HANGING_SPREAD = (-0.2, 1.25)
"""Range of the slope of the width of ``front`` between armpit and wrist. It is lower with hands on
the hips, and higher with arms raised by 40 degrees."""

MAX_CROWN_SHIFT = 0.035
"""Largest change of the crown's height between references in spans."""

# Heights in spans below the arms' axes: the rows for widths at the shoulders of `side`, and at
# armpits and wrists of `front`.
_SHOULDERS, _ARMPITS, _WRISTS = (0.02, 0.03, 0.04), (0.04, 0.05, 0.06), (0.21, 0.22, 0.23)


class Widths(NamedTuple):
    """Widths of the three silhouettes, px."""

    front: int
    side: int
    arms: int


@dataclass(frozen=True)
class _View:
    """The references, their camera and the distance of the person."""

    references: Mapping[str, Silhouette]
    camera: Camera
    distance_m: float

    def widths(self) -> Widths:
        across = (np.nonzero(self.references[name].any(axis=0))[0] for name in REFERENCE_NAMES)
        return Widths(*(int(np.ptp(one)) + 1 if len(one) else 0 for one in across))

    def crown_m(self, name: str) -> float:
        """Return the height of the top of the head above the camera's centre."""
        silhouette = self.references[name]
        row = int(np.argmax(silhouette.any(axis=1)))
        return float(row_heights_m(silhouette, self.camera, self.distance_m)[row])

    def widest_m(self, name: str, arms: _Arms, below: tuple[float, ...]) -> float:
        """Return the largest width at heights below the shoulders, given in spans."""
        heights = [arms.shoulder_m - fraction * arms.span_m for fraction in below]
        silhouette = self.references[name]
        widths = [width_m(silhouette, self.camera, self.distance_m, z) for z in heights]
        return float(np.nanmax([*widths, 0.0]))


class _Arms(NamedTuple):
    """Both arms of ``arms``, their span, and the height of the shoulders, metres."""

    left: LevelArm
    right: LevelArm
    span_m: float
    shoulder_m: float


def check_postures(references: Mapping[str, Silhouette], camera: Camera, distance_m: float) -> None:
    """Raise InitializationError, with the mistake, for references in wrong postures.

    Silhouettes (H, W) of ``front``, ``side`` and ``arms`` are as ``outline.filled`` returns them;
    the camera includes the pitch.
    """
    view = _View(references, camera, distance_m)
    if mixed_up := _mixed_up(view.widths()):
        raise InitializationError(mixed_up)
    arms = _arms(view)
    if arms is None:
        raise InitializationError(f"reference 'arms': no arms are seen; {_again('arms')}")
    # The checks of `front` and `side` use the span of `arms`, so `arms` is checked first.
    for problem in (_problem_of_arms, _problem_of_front, _problem_of_side, _problem_of_height):
        if found := problem(view, arms):
            raise InitializationError(found)


def _again(name: str) -> str:
    return f"capture '{name}' again: {POSTURE_TEXT[name]}"


def _mixed_up(widths: Widths) -> str:
    """Return a text that names swapped references, recognized by their widths, or no text."""
    if widths.arms > widths.front > MIN_FRONT_TO_SIDE * widths.side:
        return ""
    if widths.arms <= widths.front and widths.arms > MIN_FRONT_TO_SIDE * widths.front:
        return (
            "reference 'arms': the arms are not raised (it is not wider than 'front'); "
            f"{_again('arms')}"
        )
    by_width = sorted(REFERENCE_NAMES, key=lambda name: int(getattr(widths, name)))
    looks_like = dict(zip(by_width, ("side", "front", "arms"), strict=True))
    wrong = [name for name in REFERENCE_NAMES if looks_like[name] != name]
    if len(wrong) == 2:
        return f"references '{wrong[0]}' and '{wrong[1]}' look swapped; capture both again"
    pairs = ", ".join(f"'{name}' looks like '{looks_like[name]}'" for name in wrong)
    return f"the references look mixed up: {pairs}; capture them again"


def _arms(view: _View) -> _Arms | None:
    silhouette, camera, distance_m = view.references["arms"], view.camera, view.distance_m
    left, right = (level_arm(silhouette, camera, distance_m, side) for side in (1, -1))
    if left is None or right is None:
        return None
    span = left.tip_m - right.tip_m
    centre, half = (left.tip_m + right.tip_m) / 2.0, BREADTH_OF_SPAN * span / 2.0
    axis = (left.axis_m(centre + half) + right.axis_m(centre - half)) / 2.0
    return _Arms(left, right, span, axis)


def _problem_of_arms(view: _View, arms: _Arms) -> str:
    lowest, highest = ARM_DROP_DEG
    for side, arm, sign in (("left", arms.left, -1.0), ("right", arms.right, 1.0)):
        drop = float(np.degrees(np.arctan(sign * arm.slope)))
        if not lowest <= drop <= highest:
            where = f"{abs(drop):.0f} degrees {'below' if drop > 0 else 'above'} the horizontal"
            return (
                f"reference 'arms': the {side} arm is not stretched sideways (it points {where}, "
                f"expected 10 below); {_again('arms')}"
            )
    even = span_m(view.references["arms"], view.camera, view.distance_m, arms.left, arms.right)
    uneven = even / arms.span_m - 1.0
    if uneven > MAX_UNEVEN:
        shorter = "right" if arms.left.reach_m > arms.right.reach_m else "left"
        return (
            f"reference 'arms': one arm reaches {100 * uneven:.0f} % of the span further than the "
            f"other; the {shorter} arm is bent, or the person is turned; {_again('arms')}"
        )
    head = view.crown_m("arms") - arms.shoulder_m
    if arms.span_m < MIN_SPAN_TO_HEAD * head:
        return (
            "reference 'arms': the arms are not stretched (they span "
            f"{rounded_down(arms.span_m / head, 1)} times the height of head and neck, "
            f"expected {MIN_SPAN_TO_HEAD:.1f} or more); "
            f"{_again('arms')}"
        )
    return ""


def _problem_of_front(view: _View, arms: _Arms) -> str:
    upper, lower = (view.widest_m("front", arms, below) for below in (_ARMPITS, _WRISTS))
    spread = (lower - upper) / ((_WRISTS[0] - _ARMPITS[0]) * arms.span_m)
    widths = view.widths()
    ratio = widths.arms / widths.front
    if spread < HANGING_SPREAD[0]:
        problem = "the hands are at the body"
    elif spread > HANGING_SPREAD[1]:
        problem = "the arms are raised too far"
    elif ratio > MAX_ARMS_TO_FRONT:
        problem = "the arms touch the body"
    elif ratio < MIN_ARMS_TO_FRONT:
        return (
            f"references 'front' and 'arms': 'arms' is only {rounded_down(ratio)} times as wide as "
            f"'front' (expected {MIN_ARMS_TO_FRONT:.2f} or more); the arms are not stretched "
            "sideways in 'arms', or too far from the body in 'front', or the person came "
            "nearer; capture both again"
        )
    else:
        return ""
    return f"reference 'front': {problem}; {_again('front')}"


def _problem_of_side(view: _View, arms: _Arms) -> str:
    front, side = (view.widest_m(name, arms, _SHOULDERS) for name in ("front", "side"))
    # If a part of the chest is missing in the silhouette, the width follows from the span.
    turned = side / max(front, LEAST_SHOULDERS * arms.span_m)
    if turned <= MAX_SIDE_SHOULDERS:
        return ""
    return (
        f"reference 'side': the person did not turn by 90 degrees (the shoulders are "
        f"{rounded_up(100 * turned, 0)} % as wide as from the front, expected "
        f"{100 * MAX_SIDE_SHOULDERS:.0f} % or less); {_again('side')}"
    )


def _problem_of_height(view: _View, arms: _Arms) -> str:
    crown = view.crown_m("front")
    for name in ("side", "arms"):
        shift = view.crown_m(name) - crown
        if abs(shift) > MAX_CROWN_SHIFT * arms.span_m:
            return (
                f"reference '{name}': the head is {100 * abs(shift):.0f} cm "
                f"{'higher' if shift > 0 else 'lower'} than in 'front'; stand upright, on the "
                f"same spot, for all three, and capture '{name}' again; or the head is missing "
                "in a silhouette, because it has the colour of the background"
            )
    return ""
