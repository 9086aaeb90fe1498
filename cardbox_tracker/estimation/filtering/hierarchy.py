"""The hierarchical particle filter: first the torso, then both arms (paper, section III-B).

The torso filter rates torso, waist and head. Each arm filter then rates its arm beside the torso
just found, so the two arms do not depend on each other and can run at the same time.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from cardbox_tracker.body.posture import JOINT_LIMITS, JOINT_NAMES, N_JOINTS, TORSO
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.config import TrackerConfig
from cardbox_tracker.estimation.cost.silhouette import ARMS, CostArray, SilhouetteCost
from cardbox_tracker.estimation.filtering.particle_filter import ParticleFilter
from cardbox_tracker.estimation.filtering.particle_kernels import add_prior
from cardbox_tracker.estimation.filtering.resampling import STRATEGIES

_REFERENCE_AREA_PX = 320 * 240
# In which unit the prior measures each angle's distance from rest. An outline shows well how far an
# arm is raised aside, so its abduction hardly needs a prior; flexion, which moves it towards the
# camera or away, does. So does the torso: whoever stands before a camera faces it upright. Its
# place has no rest.
_RANGES = JOINT_LIMITS[:, 1] - JOINT_LIMITS[:, 0]
_PRIOR_UNITS = np.where([name.endswith("flexion") for name in JOINT_NAMES], _RANGES / 6, _RANGES)
_PRIOR_UNITS[0] = np.inf
_PRIOR_UNITS[1:4] = np.radians([20.0, 26.0, 20.0])
_ABOVE_REST = 1.0 / _PRIOR_UNITS
# A bow and leaning back lower the head alike in the image, but people bow.
_BELOW_REST = _ABOVE_REST.copy()
_BELOW_REST[JOINT_NAMES.index("torso_pitch")] *= 3.0


class HierarchicalFilter:
    """Three particle filters that share one cost."""

    def __init__(
        self, cost: SilhouetteCost, config: TrackerConfig, image_px: int, rng: np.random.Generator
    ) -> None:
        """Set the filters up; :meth:`scatter` gives them particles.

        Args:
            cost: rates postures; the caller lets it observe each silhouette.
            config: settings.
            image_px: pixels of an image, to scale what the settings say of 320x240.
            rng: split into one stream a filter, so that threads cannot mix them.
        """
        self._cost = cost
        self._config = config
        self._scale = image_px / _REFERENCE_AREA_PX
        resampler = STRATEGIES[config.strategy]
        streams = rng.spawn(3)
        torso_noise = np.full(4, config.torso.rotation_noise_rad)
        torso_noise[0] = config.torso.translation_noise_m
        arm_noise = np.full(4, config.arm.rotation_noise_rad)
        self.torso = ParticleFilter(
            config.torso, resampler, torso_noise, JOINT_LIMITS[TORSO], streams[0]
        )
        self.arms = {
            side: ParticleFilter(config.arm, resampler, arm_noise, JOINT_LIMITS[joints], stream)
            for (side, joints), stream in zip(ARMS.items(), streams[1:], strict=True)
        }
        self._last: FloatArray | None = None
        fewest = config.parallel_from
        parallel = fewest is not None and config.arm.particles >= fewest
        self._pool = ThreadPoolExecutor(1, "left_arm") if parallel else None

    def scatter(self, posture: FloatArray, noise_scale: float = 1.0) -> FloatArray:
        """Start all filters around ``posture`` (12,) on the silhouette observed last.

        Returns:
            The estimate (12,), rad and metres.
        """
        self._last = posture
        return self._run(
            lambda: self.torso.scatter(posture[TORSO], self._rate_torso, noise_scale),
            lambda side: self.arms[side].scatter(
                posture[ARMS[side]], self._rate_arm(side), noise_scale
            ),
        )

    def cycle(self, noise_scale: float = 1.0, explore: float = 0.0) -> FloatArray:
        """Run one estimation cycle of all filters on the silhouette observed last.

        Args:
            noise_scale: factor on sigma_beta.
            explore: fraction of the arms' particles to draw from anywhere.

        Returns:
            The estimate (12,), rad and metres.
        """
        explorers = int(explore * self._config.arm.particles)
        return self._run(
            lambda: self.torso.cycle(self._rate_torso, noise_scale, self._scale),
            lambda side: self.arms[side].cycle(
                self._rate_arm(side), noise_scale, self._scale, explorers
            ),
        )

    def _run(self, run_torso: Callable[[], None], run_arm: Callable[[str], None]) -> FloatArray:
        if self._config.torso_beside_arms:
            self._cost.fix_arms(self._last)
        run_torso()
        posture = np.empty(N_JOINTS)
        posture[TORSO] = self.torso.mean(self._config.average, self._scale)
        self._cost.fix_torso(posture[TORSO])
        if self._pool is None:
            run_arm("left")
            run_arm("right")
        else:
            left = self._pool.submit(run_arm, "left")
            run_arm("right")
            left.result()
        for side, joints in ARMS.items():
            posture[joints] = self.arms[side].mean(self._config.average, self._scale)
        self._last = posture
        return posture

    def stddev(self, posture: FloatArray) -> FloatArray:
        """Return the standard deviation (12,) of the particles around ``posture`` (12,)."""
        stddev = np.empty(N_JOINTS)
        stddev[TORSO] = self.torso.stddev(posture[TORSO], self._scale)
        for side, joints in ARMS.items():
            stddev[joints] = self.arms[side].stddev(posture[joints], self._scale)
        return stddev

    def _rate_torso(self, particles: FloatArray) -> FloatArray:
        return self._with_prior(self._cost.torso(particles), particles, TORSO)

    def _rate_arm(self, side: str) -> Callable[[FloatArray], FloatArray]:
        def rate(particles: FloatArray) -> FloatArray:
            return self._with_prior(self._cost.arm(side, particles), particles, ARMS[side])

        return rate

    def _with_prior(self, costs: CostArray, particles: FloatArray, joints: slice) -> FloatArray:
        """Add to costs (N,) what grows with the square of each angle's distance from rest, px."""
        rated: FloatArray = add_prior(
            costs,
            particles,
            _BELOW_REST[joints],
            _ABOVE_REST[joints],
            self._config.prior * self._cost.silhouette_px,
        )
        return rated
