"""Draw an animated picture of a tracked real person; nobody can be recognized.

python -m lab.tools.people_film SESSION --output docs/images/person.webp

The left half has the image with model and reference, the right half both skeletons from the side,
which the camera does not see. It needs the installed detector, like :mod:`lab.tools.people_sheet`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pillow

from cardbox_tracker.common.files import atomic_path
from lab.tools.people_sheet import REFERENCE_BGR, TrackedFilm

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]

_MODEL_BGR = (60, 160, 255)
_TEXT_BGR = (190, 190, 190)
_RATE_HZ = 10.0
_PX_PER_M = 170.0
# Keypoints along both arms.
_CHAIN = (2, 1, 0, 3, 4, 5)


def from_the_side(skeletons: dict[str, FloatArray], middle_m: FloatArray, size: int) -> Image:
    """Return a picture (size, size, 3) of skeletons seen from the person's left side.

    Args:
        skeletons: keypoints (6, 3), metres in the optical frame; ``model`` and ``reference``.
        middle_m: point in the middle of the picture, (3,).
        size: height and width, px.
    """
    picture = np.full((size, size, 3), 30, np.uint8)
    colours = {"model": _MODEL_BGR, "reference": REFERENCE_BGR}
    for name, keypoints_m in skeletons.items():
        if not np.isfinite(keypoints_m).all():
            continue
        # The camera is to the left, so that depth grows to the right.
        aside = keypoints_m[:, [2, 1]] - middle_m[[2, 1]]
        points = np.rint(size / 2 + _PX_PER_M * aside).astype(np.int32)
        cv2.polylines(picture, [points[list(_CHAIN)]], False, colours[name], 2, cv2.LINE_AA)
        for u, v in points.tolist():
            cv2.circle(picture, (u, v), 3, colours[name], -1, cv2.LINE_AA)
    lines = (("from the side", _TEXT_BGR), ("tracked", _MODEL_BGR), ("reference", REFERENCE_BGR))
    for row, (text, colour) in enumerate(lines):
        cv2.putText(picture, text, (8, 18 + 18 * row), 0, 0.45, colour, 1, cv2.LINE_AA)
    return picture


def pictures_of(film: TrackedFilm, begin_s: float, seconds: float) -> list[Image]:
    """Return the pictures of a film, ten for each second of the person's time."""
    stamps_s = (film.session.stamps_ns - film.session.stamps_ns[0]) / 1e9
    wanted_s = np.arange(begin_s, begin_s + seconds, 1.0 / _RATE_HZ)
    nearest = [min(film.numbers, key=lambda number: abs(stamps_s[number] - t)) for t in wanted_s]
    numbers = list(dict.fromkeys(nearest))
    truth_m = film.session.keypoints_m
    middle_m = np.nanmean(truth_m[numbers][:, [0, 3]], axis=(0, 1)) + np.array([0.0, 0.15, 0.0])
    pictures = []
    for number in numbers:
        left, found_m = film.picture(number), film.estimate(number).keypoints_m
        skeletons = {"reference": truth_m[number]}
        if found_m is not None:
            skeletons["model"] = found_m
        pictures.append(np.hstack([left, from_the_side(skeletons, middle_m, len(left))]))
    return pictures


def main(arguments: list[str] | None = None) -> int:
    """Track, and write the animated picture."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0] if __doc__ else None)
    parser.add_argument("session", type=Path, metavar="SESSION")
    parser.add_argument("--begin", type=float, default=0.0, metavar="S", help="first second")
    parser.add_argument("--seconds", type=float, default=8.0, metavar="S", help="length")
    parser.add_argument("--output", type=Path, required=True, metavar="FILE.webp")
    options = parser.parse_args(arguments)
    pictures = pictures_of(TrackedFilm(options.session), options.begin, options.seconds)
    first, *more = (Pillow.fromarray(picture[..., ::-1]) for picture in pictures)
    with atomic_path(options.output) as temporary:
        first.save(
            temporary,
            format=options.output.suffix[1:].upper(),
            save_all=True,
            append_images=more,
            duration=round(1000 / _RATE_HZ),
            loop=0,
        )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
