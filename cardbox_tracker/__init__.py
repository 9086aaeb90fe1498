"""Upper-body posture of one person from the silhouettes of one fixed camera.

The folders follow the data: :mod:`.body` has the body model, :mod:`.vision` cameras and
silhouettes, :mod:`.estimation` the tracker, :mod:`.ros` the nodes.

The names in ``__all__`` are the Python interface (``docs/python.md``). Each is imported at its
first use, so that ``import cardbox_tracker`` is fast.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cardbox_tracker.body.model import BodyModel
    from cardbox_tracker.body.model_file import load_body_model, save_body_model
    from cardbox_tracker.body.proportions import body_from_proportions
    from cardbox_tracker.body.skeleton import JOINT_NAMES, KEYPOINT_NAMES
    from cardbox_tracker.errors import (
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
    from cardbox_tracker.estimation.config import PRESETS, TrackerConfig
    from cardbox_tracker.estimation.cost.depth import Depth
    from cardbox_tracker.estimation.cost.view import OtherCamera
    from cardbox_tracker.estimation.estimate import Estimate
    from cardbox_tracker.estimation.initialization.config import (
        InitializationConfig,
        InitializationResult,
    )
    from cardbox_tracker.estimation.initialization.measure import initialize_body
    from cardbox_tracker.estimation.observation import Observation
    from cardbox_tracker.estimation.tracker import Tracker
    from cardbox_tracker.vision.background import SilhouetteExtractor
    from cardbox_tracker.vision.background_config import BackgroundConfig
    from cardbox_tracker.vision.calibration_file import load_calibration
    from cardbox_tracker.vision.camera import Calibration, Camera
    from cardbox_tracker.vision.empty_scene import BackgroundLearner, BackgroundModel
    from cardbox_tracker.vision.extrinsics import Extrinsics
    from cardbox_tracker.vision.extrinsics_files import load_extrinsics

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
    "InitializationConfig",
    "InitializationError",
    "InitializationResult",
    "NotFiniteError",
    "Observation",
    "OtherCamera",
    "RosMissingError",
    "SilhouetteExtractor",
    "Tracker",
    "TrackerConfig",
    "body_from_proportions",
    "initialize_body",
    "load_body_model",
    "load_calibration",
    "load_extrinsics",
    "save_body_model",
]

_MODULES = {
    "body.model": ("BodyModel",),
    "body.model_file": ("load_body_model", "save_body_model"),
    "body.proportions": ("body_from_proportions",),
    "body.skeleton": ("JOINT_NAMES", "KEYPOINT_NAMES"),
    "errors": (
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
    "estimation.config": ("PRESETS", "TrackerConfig"),
    "estimation.cost.depth": ("Depth",),
    "estimation.cost.view": ("OtherCamera",),
    "estimation.initialization.config": ("InitializationConfig", "InitializationResult"),
    "estimation.initialization.measure": ("initialize_body",),
    "estimation.estimate": ("Estimate",),
    "estimation.observation": ("Observation",),
    "estimation.tracker": ("Tracker",),
    "vision.background": ("SilhouetteExtractor",),
    "vision.background_config": ("BackgroundConfig",),
    "vision.calibration_file": ("load_calibration",),
    "vision.camera": ("Calibration", "Camera"),
    "vision.empty_scene": ("BackgroundLearner", "BackgroundModel"),
    "vision.extrinsics": ("Extrinsics",),
    "vision.extrinsics_files": ("load_extrinsics",),
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
