"""Settings of the tracker in a YAML file, by the names that they have in ``TrackerConfig``.

    lost_frames: 10
    whole_body:
      effort: 0.5
      cost:
        yaw_deg: 20.0

docs/parameters.md has all names.
"""

from __future__ import annotations

import os

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import foreign
from cardbox_tracker.common.small_yaml import parse_small_yaml, read_small_text
from cardbox_tracker.search.config import TrackerConfig


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
