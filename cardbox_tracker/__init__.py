"""Upper-body posture of one person from silhouettes of one or more fixed cameras.

The folders follow the data: :mod:`.person` has the body model, :mod:`.camera` and
:mod:`.segmentation` images and silhouettes, :mod:`.terms` and :mod:`.search` the search of the
posture, :mod:`.tracking` the tracker, :mod:`.ros` the nodes.

The names in ``__all__`` are the Python interface (``docs/python.md``). Each is imported at its
first use, so that ``import cardbox_tracker`` is fast.
"""

from __future__ import annotations

import ast as _ast
import os as _os
import re as _re
import sys as _sys
from importlib import import_module
from pathlib import Path as _Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cardbox_tracker.applications.exporting.formats import Result as Result
    from cardbox_tracker.applications.exporting.formats import read_result as read_result
    from cardbox_tracker.camera.calibration_file import load_calibration as load_calibration
    from cardbox_tracker.camera.camera import Calibration as Calibration
    from cardbox_tracker.camera.camera import Camera as Camera
    from cardbox_tracker.camera.extrinsics import Extrinsics as Extrinsics
    from cardbox_tracker.camera.extrinsics_files import load_extrinsics as load_extrinsics
    from cardbox_tracker.camera.view import OtherCamera as OtherCamera
    from cardbox_tracker.commands.request import Request as Request
    from cardbox_tracker.commands.track import track as track
    from cardbox_tracker.common.errors import BackgroundFileError as BackgroundFileError
    from cardbox_tracker.common.errors import BagError as BagError
    from cardbox_tracker.common.errors import BodyModelError as BodyModelError
    from cardbox_tracker.common.errors import CameraError as CameraError
    from cardbox_tracker.common.errors import CardboxError as CardboxError
    from cardbox_tracker.common.errors import EncodingError as EncodingError
    from cardbox_tracker.common.errors import InitializationError as InitializationError
    from cardbox_tracker.common.errors import NotFiniteError as NotFiniteError
    from cardbox_tracker.common.errors import RosMissingError as RosMissingError
    from cardbox_tracker.detectors.detector import Detector as Detector
    from cardbox_tracker.detectors.image_points import ImagePoints as ImagePoints
    from cardbox_tracker.measuring.config import InitializationConfig as InitializationConfig
    from cardbox_tracker.measuring.config import InitializationResult as InitializationResult
    from cardbox_tracker.measuring.measure import initialize_body as initialize_body
    from cardbox_tracker.measuring.scene_watch import SceneWatch as SceneWatch
    from cardbox_tracker.person.model import BodyModel as BodyModel
    from cardbox_tracker.person.model import body_from_proportions as body_from_proportions
    from cardbox_tracker.person.model_file import load_body_model as load_body_model
    from cardbox_tracker.person.model_file import save_body_model as save_body_model
    from cardbox_tracker.person.skeleton import JOINT_NAMES as JOINT_NAMES
    from cardbox_tracker.person.skeleton import KEYPOINT_NAMES as KEYPOINT_NAMES
    from cardbox_tracker.search.config import PRESETS as PRESETS
    from cardbox_tracker.search.config import TrackerConfig as TrackerConfig
    from cardbox_tracker.segmentation.background import SilhouetteExtractor as SilhouetteExtractor
    from cardbox_tracker.segmentation.background_config import BackgroundConfig as BackgroundConfig
    from cardbox_tracker.segmentation.empty_scene import BackgroundLearner as BackgroundLearner
    from cardbox_tracker.segmentation.empty_scene import BackgroundModel as BackgroundModel
    from cardbox_tracker.terms.depth import Depth as Depth
    from cardbox_tracker.tracking.estimate import Estimate as Estimate
    from cardbox_tracker.tracking.observation import Observation as Observation
    from cardbox_tracker.tracking.session import Session as Session
    from cardbox_tracker.tracking.tracker import Tracker as Tracker

__version__ = "0.1.0"

# The names that type checkers see above, with their modules.
_MODULE_OF: dict[str, str] = {
    alias.name: str(node.module)
    for node in _ast.walk(_ast.parse(_Path(__file__).read_text(encoding="utf-8")))
    if isinstance(node, _ast.ImportFrom) and str(node.module).startswith("cardbox_tracker.")
    for alias in node.names
}
__all__ = sorted(_MODULE_OF)

# Python cannot run the kernels, and numba cannot be imported without a thread.
for _name, _unusable in (("NUMBA_DISABLE_JIT", r"0*[1-9]\d*"), ("NUMBA_NUM_THREADS", r"0+|-\d+")):
    if _re.fullmatch(_unusable, _os.environ.get(_name, "")):
        print(f"{__name__}: {_name}={_os.environ.pop(_name)} is not followed", file=_sys.stderr)


def __getattr__(name: str) -> Any:
    """Import a name of ``__all__`` at its first use (PEP 562)."""
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_MODULE_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the Python interface, including names that are not imported yet."""
    return sorted({*globals(), *__all__})
