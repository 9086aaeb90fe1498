"""The full bodies of recorded results, at a rate of their own."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np

from cardbox_tracker.applications.exporting.placed import in_reference
from cardbox_tracker.applications.teleoperation.full_body import FullBodies, FullBody
from cardbox_tracker.person.hands import HAND_NAMES, turn_of
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.legs import LEG_NAMES
from cardbox_tracker.person.skeleton import JOINT_NAMES, NECK_NAMES
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.recordings.result_table import PALM_COLUMNS

_NAMES = (*JOINT_NAMES, *NECK_NAMES, *LEG_NAMES, *HAND_NAMES)
# Between images farther apart nothing is known; a longer gap is shortened.
_LONGEST_S, _LONGEST_GAP_S = 0.5, 1.0


def bodies_of(results: Results) -> Iterator[FullBody]:
    """Yield the full body of each image, from the first one with a person on."""
    make = FullBodies()
    values, deviations = results.of(_NAMES), results.deviations_of(_NAMES)
    palms, turns = results.of(PALM_COLUMNS).reshape(-1, 2, 3), [HAND_NAMES[0], HAND_NAMES[3]]
    images = zip(results.state, results.bodies, values, deviations, palms, strict=True)
    rows = zip(results.stamp_ns.tolist(), images, results.keypoints(), strict=True)
    for stamp_ns, (state, body, row, stddev, palm), keypoints in rows:
        found, known = (dict(zip(_NAMES, one.tolist(), strict=True)) for one in (row, stddev))
        posture = row[: len(JOINT_NAMES)]
        if body is not None and np.isfinite(palm).any() and np.isfinite(posture).all():
            # A table has the palms in place of their turns about the forearms.
            posed = pose(body, posture)
            arms = zip(turns, (1.0, -1.0), (posed.left, posed.right), palm, strict=True)
            for name, sign, arm, normal in arms:
                found[name] = turn_of(in_reference(normal, body), arm.forearm_rotation, sign)
                known[name] = 0.0
        one = make.update(stamp_ns, state, body, found, known, keypoints)
        if one is not None:
            yield one


def at_rate(bodies: Iterable[FullBody], rate_hz: float) -> Iterator[FullBody]:
    """Yield the bodies at even times, between those of the images; all is invalid in gaps."""
    before: FullBody | None = None
    first_ns = number = 0
    for after in bodies:
        if before is None:
            first_ns, before = after.stamp_ns, after
        gap_s = (after.stamp_ns - before.stamp_ns) / 1e9
        end_ns = min(after.stamp_ns, before.stamp_ns + round(_LONGEST_GAP_S * 1e9))
        while (time_ns := first_ns + round(number * 1e9 / rate_hz)) < end_ns:
            is_near = gap_s <= _LONGEST_S
            yield before.until(after, time_ns) if is_near else before.invalid(time_ns)
            number += 1
        number = max(number, math.ceil((after.stamp_ns - first_ns) * rate_hz / 1e9))
        before = after
    if before is not None:
        yield before
