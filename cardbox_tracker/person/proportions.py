"""Estimates a body from the stature: the mean sizes of people of that stature.

Every size is a fraction of the stature. The lengths of the trunk are from Drillis & Contini, "Body
Segment Parameters", 1966 (also in Winter, "Biomechanics and Motor Control of Human Movement").
Upper arm, and forearm with the hand up to its knuckles, are the means of men and women of de Leva,
"Adjustments to Zatsiorsky-Seluyanov's Segment Inertia Parameters", 1996. Breadths and depths are
from ANSUR II, 2012; the distance between the shoulder joints is the mean biacromial breadth of both
sexes, 0.237 and 0.224 of the stature, less 3 cm on either side.

Among people of one stature lengths vary by about 6 % and breadths by about 20 %, so such a
body is less exact than a measured one.
"""

from __future__ import annotations

from cardbox_tracker.person.model import PROPORTIONS, BodyModel, check_range
from cardbox_tracker.person.sizes import DEFAULT_SIZES, SIZE_INDEX, SIZES, FloatArray

STATURE_M = 1.72
"""Stature that ``DEFAULT_SIZES`` belongs to, metres."""

USUAL_STATURE_M, USUAL_STDDEV_M = 1.69, 0.09
"""Mean stature of adults, women and men alike, and its standard deviation, metres."""

_SHARES = {"upper_arm_length": 0.160, "forearm_length": 0.2005, "shoulder_breadth": 0.197}

STATURE_LIMITS_M = (1.1, 2.2)
"""Range of the stature, metres: a child of six to a very tall adult."""

BREADTHS: tuple[str, ...] = (
    "shoulder_breadth",
    "torso_top_width",
    "torso_bottom_width",
    "waist_width",
    "head_width",
    "upper_arm_width",
    "forearm_width",
)
"""Sizes that depend little on the stature and that the outline from the front shows."""


def sizes_of_stature(stature_m: float) -> FloatArray:
    """Return the mean sizes (18,) of people of a stature, metres."""
    sizes: FloatArray = DEFAULT_SIZES * stature_m / STATURE_M
    for name, share in _SHARES.items():
        sizes[SIZE_INDEX[name]] = share * stature_m
    return sizes


def body_from_proportions(
    stature_m: float,
    distance_m: float | None = None,
    shoulder_breadth_m: float | None = None,
    hip_height_m: float | None = None,
    camera_pitch_rad: float = 0.0,
) -> BodyModel:
    """Return a body of the given stature; values that are not given are marked as unknown.

    The distance is level, the breadth between the shoulder joints, the height that of the middle of
    the hips above the camera's centre. Raises BodyModelError if one is out of range.
    """
    check_range("stature", stature_m, *STATURE_LIMITS_M, "m")
    sizes = sizes_of_stature(stature_m)
    given = {"distance_m": distance_m, "hip_height_m": hip_height_m}
    unknown = [name for name, value in given.items() if value is None]
    breadths = list(BREADTHS)
    if shoulder_breadth_m is not None:
        breadth, top = SIZE_INDEX["shoulder_breadth"], SIZE_INDEX["torso_top_width"]
        limits = SIZES[breadth].minimum_m, SIZES[breadth].maximum_m
        check_range("shoulder_breadth", shoulder_breadth_m, *limits, "m")
        sizes[top] *= shoulder_breadth_m / sizes[breadth]
        sizes[breadth] = shoulder_breadth_m
        breadths.remove("shoulder_breadth")
    return BodyModel.of(
        sizes.round(4),
        camera_pitch_rad=camera_pitch_rad,
        source=PROPORTIONS,
        unknown=(*unknown, *breadths),
        **{name: value for name, value in given.items() if value is not None},
    )
