"""Body model: sizes and placement of a person, and pose of the camera (paper, section II-A).

A model file and the topic ``body_model`` contain this model, which is constant while the person is
tracked. Its parts are separate, since a second camera adds a pose and another place changes the
placement, and neither changes the person.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from cardbox_tracker.body.appearance import Appearance
from cardbox_tracker.body.person import Person
from cardbox_tracker.body.placement import CAMERA_POSE, PLACEMENT, CameraPose, Placement
from cardbox_tracker.body.posture import N_STATE, POSTURE, SIDE_TURNS, TORSO_Y, reference_posture
from cardbox_tracker.body.sizes import SIZE_NAMES, FloatArray
from cardbox_tracker.errors import BodyModelError, quoted

CONSTANTS = {**PLACEMENT, **CAMERA_POSE}
"""Range, unit and meaning of the numbers of placement and camera pose, by name."""

MEASURED, PROPORTIONS = SOURCES = ("measured", "proportions")
"""Origin of the sizes: reference postures, or the proportions of people of a stature."""


@dataclass(frozen=True)
class BodyModel:
    """One person in one place before one camera.

    Attributes:
        person: the 18 sizes.
        placement: position of mid-hip.
        camera_pose: pose of the camera.
        side_turn: turn of the person for the side reference, ``left`` or ``right``.
        appearance: the colours of the person's parts; None if they were not learned.
        source: one of ``SOURCES``; sizes from proportions are less exact.
        unknown: names of sizes and of ``PLACEMENT`` whose values are guesses; a tracker fits them
            to the first silhouette of a person.

    Raises:
        BodyModelError: ``side_turn``, ``source`` or a name in ``unknown`` is not valid.
    """

    person: Person = field(default_factory=Person)
    placement: Placement = Placement()
    camera_pose: CameraPose = CameraPose()
    side_turn: str = "left"
    appearance: Appearance | None = None
    source: str = MEASURED
    unknown: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check the names; the parts check themselves."""
        if self.side_turn not in SIDE_TURNS:
            raise BodyModelError(
                f"side_turn is {quoted(self.side_turn)}; expected one of {SIDE_TURNS}"
            )
        if self.source not in SOURCES:
            raise BodyModelError(f"source is {quoted(self.source)}; expected one of {SOURCES}")
        for name in self.unknown:
            if name not in (*PLACEMENT, *SIZE_NAMES):
                raise BodyModelError(
                    f"unknown names {quoted(name)}; expected sizes, or any of "
                    + ", ".join(PLACEMENT)
                )

    @classmethod
    def of(cls, sizes: FloatArray | None = None, **values: Any) -> BodyModel:
        """Create a model from plain numbers.

        Args:
            sizes: shape (18,), metres; None for the default sizes.
            values: any of ``CONSTANTS``, ``side_turn``, ``appearance``, ``source`` and
                ``unknown``; missing values have their defaults.

        Raises:
            BodyModelError: a number is outside of its range; the text names it.
        """
        model = cls() if sizes is None else cls(Person(sizes))
        return model.with_values(**values)

    def with_values(self, **values: Any) -> BodyModel:
        """Return the same model with other numbers.

        Args:
            values: any of ``sizes``, ``CONSTANTS``, ``side_turn``, ``appearance``, ``source`` and
                ``unknown``.

        Raises:
            BodyModelError: a number is outside of its range; the text names it.
        """
        changed: dict[str, Any] = {}
        if "sizes" in values:
            changed["person"] = Person(values.pop("sizes"))
        if "camera_pitch_rad" in values:
            changed["camera_pose"] = CameraPose(values.pop("camera_pitch_rad"))
        place = {name: values.pop(name) for name in PLACEMENT if name in values}
        changed["placement"] = replace(self.placement, **place)
        return replace(self, **changed, **values)

    @property
    def constants(self) -> dict[str, float]:
        """Numbers of placement and camera pose by name, ordered as ``CONSTANTS``."""
        return {**asdict(self.placement), "camera_pitch_rad": self.camera_pose.pitch_rad}

    @property
    def sizes(self) -> FloatArray:
        """The person's sizes, shape (18,), metres, ordered as ``SIZE_NAMES``; read-only."""
        return self.person.sizes

    def size(self, name: str) -> float:
        """Return the person's size of that name in metres."""
        return self.person.size(name)

    def reference_state(self, name: str = "front", side_turn: str = "left") -> FloatArray:
        """Return the state (14,) of a reference posture at the measured place, rad and metres."""
        state = np.zeros(N_STATE)
        state[POSTURE] = reference_posture(name, side_turn)
        state[TORSO_Y] = self.placement.lateral_m
        return state

    def __str__(self) -> str:
        """Return a line per size, in centimetres, and a remark if they were not measured."""
        return f"{self.person}\n{self.doubt}" if self.doubt else str(self.person)

    @property
    def doubt(self) -> str:
        """Remark on sizes that were not measured; empty for measured ones."""
        if self.source == MEASURED:
            return ""
        text = "sizes from the proportions of people, not measured: less exact"
        return f"{text}; unknown: {', '.join(self.unknown)}" if self.unknown else text
