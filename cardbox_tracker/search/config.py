"""Settings of the tracker and its two presets; the defaults are declared only here."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import foreign
from cardbox_tracker.common.settings import (
    NoEffectError,
    Settings,
    changed,
    restarting,
    setting,
    suggestion,
)
from cardbox_tracker.common.small_yaml import parse_small_yaml, read_small_text
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.search.resampling import STRATEGIES
from cardbox_tracker.search.whole_body_config import WholeBodyConfig
from cardbox_tracker.terms.depth import Depth
from cardbox_tracker.terms.inner_cue import InnerCue
from cardbox_tracker.terms.joint_points import JointPoints
from cardbox_tracker.terms.term import TermSettings

FILTERS = ("hierarchical", "whole_body")
"""Allowed values of ``filter``."""

# Settings of one filter, and the settings of the other filter with a similar effect; ``torso`` and
# ``arm`` stand for their settings.
_OF_HIERARCHICAL = MappingProxyType(
    {
        **dict.fromkeys(("torso", "arm", "strategy", "cycles", "torso_beside_arms"), "effort"),
        "average": "smoothing",
    }
)
_OF_WHOLE_BODY = MappingProxyType({"smoothing": "average"})


@dataclass(frozen=True)
class FilterConfig(Settings):
    """Settings of one particle filter: one column of the paper's Table I."""

    particles: int = restarting(200, "particles of each filter, N", limits=(2, 1_000_000))
    survival_rate: float = restarting(
        0.4,
        "fraction of the particles that survive a cycle, e of DRS",
        limits=(1e-9, 1.0),
    )
    rotation_noise_rad: float = restarting(
        0.25, "noise of the angles", unit="rad", limits=(0.0, 3.2)
    )
    # Arms have no place.
    translation_noise_m: float = restarting(0.0, "noise of the place", unit="m", limits=(0.0, 1.0))
    sigma_gamma_px: float = restarting(
        4000.0,
        "standard deviation sigma_gamma of the Gaussian weights of SRS, at 320x240; it grows with "
        "the image's area",
        unit="px",
        limits=(1e-9, 1e9),
    )
    elite: bool = restarting(
        True,
        "the best particle of a cycle survives unchanged as the first one of the next cycle",
    )


@dataclass(frozen=True)
class TrackerConfig(Settings):
    """Settings of the filters and of the extensions; the defaults are those of the paper.

    The filter ``hierarchical`` uses all settings except ``whole_body``. The filter ``whole_body``
    uses ``whole_body``, ``terms``, ``relocalize``, ``select_person``, ``lost_iou`` and
    ``lost_frames``.
    """

    filter: str = restarting(
        "hierarchical",
        "hierarchical: the paper's filters, one for the torso and one for each arm; whole_body: "
        "one filter of all joints and the torso's place, with a rounded model and learned priors",
        choices=FILTERS,
    )

    torso: FilterConfig = FilterConfig(200, 0.2, 0.1, 0.02, 8000.0)  #: filter of d1..d4 (Table I)
    arm: FilterConfig = FilterConfig(200, 0.4, 0.25, 0.0, 4000.0)  #: filter of each arm (Table I)
    strategy: str = restarting(
        "drs", "resampling strategy of the filters", choices=tuple(STRATEGIES)
    )
    cycles: int = setting(1, "estimation cycles per image", limits=(1, 100))
    #: settings of the cost's terms in addition to the silhouette (``terms/``)
    terms: tuple[TermSettings, ...] = ()
    whole_body: WholeBodyConfig = WholeBodyConfig()  #: settings of the filter ``whole_body``
    average: int = restarting(
        1,
        "best particles whose weighted mean is the result; 1: the best one",
        limits=(1, 1_000_000),
    )
    # A torso that is rated without arms leans forward to cover the upper arms.
    torso_beside_arms: bool = restarting(
        True,
        "rate a torso together with the last arms, which stay in place in the image, so that the "
        "whole model is drawn as in equation (2)",
    )
    relocalize: bool = setting(
        False, "search again if the person was lost or came back into the image"
    )
    select_person: bool = restarting(
        False,
        "use only the parts of the silhouette that can belong to the person, not to a door, a "
        "chair or a passer-by",
    )
    lost_iou: float = setting(
        0.4, "least IoU of an image that fits; not used with a detector's points", limits=(0.0, 1.0)
    )
    lost_frames: int = setting(
        5,
        "consecutive images whose result does not fit (IoU below lost_iou, or probably wrong as a "
        "whole) until the state is lost",
        limits=(1, 1_000_000),
    )

    @property
    def has_several_views(self) -> bool:
        """Whether the filter supports several cameras and depth images."""
        return self.filter == "whole_body"

    def __post_init__(self) -> None:
        """Raise ValueError, with the name, if a value is out of range."""
        super().__post_init__()
        fewest = min(self.torso.particles, self.arm.particles)
        if self.average > fewest:
            raise ValueError(f"average is {self.average}; expected 1 to {fewest}, the particles")

    def with_shoulders(self, body: BodyModel) -> BodyModel:
        """Return ``body`` with the shoulders that the filter gives it: rigid ones in the paper."""
        return body if self.filter == "whole_body" else body.rigid

    def with_depth(self) -> TrackerConfig:
        """Return these settings with the term for depth images."""
        return replace(self, terms=(*self.terms, Depth()))

    def changed(self, given: Mapping[str, Any]) -> TrackerConfig:
        """Return these settings with other values, nested as ``{"whole_body": {"effort": 0.5}}``.

        Raises NoEffectError if one has no effect in the selected filter, and ValueError if a name
        is unknown, or a value has the wrong type or is out of range.
        """
        config = changed(self, given)
        for name in _names(given):
            config._check_effect(name)
        return config

    def _check_effect(self, name: str) -> None:
        """Raise NoEffectError if the setting with this dotted name has no effect."""
        first, _, last = name.rpartition(".")
        if self.filter == "whole_body":
            instead = _OF_HIERARCHICAL.get(name) or _OF_HIERARCHICAL.get(first)
            if instead is not None:
                where = "with the filter whole_body (preset default)"
                raise NoEffectError(name, where, f"whole_body.{instead}")
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
        """Return these settings with N = ``particles`` in each of the paper's three filters."""
        number = {"particles": particles}
        fewer = {"average": particles} if particles < self.average else {}
        return self.changed({"torso": number, "arm": number, **fewer})


def _names(given: Mapping[str, Any], before: str = "") -> Iterator[str]:
    """Yield the dotted name of each value."""
    for name, value in given.items():
        if isinstance(value, Mapping):
            yield from _names(value, f"{before}{name}.")
        else:
            yield f"{before}{name}"


def paper_preset() -> TrackerConfig:
    """Return Table I: 600 particles, one cycle per frame; the best particle is the result."""
    return TrackerConfig()


def default_preset() -> TrackerConfig:
    """Return the most accurate settings: the whole-body filter (``docs/architecture.md``)."""
    return TrackerConfig(
        filter="whole_body",
        terms=(InnerCue(), JointPoints()),
        relocalize=True,
        select_person=True,
    )


class _Presets(dict[str, Callable[[], TrackerConfig]]):
    """Functions that return settings, by the name of the preset."""

    def __missing__(self, name: str) -> Callable[[], TrackerConfig]:
        """Raise CardboxError with the names of the presets."""
        hint = suggestion(name, self)
        raise CardboxError(f"there is no preset '{name}'; {hint}expected one of {', '.join(self)}")


PRESETS = MappingProxyType(_Presets(paper=paper_preset, default=default_preset))
"""Functions that return the settings of the presets; a wrong name raises CardboxError."""


def read_settings(path: str | os.PathLike[str], config: TrackerConfig) -> TrackerConfig:
    """Return ``config`` with the values of the file at ``path``; docs/parameters.md has all names.

    Raises CardboxError if it cannot be read, or a name or a value is none that acts.
    """
    expected = "a YAML file with names of docs/parameters.md, such as 'lost_frames: 10'"
    with foreign(path, CardboxError, expected):
        given = parse_small_yaml(read_small_text(path))
        if not isinstance(given, dict):
            raise ValueError("expected names and values, such as 'lost_frames: 10'")
        return config.changed(given)
