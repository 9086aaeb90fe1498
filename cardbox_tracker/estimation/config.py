"""Settings of the tracker and the two presets; the single source of their defaults."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

from cardbox_tracker.estimation.cost.depth import Depth
from cardbox_tracker.estimation.cost.inner_cue import InnerCue
from cardbox_tracker.estimation.cost.terms import TermSettings
from cardbox_tracker.estimation.filtering.resampling import STRATEGIES
from cardbox_tracker.estimation.filtering.whole_body_config import WholeBodyConfig
from cardbox_tracker.settings import NoEffectError, Settings, changed, restarting, setting

FILTERS = ("hierarchical", "whole_body")
"""Every name that ``filter`` may have."""

# Settings of one filter, with those that do similar work in the other one.
_OF_HIERARCHICAL = MappingProxyType(
    {
        "torso.particles": "effort",
        "arm.particles": "effort",
        "torso.survival_rate": "survivors",
        "arm.survival_rate": "survivors",
        "torso.rotation_noise_rad": "yaw_noise_rad",
        "arm.rotation_noise_rad": "arm_noise_rad",
        "torso.translation_noise_m": "y_noise_m",
        "torso": "effort",
        "arm": "effort",
        "strategy": "effort",
        "cycles": "effort",
        "average": "average",
        "torso_beside_arms": "effort",
    }
)
_OF_WHOLE_BODY = MappingProxyType({"survivors": "torso.survival_rate", "average": "average"})


@dataclass(frozen=True)
class FilterConfig(Settings):
    """One particle filter, as one column of the paper's Table I."""

    particles: int = restarting(200, "particles of each filter, N", limits=(2, 1_000_000))
    survival_rate: float = restarting(
        0.4, "fraction of the particles that survive a cycle, e of DRS", limits=(1e-9, 1.0)
    )
    rotation_noise_rad: float = restarting(
        0.25, "noise of the angles", unit="rad", limits=(0.0, 3.2)
    )
    # The arms have none.
    translation_noise_m: float = restarting(0.0, "noise of the place", unit="m", limits=(0.0, 1.0))
    sigma_gamma_px: float = restarting(
        4000.0,
        "width of the Gaussian that turns costs into the weights of SRS, at 320x240; it grows with "
        "the image's area",
        unit="px",
        limits=(1e-9, 1e9),
    )
    elite: bool = restarting(
        True, "the first particle of a cycle is the best of the one before, unchanged"
    )


@dataclass(frozen=True)
class TrackerConfig(Settings):
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

    filter: str = restarting(
        "hierarchical",
        "hierarchical: the paper's, one for the torso and one for each arm; whole_body: all joints "
        "and the torso's place, with a rounded model and learned postures",
        choices=FILTERS,
    )

    torso: FilterConfig = FilterConfig(200, 0.2, 0.1, 0.02, 8000.0)
    arm: FilterConfig = FilterConfig(200, 0.4, 0.25, 0.0, 4000.0)
    strategy: str = restarting(
        "drs", "resampling strategy of the filters", choices=tuple(STRATEGIES)
    )
    cycles: int = setting(1, "estimation cycles an image", limits=(1, 100))
    terms: tuple[TermSettings, ...] = ()
    whole_body: WholeBodyConfig = WholeBodyConfig()
    average: int = restarting(
        1,
        "best particles whose weighted mean is the result; 1: the best one",
        limits=(1, 1_000_000),
    )
    # Rated alone, the torso leans forward to cover the upper arms.
    torso_beside_arms: bool = restarting(
        True,
        "rate a torso beside the arms found last, where they are in the image, so that the whole "
        "model is drawn as in equation (2)",
    )
    relocalize: bool = setting(
        False, "search again when the person was lost, or came back into the image"
    )
    select_person: bool = restarting(
        False,
        "only the parts of the silhouette count that can be the person, not a door, a chair or "
        "somebody who passes by",
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
        super().__post_init__()
        fewest = min(self.torso.particles, self.arm.particles)
        if self.average > fewest:
            raise ValueError(f"average is {self.average}; expected 1 to {fewest}, the particles")

    def with_depth(self) -> TrackerConfig:
        """Return the same settings with the term of a measured depth."""
        return replace(self, terms=(*self.terms, Depth()))

    def changed(self, given: Mapping[str, Any]) -> TrackerConfig:
        """Return the settings with other values, all of which act in the filter that is chosen.

        Args:
            given: values by name, nested ones as mappings: ``{"whole_body": {"effort": 0.5}}``.

        Raises:
            NoEffectError: one of them would change nothing.
            ValueError: a name is unknown, a value has the wrong type or is out of range.
        """
        config = changed(self, given)
        for name in _names(given):
            config._check_effect(name)
        return config

    def _check_effect(self, name: str) -> None:
        """Raise NoEffectError if the setting of this dotted name changes nothing."""
        first, _, last = name.rpartition(".")
        if self.filter == "whole_body":
            instead = _OF_HIERARCHICAL.get(name) or _OF_HIERARCHICAL.get(first)
            if instead is not None:
                where = "with the filter whole_body (preset default)"
                raise NoEffectError(name, where, f"whole_body.{instead}")
            is_corrected = self.whole_body.corrector != "none"
            if last in ("output_smoothing_s", "learned_deviations") and not is_corrected:
                raise NoEffectError(name, "without a corrector", "whole_body.corrector")
            return
        if name.startswith("whole_body"):
            instead = _OF_WHOLE_BODY.get(last, "torso.particles")
            raise NoEffectError(name, "with the filter hierarchical (preset paper)", instead)
        if last == "sigma_gamma_px" and self.strategy == "drs":
            raise NoEffectError(name, "with the strategy drs", f"{first}.survival_rate")
        if last == "survival_rate" and self.strategy != "drs":
            text = f"with the strategy {self.strategy}"
            raise NoEffectError(name, text, f"{first}.sigma_gamma_px")
        if last == "translation_noise_m" and first == "arm":
            raise NoEffectError(name, "of arms, which have no place", "arm.rotation_noise_rad")

    def with_particles(self, particles: int) -> TrackerConfig:
        """Return the same settings with N = ``particles`` in each of the three filters.

        Raises:
            NoEffectError: the filter is another one, which has none.
            ValueError: the number is out of range.
        """
        number = {"particles": particles}
        fewer = {"average": particles} if particles < self.average else {}
        return self.changed({"torso": number, "arm": number, **fewer})


def _names(given: Mapping[str, Any], before: str = "") -> Iterator[str]:
    """Yield the dotted names of all values."""
    for name, value in given.items():
        if isinstance(value, Mapping):
            yield from _names(value, f"{before}{name}.")
        else:
            yield f"{before}{name}"


def paper_preset() -> TrackerConfig:
    """Return Table I: 600 particles, one cycle a frame, the best particle is the result."""
    return TrackerConfig()


def default_preset() -> TrackerConfig:
    """Return what tracks best: the whole-body filter (``docs/architecture.md``)."""
    return TrackerConfig(
        filter="whole_body", terms=(InnerCue(),), relocalize=True, select_person=True
    )


PRESETS = MappingProxyType({"paper": paper_preset, "default": default_preset})
