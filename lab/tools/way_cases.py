"""The recordings of :mod:`.ways`, and what of them is given and known."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.recordings.silhouettes import TimeSpan
from lab.evaluation.session import MARGIN_S, load_session
from lab.tools.people import comes, joints_of

_USUAL_HZ = 30.0


@dataclass(frozen=True)
class Person:
    """A person of a session: name, stature, and true joints (6, 3) by stamp, m, nan if unknown."""

    name: str
    stature_m: float
    joints_m: Mapping[int, FloatArray]


@dataclass(frozen=True)
class Case:
    """A session, the cameras of it that are used, and what is given."""

    name: str
    bag: Path
    cameras: tuple[str, ...]  #: namespaces
    extrinsics: Path | None  #: file with the cameras' poses; None without one
    pitch_deg: float  #: of the first camera
    fps: float
    empty: TimeSpan | None  #: None if somebody is in all images
    start_s: float  #: begin of the motions
    people: tuple[Person, ...]  #: from left to right, or as they come

    @property
    def numbers(self) -> list[int | None]:
        """Numbers of the people in the results; None for one person."""
        several = len(self.people) > 1
        return [number if several else None for number in range(1, len(self.people) + 1)]

    @property
    def given(self) -> list[str]:
        """Options of ``cardbox track`` for what is given, except for the cameras."""
        statures = ",".join(f"{person.stature_m:g}" for person in self.people)
        words = ["--stature", statures, "--camera-pitch-deg", f"{self.pitch_deg:g}"]
        if len(self.people) > 1:
            words += ["--people", str(len(self.people))]
        scene = ["--silhouettes", "detector"]
        if self.empty is not None:
            scene = ["--background", str(self.empty), "--start", f"{self.start_s:g}"]
        return [*words, *scene, "--detector", "mediapipe"]

    def slowly(self, rate: float) -> float:
        """Return the speed at which all people of all cameras are as many images as at ``rate``."""
        views = len(self.cameras) * len(self.people)
        return rate * min(1.0, _USUAL_HZ / self.fps) / views


def cases_of(folder: Path) -> Iterator[Case]:
    """Yield the first camera of a session, and the first two if it has several."""
    truth = json.loads((folder / "ground_truth.json").read_text())
    names = [one["name"] for one in truth.get("cameras", ())] or ["camera"]
    empty, start_s = None, 0.0
    if "people" in truth:
        came = sorted(truth["people"], key=lambda person: comes(person, names[0]))
        people = tuple(_person(person, names[0], truth["frames"]) for person in came)
        spans = {one["name"]: one for one in truth["segments"]}
        if "empty" in spans:
            start_s = spans["empty"]["end_s"]
            empty = TimeSpan(0.0, start_s - MARGIN_S)
    else:
        session = load_session(folder)
        joints_m = dict(zip(session.stamps_ns.tolist(), session.keypoints_m, strict=True))
        people = (Person("", session.truth.stature_m or 0.0, joints_m),)
        empty, start_s = session.spans.get("empty"), session.start_s
    poses = folder / "extrinsics.yaml"
    for count in (1, 2)[: len(names)]:
        chosen = tuple(names[:count])
        yield Case(
            " ".join([folder.name, *["+".join(chosen)][: len(names) - 1]]),
            folder / "bag",
            chosen,
            poses if count > 1 and poses.is_file() else None,
            float(truth["camera"]["pitch_down_deg"]),
            float(truth["fps"]),
            *(empty, start_s, people),
        )


def _person(person: Any, camera: str, frames: Sequence[Any]) -> Person:
    joints_m = {}
    for frame, seen in zip(frames, person["frames"], strict=True):
        if (there := joints_of(seen, camera)) is not None:
            joints_m[int(frame["stamp_ns"])] = there[0]
    return Person(person["name"], person["height"], joints_m)
