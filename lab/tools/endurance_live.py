"""The long runs with nodes: one camera for an hour, and trackers in eight namespaces."""

from __future__ import annotations

import os
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from std_msgs.msg import Header

from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.ros.messages.conversions import image_message
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.processes import Nodes, isolate, running_nodes
from lab.tools.endurance_nodes import Cameras
from lab.tools.endurance_record import Record, resources_of
from lab.tools.fault_scene import EMPTY, PERSON, Person, Sent

RATE_HZ = 15
# The background is learned in the first seconds; later the room is empty for ten of each fifty.
BEGIN_S, MOVING_S, ROUND_S = 8.0, 40.0, 50.0
LEARN_IMAGES = 15
SPACES = tuple(f"person_{number}/" for number in range(1, 9))
MOTION_S = 8.0


def is_there(at_s: float) -> bool:
    """Return whether the person is in view."""
    return at_s >= BEGIN_S and (at_s - BEGIN_S) % ROUND_S < MOVING_S


def light(at_s: float) -> float:
    """Return the brightness: clouds within four minutes, and a lamp that switches every seven."""
    return 1.0 + 0.15 * float(np.sin(at_s / 40.0)) + (0.08 if at_s // 420 % 2 else 0.0)


@contextmanager
def _nodes() -> Iterator[tuple[Nodes, Path]]:
    """Start nodes of this checkout, in a DDS domain of their own."""
    root = str(Path(__file__).resolve().parents[2])
    os.environ["PYTHONPATH"] = os.pathsep.join([root, os.environ.get("PYTHONPATH", "")])
    isolate()
    with tempfile.TemporaryDirectory() as folder, running_nodes(Path(folder)) as nodes:
        save_body_model(Person().body, Path(folder) / "body.yaml")
        yield nodes, Path(folder)


def _parameters(**values: Any) -> tuple[str, ...]:
    return tuple(word for name, value in values.items() for word in ("-p", f"{name}:={value}"))


def hour(record: Record, seconds: float) -> None:
    """Run the nodes ``background`` and ``tracker`` while person and light change."""
    with _nodes() as (nodes, folder):
        nodes.start("background", "--ros-args", *_parameters(learn_images=LEARN_IMAGES))
        model = _parameters(model_file=folder / "body.yaml")
        nodes.start("tracker", "--ros-args", *model)
        cameras = Cameras(nodes, [""], "image_raw", qos.CAMERA)
        line, person = cameras.lines[0], cameras.person

        def image(number: int) -> tuple[Any, float]:
            at_s = number / RATE_HZ
            shows = PERSON if is_there(at_s) else EMPTY
            lit = np.clip(person.image(Sent(0, 2.0 + at_s, shows)) * light(at_s), 0, 255)
            return image_message(Header(), lit.astype(np.uint8), "mono8"), 2.0 + at_s

        def take(passed_s: float) -> None:
            background = cameras.account("background", line.sent)
            # A gap before the first node is one before the second as well.
            passed_on = background["published"] + background["told"]
            tracker = cameras.account("tracker", passed_on)
            shown = [number for number in range(line.sent) if is_there(number / RATE_HZ)]
            back = [n for n in shown if not is_there((n - 2 * RATE_HZ) / RATE_HZ) and n > 150]
            come = [n for n in back if is_there((n - 2 * RATE_HZ + 1) / RATE_HZ)]
            record.counts = Counter(
                {
                    "images sent": line.sent,
                    "images received by `background`": background["received"],
                    "images left out on the way and reported": background["told"],
                    "images left out without a report": background["silent"],
                    "silhouettes sent by `background`": background["published"],
                    "silhouettes received by `tracker`": tracker["received"],
                    "silhouettes left out and reported, with those images": tracker["told"],
                    "silhouettes left out without a report": tracker["silent"],
                    "images with the person": len(shown),
                    "of these with a posture": len(line.answered & set(shown)),
                    "postures of an empty room": len(line.answered - set(shown)),
                    "times the person was back for two seconds": len(come),
                    "of these with a posture by then": len(line.answered & set(come)),
                    **{f"answers `{state}`": count for state, count in line.states.items()},
                }
            )
            resources = {name: resources_of(nodes.pid(name)) for name in ("background", "tracker")}
            _sample(record, cameras, passed_s, resources)

        try:
            cameras.run(seconds, RATE_HZ, image, (30.0, take))
        finally:
            cameras.close()


def eight(record: Record, seconds: float) -> None:
    """Run a node ``tracker`` in each of eight namespaces."""
    with _nodes() as (nodes, folder):
        names = [space.strip("/") for space in SPACES]
        model = _parameters(model_file=folder / "body.yaml")
        for name in names:
            words = ("--ros-args", "-r", f"__ns:=/{name}", *model)
            nodes.start("tracker", *words, called=name)
        cameras = Cameras(nodes, SPACES, "silhouette", qos.SILHOUETTE)
        count = round(MOTION_S * RATE_HZ)
        seen = [
            image_message(Header(), cameras.person.silhouette(2.0 + n / RATE_HZ), "mono8")
            for n in range(count)
        ]

        def image(number: int) -> tuple[Any, float]:
            return seen[number % count], 2.0 + number / RATE_HZ

        def take(passed_s: float) -> None:
            told = [
                cameras.account(f"{one}/tracker", cameras.lines[i].sent)
                for i, one in enumerate(names)
            ]
            states = sum((line.states for line in cameras.lines), Counter[str]())
            record.counts = Counter(
                {
                    "images sent": sum(one["sent"] for one in told),
                    "images received": sum(one["received"] for one in told),
                    "images answered": sum(states.values()),
                    "images left out and reported": sum(one["told"] for one in told),
                    "images left out without a report": sum(one["silent"] for one in told),
                    "most without a report at one tracker": max(one["silent"] for one in told),
                    "trackers that warn that they are slow": sum(
                        any("results come" in text for text in cameras.warnings(f"{one}/tracker"))
                        for one in names
                    ),
                    **{f"answers `{state}`": number for state, number in states.items()},
                }
            )
            resources = {name: resources_of(nodes.pid(name)) for name in names}
            _sample(record, cameras, passed_s, resources)

        try:
            cameras.run(seconds, RATE_HZ, image, (10.0, take))
        finally:
            cameras.close()


def _sample(record: Record, cameras: Cameras, passed_s: float, resources: Any) -> None:
    """Add a sample of all cameras, and forget what it contains."""
    took_s = [value for line in cameras.lines for value in line.took_s]
    errors_m = [value for line in cameras.lines for value in line.errors_m]
    for line in cameras.lines:
        line.took_s, line.errors_m = [], []
    images = sum(line.sent for line in cameras.lines)
    error_cm = 100 * float(np.mean(errors_m)) if errors_m else None
    record.add(passed_s, images, took_s, resources, error_cm=error_cm)
    print(f"{passed_s:.0f} s, {images:,} images", flush=True)
