"""``cardbox synthesize``: records a synthetic person."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cardbox_tracker.commands.arguments import (
    Written,
    at_least,
    camera_count,
    check_outputs,
    choice,
    option,
)


@dataclass(frozen=True, kw_only=True)
class Arguments(Written):
    """A recording of a synthetic person.

    Attributes:
        motion: motion after the reference postures: wave, bend, bow or all
        output: recording to write
        seed: random seed of noise and sway
        storage: format of the recording
        compressed: write JPEG images instead of raw ones
        cameras: 1 to 4; several are cam0, cam1, ..., and BAG/extrinsics.yaml says where they stand
    """

    motion: str = option(default="all")
    output: Path = option("BAG", required=True)
    seed: int = option(read=at_least(0), default=0)
    storage: str = choice(("mcap", "sqlite3"), default="mcap")
    compressed: bool = option(default=False)
    cameras: int = option("N", camera_count, default=1)


def run(given: Arguments) -> None:
    """Write the recording."""
    from cardbox_tracker.applications.simulation.session import SessionFormat, synthesize_session
    from cardbox_tracker.common.progress import progress_bar

    check_outputs((), given.force, results=(given.output,))
    form = SessionFormat(cameras=given.cameras, compressed=given.compressed, storage=given.storage)
    with progress_bar("synthesize") as show:
        synthesize_session(
            *(given.output, given.motion, given.seed, form),
            overwrite=given.force,
            progress=show,
        )
    print(f"wrote {given.output}")
