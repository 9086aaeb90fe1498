"""Files of simulated recordings: what the learned parts see, the truth, and the sources."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import NamedTuple
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.files import atomic_path
from learning.recorder import Seen

FloatArray = NDArray[np.float64]


# Names of the columns of Seen that differ from its own.
_COLUMNS = {"state": "states", "stddev": "stddevs"}


@dataclass(frozen=True)
class Origin:
    """Sources of a recording, and how it was tracked.

    Attributes:
        family: family of the body.
        body: name of the body.
        source: source of the motion.
        motion: name of the clip.
        is_measured: whether the body was measured in its reference postures.
        has_images: whether the tracker got images.
        has_points: whether it got a detector's points.
        has_depth: whether it got depth images.
        fps: images per second.
    """

    family: str
    body: str
    source: str
    motion: str
    is_measured: bool
    has_images: bool
    has_points: bool
    has_depth: bool
    fps: float


class Image(NamedTuple):
    """One image: inputs of the learned parts, and the truth as in :class:`Samples`."""

    seen: Seen
    true_m: FloatArray
    torso_rad: FloatArray
    stamp_ns: int


@dataclass(frozen=True)
class Samples:
    """The n images of one recording in which the person was tracked.

    Attributes:
        origin: sources of the recording.
        features: inputs of the corrector, (n, 2, F).
        found_m: keypoints without the correction, (n, 6, 3), metres in the optical frame.
        evidence: inputs of the chance of loss, (n, E).
        result_features: inputs of the deviations, (n, 2, G).
        result_m: keypoints with the correction, if there was one, (n, 6, 3).
        states: corrected states, (n, 14).
        stddevs: deviations of the states from the spread of the particles, (n, 14).
        true_m: true keypoints, (n, 6, 3); nan where they are unknown.
        torso_rad: true roll, pitch and yaw of the torso, (n, 3); nan where they are unknown.
        pitch_rad: downward pitch of the camera.
        stamps_ns: (n,).
    """

    origin: Origin
    features: FloatArray
    found_m: FloatArray
    evidence: FloatArray
    result_features: FloatArray
    result_m: FloatArray
    states: FloatArray
    stddevs: FloatArray
    true_m: FloatArray
    torso_rad: FloatArray
    pitch_rad: FloatArray
    stamps_ns: NDArray[np.int64]

    @classmethod
    def of(cls, origin: Origin, images: Sequence[Image], pitch_rad: float) -> Samples:
        """Return the samples of the images of one recording, in order."""
        seen = {
            _COLUMNS.get(one.name, one.name): np.array([getattr(i.seen, one.name) for i in images])
            for one in fields(Seen)
        }
        true_m, torso_rad, stamps_ns = (
            np.array([getattr(one, name) for one in images])
            for name in ("true_m", "torso_rad", "stamp_ns")
        )
        return cls(
            origin,
            **seen,
            true_m=true_m,
            torso_rad=torso_rad,
            pitch_rad=np.array(pitch_rad),
            stamps_ns=stamps_ns,
        )

    def save(self, path: Path) -> None:
        """Write the samples to a file."""
        arrays = {"origin": np.array(json.dumps(asdict(self.origin)))}
        for one in fields(self)[1:]:
            array = getattr(self, one.name)
            arrays[one.name] = array.astype(np.float32) if array.dtype.kind == "f" else array
        with atomic_path(path) as temporary, open(temporary, "wb") as file:
            np.savez_compressed(file, allow_pickle=False, **arrays)


def load(path: Path) -> Samples:
    """Read a file that :meth:`Samples.save` wrote.

    Raises:
        CardboxError: the file is none of these.
    """
    try:
        with open(path, "rb") as file, np.load(file) as stored:
            arrays = {name: stored[name] for name in stored.files}
        origin = Origin(**json.loads(str(arrays.pop("origin"))))
        return Samples(origin, **arrays)
    except (OSError, EOFError, BadZipFile, ValueError, TypeError, KeyError) as error:
        raise CardboxError(
            f"{path} has no samples: {error!r}; expected a file of python -m learning.simulate"
        ) from None


def load_all(folders: Sequence[Path]) -> list[Samples]:
    """Return the samples in all files of some folders, by name.

    Raises:
        CardboxError: a folder has no samples.
    """
    files = {folder: sorted(folder.glob("*.npz")) for folder in folders}
    for folder, paths in files.items():
        if not paths:
            raise CardboxError(
                f"{folder} has no samples (.npz); make some with python -m learning.simulate"
            )
    return [load(path) for paths in files.values() for path in paths]


def split(samples: Iterable[Samples], left_out: str) -> tuple[list[Samples], list[Samples]]:
    """Return the samples of other sources, and those of the source that is left out.

    Args:
        samples: of all sources.
        left_out: ``family=NAME`` or ``source=PREFIX``.

    Raises:
        CardboxError: the text has another form, or no sample has this source.
    """
    kind, equals, name = left_out.partition("=")
    if kind not in ("family", "source") or not equals:
        raise CardboxError(f"'{left_out}' names no source; expected family=NAME or source=PREFIX")
    others: list[Samples] = []
    chosen: list[Samples] = []
    for one in samples:
        is_chosen = getattr(one.origin, kind).startswith(name)
        (chosen if is_chosen else others).append(one)
    if not chosen or not others:
        raise CardboxError(f"{left_out} has {len(chosen)} samples, others {len(others)}")
    return others, chosen


def grouped(samples: Iterable[Samples]) -> dict[str, list[Samples]]:
    """Return the samples by family and source: sessions by name, simulated ones by source."""
    groups: dict[str, list[Samples]] = defaultdict(list)
    for one in samples:
        groups[f"{one.origin.family} {one.origin.source}"].append(one)
    return dict(sorted(groups.items()))
