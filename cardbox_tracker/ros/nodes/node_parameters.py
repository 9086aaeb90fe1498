"""The parameters of every node; ``config/*.yaml`` and ``docs/parameters.md`` are made from these.

What the core has a setting for takes default, range and text from there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from cardbox_tracker.estimation.initialization.config import (
    MAX_PITCH_RAD,
    InitializationConfig,
)
from cardbox_tracker.ros.nodes.input_parameters import (
    CameraParameters,
    PlayBagParameters,
    StereoDepthParameters,
)
from cardbox_tracker.ros.nodes.shared_parameters import (
    cameras_parameter,
    extrinsics_parameter,
    image_transport_parameter,
    max_megapixels_parameter,
)
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.ros.nodes.use_parameters import RetargetParameters, RulaParameters
from cardbox_tracker.ros.runtime.parameter_fields import NodeParameters, parameter, shared
from cardbox_tracker.settings import settings_of
from cardbox_tracker.vision.background import BackgroundConfig
from cardbox_tracker.vision.depth_silhouette import WITHIN_LIMITS_M
from cardbox_tracker.vision.learning import WAYS
from cardbox_tracker.vision.pairing import camera_names

_MAX_PITCH_DEG = round(math.degrees(MAX_PITCH_RAD), 6)
_NEXT_LEARNING = "next learning"
_NEXT_GUIDANCE, _NEXT_CAPTURE = "next guidance", "next capture"
_NEXT_MEASUREMENT = "next measurement"


@dataclass(frozen=True)
class BackgroundParameters(NodeParameters):
    """Cut the person out of the camera's images."""

    image_transport: str = image_transport_parameter()
    width: int = parameter(
        320, "working resolution, width", unit="px", limits=(32, 4096), read_only=True
    )
    height: int = parameter(
        240, "working resolution, height", unit="px", limits=(32, 4096), read_only=True
    )
    background_file: str = parameter(
        "",
        "file to keep the learned background in; if it exists at the start and fits the camera and "
        "what it shows, nothing has to be learned, although somebody stands there; empty: none",
        read_only=True,
    )
    within_m: float = parameter(
        0.0,
        "with depth images: whoever is nearer than this is the person, and nothing has to be "
        "learned; choose it between them and the wall; 0: learn the empty scene",
        unit="m",
        limits=(0.0, WITHIN_LIMITS_M[1]),
    )
    depth: str = parameter(
        "",
        "topic of these depth images (16UC1, 32FC1 or compressedDepth) from where the camera is, "
        "of its view or with a CameraInfo on TOPIC/camera_info; empty: none",
        read_only=True,
    )
    learning: str = parameter(
        next(iter(WAYS)),
        "still: learn the empty scene once nothing moves in it; person_in_view: learn around a "
        "person, and the rest when they step aside; always: learn from the first images, whatever "
        "moves",
        choices=tuple(WAYS),
        effect=_NEXT_LEARNING,
    )
    max_megapixels: float = max_megapixels_parameter()
    learn_images: int = shared(BackgroundConfig, "learn_images", effect=_NEXT_LEARNING)
    threshold: float = shared(BackgroundConfig, "threshold")
    min_stddev: float = shared(BackgroundConfig, "min_stddev")
    clean_up: bool = shared(BackgroundConfig, "clean_up")
    smoothing_px: float = shared(BackgroundConfig, "smoothing_px")
    min_contrast: float = shared(BackgroundConfig, "min_contrast")
    shadow: float = shared(BackgroundConfig, "shadow")
    soft_shadow: float = shared(BackgroundConfig, "soft_shadow")
    darkest_shadow: float = shared(BackgroundConfig, "darkest_shadow")
    color: bool = shared(BackgroundConfig, "color")
    min_color_contrast: float = shared(BackgroundConfig, "min_color_contrast")
    color_edge: float = shared(BackgroundConfig, "color_edge")
    edge: float = shared(BackgroundConfig, "edge")
    flicker: float = shared(BackgroundConfig, "flicker")
    follow: bool = shared(BackgroundConfig, "follow")
    min_area: float = shared(BackgroundConfig, "min_area")
    max_hole: float = shared(BackgroundConfig, "max_hole")
    absorb_after: int = shared(BackgroundConfig, "absorb_after")

    def check(self) -> None:
        """Raise ValueError where values do not go together."""
        if self.within_m > 0.0 and not self.depth:
            raise ValueError(
                f"within_m is {self.within_m:g} but no depth is given; set 'depth' to a topic of "
                "depth images, or within_m to 0"
            )

    def config(self) -> BackgroundConfig:
        """Return the settings of the core."""
        names = settings_of(BackgroundConfig)
        return BackgroundConfig(**{name: getattr(self, name) for name in names})


@dataclass(frozen=True)
class InitializerParameters(NodeParameters):
    """Measure the person from three reference postures."""

    person_distance_m: float = shared(InitializationConfig, "distance_m", effect=_NEXT_MEASUREMENT)
    camera_pitch_deg: float = shared(
        InitializationConfig,
        "camera_pitch_rad",
        default=math.degrees(InitializationConfig.camera_pitch_rad),
        unit="deg",
        limits=(-_MAX_PITCH_DEG, _MAX_PITCH_DEG),
        effect=_NEXT_MEASUREMENT,
    )
    side_turn: str = shared(InitializationConfig, "side_turn", effect=_NEXT_GUIDANCE)
    hypotheses: int = shared(InitializationConfig, "hypotheses", effect=_NEXT_MEASUREMENT)
    max_rounds: int = shared(InitializationConfig, "max_rounds", effect=_NEXT_MEASUREMENT)
    seed: int = shared(InitializationConfig, "seed", effect=_NEXT_MEASUREMENT)
    check_postures: bool = shared(InitializationConfig, "check_postures", effect=_NEXT_MEASUREMENT)
    least_iou: float = shared(InitializationConfig, "least_iou", effect=_NEXT_MEASUREMENT)
    capture_frames: int = parameter(
        5,
        "silhouettes a capture combines, each pixel by majority; more of them remove more noise, "
        "but the person must stand still for longer",
        limits=(1, 30),
        effect=_NEXT_CAPTURE,
    )
    count_down_s: int = parameter(
        5,
        "time the guidance gives the person for each posture",
        unit="s",
        limits=(1, 60),
        effect=_NEXT_GUIDANCE,
    )
    attempts: int = parameter(
        3,
        "times the guidance tries each posture before it gives up",
        limits=(1, 20),
        effect=_NEXT_GUIDANCE,
    )
    mirror: bool = parameter(
        True,
        "the guidance shows the person as in a mirror; false: as the camera does",
    )
    bell: bool = parameter(
        False,
        "ring the terminal's bell when the guidance has captured a posture, or could not",
    )
    model_file: str = parameter(
        "",
        "file to save the body model to; if it exists at the start, it is published; empty: none",
        read_only=True,
    )
    optical_frame_in_urdf: bool = parameter(
        True,
        "also put the camera's optical frame into robot_description; false if another node "
        "already publishes where it is",
        effect=_NEXT_MEASUREMENT,
    )
    torso_place_in_urdf: bool = parameter(
        True,
        "robot_description has the joints torso_x and torso_z; must be the same as the tracker's "
        "torso_place",
        effect=_NEXT_MEASUREMENT,
    )

    cameras: list[str] = cameras_parameter()
    extrinsics_file: str = extrinsics_parameter()
    depth: str = parameter(
        "",
        "topic of depth images (16UC1, 32FC1 or compressedDepth) from where the (first) camera is, "
        "of its view or with a CameraInfo on TOPIC/camera_info, which measure how far away the "
        "person is; empty: none",
        read_only=True,
    )
    measure_distance: bool = parameter(
        True,
        "depth images, or with two cameras or more the second one, measure how far away the person "
        "is; false: person_distance_m is that",
        effect=_NEXT_MEASUREMENT,
    )

    def check(self) -> None:
        """Raise ValueError where values do not go together."""
        camera_names(self.cameras)

    def config(self) -> InitializationConfig:
        """Return the settings of the core."""
        return InitializationConfig(
            distance_m=self.person_distance_m,
            camera_pitch_rad=math.radians(self.camera_pitch_deg),
            side_turn=self.side_turn,
            hypotheses=self.hypotheses,
            max_rounds=self.max_rounds,
            seed=self.seed,
            check_postures=self.check_postures,
            least_iou=self.least_iou,
        )


NODES: dict[str, type[NodeParameters]] = {
    "background": BackgroundParameters,
    "initializer": InitializerParameters,
    "tracker": TrackerParameters,
    "camera": CameraParameters,
    "play_bag": PlayBagParameters,
    "stereo_depth": StereoDepthParameters,
    "rula": RulaParameters,
    "retarget": RetargetParameters,
}
"""Node name to its parameters."""
