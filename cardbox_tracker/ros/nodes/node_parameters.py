"""The parameters of every node; ``config/*.yaml`` and ``docs/parameters.md`` are made from these.

What the core has a setting for takes its default from there. In the tracker, 0 or ``preset`` means
that the chosen preset decides.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, fields, replace
from typing import Any

from cardbox_tracker.body.posture import SIDE_TURNS
from cardbox_tracker.estimation.config import PRESETS, FilterConfig, TrackerConfig
from cardbox_tracker.estimation.filtering.resampling import STRATEGIES
from cardbox_tracker.estimation.initialization.measure import InitializationConfig
from cardbox_tracker.ros.nodes.input_parameters import CameraParameters, PlayBagParameters
from cardbox_tracker.ros.runtime.parameters import NodeParameters, parameter
from cardbox_tracker.vision.background import BackgroundConfig

_BACKGROUND = BackgroundConfig()
_SETTINGS = fields(BackgroundConfig)
_INITIALIZATION = InitializationConfig()
_TRACKER = TrackerConfig()


@dataclass(frozen=True)
class BackgroundParameters(NodeParameters):
    """Cut the person out of the camera's images."""

    image_transport: str = parameter(
        "raw",
        "raw subscribes to image_raw, compressed to image_raw/compressed",
        choices=("raw", "compressed"),
        read_only=True,
    )
    width: int = parameter(
        320, "working resolution, width", unit="px", limits=(32, 4096), read_only=True
    )
    height: int = parameter(
        240, "working resolution, height", unit="px", limits=(32, 4096), read_only=True
    )
    learn_images: int = parameter(
        _BACKGROUND.learn_images, "images of the empty scene to learn from", limits=(2, 10000)
    )
    threshold: float = parameter(
        _BACKGROUND.threshold,
        "foreground from this many standard deviations on, equation (1)",
        limits=(0.1, 50.0),
    )
    min_stddev: float = parameter(
        _BACKGROUND.min_stddev,
        "floor of a pixel's standard deviation",
        unit="grey levels",
        limits=(0.0, 100.0),
    )
    clean_up: bool = parameter(
        _BACKGROUND.clean_up,
        "false leaves the plain rule of equation (1), without all that follows",
    )
    smoothing_px: float = parameter(
        _BACKGROUND.smoothing_px,
        "standard deviation of the Gaussian that averages the difference before the threshold",
        unit="px",
        limits=(0.0, 20.0),
    )
    min_contrast: float = parameter(
        _BACKGROUND.min_contrast,
        "a smoothed difference below this is never foreground",
        unit="grey levels",
        limits=(0.0, 255.0),
    )
    shadow: float = parameter(
        _BACKGROUND.shadow,
        "a place darker by less than this fraction is a shadow, not the person; 0 is off",
        limits=(0.0, 1.0),
    )
    edge: float = parameter(
        _BACKGROUND.edge,
        "beside a stronger difference, a pixel is foreground from this fraction of it on; 0 is off",
        limits=(0.0, 1.0),
    )
    flicker: float = parameter(
        _BACKGROUND.flicker,
        "follow brightness changes of the whole scene by this fraction at most; 0 is off",
        limits=(0.0, 1.0),
    )
    min_area: float = parameter(
        _BACKGROUND.min_area,
        "specks smaller than this fraction of the image are dropped",
        limits=(0.0, 1.0),
    )
    max_hole: float = parameter(
        _BACKGROUND.max_hole,
        "holes smaller than this fraction of the image are filled",
        limits=(0.0, 1.0),
    )

    def config(self) -> BackgroundConfig:
        """Return the settings of the core."""
        return BackgroundConfig(**{entry.name: getattr(self, entry.name) for entry in _SETTINGS})


@dataclass(frozen=True)
class InitializerParameters(NodeParameters):
    """Measure the person from three reference postures."""

    person_distance_m: float = parameter(
        _INITIALIZATION.distance_m,
        "level distance from the camera to the person; a silhouette gives sizes only up to scale",
        unit="m",
        limits=(0.3, 20.0),
    )
    camera_pitch_deg: float = parameter(
        math.degrees(_INITIALIZATION.camera_pitch_rad),
        "how far the camera looks down; travels to the tracker in the body model",
        unit="deg",
        limits=(-80.0, 80.0),
    )
    side_turn: str = parameter(
        _INITIALIZATION.side_turn,
        "which way the person turns for the side reference, as they see it",
        choices=SIDE_TURNS,
    )
    hypotheses: int = parameter(
        _INITIALIZATION.hypotheses, "hypotheses M of the estimation", limits=(10, 100000)
    )
    max_rounds: int = parameter(
        _INITIALIZATION.max_rounds, "rounds of the estimation at most", limits=(1, 10000)
    )
    seed: int = parameter(_INITIALIZATION.seed, "seed of the random draws", limits=(0, 2**31 - 1))
    capture_frames: int = parameter(
        5,
        "silhouettes a capture combines, each pixel by majority; more is calmer but the person "
        "must stand still for longer",
        limits=(1, 30),
    )
    count_down_s: int = parameter(
        5, "time the guidance gives the person for each posture", unit="s", limits=(1, 60)
    )
    attempts: int = parameter(
        3, "times the guidance tries each posture before it gives up", limits=(1, 20)
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
    )

    def config(self) -> InitializationConfig:
        """Return the settings of the core."""
        return replace(
            _INITIALIZATION,
            distance_m=self.person_distance_m,
            camera_pitch_rad=math.radians(self.camera_pitch_deg),
            side_turn=self.side_turn,
            hypotheses=self.hypotheses,
            max_rounds=self.max_rounds,
            seed=self.seed,
        )


@dataclass(frozen=True)
class TrackerParameters(NodeParameters):
    """Follow the person's posture; 0 or ``preset`` leaves a setting to the preset."""

    preset: str = parameter(
        "default", "paper: its Table I; default: what tracks best", choices=tuple(PRESETS)
    )
    strategy: str = parameter(
        "preset", "resampling strategy of the filters", choices=("preset", *STRATEGIES)
    )
    particles: int = parameter(
        0, "particles of each of the three filters; 0: preset", limits=(0, 1000000)
    )
    cycles: int = parameter(0, "estimation cycles an image; 0: preset", limits=(0, 100))
    average: int = parameter(
        0, "best particles whose weighted mean is the result; 0: preset", limits=(0, 1000000)
    )
    torso_survival_rate: float = parameter(
        0.0, "fraction of torso particles that survive a cycle; 0: preset", limits=(0.0, 1.0)
    )
    arm_survival_rate: float = parameter(
        0.0, "fraction of an arm's particles that survive a cycle; 0: preset", limits=(0.0, 1.0)
    )
    torso_rotation_noise_rad: float = parameter(
        0.0, "noise of the torso's angles; 0: preset", unit="rad", limits=(0.0, 3.2)
    )
    torso_translation_noise_m: float = parameter(
        0.0, "noise of the torso's place; 0: preset", unit="m", limits=(0.0, 1.0)
    )
    arm_rotation_noise_rad: float = parameter(
        0.0, "noise of an arm's angles; 0: preset", unit="rad", limits=(0.0, 3.2)
    )
    recover: str = parameter(
        "preset",
        "search anew when the person was lost or came back",
        choices=("preset", "always", "never"),
    )
    lost_iou: float = parameter(
        _TRACKER.lost_iou, "an overlap (IoU) below this counts as lost", limits=(0.0, 1.0)
    )
    lost_frames: int = parameter(
        _TRACKER.lost_frames, "so many lost images in a row are a loss", limits=(1, 1000000)
    )
    seed: int = parameter(0, "seed of the random draws", limits=(0, 2**31 - 1))
    model_file: str = parameter(
        "",
        "body model to start with; one that arrives on body_model replaces it; empty: none",
        read_only=True,
    )
    rep155_id: str = parameter(
        "",
        "also publish /humans/bodies/ID/joint_states and .../robot_description after REP-155, for "
        "this ID of letters, digits and underscores; empty: do not",
        read_only=True,
    )

    def config(self) -> TrackerConfig:
        """Return the settings of the core; raises ValueError where they do not go together."""
        base = PRESETS[self.preset]()
        if self.particles:
            base = base.with_particles(self.particles)
        return replace(
            base,
            torso=self._filter(base.torso, "torso"),
            arm=self._filter(base.arm, "arm"),
            strategy=base.strategy if self.strategy == "preset" else self.strategy,
            cycles=self.cycles or base.cycles,
            average=self.average or base.average,
            relocalize=base.relocalize if self.recover == "preset" else self.recover == "always",
            lost_iou=self.lost_iou,
            lost_frames=self.lost_frames,
        )

    def _filter(self, base: FilterConfig, part: str) -> FilterConfig:
        given = {
            entry.name: getattr(self, f"{part}_{entry.name}", 0) for entry in fields(FilterConfig)
        }
        chosen: dict[str, Any] = {name: value for name, value in given.items() if value}
        return replace(base, **chosen)

    def check(self) -> None:
        """Raise ValueError where values do not go together."""
        self.config()
        if self.rep155_id and not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", self.rep155_id):
            raise ValueError(
                f"rep155_id is '{self.rep155_id}'; expected a letter, then letters, digits and "
                "underscores, as topics need"
            )


NODES: dict[str, type[NodeParameters]] = {
    "background": BackgroundParameters,
    "initializer": InitializerParameters,
    "tracker": TrackerParameters,
    "camera": CameraParameters,
    "play_bag": PlayBagParameters,
}
"""Node name to its parameters."""
