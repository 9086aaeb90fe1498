"""``cardbox urdf``: prints the robot description of a measured person."""

from __future__ import annotations

from dataclasses import MISSING, dataclass
from pathlib import Path

from cardbox_tracker.commands.arguments import Options, option


@dataclass(frozen=True)
class Arguments(Options):
    """A measured person.

    Attributes:
        model: the person
        torso_place: leave out the joints of place, neck and clavicles, for joint states without
            them
    """

    model: Path = option("MODEL.yaml", default=MISSING)
    torso_place: bool = option(default=True, flag="--no-torso-place")


def run(given: Arguments) -> None:
    """Print the URDF."""
    from cardbox_tracker.person.model_file import load_body_model
    from cardbox_tracker.person.urdf import urdf_from_body

    print(urdf_from_body(load_body_model(given.model), torso_place=given.torso_place))
