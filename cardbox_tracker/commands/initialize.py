"""``cardbox initialize``: measures the person in a recording."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

from cardbox_tracker.commands.arguments import (
    Written,
    at_least,
    check_outputs,
    choice,
    option,
    print_remarks,
    span,
)
from cardbox_tracker.commands.request import RecordingOptions
from cardbox_tracker.commands.scene import tilt_in
from cardbox_tracker.commands.tracking_request import Problems, inputs_of, recording_request
from cardbox_tracker.common.progress import progress_bar
from cardbox_tracker.detectors.person_choice import PersonChoice
from cardbox_tracker.measuring.config import InitializationConfig
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.person.posture import SIDE_TURNS
from cardbox_tracker.recordings.initialize import (
    describe,
    initialize_at_scale,
    initialize_from_recording,
)
from cardbox_tracker.recordings.silhouettes import TimeSpan

# Initial distance of the search where depth images or two cameras measure it.
_GUESSED_M = 2.0


@dataclass(frozen=True, kw_only=True)
class References(Written):
    """The reference postures in a recording.

    Attributes:
        front: seconds during which the person faces the camera, arms hanging 20 degrees away from
            the body
        side: seconds during which the person stands the same, turned by 90 degrees
        arms: seconds during which the person faces the camera, both arms stretched sideways, hands
            open
        side_turn: which way the person turns for --side, as they see it
        camera_pitch_deg: positive when the camera looks down
        seed: random seed of the hypotheses
    """

    front: TimeSpan = option("T0:T1", span, required=True)
    side: TimeSpan = option("T0:T1", span, required=True)
    arms: TimeSpan = option("T0:T1", span, required=True)
    side_turn: str = choice(SIDE_TURNS, default="left")
    distance_m: float | None = option("M", flag="--distance")
    camera_pitch_deg: float | None = option("P")
    seed: int = option(read=at_least(0), default=0)
    output: Path = option("MODEL.yaml", required=True)

    @property
    def spans(self) -> dict[str, TimeSpan]:
        """The span of each posture."""
        return {name: getattr(self, name) for name in ("front", "side", "arms")}


@dataclass(frozen=True)
class Arguments(References, RecordingOptions):
    """A recording of the reference postures.

    Attributes:
        distance_m: from the camera to the person, metres along the floor; all sizes are
            proportional to it; not needed with --depth, or with two or more --cameras, which
            measure it
        camera_pitch_deg: positive when the camera looks down (default: 0; found in the --front
            images where a detector finds silhouettes)
        output: body model to write
    """


def measuring_config(
    given: References, distance_m: float, pitch_rad: float
) -> InitializationConfig:
    """Return the settings of a measurement."""
    # The body model refuses an impossible distance or pitch by name.
    BodyModel.of(distance_m=distance_m, camera_pitch_rad=pitch_rad)
    return InitializationConfig(distance_m, pitch_rad, given.side_turn, seed=given.seed)


def run(asked: Arguments) -> None:
    """Measure the person, write the body model and print its sizes."""
    problems = Problems(asked.recording)
    # The silhouettes alone are measured.
    recording = replace(recording_request(asked, problems), points=None)
    choice = asked.person if isinstance(asked.person, PersonChoice) else None
    if choice is not None and recording.detector is None:
        problems.add("--person needs the detector's silhouettes: give --silhouettes detector")
    if choice is not None and choice.time_s is not None:
        problems.add("--person chooses in each span: leave @T out")
    is_given = asked.distance_m is not None
    if not is_given and asked.depth is None and len(asked.cameras) < 2:
        problems.miss("--distance M or --depth TOPIC or two --cameras", "one camera has no scale")
    if is_given and asked.depth is not None and asked.within_m is None:
        problems.add(
            "--depth and --distance both give the distance of the person; leave one of them out, "
            "or give --within M in place of --background"
        )
    distance_m = _GUESSED_M if asked.distance_m is None else asked.distance_m
    pitch_rad = math.radians(asked.camera_pitch_deg or 0.0)
    config = problems.caught(
        lambda: measuring_config(asked, distance_m, pitch_rad), InitializationConfig()
    )
    problems.check()
    check_outputs((asked.output,), asked.force, inputs_of(asked))
    spans = asked.spans
    if asked.camera_pitch_deg is None and recording.detector is not None:
        pitch_rad, recording = tilt_in(recording, spans["front"], choice)
        config = replace(config, camera_pitch_rad=pitch_rad)
    if is_given:
        recording = replace(recording, depth=None)
    with recording.open() as source, progress_bar("initialize") as show:
        if is_given:
            result = initialize_from_recording(source.first, spans, config, show, choice)
        else:
            result = initialize_at_scale(source, spans, config, show, choice)
        remarks, accounts = source.first.remarks, [one.account for one in source.sources]
    print_remarks(remarks)
    roll_rad = recording.camera.stands_rad
    save_body_model(result.body.with_values(camera_roll_rad=roll_rad), asked.output)
    print(describe(result))
    print(f"wrote {asked.output}", *accounts, sep="\n")
