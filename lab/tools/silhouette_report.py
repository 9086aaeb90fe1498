r"""Compare silhouettes with the true ones of recorded sessions, also in changing light.

python -m lab.tools.silhouette_report --sessions DIR... [--light DIR] \
    --output docs/evaluation/silhouettes.md

A session is a folder with ``bag/``, ``ground_truth.json`` and ``masks.npz``.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import WORKING_SIZE
from cardbox_tracker.common.files import write_file
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.segmentation.background_config import BackgroundConfig
from cardbox_tracker.segmentation.silhouettes import SilhouettePipeline
from lab.pages import table

Image = NDArray[np.uint8]
# Takes a time (s) and a shape (H, W[, channels]); returns the factor on an image.
Light = Callable[[float, tuple[int, ...]], Any]

# A person may be partly in view at the ends of the empty scene.
_MARGIN_S = 0.2
# A smaller share of the image does not count as a person.
_LEAST = 0.004
_LIMBS = ("left_shoulder", "left_elbow", "left_hand", "right_shoulder", "right_elbow", "right_hand")
_STEP_S = 6.0
FIGURES = {"IoU": "iou", "missing": "missing", "extra": "extra", "arms found": "limbs"}


def _lamp(time_s: float, _: tuple[int, ...]) -> float:
    return 1.35 if int(time_s / _STEP_S) % 2 else 1.0


def _steps(time_s: float, _: tuple[int, ...]) -> float:
    return (1.0, 0.8, 1.25, 0.65, 1.1)[int(time_s / _STEP_S) % 5]


def _drift(time_s: float, _: tuple[int, ...]) -> float:
    return 1.0 + 0.3 * float(np.sin(2 * np.pi * time_s / 60.0))


def _at(column: float, row: float, reach: float) -> Light:
    """Return a lamp of 60 % at a place given as shares of the image's width and height."""

    def light(time_s: float, shape: tuple[int, ...]) -> Any:
        if not int(time_s / _STEP_S) % 2:
            return 1.0
        v, u = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
        far = np.hypot(u / shape[1] - column, (v - row * shape[0]) / shape[1]) / reach
        return (1.0 + 0.6 * np.exp(-0.5 * far**2)).reshape(*shape[:2], *[1] * (len(shape) - 2))

    return light


LIGHTS: dict[str, Light] = {
    "drift of 30 % in a minute": _drift,
    "lamp: 35 % brighter, on or off every 6 s": _lamp,
    "gain steps between 0.65 and 1.25 every 6 s": _steps,
    "lamp in the upper left corner: up to 60 %, on or off every 6 s": _at(0.05, 0.05, 0.4),
    "lamp at the right side, near: up to 60 %, on or off every 6 s": _at(0.95, 0.5, 0.25),
}


@dataclass(frozen=True)
class Row:
    """Figures of one image: NaN where there is no person."""

    time_s: float
    segment: str
    iou: float
    missing: float
    extra: float
    limbs: float


def read_masks(path: Path) -> NDArray[np.bool_]:
    """Return the true masks (N, H, W) at the working size."""
    with np.load(path) as stored:
        count, height, width = (int(value) for value in stored["shape"])
        bits = np.unpackbits(stored["packed"], axis=1)[:, : height * width]
    masks = bits.reshape(count, height, width)
    if (width, height) == WORKING_SIZE:
        return masks > 0
    small = [cv2.resize(255 * m, WORKING_SIZE, interpolation=cv2.INTER_AREA) for m in masks]
    return np.array(small) >= 128


def limb_pixels(joints: dict[str, Any], scale: float) -> Image:
    """Return forearms and hands (H, W), as wide as 0.4 of the longest limb in the picture."""
    points = np.array([joints[name] for name in _LIMBS], float) * scale
    image = np.zeros(WORKING_SIZE[::-1], np.uint8)
    if np.isnan(points).any():
        return image
    parts = ((0, 3), (0, 1), (1, 2), (3, 4), (4, 5))
    longest = max(float(np.linalg.norm(points[a] - points[b])) for a, b in parts)
    corners = np.clip(points, -2000, 2000).round().astype(int).tolist()
    for start, end in ((1, 2), (4, 5)):
        cv2.line(image, corners[start], corners[end], 255, max(3, round(0.4 * longest)))
    return image


def images_of(folder: Path, light: Light | None) -> Iterator[tuple[float, Image]]:
    """Yield time and image of a session, in another light if that is given."""
    with BagReader(folder / "bag") as bag:
        for image in bag.images():
            time_s = (image.stamp_ns - bag.start_ns) / 1e9
            sent = image.as_sent
            if light is not None:
                sent = np.clip(sent * np.float32(light(time_s, sent.shape)) + 0.5, 0, 255).astype(
                    np.uint8
                )
            yield time_s, sent


def rows_of(folder: Path, light: Light | None = None) -> list[Row]:
    """Compare every image of a session after its empty scene."""
    truth = json.loads((folder / "ground_truth.json").read_text(encoding="utf-8"))
    masks = read_masks(folder / "masks.npz")
    empty = next(s for s in truth["segments"] if s["name"] == "empty")
    with BagReader(folder / "bag") as bag:
        calibration = bag.calibration()
    pipeline = SilhouettePipeline(calibration, WORKING_SIZE)
    scale = WORKING_SIZE[0] / float(truth["camera"]["width"])
    rows = []
    for number, (time_s, image) in enumerate(images_of(folder, light)):
        prepared = pipeline.prepare(image)
        if not pipeline.is_ready:
            if empty["start_s"] + _MARGIN_S <= time_s <= empty["end_s"] - _MARGIN_S:
                pipeline.learning.add(prepared)
            if pipeline.learning.has_enough() or time_s > empty["end_s"] - _MARGIN_S:
                pipeline.finish_learning()
            continue
        frame = truth["frames"][number]
        limbs = limb_pixels(frame["joints_px"], scale) > 0 if "joints_px" in frame else None
        found = pipeline.silhouette(prepared) > 0
        rows.append(_compare(time_s, frame["segment"], found, masks[number], limbs))
    return rows


def _compare(
    time_s: float,
    segment: str,
    found: NDArray[np.bool_],
    mask: NDArray[np.bool_],
    limbs: NDArray[np.bool_] | None,
) -> Row:
    size = np.count_nonzero(mask)
    if size < _LEAST * mask.size:
        return Row(time_s, segment, *[float("nan")] * 4)
    both = np.count_nonzero(found & mask)
    either = np.count_nonzero(found | mask)
    recall = float("nan")
    if limbs is not None and np.count_nonzero(limbs & mask) > 30:
        recall = np.count_nonzero(limbs & mask & found) / np.count_nonzero(limbs & mask)
    return Row(time_s, segment, both / either, 1 - both / size, (either - size) / size, recall)


def mean(rows: list[Row], figure: str) -> float:
    """Return the mean of a figure over the images that have it."""
    values = np.array([getattr(row, figure) for row in rows], float)
    return float(np.nanmean(values)) if np.isfinite(values).any() else float("nan")


def soon_after(rows: list[Row]) -> float:
    """Return the mean IoU 2 s after each step of the light, over half a second."""
    chosen = [r for r in rows if r.time_s > _STEP_S and 2.0 <= r.time_s % _STEP_S < 2.5]
    return mean(chosen, "iou")


def report(sessions: list[Path], lit: Path | None) -> str:
    """Return the document."""
    found = {folder.name: rows_of(folder) for folder in sessions}
    means = [[mean(rows, figure) for figure in FIGURES.values()] for rows in found.values()]
    named = [*zip(found, means, strict=True)]
    named.append((f"**mean of {len(sessions)}**", np.nanmean(means, axis=0).tolist()))
    parts = [
        "# Silhouettes against the true ones",
        "`python -m lab.tools.silhouette_report` made this page. The figures are means over all "
        "images with a person after the empty scene. *Missing* and *extra* are pixels as a share "
        "of the person; *arms found* is the share of the true pixels along forearms and hands. "
        f"The scene is learned from its first {BackgroundConfig().learn_images} images, as in the "
        "node.",
        table(["session", *FIGURES], map(_cells, named)),
    ]
    if lit is not None:
        lights = []
        for name, light in LIGHTS.items():
            rows = rows_of(lit, light)
            after = np.nan if light is _drift else soon_after(rows)
            lights.append((name, [mean(rows, "iou"), after]))
        parts += [
            f"## `{lit.name}` in changing light",
            "The columns have the IoU over all images, and 2 to 2.5 s after each step.",
            table(["light", "IoU", "2 s after a step"], map(_cells, lights)),
        ]
    return "\n\n".join(parts) + "\n"


def _cells(named: tuple[str, list[float]]) -> list[str]:
    name, values = named
    return [name, *(f"{value:.3f}" if np.isfinite(value) else "-" for value in values)]


def main(arguments: list[str] | None = None) -> int:
    """Write the document."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0] if __doc__ else None)
    parser.add_argument("--sessions", type=Path, nargs="+", required=True, metavar="DIR")
    parser.add_argument("--light", type=Path, metavar="DIR", help="session to change the light of")
    parser.add_argument("--output", type=Path, required=True)
    options = parser.parse_args(arguments)
    write_file(options.output, report(options.sessions, options.light))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
