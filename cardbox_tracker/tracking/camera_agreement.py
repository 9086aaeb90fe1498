"""Detection of wrong extrinsics from the tracked person.

With wrong extrinsics no posture fits all silhouettes: size, place and height of the person in one
image contradict those in the other. A window of sampled frames gives a new estimate of the rotation
of each further camera (:mod:`cardbox_tracker.measuring.camera_pose`). A difference of about a
degree in pitch or yaw from the extrinsics is reported.

A roll of the camera hardly changes the fit, because the model leans with it. It is estimated from
the planes through both cameras that touch the person
(:mod:`cardbox_tracker.measuring.silhouette_tangents`), which show an inverted pose and exchanged
images within seconds.
``docs/research.md#several-cameras`` has detection rates.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from math import atan2

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.view import View
from cardbox_tracker.common.errors import CameraError
from cardbox_tracker.common.health import WATCHES, Verdict
from cardbox_tracker.measuring.camera_pose import ROTATION, PoseProblem, Sighting, turned_by
from cardbox_tracker.measuring.silhouette_tangents import EVERY, PoseDirection, TopTangents, roll_of
from cardbox_tracker.person.model import MEASURED, BodyModel
from cardbox_tracker.person.posture import TORSO_X, TORSO_Y
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.approach import DISTANCES_M
from cardbox_tracker.terms.term import Frame
from cardbox_tracker.tracking.tracked_camera import middle

# Samples in a window (12 s at 15 Hz), and between two checks; as many tangents show the roll.
_WINDOW, _AGAIN = 15, 60
LEAST_SIGHTINGS = 8
"""Least number of samples of a recording."""
# Least sine of the angle between lines of sight that show a distance.
_LEAST_ANGLE = 0.2
# Lines of sight at a smaller angle are those of a narrow pair. How far a distance by the size may
# be off.
_NARROW_DEG, _SIZES = 10.0, np.array([0.85, 1.15])


class _Compared:
    """A further camera beside the first one: samples, and what they say of its extrinsics."""

    def __init__(self, body: BodyModel, first: Camera, view: View, earlier: _Compared | None):
        """Begin without samples, but for the verdict on the pose that holds for any body."""
        self.view = view
        # The pose of the camera without its roll.
        axes = view.level_axes() @ first.reference_to_optical_rotation().T
        offset_m = view.camera.reference_to_optical_rotation() @ view.offset_m
        self.upright = Extrinsics(axes, offset_m)
        self.kept, self.missing = deque[Sighting](maxlen=_WINDOW), _WINDOW
        self.tops = TopTangents(first, view.camera, most=_AGAIN)
        self.direction: PoseDirection = (
            PoseDirection(first, view.camera, self.upright, view.roll_rad)
            if earlier is None
            else earlier.direction
        )
        self.is_measured = body.source == MEASURED
        self.aside: Verdict = Verdict("aside") if earlier is None else earlier.aside
        self.turned = Verdict("extrinsics" if self.is_measured else "extrinsics unmeasured")
        self.rolled, self.unit = Verdict("rolled", abs), Verdict("unit", abs)
        self._distance_m = body.placement.distance_m

    @property
    def fault(self) -> Verdict | None:
        """A gross error, so that images are not used; None without one."""
        others = self.aside, self.direction.lag.concordance
        return self.direction.fault or next((one for one in others if one.holds), None)

    @property
    def is_suspected(self) -> bool:
        """Whether the first samples show an error, which are too few to tell it."""
        verdicts = self.direction, self.aside, self.unit
        return any(one.is_suspected for one in verdicts)

    def remarks(self, name: str) -> Iterator[str]:
        """Yield warnings about doubtful extrinsics; some are empty."""
        if self.fault is not None:
            yield self.fault.remark(name=name)
            return
        if self.unit.holds:
            given_m = float(np.linalg.norm(self.view.offset_m))
            shown_m = given_m / 10 ** self.unit.medians[0]
            yield self.unit.remark(name=name, given_m=given_m, shown_m=shown_m)
            return
        if self.turned.holds:
            shown = _shown(self.turned.value)
            yield WATCHES["extrinsics"].words.format(name=name, shown=shown)
        else:
            yield self.direction.height.remark(name=name)
        yield self.direction.joints.remark(name=name)
        yield self.direction.lag.remark(name)
        yield self.rolled.remark(name=name, shown=_shown(self.rolled.value))

    def look(self, first: Frame, other: Frame, distance_m: float | None) -> None:
        """Compare silhouettes and points, whether or not a posture fits.

        Of a narrow pair, whose silhouettes have the same middle, the angle between both lines of
        sight shows the distance, which is ``distance_m`` by the size, if that is known.
        """
        points = first.points, other.points
        self.direction.see(first.silhouette, other.silhouette, points, first.stamp_ns)
        columns = middle(first.silhouette), middle(other.silhouette)
        if columns[0] is None or columns[1] is None:
            return
        here = (columns[0] - first.camera.cx) / first.camera.fx
        there = (columns[1] - other.camera.cx) / other.camera.fx
        at, ahead = map(np.array, self.view.line_of_sight(there))
        before = np.array([-1.0, here])

        def angle(line: FloatArray, away_m: float) -> float:
            to = away_m * before - at
            return float(np.degrees(atan2(line[0] * to[1] - line[1] * to[0], line @ to)))

        if abs(angle(before, distance_m or self._distance_m)) < _NARROW_DEG:
            range_m = DISTANCES_M[[0, -1]] if distance_m is None else distance_m * _SIZES
            off = np.array([angle(ahead, away_m) for away_m in range_m])
            across = 0.0 if off.prod() <= 0.0 else np.abs(off).min()
            self.aside.see(max(across, self.direction.height.value))

    def place(self, state: FloatArray, column: float) -> None:
        """Compare how far the person is by their size and by both cameras' lines of sight.

        ``column``, px, is where the further camera sees them; ``state`` (14,) is for the first one.
        Lines that hardly meet show nothing.
        """
        camera, here = self.view.camera, (state[TORSO_X] - self._distance_m, state[TORSO_Y])
        at, ahead = self.view.line_of_sight((column - camera.cx) / camera.fx)
        turned = here[0] * ahead[1] - here[1] * ahead[0]
        share = (at[0] * ahead[1] - at[1] * ahead[0]) / turned if turned else 0.0
        if share > 0.0 and abs(turned) > _LEAST_ANGLE * np.hypot(*here):
            self.unit.see(float(np.log10(share)))


class CameraAgreement:
    """Compares extrinsics with silhouettes; :meth:`check` takes as long as about 100 frames.

    Frames in which others hide pixels of the person show no outline, so they do not count.
    """

    def __init__(
        self,
        body: BodyModel,
        first: Camera,
        views: Sequence[View],
        earlier: CameraAgreement | None = None,
    ) -> None:
        """Begin to compare ``views`` of further cameras with ``first``, which includes its pitch.

        ``body`` was measured by the first camera. ``earlier`` is a comparison of the same cameras
        with another body.
        """
        self._body, self._first, self.views = body, first, tuple(views)
        before = [None] * len(views) if earlier is None else earlier._others
        pairs = zip(views, before, strict=True)
        self._others: list[_Compared] = [_Compared(body, first, *one) for one in pairs]
        self._frames = 0
        self._joints_deg = list[float | None]()
        # How far the person was in the frame before, by their size; None without a posture.
        self._away_m: float | None = None if earlier is None else earlier._away_m

    def look(self, frames: Sequence[Frame]) -> bool:
        """Compare upright frames, whether or not a posture fits; return whether they count."""
        first, *others = frames
        pairs = [*zip(self._others, others, strict=True)]
        if not _are_whole(frames):
            self._joints_deg = [
                one.direction.joints_deg(first.points, other.points) for one, other in pairs
            ]
            return False
        for one, other in pairs:
            one.look(first, other, self._away_m)
        self._away_m = None
        return True

    def take_joints(self) -> list[float | None]:
        """Return :meth:`.PoseDirection.joints_deg` of each further camera in a frame, once.

        They are known of frames in which others hide pixels of the person.
        """
        found, self._joints_deg = self._joints_deg or [None] * len(self._others), []
        return found

    @property
    def are_contradicted(self) -> list[bool]:
        """Whether the silhouettes show a gross error of the pose of each further camera."""
        return [one.fault is not None for one in self._others]

    @property
    def are_doubtful(self) -> list[bool]:
        """Whether anything is told, or suspected, of each further camera."""
        return [one.is_suspected or any(one.remarks("")) for one in self._others]

    def see(
        self, state: FloatArray, frames: Sequence[Frame], columns: Sequence[float | None] = ()
    ) -> None:
        """Add tracked frames, as for :meth:`look`: state (14,) for the first camera.

        ``columns``, px, are the middles of what further cameras show in front of the background.
        """
        self._away_m = self._body.placement.distance_m - float(state[TORSO_X])
        if not _are_whole(frames):
            return
        for one, column in zip(self._others, columns, strict=False):
            if column is not None:
                one.place(state, column)
        first, *others = (frame.silhouette for frame in frames)
        self._frames += 1
        if self._frames % EVERY or not np.any(first):
            return
        for one, other in zip(self._others, others, strict=True):
            if not np.any(other):
                continue
            one.tops.add(first, other)
            if self._frames % (2 * EVERY) == 0:
                one.kept.append(Sighting(state.copy(), first.copy(), other.copy()))
                one.missing -= 1

    @property
    def is_due(self) -> bool:
        """Whether a further camera has a full window for :meth:`check`."""
        return any(one.missing <= 0 for one in self._others)

    def check(self, is_last: bool = False) -> None:
        """Estimate rotations of cameras with a full window, of others too if no frames follow."""
        for one in self._others:
            is_enough = is_last and not one.turned.samples and len(one.kept) >= LEAST_SIGHTINGS
            if one.missing > 0 and not is_enough:
                continue
            one.missing = _AGAIN
            one.turned.see(self._turn_of(one))
            roll_rad, stddev_rad = roll_of(one.tops.copy(), one.upright)
            # Three deviations are less than what is told.
            if 3.0 * np.degrees(stddev_rad) < one.rolled.watch.limit:
                one.rolled.see(float(np.degrees(roll_rad)))

    @property
    def turned_deg(self) -> list[float | None]:
        """Pitch and yaw of each further camera against its extrinsics, as one angle, degrees.

        The median of the latest windows; None before the first check.
        """
        return [next(iter(one.turned.medians), None) for one in self._others]

    @property
    def rolled_deg(self) -> list[float | None]:
        """Median roll against the extrinsics, signed degrees; None before it, or without motion."""
        return [next(iter(one.rolled.medians), None) for one in self._others]

    def values(self, names: Sequence[str]) -> dict[str, str]:
        """Return the rotation error of each further camera, by ``names``, for the diagnostics."""
        errors = {"turned": self.turned_deg, "rolled": self.rolled_deg}
        return {
            f"{name} {how} (deg)": "not yet known" if degrees is None else f"{degrees:.1f}"
            for how, found in errors.items()
            for name, degrees in zip(names, found, strict=True)
        }

    def remarks(self, names: Sequence[str]) -> list[str]:
        """Return a warning for each further camera, by ``names``, with doubtful extrinsics."""
        pairs = zip(names, self._others, strict=True)
        return [text for name, one in pairs for text in one.remarks(name) if text]

    def _turn_of(self, other: _Compared) -> float:
        """Return pitch and yaw of a camera as one angle, degrees; inf if no pose fits."""
        given = self._body, self._first, other.view.camera, other.upright, list(other.kept)
        try:
            found, _ = PoseProblem(*given).solve(ROTATION)
        except (CameraError, np.linalg.LinAlgError):
            return float("inf")
        return float(np.degrees(np.linalg.norm(turned_by(other.upright, found)[:2])))


def _are_whole(frames: Sequence[Frame]) -> bool:
    # What others hide is missing in the outline, and networks mix people.
    return all(frame["covered"] is None for frame in frames)


def _shown(degrees: float) -> str:
    return f"about {degrees:.1f}" if np.isfinite(degrees) else "many"
