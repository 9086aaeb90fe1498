"""``cardbox view``: shows results in the viewer Rerun, from a recording or from running nodes."""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from cardbox_tracker.commands.arguments import add_force, check_outputs
from cardbox_tracker.commands.request import (
    OptionsError,
    TrackingRequest,
    add_tracking,
    inputs_of,
    tracking_request,
)
from cardbox_tracker.commands.tracking import track
from cardbox_tracker.common.errors import CardboxError, RosMissingError

if TYPE_CHECKING:
    from cardbox_tracker.applications.viewing.scene import Scene
    from cardbox_tracker.recordings.truth import TrueFrame

NAME = "view"
HELP = "show results in a viewer: image, body in 3D, plots, error, a slider for the time"
_TRUTH = "ground_truth.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox view``."""
    parser.add_argument("--live", action="store_true", help="show the results of the running nodes")
    parser.add_argument("--save", type=Path, metavar="FILE.rrd", help="write a file for the viewer")
    parser.add_argument(
        "--web", action="store_true", help="serve the viewer to a browser on this computer"
    )
    parser.add_argument(
        "--truth",
        type=Path,
        metavar="FILE",
        help=f"{_TRUTH} of the recording, to plot the error; not needed if it lies beside BAG",
    )
    add_tracking(parser, needs_recording=False)
    add_force(parser)


def run(options: argparse.Namespace) -> None:
    """Show a bag of results, a recording that is tracked meanwhile, or the running nodes."""
    if options.live == (options.recording is not None):
        raise CardboxError("expected either BAG or --live")
    if options.person is not None and options.live:
        raise CardboxError("--person chooses in a recording or in results: leave out --live")
    inputs = *inputs_of(options), options.truth
    check_outputs((options.save,), options.force, inputs=inputs)
    # A wrong input is reported before a missing library or display.
    is_result = not options.live and _has_results(options)
    request = None if options.live or is_result else _request_of(options)
    from cardbox_tracker.applications.viewing.scene import Scene, layout
    from cardbox_tracker.applications.viewing.sources import ShownTracking, show_results
    from cardbox_tracker.applications.viewing.viewer import recording
    from cardbox_tracker.common.progress import progress_bar

    truth = None if options.live else _truth_of(options, is_result)
    blueprint = layout(has_truth=truth is not None, is_live=options.live)
    with recording(blueprint, options.save, options.web) as (stream, address):
        if address:
            print(f"open {address} in a browser; Ctrl-C ends", flush=True)
        scene = Scene(stream, truth)
        if options.live:
            _show_nodes(scene)
        elif request is not None:
            shown = ShownTracking(scene)
            track(request, observers=(shown,))
            print(f"shown: {shown.count} images with a posture", flush=True)
        else:
            with progress_bar("view") as show:
                count = show_results(options.recording, scene, show, options.person)
            print(f"shown: {count} images with a posture", flush=True)
        if options.web and not options.live:
            stream.flush()
            with suppress(KeyboardInterrupt):
                while True:
                    time.sleep(1.0)
    if options.save is not None:
        print(f"wrote {options.save}; look at it with 'rerun {options.save}'")


def _show_nodes(scene: Scene) -> None:
    try:
        from cardbox_tracker.ros.live_view import show_nodes
    except ImportError as error:
        raise RosMissingError(error) from None
    show_nodes(scene)


def _has_results(options: argparse.Namespace) -> bool:
    """Return whether there are results to show; else the recording is to be tracked."""
    from cardbox_tracker.recordings.bag_reader import BagReader
    from cardbox_tracker.recordings.open_images import is_bag
    from cardbox_tracker.recordings.result_reader import has_results, results_in

    if not is_bag(options.recording) and options.recording.exists():
        return False
    with BagReader(options.recording) as bag:
        if not has_results(bag):
            return False
        results_in(bag, options.person)
    return True


def _request_of(options: argparse.Namespace) -> TrackingRequest:
    """Return what is tracked in a recording without results."""
    try:
        return tracking_request(options)
    except OptionsError as error:
        raise CardboxError(
            f"{options.recording} has no results to show; give a bag of 'cardbox track --bag', or "
            f"the options of 'cardbox track', to track it now: {error}"
        ) from None


def _truth_of(options: argparse.Namespace, is_result: bool) -> Mapping[int, TrueFrame] | None:
    """Return the true frames by stamp, of which results must have one; None if there are none."""
    from cardbox_tracker.applications.viewing.sources import image_stamps
    from cardbox_tracker.recordings.truth import load_ground_truth

    path = options.truth or _truth_beside(options.recording)
    if path is None:
        return None
    frames = load_ground_truth(path).frames
    stamps = image_stamps(options.recording, options.person) if is_result else [*frames]
    if not frames.keys().isdisjoint(stamps):
        return frames
    if options.truth is not None:
        raise CardboxError(
            f"{path} has no true frame for an image of {options.recording}; give the ground truth "
            "of its recording"
        )
    return None


def _truth_beside(bag: Path) -> Path | None:
    for folder in (bag, bag.parent):
        if (folder / _TRUTH).is_file():
            return folder / _TRUTH
    return None
