"""Recorded sessions as the films that people make, and the figures of tracking them.

A film shows the motions only, is compressed, and does not tell its camera. The optical axis of a
phone is in the middle of its image, so the images of a session are turned until theirs is; the
truth is turned with them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import sin
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import cv2
import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from cardbox_tracker.applications.drawing.video import video_file
from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.commands.request import TrackingOptions
from cardbox_tracker.commands.tracking import track
from cardbox_tracker.commands.tracking_request import tracking_request
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import write_file
from cardbox_tracker.common.progress import progress_bar
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.skeleton import SHOULDERS, KeypointState
from cardbox_tracker.recordings.open_images import open_images
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.search.doubt import FAR_M
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.precompile import compile_all
from cardbox_tracker.tracking.tracker import Tracker
from lab.evaluation.people import people_figures
from lab.evaluation.results import provenance, write_json
from lab.evaluation.session import RecordedSession, load_session
from lab.evaluation.tracking import run_of
from lab.pages import number, table

FloatArray = NDArray[np.float64]

SHAPES: Mapping[str, float | None] = {"across": None, "upright": 9 / 16}
"""Width of a film's images as a share of their height, by name; None: as it was recorded."""

_FIGURES = (
    *("frames", "without_estimate", "aligned", "absolute"),
    *("tracking", "tracking_beyond_30"),
)


FAR_DEG = 10.0
"""Error of the camera's pitch from which on the vertical counts as wrong."""


class Film(NamedTuple):
    """A session as a film.

    Attributes:
        session: its truth, in the optical frame of the film.
        shape: a name of ``SHAPES``.
        path: the video.
        fov_deg: field of view across its width.
        stamps_ns: stamps of the session for the images of the film.
    """

    session: RecordedSession
    shape: str
    path: Path
    fov_deg: float
    stamps_ns: tuple[int, ...]


MOTIONS: Mapping[str, Callable[[float], tuple[float, float, float]]] = {
    "still": lambda share: (0.0, 0.0, 0.0),
    "shaken by 2 degrees": lambda share: (
        1.6 * sin(47 * share),
        1.6 * sin(38 * share),
        sin(29 * share),
    ),
    "panned by 30 degrees": lambda share: (0.0, 30.0 * share - 15.0, 0.0),
}
"""How a camera turns by itself, by name: about its horizontal axis, the vertical and its optical
axis, degrees, at a share of the film's time."""


def make_film(
    folder: Path, shape: str, path: Path, motion: str = "still", *, is_compared: bool = False
) -> Film:
    """Write a session, as its first camera sees it, as a film without its empty scene.

    Args:
        folder: the session.
        shape: a name of ``SHAPES``.
        path: video to write, .mp4.
        motion: a name of ``MOTIONS``. Upright mirrors show what is beside the session's images.
        is_compared: show the mirrors in a still film, too, and leave out the truth of images that
            have a joint outside with any motion.

    Raises:
        CardboxError: the folder is not a session, or the video cannot be written.
    """
    session = load_session(folder)
    if session.truth.stature_m is None:
        raise CardboxError(f"{folder} does not say the stature of the person")
    name = session.truth.cameras[0] if session.truth.cameras else None
    if name is not None:
        session = load_session(folder, (name,))
    with open_images(session.bag) as bag:
        lens = bag.calibration(name)
        share = SHAPES[shape]
        height = lens.height // 2 * 2
        width = lens.width // 2 * 2 if share is None else round(height * share / 2) * 2
        begins_ns = session.truth.start_ns + round(1e9 * session.start_s)
        images = [i for i in bag.images(bag.image_topic(name)) if i.stamp_ns >= begins_ns]
        stamps_ns = tuple(image.stamp_ns for image in images)
        k = lens.k.copy()
        k[:2, 2] = (width - 1) / 2, (height - 1) / 2
        column = (lens.width - 1) / 2
        if share is not None:
            # An upright phone points at the person.
            there = session.keypoints_m.mean(axis=1) @ lens.k.T
            column = float(np.median(there[:, 0] / there[:, 2]))
        down = -session.to_optical[:, 2]
        turn = _turn(lens.k, (column, (lens.height - 1) / 2), down)
        size = (width, height)
        shares = (np.array(stamps_ns) - stamps_ns[0]) / (stamps_ns[-1] - stamps_ns[0])
        turns = [_turned(turn, down, MOTIONS[motion](share)) for share in shares.tolist()]
        if is_compared:
            every = [[_turned(turn, down, of(one)) for of in MOTIONS.values()] for one in shares]
            session = _inside(session, dict(zip(stamps_ns, np.array(every), strict=True)), k, size)
        is_plain = motion == "still" and not is_compared
        maps = cv2.initUndistortRectifyMap(lens.k, lens.distortion, turn, k, size, cv2.CV_32FC1)
        border = cv2.BORDER_CONSTANT if is_plain else cv2.BORDER_REFLECT_101
        fps = round(1e9 / float(np.median(np.diff(stamps_ns))), 2)
        with video_file(path, fps) as add:
            for image, there in zip(images, turns, strict=True):
                if not is_plain:
                    maps = _mirrored(lens, there, down, k, size)
                shown = image.as_sent
                color = shown if shown.ndim == 3 else cv2.cvtColor(shown, cv2.COLOR_GRAY2BGR)
                add(cv2.remap(color, *maps, cv2.INTER_LINEAR, borderMode=border).astype(np.uint8))
    hips, turn = session.hips_m, turns[0]
    pitch_deg = float(np.degrees(np.arcsin(turn[2] @ down)))
    turned = replace(
        session,
        truth=replace(session.truth, pitch_deg=pitch_deg),
        keypoints_m=session.keypoints_m @ turn.T,
        hips_m=None if hips is None else hips @ turn.T,
    )
    fov_deg = float(np.degrees(2 * np.arctan(width / 2 / k[0, 0])))
    return Film(turned, shape, path, fov_deg, stamps_ns)


def _inside(
    session: RecordedSession,
    turns: Mapping[int, FloatArray],
    k: FloatArray,
    size: tuple[int, int],
) -> RecordedSession:
    """Return a session without the truth of images that lack a joint with one of their turns."""
    kept = np.zeros(len(session.stamps_ns), bool)
    for i, stamp_ns in enumerate(session.stamps_ns.tolist()):
        if stamp_ns in turns:
            there = np.einsum("ij,mjk,nk->mni", k, turns[stamp_ns], session.keypoints_m[i])
            px = there[..., :2] / there[..., 2:]
            kept[i] = ((px >= 0) & (px < size)).all()
    if not kept.any():
        raise CardboxError(f"{session.name} has no image whose joints are in view with each motion")
    names = "stamps_ns", "segments", "keypoints_m", "torso_rad", "hips_m"
    values = ((name, getattr(session, name)) for name in names)
    left: dict[str, Any] = {name: one if one is None else one[kept] for name, one in values}
    return replace(session, **left)


def _turn(k: FloatArray, middle: tuple[float, float], down: FloatArray) -> FloatArray:
    """Return the rotation (3, 3) to a level camera whose axis goes through a pixel."""
    ahead = np.linalg.solve(k, [*middle, 1.0])
    ahead /= np.linalg.norm(ahead)
    right = np.cross(down, ahead)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(ahead, right), ahead])


def _turned(turn: FloatArray, down: FloatArray, angles_deg: Sequence[float]) -> FloatArray:
    """Return a rotation (3, 3) to a camera that also turns by itself, see ``MOTIONS``."""
    axes = np.array([turn[0], down, turn[2]])
    vector = turn @ (np.radians(angles_deg) @ axes)
    return np.asarray(cv2.Rodrigues(vector)[0]) @ turn


def _mirrored(
    lens: Calibration, turn: FloatArray, down: FloatArray, k: FloatArray, size: tuple[int, int]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return maps of ``cv2.remap`` to a turned camera between two upright mirrors.

    The mirrors stand in the camera, at the sides of the recorded images, so that upright edges stay
    upright.
    """
    ahead = np.array([0.0, 0.0, 1.0]) - down * down[2]
    ahead /= np.linalg.norm(ahead)
    level = np.array([np.cross(down, ahead), down, ahead])
    width, height = lens.width, lens.height
    sides = [np.column_stack([np.full(height, x), np.arange(height)]) for x in (0, width - 1)]
    seen = [lens.camera(width, height).rays(lens.rectified(px, width, height)) for px in sides]
    left, right = (np.arctan2(*(rays @ level.T)[:, [0, 2]].T) for rays in seen)
    begin, end = float(left.max()), float(right.min())
    columns, rows = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    px = np.stack([columns.ravel(), rows.ravel(), np.ones(columns.size)])
    rays = level @ turn.T @ np.linalg.inv(k) @ px
    away = np.hypot(rays[0], rays[2])
    angles = (np.arctan2(rays[0], rays[2]) - begin) % (2 * (end - begin))
    angles = end - np.abs(angles - (end - begin))
    there = (np.array([away * np.sin(angles), rays[1], away * np.cos(angles)]).T) @ level
    found, _ = cv2.projectPoints(there, np.zeros(3), np.zeros(3), lens.k, lens.distortion)
    across, below = np.asarray(found, np.float32).reshape(*size[::-1], 2).transpose(2, 0, 1)
    return np.ascontiguousarray(across), np.ascontiguousarray(below)


def tracked_figures(film: Film, asked: TrackingOptions) -> dict[str, Any]:
    """Track a film as asked, and return its :func:`film_figures`."""
    estimates: list[Estimate] = []
    keep = partial(_keep, estimates)
    summary = track(tracking_request(asked), (keep,), lambda _: None)
    return film_figures(film, estimates, summary.body)


def film_figures(
    film: Film, estimates: Sequence[Estimate], body: BodyModel | None
) -> dict[str, Any]:
    """Return figures of :func:`people_figures`, and the pitch that was found and is true, deg.

    Args:
        film: what was tracked.
        estimates: one for each image of the film.
        body: the body at the end.
    """
    roll_rad = 0.0 if body is None else body.camera_pose.roll_rad
    standing = [estimate.as_camera_stands(roll_rad) for estimate in estimates]
    by_stamp = dict(zip(film.stamps_ns, standing, strict=True))
    # The time of an image is not measured.
    run = run_of(film.session, body, "", by_stamp, [float("nan")])
    every = people_figures(film.session, run)
    found = {name: every[name] for name in _FIGURES if name in every}
    found["pitch_deg"] = film.session.truth.pitch_deg
    is_level = False
    if body is not None:
        found["pitch_found_deg"] = float(np.degrees(body.camera_pose.pitch_rad))
        is_level = abs(found["pitch_found_deg"] - found["pitch_deg"]) <= FAR_DEG
    return found | _other_verdicts(film.session, by_stamp, is_level)


def _other_verdicts(
    session: RecordedSession, by_stamp: Mapping[int, Estimate], is_level: bool
) -> dict[str, int]:
    """Count images whose vertical and whose place are sure, and those of them that are wrong."""
    counts = dict.fromkeys(("vertical", "vertical_wrong", "place", "place_wrong"), 0)
    for stamp_ns, true_m in zip(session.stamps_ns.tolist(), session.keypoints_m, strict=True):
        one = by_stamp.get(stamp_ns)
        if one is None or one.keypoints_m is None:
            continue
        if one.vertical_state is KeypointState.TRACKED:
            counts["vertical"] += 1
            counts["vertical_wrong"] += not is_level
        if one.place is not None and one.place.state is KeypointState.TRACKED:
            off_m = (one.keypoints_m - true_m)[list(SHOULDERS)].mean(axis=0)
            counts["place"] += 1
            counts["place_wrong"] += bool(np.linalg.norm(off_m) > FAR_M)
    return counts


def films_report(results: Mapping[str, Any]) -> str:
    """Return the report in Markdown of the contents of ``films.json``."""
    groups: dict[tuple[str, ...], list[Mapping[str, Any]]] = {}
    for film in results["films"]:
        groups.setdefault((film["group"], film["shape"], film["given"]), []).append(film)
    rows = [_cells(film["name"], [film]) for film in results["films"]]
    rows += [
        _cells(f"**mean of {len(films)} in {group}, {shape}**", films)
        for (group, shape, _), films in groups.items()
        if len(films) > 1
    ]
    parts = [
        "# Sessions as films",
        "Each session is tracked by `cardbox track FILM --detector mediapipe` with what is given, "
        "and without an empty scene. Errors are those of shoulders, elbows and hands, cm; "
        "*aligned*: beside the middle of the shoulders. Settings were chosen on the same "
        "recordings. Then come the three verdicts: the share of the images in which each is sure, "
        "and how many of these are wrong. A shape is wrong if a joint is off by more than 30 cm "
        f"beside the middle of the shoulders, a vertical if the pitch is by more than {FAR_DEG} "
        "degrees, and a place if the middle of the shoulders is by more than 30 cm. With motions "
        "of the camera, images count whose joints are in view with each of them.",
        table(_HEAD, rows),
        f"Made by `{results['command']}` at commit {results['provenance']['commit']}.",
    ]
    return "\n\n".join(parts) + "\n"


_VERDICTS = {
    "shape": ("tracking", "tracking_beyond_30"),
    "vertical": ("vertical", "vertical_wrong"),
    "place": ("place", "place_wrong"),
}
"""Names of the numbers of images in which a verdict is sure, and sure and wrong."""
_HEAD = (
    *("film", "given", "aligned", "absolute", "MediaPipe aligned"),
    *(head for name in _VERDICTS for head in (f"{name} sure, %", "of these wrong, %")),
    *("without posture, %", "pitch found / true, degrees"),
)


def _cells(name: str, films: Sequence[Mapping[str, Any]]) -> list[str]:
    runs = [run for film in films for run in film["runs"]]

    def mean(key: str, of: Sequence[Mapping[str, Any]] = runs) -> float:
        values = [one.get(key) for one in of]
        return float(np.mean([np.nan if value is None else value for value in values]))

    def share(part: str, whole: str, form: str = "{:.0f}") -> str:
        total = sum(run[whole] for run in runs)
        return number(100 * sum(run[part] for run in runs) / total if total else np.nan, form)

    return [
        *(name, str(films[0]["given"]), number(mean("aligned")), number(mean("absolute"))),
        number(mean("mediapipe_aligned", films)),
        *(
            cell
            for sure, wrong in _VERDICTS.values()
            for cell in (share(sure, "frames"), share(wrong, sure, "{:.1f}"))
        ),
        share("without_estimate", "frames"),
        f"{number(mean('pitch_found_deg'))} / {number(mean('pitch_deg'))}",
    ]


def evaluate_films(
    folders: Sequence[Path],
    report: Path,
    preset: str,
    seeds: range,
    jobs: int,
    is_moving: bool = False,
) -> None:
    """Track sessions as films, and write the report and, beside it, all numbers as JSON.

    Args:
        folders: sessions.
        report: Markdown file to write.
        preset: name of the tracker's settings.
        seeds: seeds of the runs.
        jobs: number of processes; 1 stays in this one.
        is_moving: whether the camera also turns, in films across.

    Raises:
        CardboxError: a folder is no session, or the report cannot be written.
    """
    for folder in folders:
        load_session(folder)
    report.parent.mkdir(parents=True, exist_ok=True)
    compile_all()
    # The code may change while it runs.
    made = provenance()
    films: list[dict[str, Any]] = []
    kinds = [(shape, "still") for shape in SHAPES]
    if is_moving:
        kinds = [("across", motion) for motion in MOTIONS]
    work = [(folder, *kind) for folder in folders for kind in kinds]
    parallel = Parallel(jobs, return_as="generator", batch_size=1)
    with progress_bar("evaluate") as show:
        found = parallel(delayed(_film)(*one, preset, seeds, is_moving) for one in work)
        for done, entries in enumerate(found, 1):
            films += entries
            show(done / len(work))
    names = " ".join(folder.name for folder in folders)
    how = f"--preset {preset} --seed {seeds[0]} --seeds {len(seeds)}{' --moving' * is_moving}"
    results = {
        "command": f"cardbox evaluate --films {names} {how} --output DIR",
        "films": sorted(films, key=lambda film: (film["given"], film["shape"])),
        "provenance": made,
    }
    write_json(results, report.with_suffix(".json"))
    write_file(report, films_report(results))


def _film(
    folder: Path, shape: str, motion: str, preset: str, seeds: range, is_moving: bool
) -> list[dict[str, Any]]:
    """Return the entries of one session in ``films.json``, one for all that is given."""
    found = list[dict[str, Any]]()
    with TemporaryDirectory() as made:
        film = make_film(
            folder, shape, Path(made) / f"{folder.name}.mp4", motion, is_compared=is_moving
        )
        stature_m = film.session.truth.stature_m
        known: dict[str, Any] = {"fov_deg": round(film.fov_deg, 1), "stature_m": stature_m}
        for given, more in {"field of view, stature": known, "nothing": {}}.items():
            runs = []
            for seed in seeds:
                fixed: dict[str, Any] = {"detector": "mediapipe", "preset": preset, "seed": seed}
                runs.append(tracked_figures(film, TrackingOptions(film.path, **fixed, **more)))
            found.append(
                {
                    "name": f"{folder.name}, {shape}" + f", {motion}" * (motion != "still"),
                    "group": folder.resolve().parent.name,
                    "shape": shape if motion == "still" else motion,
                    "given": given,
                    "mediapipe_aligned": film.session.mediapipe.get("aligned"),
                    "runs": runs,
                }
            )
    return found


def _keep(estimates: list[Estimate], _: RecordedFrame, estimate: Estimate, __: Tracker) -> None:
    estimates.append(estimate)
