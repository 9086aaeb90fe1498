"""Rows of the README's table of accuracy for films of real people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from cardbox_tracker.applications.evaluation.report import mean_of

PEOPLE_REPORT = "real-people.md"
_NOT_LEARNED = "body, motion, camera"


class _Row(NamedTuple):
    """A row: its text, names of sessions begin with ``session``, and the cameras' names."""

    people: str
    session: str
    cameras: tuple[str, ...]
    how_many: str


_ROWS = (
    _Row("**real**, a woman gestures, hands before the body (seven clips)", "P0_", (), "one"),
    _Row("**real**, a man on a treadmill, no empty scene", "real_balance", ("cam02",), "one"),
    _Row("**real**, a man at a desk, no empty scene", "real_desk", ("cam2",), "one"),
    _Row("the man on the treadmill", "real_balance", ("cam02", "cam01"), "two"),
    _Row("the man at the desk", "real_desk", ("cam2", "cam3"), "two"),
)


def people_rows(results: Mapping[str, Any], mediapipe: Mapping[str, float]) -> list[dict[str, Any]]:
    """Return rows as ``accuracy.json`` has them.

    Args:
        results: ``real-people.json``.
        mediapipe: MediaPipe's aligned error, cm, of sessions that have no file with it, by the
            beginning of their names.
    """
    rows = []
    for row in _ROWS:
        found = {
            points: _sessions(results["sessions"], row, points) for points in ("none", "mediapipe")
        }
        if not all(found.values()):
            continue
        peers = [one["mediapipe"].get("aligned") for one in found["none"]]
        known = [float(peer) for peer in peers if peer is not None]
        peer = float(np.mean(known)) if known else mediapipe.get(row.session)
        rows.append(
            {
                "people": row.people,
                "cameras": row.how_many,
                "left_out": _NOT_LEARNED,
                "aligned": _mean(found["none"], "aligned"),
                "with_detector": _mean(found["mediapipe"], "aligned"),
                "mediapipe": peer if row.how_many == "one" else None,
                "absolute": _mean(found["none"], "absolute"),
                "absolute_with_detector": _mean(found["mediapipe"], "absolute"),
                "source": f"[real people](docs/evaluation/{PEOPLE_REPORT})",
            }
        )
    return rows


def _sessions(
    sessions: Sequence[Mapping[str, Any]], row: _Row, points: str
) -> list[Mapping[str, Any]]:
    return [
        one
        for one in sessions
        if one["name"].startswith(row.session)
        and one["points"] == points
        and (not row.cameras or tuple(one["cameras"]) == row.cameras)
    ]


def _mean(sessions: Sequence[Mapping[str, Any]], key: str) -> float:
    return float(np.mean([mean_of(session["runs"], key) for session in sessions]))
