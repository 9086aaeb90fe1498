"""Results of a recording for programs in Python (``docs/python.md``)."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cardbox_tracker.applications.exporting.formats import export, formats
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import scene_beside
from cardbox_tracker.measuring.scene import Scene, load_scene
from cardbox_tracker.recordings import result_reader
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.recordings.result_table import units


@dataclass(frozen=True)
class Result(Results):
    """Results of one person, with camera and people as of ``OUT.scene.yaml`` if they are known."""

    scene: Scene | None = None

    def to_pandas(self) -> Any:
        """Return a ``pandas.DataFrame`` with a row for each image and the columns of the table.

        Unknown numbers are nan, unknown texts empty; ``stamp_ns`` is the only stamp.

        Raises:
            CardboxError: pandas is not installed.
        """
        try:
            import pandas
        except ImportError as error:
            raise CardboxError(
                f"to_pandas needs the library pandas ({error}); install it with "
                "pip install 'cardbox_tracker[pandas]'"
            ) from None
        times = {"stamp_ns": self.stamp_ns, "time_s": self.time_s, "state": self.state}
        found = {**times, **self.numbers, **self.texts}
        return pandas.DataFrame({name: found[name] for name in units(*[True] * 3) if name in found})

    def save(self, path: str | os.PathLike[str]) -> list[str]:
        """Write a file in the format of ``cardbox export`` that its ending says, and replace it.

        Returns:
            Lines that say what was written, and what is not known.

        Raises:
            CardboxError: no format has this ending, or see :func:`~.formats.export`.
        """
        path, known = Path(path), formats().values()
        fitting = [one for one in known if path.name.endswith(one.suffix)]
        if not fitting:
            endings = ", ".join(one.suffix for one in known)
            raise CardboxError(f"no format has the ending of {path}; those are {endings}")
        return export(self, path, max(fitting, key=lambda one: len(one.suffix)))


def read_result(path: str | os.PathLike[str], person: int | None = None) -> Result:
    """Return the results in a table or a bag, see :func:`~.result_reader.read_results`, and scene.

    Raises:
        CardboxError: a file cannot be read, or contains what no result is; the text names the line.
    """
    path = Path(path)
    results, beside = result_reader.read_results(path, person), scene_beside(path)
    scene = load_scene(beside) if beside.is_file() else None
    return Result(**vars(results), scene=scene)
