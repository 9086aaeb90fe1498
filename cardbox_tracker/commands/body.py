"""``cardbox body``: makes a body model from a stature and the proportions of people."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from cardbox_tracker.commands.arguments import Written, check_outputs, option


@dataclass(frozen=True, kw_only=True)
class Arguments(Written):
    """A person of a stature.

    Attributes:
        stature_m: height of the person, metres, crown to floor
        distance_m: from the camera to the person, metres along the floor; without it, it is found
            from the first silhouette, to about a fifth
        shoulder_breadth_m: between the shoulder joints, metres; by default it is fitted to the
            first silhouette, like all other breadths
        hip_height_m: of the middle of the hips above the camera's centre, metres, negative below
            it; by default it is fitted to the first silhouette
        camera_pitch_deg: positive when the camera looks down
        output: body model to write
    """

    stature_m: float = option("M", flag="--stature", required=True)
    distance_m: float | None = option("M", flag="--distance")
    shoulder_breadth_m: float | None = option("M", flag="--shoulder-breadth")
    hip_height_m: float | None = option("M", flag="--hip-height")
    camera_pitch_deg: float = option("P", default=0.0)
    output: Path = option("MODEL.yaml", required=True)


def run(given: Arguments) -> None:
    """Write the body model and print its sizes."""
    from cardbox_tracker.person.model import body_from_proportions
    from cardbox_tracker.person.model_file import save_body_model

    check_outputs((given.output,), given.force)
    body = body_from_proportions(
        given.stature_m,
        given.distance_m,
        given.shoulder_breadth_m,
        given.hip_height_m,
        math.radians(given.camera_pitch_deg),
    )
    save_body_model(body, given.output)
    print(body)
    print(f"wrote {given.output}")
