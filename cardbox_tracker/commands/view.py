"""``cardbox view``: shows results in the viewer Rerun, from a recording or from running nodes."""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from cardbox_tracker.commands.output_paths import add_force, check_outputs
from cardbox_tracker.commands.tracking import add_inputs, inputs_of, track_inputs
from cardbox_tracker.errors import CardboxError, RosMissingError

if TYPE_CHECKING:
    from cardbox_tracker.evaluation.truth import TrueFrame
    from cardbox_tracker.viewing.feed import Feed
    from cardbox_tracker.viewing.scene import Scene

NAME = "view"
HELP = "show results in a viewer: image, body in 3D, plots, error, a slider for the time"
_TRUTH = "ground_truth.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox view``."""
    parser.add_argument("--live", action="store_true", help="show the results of the running nodes")
    parser.add_argument(
        "--save", type=Path, default=None, metavar="FILE.rrd", help="write a file for the viewer"
    )
    parser.add_argument(
        "--web", action="store_true", help="serve the viewer to a browser on this computer"
    )
    parser.add_argument(
        "--truth",
        type=Path,
        default=None,
        metavar="FILE",
        help=f"{_TRUTH} of the recording, to plot the error; not needed if it lies beside BAG",
    )
    add_inputs(parser, needs_recording=False, needs_person=False)
    add_force(parser)


def run(options: argparse.Namespace) -> None:
    """Show a bag of results, a recording that is tracked meanwhile, or the running nodes.

    Raises:
        CardboxError: rerun-sdk is not installed, or the input cannot be read.
    """
    if options.live == (options.recording is not None):
        raise CardboxError("expected either BAG or --live")
    inputs = *inputs_of(options), options.truth
    check_outputs((options.save,), options.force, inputs=inputs)
    # A wrong input is reported before a missing library or display.
    is_result = not options.live and _holds_results(options)
    truth = None if options.live else _truth_of(options)
    from cardbox_tracker.viewing.feed import Feed
    from cardbox_tracker.viewing.layout import layout
    from cardbox_tracker.viewing.library import recording
    from cardbox_tracker.viewing.scene import Scene

    with recording(layout(), options.save, options.web) as (stream, address):
        if address:
            print(f"open {address} in a browser; Ctrl-C ends", flush=True)
        if options.live:
            _show_nodes(Scene(stream))
        else:
            feed = Feed(Scene(stream), truth)
            count = _show_results(options.recording, feed) if is_result else _track(options, feed)
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


def _holds_results(options: argparse.Namespace) -> bool:
    """Return whether the recording has results, or False if the options suffice to track it.

    Raises:
        CardboxError: the recording cannot be read, or options are missing.
    """
    from cardbox_tracker.recordings.bag_reader import BagReader
    from cardbox_tracker.recordings.open_images import is_bag
    from cardbox_tracker.recordings.result_reader import has_results

    if is_bag(options.recording) or not options.recording.exists():
        with BagReader(options.recording) as bag:
            if has_results(bag):
                return True
    missing = [] if options.stature is not None else _missing(options)
    if missing:
        raise CardboxError(
            f"{options.recording} has no results to show; give a bag of 'cardbox track --bag', or "
            f"--{', --'.join(missing)} as for 'cardbox track', to track it now"
        )
    return False


def _truth_of(options: argparse.Namespace) -> Mapping[int, TrueFrame] | None:
    from cardbox_tracker.evaluation.truth import load_ground_truth

    path = options.truth or _truth_beside(options.recording)
    return None if path is None else load_ground_truth(path).frames


def _show_results(path: Path, feed: Feed) -> int:
    """Show the results in the bag ``path``; return the number of images with a posture."""
    from cardbox_tracker.progress import progress_bar
    from cardbox_tracker.recordings.bag_reader import BagReader
    from cardbox_tracker.viewing.result_bag import show_results

    with BagReader(path) as bag, progress_bar("view") as show:
        return show_results(bag, feed, show)


def _track(options: argparse.Namespace, feed: Feed) -> int:
    """Track the recording and show it; return the number of images with a posture."""
    from cardbox_tracker.viewing.tracking import ShownTracking

    shown = ShownTracking(feed)
    track_inputs(options, observers=(shown,))
    return shown.count


def _missing(options: argparse.Namespace) -> list[str]:
    """Return the names of the options that tracking needs."""
    from cardbox_tracker.recordings.open_images import is_bag

    sources = options.within, options.silhouettes, options.detector
    is_empty_needed = is_bag(options.recording) and sources == (None, None, None)
    needed = ("model", "start", *(["background"] if is_empty_needed else []))
    return [name for name in needed if getattr(options, name) is None]


def _truth_beside(bag: Path) -> Path | None:
    for folder in (bag, bag.parent):
        if (folder / _TRUTH).is_file():
            return folder / _TRUTH
    return None
