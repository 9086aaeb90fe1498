"""A motion: the turns of every segment and the place of the hips, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from learning.motions.rotations import about_axis, between, from_quaternions, to_quaternions
from learning.segments import SEGMENTS

CHEST = SEGMENTS.index("chest")
SMOOTHING_S = 0.6
"""Standard deviation of the smoothing that finds the path of a walk, s."""


@dataclass(frozen=True)
class Motion:
    """A motion at a constant rate, for a person whose legs are 1 m long.

    Args:
        name: of the clip, unique within its source.
        source: such as "cmu-13"; all clips of a source come from the same person or kind.
        fps: frames a second.
        turns: world rotations (frames, segments, 3, 3) against the T-pose.
        places: middle of the hip joints (frames, 3), in lengths of the leg, z from the floor.

    Raises:
        ValueError: if the shapes do not agree or the rate is not positive.
    """

    name: str
    source: str
    fps: float
    turns: NDArray[np.float32]
    places: NDArray[np.float32]

    def __post_init__(self) -> None:
        if self.turns.shape != (len(self.places), len(SEGMENTS), 3, 3):
            raise ValueError(f"The turns of {self.name} have the shape {self.turns.shape}.")
        if self.places.shape != (len(self.turns), 3) or not len(self.places):
            raise ValueError(f"The places of {self.name} have the shape {self.places.shape}.")
        if not self.fps > 0:
            raise ValueError(f"The rate of {self.name} is {self.fps} frames a second.")

    def __len__(self) -> int:
        return len(self.places)

    @property
    def duration_s(self) -> float:
        """Time from the first frame to the last, s."""
        return (len(self) - 1) / self.fps

    def segment(self, start_s: float, end_s: float) -> Motion:
        """Return the frames from a time to another, s; at least one frame is kept."""
        first = min(max(round(start_s * self.fps), 0), len(self) - 1)
        last = max(round(end_s * self.fps), first)
        kept = slice(first, last + 1)
        return replace(self, turns=self.turns[kept], places=self.places[kept])

    def resampled(self, fps: float) -> Motion:
        """Return the motion at another rate; turns between two frames take the shorter arc."""
        at = np.arange(0, self.duration_s + 1e-9, 1 / fps) * self.fps
        low = np.minimum(at.astype(int), max(len(self) - 2, 0))
        high = np.minimum(low + 1, len(self) - 1)
        share = at - low
        start, end = (to_quaternions(self.turns[index]) for index in (low, high))
        turns = from_quaternions(between(start, end, np.repeat(share[:, None], len(SEGMENTS), 1)))
        places = self.places[low] + share[:, None] * (self.places[high] - self.places[low])
        return replace(
            self, fps=fps, turns=turns.astype(np.float32), places=places.astype(np.float32)
        )

    def headings_rad(self) -> NDArray[np.float64]:
        """Return the direction (frames,) that the chest faces, about z from +x, rad."""
        forward = self.turns[:, CHEST, :, 0].astype(float)
        return np.asarray(np.arctan2(forward[:, 1], forward[:, 0]))

    def turned(self, angle_rad: float) -> Motion:
        """Return the motion turned about the vertical through the origin, rad."""
        turn = about_axis(2, angle_rad).astype(np.float32)
        return replace(self, turns=turn @ self.turns, places=self.places @ turn.T)

    def facing_forward(self) -> Motion:
        """Return the motion about the origin, with the mean heading of the chest along +x.

        The person still turns within the motion.
        """
        forward = self.turns[:, CHEST, :2, 0].astype(float).mean(axis=0)
        turned = self.turned(-float(np.arctan2(forward[1], forward[0])))
        middle = turned.places.mean(axis=0) * (1, 1, 0)
        return replace(turned, places=(turned.places - middle).astype(np.float32))

    def on_the_spot(self, radius: float = 0.5) -> Motion:
        """Return the motion without the path of a walk, within a radius of the origin.

        Args:
            radius: the largest horizontal distance, in lengths of the leg.
        """
        path = smoothed(self.places[:, :2].astype(float), SMOOTHING_S * self.fps)
        away = self.places[:, :2] - path
        far = np.linalg.norm(away, axis=1, keepdims=True) / radius
        away *= np.tanh(far) / np.maximum(far, 1e-9)
        places = np.concatenate([away, self.places[:, 2:]], axis=1).astype(np.float32)
        return replace(self, places=places)

    def save(self, path: Path) -> None:
        """Write a compressed ``.npz`` file with quaternions of half precision."""
        np.savez_compressed(
            path,
            name=self.name,
            source=self.source,
            fps=self.fps,
            quaternions=to_quaternions(self.turns).astype(np.float16),
            places=self.places,
        )


def load(path: Path) -> Motion:
    """Return the motion of a file that :meth:`Motion.save` wrote.

    Raises:
        OSError: if the file cannot be read.
        KeyError: if the file contains something else.
    """
    with np.load(path) as file:
        return Motion(
            name=str(file["name"]),
            source=str(file["source"]),
            fps=float(file["fps"]),
            turns=from_quaternions(file["quaternions"]).astype(np.float32),
            places=file["places"],
        )


def smoothed(values: NDArray[np.float64], deviation: float) -> NDArray[np.float64]:
    """Return columns (n, k), smoothed by a Gaussian of a standard deviation in frames.

    Beyond its ends a column goes on as its reflection in the end point, which keeps straight lines.
    """
    reach = min(int(3 * deviation), len(values) - 1)
    if reach < 1:
        return values.copy()
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / deviation) ** 2)
    before = 2 * values[0] - values[reach:0:-1]
    after = 2 * values[-1] - values[-2 : -reach - 2 : -1]
    padded = np.concatenate([before, values, after])
    columns = [np.convolve(column, kernel / kernel.sum(), "valid") for column in padded.T]
    return np.stack(columns, axis=1)
