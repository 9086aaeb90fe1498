"""The parameters of every node, the source of ``config/*.yaml`` and ``docs/parameters.md``."""

from __future__ import annotations

from cardbox_tracker.ros.nodes.background_node import BackgroundParameters
from cardbox_tracker.ros.nodes.camera_node import CameraParameters
from cardbox_tracker.ros.nodes.initializer_parameters import InitializerParameters
from cardbox_tracker.ros.nodes.play_bag_node import PlayBagParameters
from cardbox_tracker.ros.nodes.retarget_node import RetargetParameters
from cardbox_tracker.ros.nodes.rula_node import RulaParameters
from cardbox_tracker.ros.nodes.stereo_depth_node import StereoDepthParameters
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.ros.runtime.parameter_fields import NodeParameters

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
"""Parameter class of each node, by name."""
