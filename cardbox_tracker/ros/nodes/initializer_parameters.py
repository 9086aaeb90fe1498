"""The parameters of the node ``initializer`` and of its sources of the distance."""

from __future__ import annotations

import math
from dataclasses import dataclass

from cardbox_tracker.camera.pairing import camera_names
from cardbox_tracker.measuring.config import MAX_PITCH_RAD, InitializationConfig
from cardbox_tracker.ros.nodes.shared_parameters import (
    camera_roll_parameter,
    cameras_parameter,
    depth_parameter,
    extrinsics_parameter,
)
from cardbox_tracker.ros.runtime.parameter_fields import NodeParameters, at_start, parameter, shared

_MAX_PITCH_DEG = round(math.degrees(MAX_PITCH_RAD), 6)
_NEXT_GUIDANCE, _NEXT_MEASUREMENT = "next guidance", "next measurement"


@dataclass(frozen=True)
class InitializerParameters(NodeParameters):
    """Measure a person from the silhouettes of three reference postures."""

    person_distance_m: float = shared(InitializationConfig, "distance_m", effect=_NEXT_MEASUREMENT)
    camera_pitch_deg: float = shared(
        InitializationConfig,
        "camera_pitch_rad",
        default=math.degrees(InitializationConfig.camera_pitch_rad),
        unit="deg",
        limits=(-_MAX_PITCH_DEG, _MAX_PITCH_DEG),
        effect=_NEXT_MEASUREMENT,
    )
    camera_roll_deg: float = camera_roll_parameter()
    side_turn: str = shared(InitializationConfig, "side_turn", effect=_NEXT_GUIDANCE)
    seed: int = shared(InitializationConfig, "seed", effect=_NEXT_MEASUREMENT)
    check_postures: bool = shared(InitializationConfig, "check_postures", effect=_NEXT_MEASUREMENT)
    least_iou: float = shared(InitializationConfig, "least_iou", effect=_NEXT_MEASUREMENT)
    count_down_s: int = parameter(
        5,
        "time the guidance gives the person for each posture",
        unit="s",
        limits=(1, 60),
        effect=_NEXT_GUIDANCE,
    )
    attempts: int = parameter(
        3, "number of tries of the guidance for each posture", limits=(1, 20), effect=_NEXT_GUIDANCE
    )
    mirror: bool = parameter(
        True, "the guidance shows the person as in a mirror; false: as in the image"
    )
    model_file: str = at_start(
        "",
        "file to save the body model to; if it exists at the start, it is published; empty: none",
    )
    optical_frame_in_urdf: bool = parameter(
        True,
        "also put the camera's optical frame into robot_description; false if another node "
        "publishes that frame",
        effect=_NEXT_MEASUREMENT,
    )
    torso_place_in_urdf: bool = parameter(
        True,
        "robot_description has the joints of place, neck and clavicles, too; must be the "
        "same as the tracker's torso_place",
        effect=_NEXT_MEASUREMENT,
    )
    hands: bool = parameter(
        False,
        "robot_description has the joints of hands, too; must be the same as the tracker's hands",
        effect=_NEXT_MEASUREMENT,
    )

    cameras: list[str] = cameras_parameter()
    extrinsics_file: str = extrinsics_parameter()
    depth: str = depth_parameter()
    measure_distance: bool = parameter(
        True,
        "measure the person's distance with depth images, or with the second of several cameras; "
        "false: use person_distance_m",
        effect=_NEXT_MEASUREMENT,
    )

    def check(self) -> None:
        """Raise ValueError if values contradict each other."""
        camera_names(self.cameras)

    def config(self) -> InitializationConfig:
        """Return the settings of the core."""
        return InitializationConfig(
            distance_m=self.person_distance_m,
            camera_pitch_rad=math.radians(self.camera_pitch_deg),
            side_turn=self.side_turn,
            seed=self.seed,
            check_postures=self.check_postures,
            least_iou=self.least_iou,
        )
