"""A page of a tracked recording: the film with the body over it, pictures, and what is doubtful."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

import numpy as np

from cardbox_tracker.applications.drawing.page import pdf_of, png_of, render_page
from cardbox_tracker.applications.exporting.markers import markers_of
from cardbox_tracker.applications.exporting.motion import Motion, floor_below, in_reference
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.measuring.scene import Value
from cardbox_tracker.person.isb_angles import ANATOMICAL_NAMES, LABORATORY, anatomical_angles
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import JOINT_NAMES
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.recordings.track import TrackSummary
from cardbox_tracker.tracking.estimate import TRACKING, UNCERTAIN

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

FIGURES = {".png": png_of, ".pdf": pdf_of}
"""Kinds of figures by the endings of their files."""
STATE_COLOURS = {UNCERTAIN: "#e69f00", "": "#9a9a9a"}
"""Colours of times whose posture may be wrong, and of those without one."""
_KNEES = "left_knee_flexion", "right_knee_flexion"
_ANGLES = {
    "elbow": {"left": "left_elbow_bend_deg", "right": "right_elbow_bend_deg"},
    "raised arm": {"left": "left_arm_elevation_deg", "right": "right_arm_elevation_deg"},
    "lean of the trunk": {"forward": "trunk_lean_deg", "right": "trunk_side_lean_deg"},
    "knee": dict(zip(("left", "right"), _KNEES, strict=True)),
}
_DPI = 100

_TRUNK, _LEFT, _RIGHT, _TRUE = "#4073bf", "#33b366", "#d97333", "#00b4d8"
_ARMS = (("Neck", "Shoulder"), ("Shoulder", "Elbow"), ("Elbow", "Hand"))
_LEGS = (("Hip", "Hip"), ("Hip", "Knee"), ("Knee", "Ankle"))
_ALONG_ARMS = [2, 1, 0, 3, 4, 5]
_MOMENTS = 4


def angles_plot(results: Results) -> bytes:
    """Return elbows, arms, trunk and knees over time as PNG, with bands of a standard deviation."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, _height(results)), dpi=_DPI, layout="constrained")
    _draw_angles(figure, results)
    return png_of(figure)


def page_figure(results: Results, kind: str) -> bytes:
    """Return the skeleton at some moments over the angles, as :data:`FIGURES` of a kind."""
    from matplotlib.figure import Figure

    high, low = (3.4 if results.is_seen else 0.0), _height(results)
    figure = Figure(figsize=(12.0, high + low), dpi=_DPI, layout="constrained")
    if results.is_seen:
        parts = figure.subfigures(2, 1, squeeze=False, height_ratios=(high, low))
        above, below = parts[:, 0]
        _draw_space(above, Motion.of(results), results.body)
    _draw_angles(below if results.is_seen else figure, results)
    return FIGURES[kind](figure)


def _shown(results: Results) -> dict[str, dict[str, str]]:
    has_knees = bool(np.isfinite(results.of(_KNEES)).any())
    return {name: columns for name, columns in _ANGLES.items() if name != "knee" or has_knees}


def _height(results: Results) -> float:
    return 2.2 * len(_shown(results))


def _draw_angles(figure: FigureBase, results: Results) -> None:
    angles = angles_of(results)
    shown = {
        name: {label: angles[column] for label, column in columns.items()}
        for name, columns in _shown(results).items()
    }
    time_s = results.time_s
    for row, (name, lines) in zip(
        figure.subplots(len(shown), sharex=True, squeeze=False)[:, 0], shown.items(), strict=True
    ):
        for label, (angle, deviation) in lines.items():
            line = row.plot(time_s, angle, linewidth=1.2, label=label)[0]
            low, high = angle - deviation, angle + deviation
            row.fill_between(time_s, low, high, color=line.get_color(), alpha=0.15, linewidth=0)
        # Deviations of what is hardly seen would leave no room for the curves.
        known = np.concatenate([angle[np.isfinite(angle)] for angle, _ in lines.values()])
        if len(known):
            row.set_ylim(known.min() - 30.0, known.max() + 30.0)
        for begin_s, end_s, state in doubtful_spans(results):
            row.axvspan(begin_s, end_s, 0.0, 0.04, color=STATE_COLOURS[state], linewidth=0)
        row.set(ylabel=f"{name} [deg]")
        row.margins(x=0.0)
        row.grid(alpha=0.3)
        row.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False)
    row.set_xlabel(
        "time [s]; bands: one standard deviation; orange: may be wrong, grey: no posture"
    )


def angles_of(results: Results) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return angles and standard deviations, (n,), degrees, by the columns' names; nan in gaps.

    Deviations are carried to the first order from those of the joints, taken as independent.
    """
    posture, stddev = results.of(JOINT_NAMES), results.deviations_of(JOINT_NAMES)
    is_seen = np.isfinite(posture).all(axis=1)
    found = np.full((2, len(posture), len(ANATOMICAL_NAMES)), np.nan)
    seen, spread = posture[is_seen], stddev[is_seen]
    found[0, is_seen] = values = anatomical_angles(seen)
    changes = [anatomical_angles(seen + spread * one) - values for one in np.eye(len(JOINT_NAMES))]
    found[1, is_seen] = np.linalg.norm(changes, axis=0)
    knees = np.degrees([results.of(_KNEES), results.deviations_of(_KNEES)])
    columns = np.concatenate([found, knees], axis=2).transpose(2, 0, 1)
    return dict(zip((*ANATOMICAL_NAMES, *_KNEES), map(tuple, columns), strict=True))


def doubtful_spans(results: Results) -> list[tuple[float, float, str]]:
    """Yield start, end, s, and ``uncertain``, or "" without a posture, of doubtful times."""
    step_s = float(np.median(np.diff(results.time_s))) if len(results.time_s) > 1 else 0.0
    spans: list[tuple[float, float, str]] = []
    before = None
    for time_s, state in zip(results.time_s.tolist(), results.state, strict=True):
        kind = state if state in (TRACKING, UNCERTAIN) else ""
        if kind != TRACKING:
            begin_s = spans.pop()[0] if kind == before else time_s
            spans.append((begin_s, time_s + step_s, kind))
        before = kind
    return spans


def _why(results: Results, begin_s: float, end_s: float) -> str:
    """Return the commonest reason why the posture may be wrong in a time."""
    is_in = (results.time_s >= begin_s) & (results.time_s < end_s)
    reasons = Counter(compress(results.texts_of("state_reason"), is_in))
    return reasons.most_common(1)[0][0] or UNCERTAIN


def space_view(
    motion: Motion,
    body: BodyModel | None,
    true_m: FloatArray | None = None,
    pitch: Value | None = None,
) -> bytes:
    """Return the skeleton from aside at some moments of a motion of n images as PNG.

    ``true_m`` are keypoints of a reference, (n, 6, 3), metres in the optical frame, or nan; the
    ``pitch`` of the camera, rad, explains their distance.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.0 * _MOMENTS, 3.4), dpi=_DPI, layout="constrained")
    _draw_space(figure, motion, body, true_m, pitch)
    return png_of(figure)


def _draw_space(
    figure: FigureBase,
    motion: Motion,
    body: BodyModel | None,
    true_m: FloatArray | None = None,
    pitch: Value | None = None,
) -> None:
    seen = motion.is_seen if true_m is None else motion.is_seen & np.isfinite(true_m).all((1, 2))
    numbers = np.flatnonzero(seen if seen.any() else motion.is_seen)
    chosen = numbers[np.linspace(0, len(numbers) - 1, 2 * _MOMENTS + 1).astype(int)[1::2]]
    markers = markers_of(motion, body)
    points_m = _upright(markers.points_m[chosen])
    reference_m = None if true_m is None else _placed(true_m[chosen], body)
    low, high = (f(points_m, axis=(0, 1)) for f in (np.nanmin, np.nanmax))
    middle, half = (low + high) / 2, float(np.max(high - low)) / 2 + 0.1
    for column, number in enumerate(chosen.tolist()):
        axes = figure.add_subplot(1, _MOMENTS, column + 1, projection="3d")
        joints = dict(zip(markers.names, points_m[column], strict=True))
        for begin, end, colour in _bones():
            if begin in joints and end in joints:
                axes.plot(*np.transpose([joints[begin], joints[end]]), color=colour, linewidth=3)
        if reference_m is not None:
            axes.plot(
                *reference_m[column][_ALONG_ARMS].T, color=_TRUE, linewidth=1.5, marker="o", ms=3
            )
        axes.set(
            title=f"{motion.time_s[number]:.1f} s",
            xlim=(middle[0] - half, middle[0] + half),
            ylim=(middle[1] - half, middle[1] + half),
            zlim=(middle[2] - half, middle[2] + half),
        )
        axes.set_box_aspect((1, 1, 1), zoom=1.25)
        axes.view_init(elev=10.0, azim=-35.0)
        axes.tick_params(labelsize=6)
    what = "" if true_m is None else _reference_words(motion.keypoints_m - true_m, pitch)
    figure.suptitle(f"green: left, orange: right{what}; metres", fontsize=10)


def _reference_words(off_m: FloatArray, pitch: Value | None) -> str:
    """Return how far a skeleton is from its reference, (n, 6, 3), m, and on what that rests."""
    middle_m = np.nanmean(off_m, axis=(0, 1))
    where = "farther from" if middle_m[2] > 0 else "nearer to"
    words = f"; light blue: reference.\nThe skeleton is {100 * np.linalg.norm(middle_m):.0f} cm "
    words += f"{where} the camera"
    if pitch is None:
        return words
    mean_deg, stddev_deg = np.degrees(pitch[:2])
    return (
        f"{words}: one camera sees the distance by size and by its own pitch, here {mean_deg:.0f} "
        f"+- {stddev_deg:.0f} degrees"
    )


def cameras_view(
    motion: Motion, body: BodyModel | None, cameras: Mapping[str, Extrinsics]
) -> bytes:
    """Return the cameras and the way of the hips from above as PNG, the first camera below."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.0, 5.0), dpi=_DPI, layout="constrained")
    axes = figure.subplots()
    markers = markers_of(motion, body)
    hips_m = _upright(markers.points_m[motion.is_seen, markers.names.index("Hip")])
    axes.plot(hips_m[:, 0], hips_m[:, 1], color=_TRUNK, linewidth=1.5)
    first = Extrinsics(np.eye(3), np.zeros(3))
    for name, pose in {"first camera": first, **cameras}.items():
        ahead_m = pose.centre_m + 0.5 * pose.rotation[2]
        ends_m = _placed(np.array([pose.centre_m, ahead_m]), body)
        axes.plot(*ends_m[:, :2].T, color="black", linewidth=2)
        axes.plot(*ends_m[0, :2], color="black", marker="o")
        at_m = float(ends_m[0, 0]), float(ends_m[0, 1])
        axes.annotate(name, at_m, (6, 6), textcoords="offset points", fontsize=9)
    axes.set(xlabel="to the right [m]", ylabel="away from the first camera [m]")
    axes.set_aspect("equal", "datalim")
    axes.margins(0.2)
    axes.grid(alpha=0.3)
    return png_of(figure)


def _bones() -> list[tuple[str, str, str]]:
    bones = [("Hip", "Neck", _TRUNK)]
    for side, colour in (("L", _LEFT), ("R", _RIGHT)):
        for begin, end in (*_ARMS, *_LEGS):
            is_middle = begin in ("Neck", "Hip") and end in ("Shoulder", "Hip")
            bones.append((begin if is_middle else f"{side}{begin}", f"{side}{end}", colour))
    return bones


def _upright(points_m: FloatArray) -> FloatArray:
    """Return points (..., 3) of the laboratory with x to the image's right, y away, z up."""
    return np.asarray(points_m[..., [2, 0, 1]] * np.array([-1.0, -1.0, 1.0]))


def _placed(optical_m: FloatArray, body: BodyModel | None) -> FloatArray:
    """Return points (..., 3), m, of the optical frame as :func:`_upright` does."""
    return _upright((in_reference(optical_m, body) - floor_below(body)) @ LABORATORY.T)


_MOST_SPANS = 20


def write_page(
    path: Path,
    film: Path,
    title: str,
    people: Mapping[str, tuple[Results, TrackSummary]],
    lines: Sequence[str],
    cameras: Mapping[str, Extrinsics],
    hides_heads: bool,
) -> None:
    """Write the page, which needs no other file than the ``film``, named relative to it.

    It has the results of ``people`` with their summaries by a heading, and ``lines`` on what they
    rest on, and shows the further ``cameras`` from above; ``hides_heads`` says that no face is in
    the film. Raises CardboxError if the file cannot be written.
    """
    render_page(
        path,
        Path(__file__).with_name("page.html"),
        title=title,
        film=quote(os.fsencode(os.path.relpath(film, path.parent))),
        film_name=film.name,
        start_s=min(float(results.time_s[0]) for results, _ in people.values()),
        people=[_person(name, *of, cameras) for name, of in people.items()],
        lines=lines,
        hides_heads=hides_heads,
    )


def _person(
    name: str, results: Results, summary: TrackSummary, cameras: Mapping[str, Extrinsics]
) -> dict[str, object]:
    seen = Motion.of(results) if np.isfinite(results.of(["torso_y"])).any() else None
    spans = sorted(doubtful_spans(results), key=lambda span: span[0] - span[1])
    pictures = {"angles over time, with a standard deviation": angles_plot(results)}
    if seen is not None:
        pictures = {"skeleton from aside": space_view(seen, results.body)} | pictures
    if seen is not None and cameras:
        pictures["cameras and hips from above"] = cameras_view(seen, results.body, cameras)
    return {
        "name": name,
        "words": summary.quality,
        "moments": [
            (begin_s, end_s, _why(results, begin_s, end_s) if what else "no posture")
            for begin_s, end_s, what in sorted(spans[:_MOST_SPANS])
        ],
        "more": max(0, len(spans) - _MOST_SPANS),
        "pictures": pictures,
    }
