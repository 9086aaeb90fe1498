"""The parameters of the tracker."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from cardbox_tracker.camera.pairing import camera_names
from cardbox_tracker.common.settings import NoEffectError, nested
from cardbox_tracker.measuring.people_camera import PITCH_PRIOR, USUAL_PITCH
from cardbox_tracker.measuring.scene_camera import GIVEN_STDDEV
from cardbox_tracker.person.model import BodyModel, body_from_proportions
from cardbox_tracker.person.proportions import STATURE_LIMITS_M, USUAL_STATURE_M, USUAL_STDDEV_M
from cardbox_tracker.ros.nodes.shared_parameters import (
    camera_roll_parameter,
    cameras_parameter,
    depth_parameter,
    extrinsics_parameter,
)
from cardbox_tracker.ros.runtime.parameter_fields import (
    RESTARTS,
    NodeParameters,
    at_start,
    parameter,
    shared,
)
from cardbox_tracker.search.config import PRESETS, TrackerConfig, read_settings
from cardbox_tracker.search.whole_body_config import WholeBodyConfig
from cardbox_tracker.tracking.session import MOST_PEOPLE

_NEXT_START = "next start of tracking"
NOT_GIVEN_DEG = 90.0
"""Pitch of a camera that is not given, deg."""

_CHANGEABLE = {"effort": "whole_body.effort", "lost_iou": "lost_iou", "lost_frames": "lost_frames"}

MOST_MOVES = 20_000
"""Largest product of particles and cycles in a settings file. During an image the node handles no
other image, service or signal, so an image must not take much longer than 0.2 s."""


@dataclass(frozen=True)
class TrackerParameters(NodeParameters):
    """Follow the measured person: silhouettes in, joint states out."""

    preset: str = parameter(
        "default",
        "paper: the settings of its Table I; default: the most accurate tracking",
        choices=tuple(PRESETS),
        effect=RESTARTS,
    )
    effort: float = shared(WholeBodyConfig, "effort")
    settings_file: str = at_start(
        "",
        "YAML file with further settings, by the names at the end of docs/parameters.md; "
        "parameters that differ from their default take precedence; empty: none",
    )
    lost_iou: float = shared(TrackerConfig, "lost_iou")
    lost_frames: int = shared(TrackerConfig, "lost_frames")
    seed: int = parameter(0, "seed of the random draws", limits=(0, 2**31 - 1), effect=_NEXT_START)
    model_file: str = at_start(
        "", "body model to start with; one that arrives on body_model replaces it; empty: none"
    )
    stature: float = at_start(
        0.0,
        "height of a person who is not measured; without a measured body, the person in the image "
        "is tracked with it, and distance and breadths are found; 0: a measured body is waited "
        "for, or with keypoints the mean of people is taken",
        unit="m",
        limits=(0.0, STATURE_LIMITS_M[1]),
    )
    statures: list[float] = at_start(
        [],
        "heights of several people who are not measured, instead of stature: from left to right if "
        "they come together, else as they come; the last one is also that of further people",
        unit="m",
    )
    person_distance_m: float = at_start(
        0.0,
        "with people who are not measured: level distance from the camera at first; 0: it is found",
        unit="m",
        limits=(0.0, 20.0),
    )
    camera_pitch_deg: float = at_start(
        NOT_GIVEN_DEG,
        "with people who are not measured: pitch of the (first) camera, positive downwards; 90: "
        "with keypoints it is found, without them the camera is taken as level, and leans are "
        "uncertain",
        unit="deg",
        limits=(-80.0, NOT_GIVEN_DEG),
    )
    torso_place: bool = at_start(
        True,
        "joint_states also has the joints of place, neck and clavicles; "
        "must be the same as the initializer's torso_place_in_urdf",
    )
    use_image: bool = at_start(
        True,
        "also use silhouette/image to find hands and forearms in front of the torso by the colours "
        "in the body model",
    )
    optical_frame_in_tf: bool = at_start(
        True,
        "robot_description of people who are not measured has the camera's optical frame; false "
        "if another node publishes it",
    )
    rep155_id: str = at_start(
        "",
        "also publish /humans/bodies/ID/joint_states and .../robot_description after REP-155, for "
        "this ID of letters, digits and underscores; empty: do not",
    )

    hands: bool = at_start(
        False,
        "also look at hands in silhouette/image, with the detector's network and the points on "
        "keypoints: the topic hands tells open from closed ones, and joint_states has their "
        "joints; must be the same as the initializer's hands",
    )
    people: int = at_start(
        0,
        "number of people to track, each with topics below person_1, person_2 ...; "
        "body_model is the body of each; 0: one person without a number",
        limits=(0, MOST_PEOPLE),
    )
    cameras: list[str] = cameras_parameter()
    extrinsics_file: str = extrinsics_parameter()
    depth: str = depth_parameter()
    keypoints: str = at_start(
        "",
        "2D points of the person's joints: a topic, below each camera's namespace if there are "
        "several, such as detector/keypoints, or a table FILE.csv (docs/detectors.md); empty: none",
    )
    camera_roll_deg: float = camera_roll_parameter()
    lag: float = at_start(
        0.0,
        "results are published so much later, each smoothed with the images that came until then, "
        "which takes out the shaking; 0: at once",
        unit="s",
        limits=(0.0, 1.0),
    )

    @property
    def has_point_table(self) -> bool:
        """Whether ``keypoints`` is a table; no name of a topic has a dot."""
        return self.keypoints.endswith(".csv")

    @property
    def guesses(self) -> tuple[BodyModel, ...]:
        """Bodies of people who are not measured; empty if a measured one is waited for."""
        given = self.statures or [self.stature] * (self.stature > 0.0)
        if not (given or self.keypoints) or self.model_file:
            return ()
        place, pitch = self.person_distance_m or None, self.pitch
        bodies = [body_from_proportions(one, place) for one in given or [USUAL_STATURE_M]]
        changes = {} if given else {"stature_stddev": USUAL_STDDEV_M / USUAL_STATURE_M}
        if pitch is None:
            # Only points show the pitch; without them, a level camera is assumed.
            usual = USUAL_PITCH, PITCH_PRIOR
            pitch = usual if self.keypoints else (0.0, math.hypot(*usual))
        changes["camera_pitch_rad"], changes["pitch_stddev_rad"] = pitch
        return tuple(body.with_values(**changes) for body in bodies)

    @property
    def pitch(self) -> tuple[float, float] | None:
        """Mean and standard deviation of the pitch that is given, rad; None for none."""
        if self.camera_pitch_deg == NOT_GIVEN_DEG:
            return None
        return math.radians(self.camera_pitch_deg), GIVEN_STDDEV

    def config(self) -> TrackerConfig:
        """Return the settings of the core."""
        base = PRESETS[self.preset]()
        if self.depth:
            base = base.with_depth()
        if self.settings_file:
            base = read_settings(self.settings_file, base)
        given = {
            path: getattr(self, name)
            for name, path in _CHANGEABLE.items()
            if getattr(self, name) != getattr(type(self), name)
        }
        try:
            return base.changed(nested(given))
        except NoEffectError as error:
            raise ValueError(
                f"effort has no effect {error.where}: set it back to {type(self).effort:g}, or "
                f"give {error.instead} in a settings_file"
            ) from None

    def check(self) -> None:
        """Raise ValueError or CardboxError if values contradict each other."""
        config = self.config()
        if (len(self.cameras) > 1 or self.depth) and not config.has_several_views:
            raise ValueError(
                f"the preset {self.preset} uses the silhouette of one camera; set preset to "
                "default with several cameras or depth"
            )
        if self.people and (self.depth or self.preset != "default"):
            raise ValueError(
                f"people is {self.people}; several people are tracked without depth, and with the "
                "preset default"
            )
        if self.lag and self.preset == "paper":
            raise ValueError(
                f"lag is {self.lag:g}; results are smoothed with the preset default, not with paper"
            )
        if self.hands and not (self.keypoints and self.use_image):
            raise ValueError(
                "hands needs images, and wrists and knuckles: leave use_image on, and give "
                "keypoints, such as detector/keypoints"
            )
        camera_names(self.cameras)
        if self.statures and (self.stature or len(self.statures) > self.people):
            raise ValueError(
                f"statures has {len(self.statures)} heights; expected them instead of stature, and "
                f"people as their number or more, which is {self.people}"
            )
        is_placed = bool(self.person_distance_m) or self.camera_pitch_deg != NOT_GIVEN_DEG
        if is_placed and not self.guesses:
            raise ValueError(
                "person_distance_m and camera_pitch_deg are of people who are not measured: give "
                "stature, statures or keypoints, too, or leave them out, because a body model has "
                "its own"
            )
        lowest_m, highest_m = STATURE_LIMITS_M
        given = self.stature or lowest_m, *self.statures
        wrong = [one for one in given if not lowest_m <= one <= highest_m]
        if wrong:
            raise ValueError(
                f"stature is {wrong[0]:g} m; expected {lowest_m:g} to "
                f"{highest_m:g} m, or 0 if it is not known"
            )
        if len(self.cameras) > 1 and self.keypoints.startswith("/") and not self.has_point_table:
            raise ValueError(
                f"keypoints is '{self.keypoints}', one topic for {len(self.cameras)} cameras; "
                "expected a name below each camera's namespace, such as detector/keypoints"
            )
        most = max(config.torso.particles, config.arm.particles)
        if most * config.cycles > MOST_MOVES:
            raise ValueError(
                f"{most} particles x {config.cycles} cycles are {most * config.cycles}; expected "
                f"{MOST_MOVES} at most, because the node handles nothing else during an image; "
                "for more, track a recording with 'cardbox track'"
            )
        if self.rep155_id and not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", self.rep155_id):
            raise ValueError(
                f"rep155_id is '{self.rep155_id}'; expected a letter, then letters, digits and "
                "underscores, as topics need"
            )
