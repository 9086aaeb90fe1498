"""Settings of the tracker and the two presets; the single source of their defaults."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType

from cardbox_tracker.estimation.filtering.resampling import STRATEGIES


def _check(name: str, value: float, lowest: float, highest: float) -> None:
    if not lowest <= value <= highest:
        raise ValueError(f"{name} is {value:g}; expected {lowest:g} to {highest:g}")


@dataclass(frozen=True)
class FilterConfig:
    """One particle filter, as one column of the paper's Table I.

    Attributes:
        particles: N.
        survival_rate: e, the fraction of particles that survive a cycle of DRS, in (0, 1].
        rotation_noise_rad: sigma_beta of the rotations.
        translation_noise_m: sigma_beta of the translation; the arms have none.
        sigma_gamma_px: sigma_gamma, the width of the Gaussian that turns costs into the weights of
            SRS, pixels at 320x240; it grows with the image's area.
        elite: the first particle of a cycle is the best of the one before, unchanged.
    """

    particles: int = 200
    survival_rate: float = 0.4
    rotation_noise_rad: float = 0.25
    translation_noise_m: float = 0.0
    sigma_gamma_px: float = 4000.0
    elite: bool = True

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            ValueError: a value is out of range; the text names it.
        """
        _check("particles", self.particles, 2, 1_000_000)
        _check("survival_rate", self.survival_rate, 1e-9, 1.0)
        _check("rotation_noise_rad", self.rotation_noise_rad, 0.0, 3.2)
        _check("translation_noise_m", self.translation_noise_m, 0.0, 1.0)
        _check("sigma_gamma_px", self.sigma_gamma_px, 1e-9, 1e9)


@dataclass(frozen=True)
class TrackerConfig:
    """The hierarchy of filters and what goes beyond the paper; the defaults are the paper's.

    Attributes:
        torso: filter of d1..d4 (Table I).
        arm: filter of each arm (Table I).
        strategy: a name of ``resampling.STRATEGIES``.
        cycles: estimation cycles a frame.
        noise_decay: factor on the noise from one cycle of a frame to the next.
        prior: cost of an angle one unit from rest (see ``hierarchy``), as a fraction of the
            silhouette's pixels.
        average: output the weighted mean of this many best particles; 1 outputs the best.
        explore: fraction of the arms' particles that each frame draws from anywhere within the
            joint limits, so that an arm that was lost is found again.
        torso_beside_arms: rate a torso beside the arms found last, where they are in the image,
            so that the whole model is drawn as equation (2) has it; rated alone, it leans forward
            to cover the upper arms.
        parallel_from: arms of so many particles or more are estimated at the same time, in two
            threads; with fewer, waking the other thread costs more than it saves. None: never.
        relocalize: search anew when the person was lost, or came back into the image.
        lost_iou: an IoU below this counts as lost.
        lost_frames: after so many lost frames in a row the state is ``lost``.
    """

    torso: FilterConfig = FilterConfig(200, 0.2, 0.1, 0.02, 8000.0)
    arm: FilterConfig = FilterConfig(200, 0.4, 0.25, 0.0, 4000.0)
    strategy: str = "drs"
    cycles: int = 1
    noise_decay: float = 1.0
    prior: float = 0.0
    average: int = 1
    explore: float = 0.0
    torso_beside_arms: bool = True
    parallel_from: int | None = 500
    relocalize: bool = False
    lost_iou: float = 0.4
    lost_frames: int = 5

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            ValueError: a value is out of range; the text names it.
        """
        if self.strategy not in STRATEGIES:
            raise ValueError(
                f"strategy is {self.strategy!r}; expected one of {', '.join(STRATEGIES)}"
            )
        _check("cycles", self.cycles, 1, 100)
        _check("noise_decay", self.noise_decay, 0.0, 1.0)
        _check("prior", self.prior, 0.0, 1.0)
        if self.parallel_from is not None:
            _check("parallel_from", self.parallel_from, 0, 1_000_000)
        _check("average", self.average, 1, min(self.torso.particles, self.arm.particles))
        _check("explore", self.explore, 0.0, 0.9)
        _check("lost_iou", self.lost_iou, 0.0, 1.0)
        _check("lost_frames", self.lost_frames, 1, 1_000_000)

    def with_particles(self, particles: int) -> TrackerConfig:
        """Return the same settings with N = ``particles`` in each of the three filters."""
        return replace(
            self,
            torso=replace(self.torso, particles=particles),
            arm=replace(self.arm, particles=particles),
            average=min(self.average, particles),
        )


def paper_preset() -> TrackerConfig:
    """Return Table I: 600 particles, one cycle a frame, the best particle is the result."""
    return TrackerConfig()


def default_preset() -> TrackerConfig:
    """Return what tracks best: cycles with falling noise, a weak prior, a mean of the best.

    A third cycle does not track better (``docs/architecture.md``).
    """
    return TrackerConfig(
        cycles=2,
        noise_decay=0.5,
        prior=0.012,
        average=20,
        explore=0.2,
        relocalize=True,
    )


PRESETS = MappingProxyType({"paper": paper_preset, "default": default_preset})
