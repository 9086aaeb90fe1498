"""Ratings of whole bodies with one camera, one silhouette at a time.

:mod:`cardbox_tracker.terms.whole_body_kernels` defines the rating. Rows down to a hand's
breadth below hanging hands count, except for the columns of the legs. So the pixels that count
depend on the last place of the hips.
"""

from __future__ import annotations

from functools import cached_property
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.array_checks import check_array
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import TORSO_X, TORSO_Y, TORSO_Z, state_limits
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.segmentation.regions import NO_WORDS
from cardbox_tracker.terms import body_priors as priors
from cardbox_tracker.terms import whole_body_kernels as kernels
from cardbox_tracker.terms.arm_points import add_costs_of_arms, joints_of_arms
from cardbox_tracker.terms.bit_planes import (
    COUNTED,
    FOREGROUND,
    Planes,
    fill_planes,
    leave_out,
    median_column,
    new_planes,
)
from cardbox_tracker.terms.body_outline import BODY_PATCHES, corners_of_body
from cardbox_tracker.terms.kernel_arguments import Drawn, body_tuple, intrinsics_of, place_of
from cardbox_tracker.terms.outline import Outline
from cardbox_tracker.terms.pose_prior import load_gmm
from cardbox_tracker.terms.term import ARM, ARMS, TRUNK, WHOLE, Posed, Silhouette, TermObservation
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.terms.whole_body_kernels import ObservedTuple, Points

SIDES = tuple(ARMS)
_BOTH_ARMS = (False, True, True)


class Bodies(NamedTuple):
    """Rated states."""

    ratings: FloatArray  #: (N,); lower is better
    costs_px: FloatArray  #: pixels in which model and silhouettes differ, (N,)
    areas_px: FloatArray  #: pixels of the model, (N,)
    points: Points  #: joints of the arms


class Ratings(NamedTuple):
    """Ratings (N,) and the fields of :class:`~.whole_body_kernels.Points` of N states."""

    ratings: FloatArray
    joints_m: FloatArray
    keypoints_m: FloatArray


class WholeBodyCost:
    """Ratings of states (N, 14) of one body before one camera with the present silhouette.

    Attributes:
        person: the body.
        body: fields of :class:`~cardbox_tracker.terms.kernel_arguments.Body`.
        parts: measured parts of ``body``, (6, 6), metres.
        girdle: girdle of ``body``, (3,).
        place: place of the hips of ``body``.
        view: camera of ``body``.
        size: width and height of the image, px.
        limits: lowest and highest value of each value of a state, (14, 2).
        pitch_rad: pitch of the camera, rad, positive downwards.
        counted: number of rows of the present silhouette that count, from the top, and width, px.
        silhouette_px: foreground pixels that count in the present silhouette.
        anchor: x and z of the last frame, home of x, metres, expected yaw and lean, rad; (5,).
        terms: observations of further terms in the present frame.
        covered: pixels (H, W) of other people, not 0, which do not count from the next silhouette
            on; None without any.
    """

    def __init__(self, body: BodyModel, camera: Camera, config: WholeBodyCostConfig) -> None:
        """Prepare for one body and one camera, which includes the pitch."""
        self.person, self._camera, self._config = body, camera, config
        self.body = body_tuple(body, camera, config)
        self.parts, _, self.girdle, self.place, self.view = self.body
        self.size = camera.width, camera.height
        self.limits = state_limits(body.placement.distance_m)
        self.pitch_rad = camera.pitch_rad
        self._rules = priors.rules_of(config)
        self._waist_m = float(body.size("waist_width"))
        self._gaussians = np.ascontiguousarray(load_gmm().T)
        self._beside_arm: int | None = None
        self._seen, self._beside, self._beside_trunk = (
            new_planes(camera.width, camera.height) for _ in range(3)
        )
        self.terms: tuple[TermObservation, ...] = ()
        self.covered: Silhouette | None = None
        self._outline: Outline | None = None
        self.anchor = np.zeros(5)
        self._prior: priors.PriorTuple = self.anchor, self._rules, self._gaussians
        self.see_nothing()

    @cached_property
    def frontal_px(self) -> int:
        """Pixels of the model in the front reference posture."""
        front = self.person.reference_state()[None]
        alone = WholeBodyCost(self.person, self._camera, self._config)
        alone.see(np.zeros(self.size[::-1], np.uint8), front[0])
        return max(1, int(alone.bodies(front).areas_px[0]))

    def see(self, silhouette: Silhouette, state: FloatArray) -> None:
        """Set the silhouette (H, W) of a person whose hips are near those of ``state`` (14,)."""
        config, camera = self._config, self._camera
        check_array("silhouette", silhouette, (camera.height, camera.width))
        if self.covered is not None:
            check_array("covered", self.covered, (camera.height, camera.width))
        self._silhouette, self._outline = silhouette, None
        aside_m, down_m, ahead_m = self.hips(state)
        depth_m = max(ahead_m, 1e-3)
        column = camera.fx * aside_m / depth_m + camera.cx
        row = camera.fy * down_m / depth_m + camera.cy
        hip_row, rows = (
            min(max(ceil(end), 1), camera.height)
            for end in (row, row + config.below_hips_m * camera.fy / depth_m)
        )
        upper = np.ascontiguousarray(silhouette[:rows])
        if self.covered is not None:
            unknown = np.ascontiguousarray(self.covered[:rows])
            fill_planes(unknown, NO_WORDS, self._beside)
            upper = np.where(unknown > 0, np.uint8(0), upper)
        words = upper.view(np.uint64) if camera.width % 8 == 0 else NO_WORDS
        self.counted = rows, camera.width
        self.silhouette_px = int(fill_planes(upper, words, self._seen))
        if self.covered is not None:
            self._seen[COUNTED] &= ~self._beside[FOREGROUND]
        if hip_row < rows:
            half = config.legs * self._waist_m * camera.fx / depth_m
            ends = (min(max(int(end), 0), camera.width) for end in (column - half, column + half))
            self.silhouette_px -= leave_out(self._seen, hip_row, rows, *ends)
        self._scale = 1.0 / max(self.silhouette_px, 1)
        self._by_body = self._by(self._seen, self.silhouette_px)

    def _by(self, planes: Planes, base_px: int) -> tuple[ObservedTuple, priors.PriorTuple]:
        """Return the arguments of the kernels that rate by pixels of ``planes`` and priors."""
        return (planes, *self.counted, base_px, self._scale), self._prior

    def loosen(self, x_factor: float, yaw_unit_rad: float, z_units_m: tuple[float, float]) -> None:
        """Set the factor on the units of ``torso_x``, and the units of yaw and ``torso_z``."""
        self._rules[priors.X_STEP] = x_factor * self._config.x_step_m
        self._rules[priors.X_HOME] = x_factor * self._config.x_home_m
        self._rules[priors.YAW_UNIT] = yaw_unit_rad
        self._rules[priors.Z_STEP], self._rules[priors.Z_HOME] = z_units_m

    def hips(self, state: FloatArray) -> tuple[float, float, float]:
        """Return the middle of the hips of a state (14,), x, y, z in the optical frame, metres."""
        distance_m, height_m = self.place
        x_m = distance_m - float(state[TORSO_X])
        z_m = height_m + float(state[TORSO_Z])
        cos_pitch, sin_pitch = self.view[4:]
        down_m = -cos_pitch * z_m - sin_pitch * x_m
        return float(state[TORSO_Y]), down_m, cos_pitch * x_m - sin_pitch * z_m

    def outline(self, state: FloatArray) -> Outline:
        """Return the present silhouette's outline above the hips of a state (14,)."""
        if self._outline is None:
            hips = self.hips(state)[1:]
            self._outline = Outline(self._silhouette, self._camera, hips, self.covered)
        return self._outline

    def see_nothing(self) -> None:
        """Ignore this frame's silhouette and terms: ratings are the priors alone."""
        self._seen[:], self.counted = 0, (1, self.size[0])
        self.silhouette_px, self._scale, self.terms = 0, 0.0, ()
        self._by_body = self._by(self._seen, 0)

    def bearing(self) -> float:
        """Bearing of the silhouette's median column: lateral coordinate divided by depth."""
        column = median_column(self._seen, *self.counted)
        return (float(column) - self._camera.cx) / self._camera.fx

    def torsos(self, states: FloatArray, arms_of: FloatArray) -> FloatArray:
        """Rate torsos (N,); the arms of the state ``arms_of`` keep their place in the image."""
        self._beside_arm = None
        gain = kernels.cover(arms_of, _BOTH_ARMS, self.body, self.counted, self._seen, self._beside)
        seen = self._by(self._beside, self.silhouette_px + gain)
        rated = self._rated(states, (True, False), seen)
        return self._with_terms(rated.ratings, states, TRUNK, arms_of)

    def fix_torso(self, torso: FloatArray) -> None:
        """Rate arms beside the trunk of the state ``torso`` (14,) from now on."""
        self._torso, self._beside_arm = torso, None
        gain = kernels.cover(torso, TRUNK, self.body, self.counted, self._seen, self._beside_trunk)
        self._by_arms = self._by(self._beside_trunk, self.silhouette_px + gain)

    def uncovered(self, arm: int) -> Planes:
        """Return the planes outside of the fixed torso and the arm opposite to ``arm``."""
        if self._beside_arm != arm:
            other = False, arm == 1, arm == 0
            uncovered = self._beside_trunk, self._beside
            kernels.cover(self._torso, other, self.body, self.counted, *uncovered)
            self._beside_arm = arm
        return self._beside

    def joints(self, arms: FloatArray, arm: int) -> FloatArray:
        """Return shoulder, elbow and hand (N, 3, 3) of arms (N, 4), metres in the torso's frame."""
        joints = np.empty((len(arms), 3, 3))
        joints_of_arms(arms, 1.0 - 2.0 * arm, self.parts, self.girdle, joints)
        return joints

    def arms_by_points(self, arms: FloatArray, joints: FloatArray, arm: int) -> FloatArray:
        """Return approximate ratings (N,) of arms (N, 4), rad, 0 left or 1 right, without priors.

        The silhouette's part is that of :mod:`cardbox_tracker.terms.arm_points`; ``joints`` are the
        arms' :meth:`joints`.
        """
        ratings = np.zeros(len(joints))
        seen = self.uncovered(arm), self.counted, self._scale
        add_costs_of_arms(joints, self._torso, self.body, *seen, ratings)
        return self._with_terms_of_arms(ratings, arms, arm)

    def arms(self, arms: FloatArray, arm: int) -> tuple[FloatArray, FloatArray]:
        """Rate arms (N, 4), 0 left or 1 right, beside the torso, as ``MultiViewCost.arms``."""
        ratings, joints_m = np.empty(len(arms)), np.empty((len(arms), 3, 3))
        of_arms = 1.0 - 2.0 * arm, self._torso, self.body, *self._by_arms
        kernels.rate_arms(arms, *of_arms, ratings, joints_m)
        return self._with_terms_of_arms(ratings, arms, arm), joints_m

    def _with_terms_of_arms(self, ratings: FloatArray, arms: FloatArray, arm: int) -> FloatArray:
        """Add the further terms of arms (N, 4), 0 left or 1 right, at the fixed torso."""
        if not self.terms:
            return ratings
        states = np.repeat(self._torso[None], len(arms), axis=0)
        states[:, ARMS[SIDES[arm]]] = arms
        return self._with_terms(ratings, states, ARM[arm])

    def _with_terms(
        self,
        ratings: FloatArray,
        states: FloatArray,
        parts: Drawn = WHOLE,
        lifted: FloatArray | None = None,
    ) -> FloatArray:
        """Add the further terms of states (N, 14) to their ``ratings`` (N,), which are returned."""
        if self.terms:
            posed = Posed(self.body, states, parts, lifted)
            for term in self.terms:
                ratings += self._scale * term.rate(posed)
        return ratings

    def pairs(self, states: FloatArray, into: Ratings | None = None) -> Ratings:
        """Rate whole states (N, 14), N > 0, with the trunk of :meth:`fix_torso`, as ``bodies``."""
        rated = self._rated(states, (False, True), self._by_arms, into)
        self._with_terms(rated.ratings, states)
        return Ratings(rated.ratings, *rated.points)

    def bodies(self, states: FloatArray, into: Ratings | None = None) -> Bodies:
        """Rate whole states (N, 14); ratings and points are written to ``into`` if it is given."""
        rated = self._rated(states, (True, True), self._by_body, into)
        self._with_terms(rated.ratings, states)
        return rated

    def _rated(
        self,
        states: FloatArray,
        drawn: tuple[bool, bool],
        seen: tuple[ObservedTuple, priors.PriorTuple],
        into: Ratings | None = None,
    ) -> Bodies:
        """Rate states (N, 14) without further terms; ``drawn`` are trunks and arms."""
        n = len(states)
        into = into or Ratings(np.empty(n), np.empty((n, 6, 3)), np.empty((n, 6, 3)))
        pixels, points = (np.empty(n), np.empty(n)), (into.joints_m, into.keypoints_m)
        kernels.rate_bodies(states, drawn, self.body, *seen, into.ratings, pixels, points)
        return Bodies(into.ratings, *pixels, Points(*points))

    def keypoints(self, state: FloatArray) -> FloatArray:
        """Return the keypoints (6, 3) of a state (14,), metres in the optical frame."""
        return pose(self.person, state, self.pitch_rad).keypoints_m

    def are_covered(self, state: FloatArray) -> NDArray[np.bool_]:
        """Return which keypoints (6,) of a state (14,) are where other people are in the image."""
        if self.covered is None:
            return np.zeros(6, np.bool_)
        width, height = self.size
        pixels = Posed(self.body, state[None]).keypoints_px[0]
        columns, rows = np.rint(np.clip(pixels, 0, (width - 1, height - 1))).astype(int).T
        found: NDArray[np.bool_] = self.covered[rows, columns] > 0
        return found

    def corners(self, state: FloatArray) -> FloatArray:
        """Return the drawn patches (13, 4, 3) of a state (14,), metres in the optical frame."""
        corners_m = np.empty((BODY_PATCHES, 4, 3))
        corners_of_body(state, self.body, corners_m)
        return corners_m

    def corners_before(self, state: FloatArray, body: BodyModel, camera: Camera) -> FloatArray:
        """Return :meth:`corners` of the same person, placed as ``body``, before another camera."""
        corners_m = np.empty((BODY_PATCHES, 4, 3))
        moved = *self.body[:3], place_of(body), intrinsics_of(camera)
        corners_of_body(state, moved, corners_m)
        return corners_m


def iou_of(silhouette_px: float, model_px: float, differing_px: float) -> float:
    """Return the intersection over union of silhouette and model from their numbers of pixels."""
    twice_either = float(silhouette_px + model_px + differing_px)
    return 2.0 * float(silhouette_px + model_px) / twice_either - 1.0 if twice_either else 0.0
