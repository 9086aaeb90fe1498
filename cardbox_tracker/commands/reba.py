"""``cardbox reba``: computes the REBA score of a recording, with its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

from cardbox_tracker.applications.ergonomics.reba import REBA, RebaConfig, score_reba
from cardbox_tracker.commands.rula import Scored, is_results, score
from cardbox_tracker.common.errors import CardboxError


@dataclass(frozen=True)
class Arguments(Scored, RebaConfig):
    """A recording or its results, and what no image shows."""

    group = "what no image shows"


def run(asked: Arguments) -> None:
    """Score every image, and print times, part scores and declared inputs."""
    if not is_results(asked.recording) and (asked.detector, asked.detector_class) == (None, None):
        raise CardboxError("REBA needs legs, which a detector shows; give --detector mediapipe")
    score(asked, asked, REBA, score_reba)
