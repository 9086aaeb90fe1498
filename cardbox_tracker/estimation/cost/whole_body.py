"""Rate whole bodies against one silhouette after the other: what the whole-body filter asks.

See :mod:`cardbox_tracker.estimation.cost.whole_body_kernels` for what a rating is. Rows down to a
hand's breadth below hanging hands count, but not where the legs are; so the rows and columns that
count depend on where the hips were found last.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.model import MEASURED, BodyModel
from cardbox_tracker.body.posture import reference_posture
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost import whole_body_kernels as kernels
from cardbox_tracker.estimation.cost.arm_points import add_costs_of_arms, joints_of_arms
from cardbox_tracker.estimation.cost.kernel_arguments import place_of, shape_of, view_of
from cardbox_tracker.estimation.cost.kernels import PlaceTuple, ViewTuple
from cardbox_tracker.estimation.cost.pose_prior import load_gmm
from cardbox_tracker.estimation.cost.row_sums import fill_row_sums
from cardbox_tracker.estimation.cost.terms import ARMS, Silhouette, TermObservation
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.vision.camera import Camera

SIDES = tuple(ARMS)
_NO_WORDS = np.zeros((1, 0), np.uint64)
# The neck is drawn this far into the head, as a fraction of the head's height: an outline has no
# gap below the jaw.
_NECK_INTO_HEAD = 0.25
_TORSO_OF_TERMS = [0, 1, 2, 3, kernels.TORSO_X, kernels.TORSO_Z]


_Figure = tuple[FloatArray, FloatArray, FloatArray, PlaceTuple, ViewTuple]


class WholeBodyCost:
    """Ratings of states (N, 14) of one body before one camera; sees one silhouette at a time.

    Attributes:
        parts: the measured parts, (6, 6), metres (``kernel_arguments.shape_of``).
        girdle: where the shoulders are, and how they are lifted, (5,).
        place: where the hips are in the body model.
        view: the camera.
        pitch_rad: how far the camera looks down.
        is_measured: the body was measured, not guessed from proportions.
        frontal_px: pixels of the model in the front reference posture.
        silhouette_px: foreground pixels that count in the present silhouette.
        anchor: x and z of the last frame and the home of x, metres, and the expected yaw, rad;
            (4,).
        terms: what further terms say of the present frame.
    """

    def __init__(self, body: BodyModel, camera: Camera, config: WholeBodyCostConfig) -> None:
        """Prepare for one body before one camera, pitched as it stands."""
        self._body, self._camera, self._config = body, camera, config
        self.parts, shoulder = shape_of(body.sizes, config.neck_to_head)
        self.girdle = np.array(
            [
                *shoulder,
                config.clavicle * body.size("shoulder_breadth"),
                config.lift_gain,
                np.radians(config.lift_from_deg),
            ]
        )
        self.place, self.view = place_of(body), view_of(camera)
        self.pitch_rad = camera.pitch_rad
        self.is_measured = body.source == MEASURED
        self._drawn = _drawn_parts(self.parts, config)
        self._rules = _rules(config)
        self._gmm = np.array(load_gmm())
        # Sums along a row fit 16 bits for any image narrower than 32768 px, and stay in cache.
        kind = np.int16 if camera.width < 2**15 else np.int32
        shape = (camera.height, camera.width + 1)
        self._beside_arm: int | None = None
        self._all_rows: tuple[NDArray[Any], ...] = tuple(np.zeros(shape, kind) for _ in range(3))
        self.terms: tuple[TermObservation, ...] = ()
        self.anchor = np.zeros(4)
        front = np.zeros((1, kernels.N_STATE))
        front[0, :12] = reference_posture("front")
        front[0, 0] = body.placement.lateral_m
        self.see(np.zeros((camera.height, camera.width), np.uint8), front[0])
        self.frontal_px = max(1, int(self.bodies(front)[2][0]))

    def see(self, silhouette: Silhouette, state: FloatArray) -> None:
        """Take a silhouette (H, W) of a person whose hips are about where ``state`` (14,) says."""
        config, camera = self._config, self._camera
        hip = self._hips(state, camera)
        depth_m = max(float(hip[2]), 1e-3)
        column, row = camera.fx * hip[0] / depth_m + camera.cx, camera.fy * hip[1] / depth_m
        row += camera.cy
        hip_row, rows = (
            int(np.clip(np.ceil(end), 1, camera.height))
            for end in (row, row + config.below_hips_m * camera.fy / depth_m)
        )
        upper = np.ascontiguousarray(silhouette[:rows])
        words = upper.view(np.uint64) if upper.shape[1] % 8 == 0 else _NO_WORDS
        self._seen, self._beside, self._beside_trunk = (table[:rows] for table in self._all_rows)
        self.silhouette_px = int(fill_row_sums(upper, words, self._seen))
        if hip_row < rows:
            half = config.legs * self._body.size("waist_width") * camera.fx / depth_m
            ends = (int(np.clip(end, 0, camera.width)) for end in (column - half, column + half))
            self.silhouette_px -= kernels.leave_out(self._seen, hip_row, *ends)
        self._scale = 1.0 / max(self.silhouette_px, 1)

    def _hips(self, state: FloatArray, camera: Camera) -> FloatArray:
        x_m = self._body.placement.distance_m - state[kernels.TORSO_X]
        z_m = self._body.placement.hip_height_m + state[kernels.TORSO_Z]
        return camera.reference_to_optical(np.array([-x_m, state[kernels.TORSO_Y], z_m]))

    def hip_row(self, state: FloatArray, camera: Camera) -> float:
        """Return the row of the hips of a state (14,) in the image of ``camera``, at any size."""
        _, down_m, ahead_m = self._hips(state, camera).tolist()
        return float(camera.fy * down_m / max(ahead_m, 1e-3) + camera.cy)

    def see_nothing(self) -> None:
        """Let this frame's silhouette and terms say nothing: ratings are the priors alone."""
        self._seen, self._beside, self._beside_trunk = (table[:1] for table in self._all_rows)
        self._seen[:] = 0
        self.silhouette_px, self._scale, self.terms = 0, 0.0, ()

    def bearing(self) -> float:
        """Bearing of the silhouette's median column, aside over ahead."""
        column = kernels.median_column(self._seen)
        return (float(column) - self._camera.cx) / self._camera.fx

    def torsos(self, states: FloatArray, arms_of: FloatArray) -> FloatArray:
        """Rate torsos (N,), with the arms of a state drawn where they are in the image."""
        self._beside_arm = None
        gain = kernels.cover(arms_of, False, True, True, *self.figure, self._seen, self._beside)
        ratings = np.empty(len(states))
        kernels.rate_trunks(
            states,
            self._drawn,
            self.place,
            self.view,
            self._beside,
            self.silhouette_px + gain,
            self._scale,
            self.anchor,
            self._rules,
            ratings,
        )
        for term in self.terms:
            ratings += self._scale * term.torsos_beside(None)(states[:, _TORSO_OF_TERMS])
        return ratings

    def fix_torso(self, torso: FloatArray) -> None:
        """Rate arms beside the trunk of the state ``torso`` (14,) from now on."""
        self._torso, self._beside_arm = torso, None
        gain = kernels.cover(
            torso, True, False, False, *self.figure, self._seen, self._beside_trunk
        )
        self._base_px = self.silhouette_px + gain
        self._arm_terms = [term.arms_beside(torso[_TORSO_OF_TERMS]) for term in self.terms]

    def uncovered(self, arm: int) -> NDArray[Any]:
        """Row sums beside the fixed torso and the other arm than ``arm``, 0 left or 1 right."""
        if self._beside_arm != arm:
            is_left, seen = arm == 1, (self._seen, self._beside)
            kernels.cover(self._torso, True, is_left, not is_left, *self.figure, *seen)
            self._beside_arm = arm
        return self._beside

    def joints(self, arms: FloatArray, arm: int) -> FloatArray:
        """Return shoulder, elbow and hand (N, 3, 3) of arms (N, 4), metres in the torso's frame."""
        joints = np.empty((len(arms), 3, 3))
        joints_of_arms(arms, 1.0 - 2.0 * arm, self.parts, self.girdle, joints)
        return joints

    def arms_by_points(self, joints: FloatArray, arm: int) -> FloatArray:
        """Return about what arms with ``joints`` cost, 0 left or 1 right, without priors, (N,).

        See :mod:`cardbox_tracker.estimation.cost.arm_points`.
        """
        costs = np.zeros(len(joints))
        seen = self.uncovered(arm), self._scale
        add_costs_of_arms(joints, self._torso, *self.figure, *seen, costs)
        return costs

    def arms(self, arms: FloatArray, arm: int) -> FloatArray:
        """Rate arms (N, 4), 0 left or 1 right, beside the fixed torso."""
        ratings = np.empty(len(arms))
        kernels.rate_arms(
            arms,
            1.0 - 2.0 * arm,
            self._torso,
            *self.figure,
            self._beside_trunk,
            self._base_px,
            self._scale,
            self._rules,
            self._gmm,
            ratings,
        )
        for costs in self._arm_terms:
            ratings += self._scale * costs(SIDES[arm], arms)
        return ratings

    def bodies(self, states: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Rate whole states (N, 14): ratings, differing and drawn pixels, each (N,)."""
        ratings, costs_px, areas_px = np.empty((3, len(states)))
        kernels.rate_bodies(
            states,
            *self.figure,
            self._seen,
            self.silhouette_px,
            self._scale,
            self.anchor,
            self._rules,
            self._gmm,
            ratings,
            costs_px,
            areas_px,
        )
        for term in self.terms:
            ratings += self._scale * term.postures(states)
        return ratings, costs_px, areas_px

    def share_silhouette(self, other: WholeBodyCost) -> None:
        """Take over the silhouette of ``other``, of another body before the same camera."""
        self._seen, self.anchor = other._seen, other.anchor
        self.silhouette_px, self._scale = other.silhouette_px, other._scale

    def outline_rating(self, state: FloatArray) -> float:
        """Return the rating of a state (14,) without further terms."""
        terms, self.terms = self.terms, ()
        rating = float(self.bodies(state[None])[0][0])
        self.terms = terms
        return rating

    def keypoints(self, state: FloatArray) -> FloatArray:
        """Return the keypoints (6, 3) of a state (14,), metres in the optical frame."""
        points = np.empty((6, 3))
        kernels.keypoints(state, self.parts, self.girdle, self.place, self.view, points)
        return points

    def corners(self, state: FloatArray) -> FloatArray:
        """Return the drawn patches (13, 4, 3) of a state (14,), metres in the optical frame."""
        corners_m = np.empty((kernels.BODY_PATCHES, 4, 3))
        kernels.corners_of_body(state, *self.figure, corners_m)
        return corners_m

    def corners_before(self, state: FloatArray, body: BodyModel, camera: Camera) -> FloatArray:
        """Return :meth:`corners` of the same person, placed as ``body``, before another camera."""
        corners_m = np.empty((kernels.BODY_PATCHES, 4, 3))
        figure = self.parts, self._drawn, self.girdle, place_of(body), view_of(camera)
        kernels.corners_of_body(state, *figure, corners_m)
        return corners_m

    @property
    def rows(self) -> int:
        """Rows of the present silhouette that count, from the top."""
        return len(self._seen)

    @property
    def figure(self) -> _Figure:
        """What the kernels know of the body and its camera."""
        return self.parts, self._drawn, self.girdle, self.place, self.view


def iou_of(silhouette_px: float, model_px: float, differing_px: float) -> float:
    """Return the intersection over union of silhouette and model, of which some pixels differ."""
    twice_either = float(silhouette_px + model_px + differing_px)
    return 2.0 * float(silhouette_px + model_px) / twice_either - 1.0 if twice_either else 0.0


def _drawn_parts(parts: FloatArray, config: WholeBodyCostConfig) -> FloatArray:
    """Return the parts (6, 6) whose outlines are drawn."""
    drawn = parts.copy()
    drawn[kernels.WAIST, kernels.BOTTOM] -= config.waist_extension_m
    drawn[kernels.WAIST, kernels.HEIGHT] += config.waist_extension_m
    into_m = _NECK_INTO_HEAD * parts[kernels.HEAD, kernels.HEIGHT]
    drawn[kernels.NECK, kernels.HEIGHT] += into_m
    drawn[kernels.FOREARM, kernels.HEIGHT] += config.fingers_m
    return drawn


def _rules(config: WholeBodyCostConfig) -> FloatArray:
    """Return what the kernels call ``rules``, (15,)."""
    rules = np.empty(kernels.N_RULES)
    rules[kernels.WEIGHT] = config.weight
    rules[kernels.ROLL_UNIT] = np.radians(config.roll_deg)
    rules[kernels.PITCH_REST] = np.radians(config.pitch_rest_deg)
    rules[kernels.FORWARD_UNIT] = np.radians(config.pitch_forward_deg)
    rules[kernels.BACK_UNIT] = np.radians(config.pitch_back_deg)
    rules[kernels.YAW_UNIT] = np.radians(config.yaw_deg)
    rules[kernels.ANGLE_CAP] = config.angle_cap
    rules[kernels.X_STEP], rules[kernels.Z_STEP] = config.x_step_m, config.z_step_m
    rules[kernels.STEP_CAP] = config.step_cap
    rules[kernels.X_HOME], rules[kernels.Z_HOME] = config.x_home_m, config.z_home_m
    rules[kernels.HOME_CAP] = config.home_cap
    rules[kernels.PENETRATION] = config.penetration
    rules[kernels.UNKNOWN_DENSITY] = np.exp(-config.unknown_nats)
    return rules
