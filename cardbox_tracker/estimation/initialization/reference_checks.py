"""Whether each reference silhouette shows the posture that it should.

:mod:`.references` refuses images without a usable person. Here widths and directions in the
silhouettes are compared with those of people who hold the postures, so that whoever mixed them up,
or did not turn or stretch the arms, is told so by name instead of being measured.

The bounds were chosen on 210 rendered bodies who hold the postures, none of whom is refused, and 26
who make mistakes. 60 of the 210 have arms up to 10 degrees off, 70 were cut out by the background
model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.posture import REFERENCE_NAMES
from cardbox_tracker.errors import InitializationError
from cardbox_tracker.estimation.initialization.outline import (
    LevelArm,
    level_arm,
    row_heights_m,
    span_m,
    width_m,
)
from cardbox_tracker.estimation.initialization.references import POSTURE_TEXT
from cardbox_tracker.estimation.initialization.skeleton import BREADTH_OF_SPAN
from cardbox_tracker.estimation.initialization.wording import rounded_down, rounded_up
from cardbox_tracker.vision.camera import Camera

Silhouette = NDArray[np.uint8]

MIN_ARMS_TO_FRONT = 1.72
"""Width of ``arms`` to width of ``front``; 1.8 to 2.7 in people who hold the postures."""

MAX_ARMS_TO_FRONT = 3.0
"""Beyond this the arms touch the body in ``front``; 3.4 with hands on the trousers' seams."""

MIN_FRONT_TO_SIDE = 0.95
"""Width of ``front`` to width of ``side``; 1.2 to 3.3, and 0.3 to 0.65 if swapped."""

MAX_SIDE_SHOULDERS = 0.74
"""Width of the shoulders, ``side`` to ``front``; 0.3 to 0.65, and 0.75 half turned."""

LEAST_SHOULDERS = 0.27
"""Width of the shoulders of ``front``, of the span; 0.25 to 0.34."""

ARM_DROP_DEG = (-8.0, 32.0)
"""Arms of ``arms`` below the level; 10 is asked for."""

MIN_SPAN_TO_HEAD = 3.3
"""Span to height of the crown above the arms; 3.5 to 6.2, and 2.6 to 3.3 with bent elbows."""

MAX_UNEVEN = 0.17
"""By how much one arm reaches further than the other, of the span; 0.16 at most."""

HANGING_SPREAD = (-0.2, 1.25)
"""Growth of the width of ``front`` from armpit to wrist per height; 0.2 to 1.0, hands on the hips
-1.6 to -0.8, arms at 40 degrees 1.46 or more."""

MAX_CROWN_SHIFT = 0.035
"""Change of the crown's height between references, of the span; 2 cm at most."""

# The shoulder joints below the arms' axes; where widths are read, below the joints: at the
# shoulders of `side`, and at armpits and wrists of `front`. All of the span.
_JOINT_BELOW_AXIS = 0.01
_SHOULDERS, _ARMPITS, _WRISTS = (0.02, 0.03, 0.04), (0.04, 0.05, 0.06), (0.21, 0.22, 0.23)


class Widths(NamedTuple):
    """Widths of the three silhouettes, px."""

    front: int
    side: int
    arms: int


@dataclass(frozen=True)
class _View:
    """The references and what they are measured with."""

    references: Mapping[str, Silhouette]
    camera: Camera
    distance_m: float

    def widths(self) -> Widths:
        return Widths(*(_extent_px(self.references[name]) for name in REFERENCE_NAMES))

    def crown_m(self, name: str) -> float:
        """Height of the top of the head above the camera's centre."""
        silhouette = self.references[name]
        row = int(np.argmax(silhouette.any(axis=1)))
        return float(row_heights_m(silhouette, self.camera, self.distance_m)[row])

    def widest_m(self, name: str, arms: _Arms, below: tuple[float, ...]) -> float:
        """Largest width at heights below the shoulders, given as fractions of the span."""
        heights = [arms.shoulder_m - fraction * arms.span_m for fraction in below]
        silhouette = self.references[name]
        widths = [width_m(silhouette, self.camera, self.distance_m, z) for z in heights]
        return float(np.nanmax([*widths, 0.0]))


class _Arms(NamedTuple):
    """Both arms of ``arms``, their span and the height where the shoulders are, metres."""

    left: LevelArm
    right: LevelArm
    span_m: float
    shoulder_m: float


def posture_problems(
    references: Mapping[str, Silhouette], camera: Camera, distance_m: float
) -> list[str]:
    """Return what is wrong with the references, in sentences for the person; empty if nothing.

    Args:
        references: usable silhouettes (H, W) of ``front``, ``side`` and ``arms``, as
            ``outline.filled`` returns them.
        camera: working camera, pitched as it is.
        distance_m: level distance to the person.
    """
    view = _View(references, camera, distance_m)
    mixed_up = _mixed_up(view.widths())
    if mixed_up:
        return [mixed_up]
    arms = _arms(view)
    if arms is None:
        return [f"reference 'arms': no arms are seen; {_again('arms')}"]
    # What is said of `front` and `side` builds on the span of `arms`, so that one comes first.
    for problem in (_problem_of_arms, _problem_of_front, _problem_of_side, _problem_of_height):
        found = problem(view, arms)
        if found:
            return [found]
    return []


def check_postures(references: Mapping[str, Silhouette], camera: Camera, distance_m: float) -> None:
    """Refuse references that do not show what they should; arguments as ``posture_problems``.

    Raises:
        InitializationError: the text names the reference and the mistake.
    """
    problems = posture_problems(references, camera, distance_m)
    if problems:
        raise InitializationError("; ".join(problems))


def _again(name: str) -> str:
    return f"capture '{name}' again: {POSTURE_TEXT[name]}"


def _mixed_up(widths: Widths) -> str:
    """Name the references that were captured for each other: arms are wide, sides narrow."""
    if widths.arms > widths.front > MIN_FRONT_TO_SIDE * widths.side:
        return ""
    if widths.arms <= widths.front and widths.arms > MIN_FRONT_TO_SIDE * widths.front:
        return (
            "reference 'arms': the arms were not raised (it is no wider than 'front'); "
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
    return _Arms(left, right, span, axis - _JOINT_BELOW_AXIS * span)


def _problem_of_arms(view: _View, arms: _Arms) -> str:
    lowest, highest = ARM_DROP_DEG
    for side, arm, sign in (("left", arms.left, -1.0), ("right", arms.right, 1.0)):
        drop = float(np.degrees(np.arctan(sign * arm.slope)))
        if not lowest <= drop <= highest:
            where = f"{abs(drop):.0f} degrees {'below' if drop > 0 else 'above'} the level"
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
    # Where the chest was not cut out, the span tells how wide it is.
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
                "from one silhouette, as where a shirt has the colour of the wall"
            )
    return ""


def _extent_px(silhouette: Silhouette) -> int:
    columns = np.nonzero(silhouette.any(axis=0))[0]
    return int(columns[-1] - columns[0] + 1) if len(columns) else 0
