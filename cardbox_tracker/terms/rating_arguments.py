"""Arguments and scratch arrays of the compiled ratings of whole bodies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cardbox_tracker.common.compiling import inlined_allocation
from cardbox_tracker.person.kinematics import PosedArm, new_arm
from cardbox_tracker.terms.bit_masks import Masks, new_masks
from cardbox_tracker.terms.bit_planes import Planes
from cardbox_tracker.terms.body_priors import Prior
from cardbox_tracker.terms.kernel_arguments import Floats
from cardbox_tracker.terms.rasterisation import Workspace, new_workspace


class Observed(NamedTuple):
    """A silhouette, or the part of it outside of parts that are already drawn."""

    planes: Planes  #: pixels that count, and foreground, (2, words, rows); see :mod:`.bit_planes`
    rows: int  #: number of rows that count, from the top
    width: int  #: width of the image, px
    base_px: int  #: cost without further parts, px
    scale: float  #: 1 / (pixels of the silhouette)


class Points(NamedTuple):
    """Shoulder, elbow and hand of the left, then of the right arm of N states."""

    joints_m: Floats  #: in the torso's frame, (N, 6, 3), metres
    keypoints_m: Floats  #: in the optical frame, (N, 6, 3), metres


ObservedTuple = tuple[Planes, int, int, int, float]
PointsTuple = tuple[Floats, Floats]


class Scratch(NamedTuple):
    """Scratch arrays of the ratings."""

    work: Workspace  #: for the drawn patches
    arm: PosedArm  #: for one arm
    masks: Masks  #: for the union of the patches
    logs: Floats  #: one value for each Gaussian of the prior, (K,)


@inlined_allocation
def new_scratch(patches: int, seen: Observed, given: Prior) -> Scratch:
    """Return the scratch arrays for a number of patches."""
    return Scratch(
        new_workspace(patches, seen.planes.shape[2]),
        new_arm(),
        new_masks(patches, seen.planes),
        np.empty(given.gaussians.shape[1]),
    )
