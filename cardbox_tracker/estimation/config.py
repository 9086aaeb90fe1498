"""Settings of the tracker and the two presets; the single source of their defaults."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType

from cardbox_tracker.estimation.cost.inner_cue import InnerCue
from cardbox_tracker.estimation.cost.terms import TermSettings
from cardbox_tracker.estimation.filtering.resampling import STRATEGIES
from cardbox_tracker.estimation.filtering.whole_body_config import WholeBodyConfig
from cardbox_tracker.settings import check, setting

FILTERS = ("hierarchical", "whole_body")
"""Every name that ``filter`` may have."""


@dataclass(frozen=True)
class FilterConfig:
    """One particle filter, as one column of the paper's Table I."""

    particles: int = setting(
        200, "particles of each filter, N", limits=(2, 1_000_000), restarts=True
    )
    survival_rate: float = setting(
        0.4,
        "fraction of the particles that survive a cycle, e of DRS",
        limits=(1e-9, 1.0),
        restarts=True,
    )
    rotation_noise_rad: float = setting(
        0.25, "noise of the angles", unit="rad", limits=(0.0, 3.2), restarts=True
    )
    # The arms have none.
    translation_noise_m: float = setting(
        0.0, "noise of the place", unit="m", limits=(0.0, 1.0), restarts=True
    )
    sigma_gamma_px: float = setting(
        4000.0,
        "width of the Gaussian that turns costs into the weights of SRS, at 320x240; it grows with "
        "the image's area",
        unit="px",
        limits=(1e-9, 1e9),
        restarts=True,
    )
    elite: bool = setting(
        True,
        "the first particle of a cycle is the best of the one before, unchanged",
        restarts=True,
    )

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            ValueError: a value is out of range; the text names it.
        """
        check(self)


@dataclass(frozen=True)
class TrackerConfig:
    """The hierarchy of filters and what goes beyond the paper; the defaults are the paper's.

    Attributes:
        torso: filter of d1..d4 (Table I).
        arm: filter of each arm (Table I).
        terms: settings of the cost's terms beside that of the silhouette (``estimation/cost``).
        whole_body: settings of the filter ``whole_body``.

    The filter ``hierarchical`` uses all settings but those of ``whole_body``; the filter
    ``whole_body`` uses those, ``terms``, ``relocalize``, ``select_person``, ``lost_iou`` and
    ``lost_frames``.
    """

    filter: str = setting(
        "hierarchical",
        "hierarchical: the paper's, one for the torso and one for each arm; whole_body: all joints "
        "and the torso's place, with a rounded model and learned postures",
        choices=FILTERS,
        restarts=True,
    )

    torso: FilterConfig = FilterConfig(200, 0.2, 0.1, 0.02, 8000.0)
    arm: FilterConfig = FilterConfig(200, 0.4, 0.25, 0.0, 4000.0)
    strategy: str = setting(
        "drs", "resampling strategy of the filters", choices=tuple(STRATEGIES), restarts=True
    )
    cycles: int = setting(1, "estimation cycles an image", limits=(1, 100))
    terms: tuple[TermSettings, ...] = ()
    whole_body: WholeBodyConfig = WholeBodyConfig()
    average: int = setting(
        1,
        "best particles whose weighted mean is the result; 1: the best one",
        limits=(1, 1_000_000),
        restarts=True,
    )
    # Rated alone, the torso leans forward to cover the upper arms.
    torso_beside_arms: bool = setting(
        True,
        "rate a torso beside the arms found last, where they are in the image, so that the whole "
        "model is drawn as in equation (2)",
        restarts=True,
    )
    relocalize: bool = setting(
        False, "search again when the person was lost, or came back into the image"
    )
    select_person: bool = setting(
        False,
        "only the parts of the silhouette count that can be the person, not a door, a chair or "
        "somebody who passes by",
        restarts=True,
    )
    lost_iou: float = setting(
        0.4, "an image whose overlap (IoU) is below this does not fit", limits=(0.0, 1.0)
    )
    lost_frames: int = setting(
        5,
        "consecutive images below lost_iou before the state is lost",
        limits=(1, 1_000_000),
    )

    @property
    def has_several_views(self) -> bool:
        """Whether it may be given several cameras, or depth."""
        return self.filter == "whole_body"

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            ValueError: a value is out of range; the text names it.
        """
        check(self)
        fewest = min(self.torso.particles, self.arm.particles)
        if self.average > fewest:
            raise ValueError(f"average is {self.average}; expected 1 to {fewest}, the particles")

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
    """Return what tracks best: the whole-body filter (``docs/architecture.md``)."""
    return TrackerConfig(
        filter="whole_body", terms=(InnerCue(),), relocalize=True, select_person=True
    )


PRESETS = MappingProxyType({"paper": paper_preset, "default": default_preset})
