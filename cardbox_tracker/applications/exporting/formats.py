"""The formats of ``cardbox export`` by name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from cardbox_tracker.applications.exporting.bvh import write_bvh
from cardbox_tracker.applications.exporting.isb import write_isb
from cardbox_tracker.applications.exporting.markers import ezc3d_or_error, write_c3d, write_trc
from cardbox_tracker.applications.exporting.mot import write_mot
from cardbox_tracker.applications.exporting.motion import Motion
from cardbox_tracker.person.model import BodyModel


class Format(NamedTuple):
    """One format.

    Attributes:
        suffix: end of the names of its files.
        write: writes a motion of a body to a file; the body may be unknown.
        check: raises CardboxError if a library is missing.
        has_places: whether it depends on the pitch of the camera.
        needs_body: whether it has the sizes of the body.
    """

    suffix: str
    write: Callable[[Path, Motion, BodyModel | None], None]
    check: Callable[[], object] = lambda: None
    has_places: bool = True
    needs_body: bool = False


FORMATS: dict[str, Format] = {
    "trc": Format(".trc", write_trc),
    "bvh": Format(".bvh", write_bvh, needs_body=True),
    "c3d": Format(".c3d", write_c3d, ezc3d_or_error),
    "mot": Format(".mot", write_mot),
    "isb": Format(".isb.csv", write_isb, has_places=False),
}
