"""Executes the recipe "Add a joint" of CONTRIBUTING.md, and prints where the joint then is.

python added_joint.py FOLDER
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import cardbox_tracker.person

# A new joint carries the head.
PITCH = '    Joint("neck_pitch", Group.NECK, "neck_yaw", REVOLUTE, Y, _deg(-60, 60), "p_head"),\n'
ROLL = '    Joint("neck_roll", Group.NECK, "neck_pitch", REVOLUTE, X, _deg(-40, 40), "r_head"),\n'
HEAD = 'Joint("neck", Group.END, "neck_{}"'


def add_row() -> None:
    """Import the skeleton as if its table had the row."""
    name = "cardbox_tracker.person.skeleton"
    path = Path(cardbox_tracker.person.__file__).with_name("skeleton.py")
    text = path.read_text(encoding="utf-8")
    assert text.count(PITCH) == text.count(HEAD.format("pitch")) == 1
    text = text.replace(PITCH, PITCH + ROLL).replace(HEAD.format("pitch"), HEAD.format("roll"))
    sys.modules[name] = module = ModuleType(name)
    exec(compile(text, str(path), "exec"), module.__dict__)


def found_in(folder: Path) -> dict[str, Any]:
    """Return the joint and its deviation by output; the head leans by 12 degrees."""
    import numpy as np

    from cardbox_tracker.applications.exporting.formats import FORMATS, export
    from cardbox_tracker.camera.camera import Camera
    from cardbox_tracker.detectors.image_points import ImagePoints
    from cardbox_tracker.person.kinematics import pose
    from cardbox_tracker.person.model import BodyModel
    from cardbox_tracker.person.model_file import save_body_model
    from cardbox_tracker.person.rep155 import Rep155Joints, joint_names
    from cardbox_tracker.person.skeleton import neck_rotation
    from cardbox_tracker.person.urdf import LinkTransforms, rep155_urdf, urdf_from_body
    from cardbox_tracker.recordings.messages import message_of
    from cardbox_tracker.recordings.outputs import OutputStream, joint_values
    from cardbox_tracker.recordings.result_reader import read_results
    from cardbox_tracker.recordings.result_table import result_table
    from cardbox_tracker.tracking.estimate import Estimate
    from cardbox_tracker.tracking.head import FACE_M, FACE_POINTS, HeadTracker

    body, camera = BodyModel.of(distance_m=2.0), Camera(640, 480, 600.0, 600.0, 319.5, 239.5)
    posed = pose(body, np.zeros(12))
    face_m = posed.head + FACE_M @ neck_rotation(np.radians([20.0, -5.0, 12.0])).T
    px = camera.project(camera.reference_to_optical(face_m))
    points = {name: (*xy, 1.0) for name, xy in zip(FACE_POINTS, px.tolist(), strict=True)}
    frame: Any = SimpleNamespace(points=ImagePoints.of(points), interval_s=0.1)
    keypoints_m = camera.reference_to_optical(posed.keypoints_m)
    estimate = Estimate("tracking", np.zeros(12), np.full(12, 0.01), keypoints_m, 100, 0.9)
    estimate = HeadTracker(body, camera).see(frame, estimate)

    def new(_: str, **fields: Any) -> Any:
        return SimpleNamespace(**fields)

    tracker: Any = SimpleNamespace(body=body, camera=camera)
    topics = dict(OutputStream().values(0, estimate, tracker))
    found: dict[str, Any] = {}
    for topic in ("joint_states", "joint_states_stddev"):
        message = message_of(new, None, topics[topic])
        found[topic] = dict(zip(message.name, message.position.tolist(), strict=True))["neck_roll"]
    with result_table(folder / "a.csv", has_points=True) as add:
        add(SimpleNamespace(stamp_ns=0, time_s=0.0), estimate)  # type: ignore[arg-type]
    save_body_model(body, folder / "a.body.yaml")
    results = read_results(folder / "a.csv")
    found["table"] = float(results.of(["neck_roll"])[0, 0])
    found["table_stddev"] = float(results.deviations_of(["neck_roll"])[0, 0])
    export(results, folder / "a.bvh", FORMATS["bvh"])
    joints = joint_values(estimate)
    assert joints is not None
    heads = LinkTransforms(urdf_from_body(body)).at(joints.by_name)
    found["urdf"] = {one.parent: one.child for one in heads}
    values = Rep155Joints()(estimate.joints[0, : len(joint_names("a"))])
    robot = LinkTransforms(rep155_urdf(body, "a", "eye"))
    assert set(robot.joint_names) == set(joint_names("a"))
    found["rep155"] = dict(zip(joint_names("a"), values.tolist(), strict=True))["r_head_a"]
    return found


if __name__ == "__main__":
    add_row()
    print(json.dumps(found_in(Path(sys.argv[1]))))
