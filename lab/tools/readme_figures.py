"""Write the README's table of accuracy from the committed results of evaluation.

``python -m lab.tools.readme_figures`` replaces the part between the marks in ``README.md``; with
``--check`` it only compares them.
"""

from __future__ import annotations

import argparse
import sys
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cardbox_tracker.common.files import write_file
from lab.evaluation.report import mean_of
from lab.evaluation.results import read_json
from lab.pages import replaced, table

BEGIN, END = "<!-- accuracy:begin -->", "<!-- accuracy:end -->"
RESULTS = Path("docs/evaluation")
# MediaPipe's error on the clips of gestures, from their description; they have no file of it, cm.
_GESTURES_CM = 7.7

Session = Mapping[str, Any]


class Row(NamedTuple):
    """A row of real people.

    Attributes:
        who: people and what they do.
        given: what the tracker was given.
        films: beginning of the names of sessions, and names of their cameras.
        has_scene: whether an empty scene was filmed, which the tracker needs without a detector.
        mediapipe: MediaPipe's error, cm, of films that have no file of it.
    """

    who: str
    given: str
    films: tuple[tuple[str, tuple[str, ...]], ...]
    has_scene: bool = False
    mediapipe: float | None = None

    @property
    def cameras(self) -> int:
        """Number of cameras."""
        return max(1, len(self.films[0][1]))


ROWS = (
    Row(
        "a woman who gestures, seven clips",
        "stature, distance, pitch, empty scene",
        (("P0_", ()),),
        True,
        _GESTURES_CM,
    ),
    Row(
        "a man at a desk, from the front",
        "stature, distance, pitch, masks",
        (("real_desk", ("cam2",)),),
    ),
    Row(
        "a man on a treadmill, from the front",
        "stature, distance, pitch, masks",
        (("real_balance", ("cam02",)),),
    ),
    Row(
        "both men, two cameras",
        "the same, cameras' poses",
        (("real_desk", ("cam2", "cam3")), ("real_balance", ("cam02", "cam01"))),
    ),
)
"""The rows of real people; the last row of the table is that of the rendered recordings."""


def section(
    people: Mapping[str, Any], rendered: Mapping[str, Any], films: Mapping[str, Any] | None = None
) -> str:
    """Return the text between the marks.

    Args:
        people: ``real-people.json``.
        rendered: ``sessions.json``.
        films: ``films.json``; None leaves out the row of films.
    """
    recordings = rendered["sessions"]
    peers = [float(one["mediapipe"]["aligned"]) for one in recordings]
    cells = [_cells(row, people["sessions"]) for row in ROWS]
    if films is not None:
        cells.insert(0, _film_cells(films["films"]))
    cells.append(
        (
            f"{len(recordings)} rendered recordings",
            "distance, pitch, sizes, empty scene",
            *map(_cm, (_mean(recordings, "aligned"), None, float(np.mean(peers)))),
            _cm(_mean(recordings, "absolute")),
        )
    )
    titles = ("who", "given", "shape, no detector", "shape, detector", "MediaPipe", "place")
    alone = [one for one in people["sessions"] if len(one["cameras"]) <= 1]
    silhouettes, points = (
        [one for one in alone if (one["points"] == "none") is is_without]
        for is_without in (True, False)
    )
    text = (
        f"One camera and the detector call {_tracking(points)}; without a detector, one camera "
        f"calls {_tracking(silhouettes)}. From silhouette to posture an image takes "
        f"{_mean(recordings, 'ms'):.1f} ms on one core, {_mean(points, 'ms'):.1f} ms with points."
    )
    return "\n".join([table(titles, cells), "", *textwrap.wrap(text, 100)])


def _tracking(sessions: Sequence[Session]) -> str:
    """Return in words how many images are `tracking`, and how many of these are wrong."""
    runs = [run for one in sessions for run in one["runs"]]
    tracking = sum(run["tracking"] for run in runs)
    wrong = sum(run["tracking_beyond_30"] for run in runs)
    if not tracking:
        return "none of the images of real people `tracking`"
    share = 100.0 * tracking / sum(run["frames"] for run in runs)
    return (
        f"{share:.0f} % of the images of real people `tracking`, of which "
        f"{100.0 * wrong / tracking:.1f} % have a joint beyond 30 cm, beside the shoulders"
    )


def current(root: Path) -> str:
    """Return the text of the README in ``root`` with current figures."""
    folder = root / RESULTS
    films = folder / "films.json"
    text = section(
        read_json(folder / "real-people.json"),
        read_json(folder / "sessions.json"),
        read_json(films) if films.is_file() else None,
    )
    return replaced((root / "README.md").read_text(encoding="utf-8"), text, BEGIN, END)


def main(arguments: Sequence[str] | None = None) -> int:
    """Write or check; return 1 if a check found a difference."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing")
    parser.add_argument("--root", type=Path, default=Path(), help="folder of the repository")
    given = parser.parse_args(arguments)
    path = given.root / "README.md"
    text = current(given.root)
    if text == path.read_text(encoding="utf-8"):
        return 0
    print(f"{'differs' if given.check else 'written'}: {path}")
    if not given.check:
        write_file(path, text)
    return 1 if given.check else 0


def _cells(row: Row, sessions: Sequence[Session]) -> tuple[str, ...]:
    """Return the cells of a row."""
    silhouettes, points = (
        [
            one
            for one in sessions
            for name, cameras in row.films
            if one["points"] == source
            and one["name"].startswith(name)
            and (not cameras or tuple(one["cameras"]) == cameras)
        ]
        for source in ("none", "mediapipe")
    )
    peers = [one["mediapipe"]["aligned"] for one in points if "aligned" in one["mediapipe"]]
    peer = float(np.mean(peers)) if peers else row.mediapipe
    return (
        row.who,
        row.given,
        _cm(_mean(silhouettes, "aligned") if row.has_scene else None),
        _cm(_mean(points, "aligned")),
        # MediaPipe has the images of one camera.
        _cm(peer if row.cameras == 1 else None),
        _cm(_mean(points, "absolute")),
    )


def _film_cells(films: Sequence[Session]) -> tuple[str, ...]:
    """Return the row of films across with field of view and stature, a mean over the recordings."""
    across = [one for one in films if one["shape"] == "across" and one["given"] != "nothing"]
    groups: dict[str, list[Session]] = {}
    for one in across:
        groups.setdefault("gestures" if one["name"].startswith("P0_") else one["name"], []).append(
            one
        )
    peers = [
        _GESTURES_CM if name == "gestures" else of[0]["mediapipe_aligned"]
        for name, of in groups.items()
    ]
    shape, place = (
        float(np.mean([_mean(of, key) for of in groups.values()]))
        for key in ("aligned", "absolute")
    )
    return (
        "the three below, as films",
        "field of view, stature",
        "",
        *map(_cm, (shape, float(np.mean(peers)), place)),
    )


def _mean(sessions: Sequence[Session], key: str) -> float:
    return float(np.mean([mean_of(session["runs"], key) for session in sessions]))


def _cm(value_cm: float | None) -> str:
    return "" if value_cm is None else f"{value_cm:.1f} cm"


if __name__ == "__main__":
    sys.exit(main())
