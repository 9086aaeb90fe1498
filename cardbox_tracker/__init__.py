"""Upper-body posture of one person from silhouettes of one or more fixed cameras.

The folders follow the data: :mod:`.person` has the body model, :mod:`.camera` and
:mod:`.segmentation` images and silhouettes, :mod:`.terms` and :mod:`.search` the search of the
posture, :mod:`.tracking` the tracker, :mod:`.ros` the nodes.

The names in ``__all__`` are the Python interface (``docs/python.md``). Each is imported at its
first use, so that ``import cardbox_tracker`` is fast.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cardbox_tracker.applications.exporting.formats import Result, read_result
    from cardbox_tracker.camera.calibration_file import load_calibration
    from cardbox_tracker.camera.camera import Calibration, Camera
    from cardbox_tracker.camera.extrinsics import Extrinsics
    from cardbox_tracker.camera.extrinsics_files import load_extrinsics
    from cardbox_tracker.camera.view import OtherCamera
    from cardbox_tracker.commands.python import track
    from cardbox_tracker.common.errors import (
        BackgroundFileError,
        BagError,
        BodyModelError,
        CameraError,
        CardboxError,
        EncodingError,
        InitializationError,
        NotFiniteError,
        RosMissingError,
    )
    from cardbox_tracker.detectors.image_points import ImagePoints
    from cardbox_tracker.measuring.config import (
        InitializationConfig,
        InitializationResult,
    )
    from cardbox_tracker.measuring.measure import initialize_body
    from cardbox_tracker.person.model import BodyModel, body_from_proportions
    from cardbox_tracker.person.model_file import load_body_model, save_body_model
    from cardbox_tracker.person.skeleton import JOINT_NAMES, KEYPOINT_NAMES
    from cardbox_tracker.search.config import PRESETS, TrackerConfig
    from cardbox_tracker.segmentation.background import SilhouetteExtractor
    from cardbox_tracker.segmentation.background_config import BackgroundConfig
    from cardbox_tracker.segmentation.empty_scene import BackgroundLearner, BackgroundModel
    from cardbox_tracker.terms.depth import Depth
    from cardbox_tracker.tracking.estimate import Estimate
    from cardbox_tracker.tracking.observation import Observation
    from cardbox_tracker.tracking.session import Session
    from cardbox_tracker.tracking.tracker import Tracker

__version__ = "0.1.0"

__all__ = [
    "JOINT_NAMES",
    "KEYPOINT_NAMES",
    "PRESETS",
    "BackgroundConfig",
    "BackgroundFileError",
    "BackgroundLearner",
    "BackgroundModel",
    "BagError",
    "BodyModel",
    "BodyModelError",
    "Calibration",
    "Camera",
    "CameraError",
    "CardboxError",
    "Depth",
    "EncodingError",
    "Estimate",
    "Extrinsics",
    "ImagePoints",
    "InitializationConfig",
    "InitializationError",
    "InitializationResult",
    "NotFiniteError",
    "Observation",
    "OtherCamera",
    "Result",
    "RosMissingError",
    "Session",
    "SilhouetteExtractor",
    "Tracker",
    "TrackerConfig",
    "body_from_proportions",
    "initialize_body",
    "load_body_model",
    "load_calibration",
    "load_extrinsics",
    "read_result",
    "save_body_model",
    "track",
]

_MODULES = {
    "person.model": ("BodyModel",),
    "person.model_file": ("load_body_model", "save_body_model"),
    "person.proportions": ("body_from_proportions",),
    "person.skeleton": ("JOINT_NAMES", "KEYPOINT_NAMES"),
    "common.errors": (
        "BackgroundFileError",
        "BagError",
        "BodyModelError",
        "CameraError",
        "CardboxError",
        "EncodingError",
        "InitializationError",
        "NotFiniteError",
        "RosMissingError",
    ),
    "search.config": ("PRESETS", "TrackerConfig"),
    "detectors.image_points": ("ImagePoints",),
    "terms.depth": ("Depth",),
    "camera.view": ("OtherCamera",),
    "measuring.config": ("InitializationConfig", "InitializationResult"),
    "measuring.measure": ("initialize_body",),
    "tracking.estimate": ("Estimate",),
    "tracking.observation": ("Observation",),
    "tracking.session": ("Session",),
    "tracking.tracker": ("Tracker",),
    "segmentation.background": ("SilhouetteExtractor",),
    "segmentation.background_config": ("BackgroundConfig",),
    "camera.calibration_file": ("load_calibration",),
    "camera.camera": ("Calibration", "Camera"),
    "segmentation.empty_scene": ("BackgroundLearner", "BackgroundModel"),
    "camera.extrinsics": ("Extrinsics",),
    "camera.extrinsics_files": ("load_extrinsics",),
    "applications.exporting.formats": ("Result", "read_result"),
    "commands.python": ("track",),
}
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Import a name of ``__all__`` at its first use (PEP 562)."""
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_MODULE_OF[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the Python interface, including names that are not imported yet."""
    return sorted({*globals(), *__all__})
