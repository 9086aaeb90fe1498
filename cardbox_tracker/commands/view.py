"""``cardbox view``: shows results in the viewer Rerun, from a bag or from running nodes."""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from cardbox_tracker.commands.arguments import add_force, at_least, check_outputs
from cardbox_tracker.common.errors import CardboxError, RosMissingError

if TYPE_CHECKING:
    from cardbox_tracker.applications.viewing.scene import Scene
    from cardbox_tracker.recordings.truth import TrueFrame

_TRUTH = "ground_truth.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox view``."""
    add = parser.add_argument
    add("results", type=Path, nargs="?", metavar="BAG", help="bag of 'cardbox track --bag'")
    add("--live", action="store_true", help="show the results of the running nodes")
    add("--save", type=Path, metavar="FILE.rrd", help="write a file for the viewer")
    add("--web", action="store_true", help="serve the viewer to a browser on this computer")
    add(
        "--truth",
        type=Path,
        metavar="FILE",
        help=f"{_TRUTH} of the recording, to plot the error; not needed if it lies beside BAG",
    )
    add("--person", type=at_least(1), metavar="K", help="whom of several people (default: 1)")
    add_force(parser)


def run(options: argparse.Namespace) -> None:
    """Show a bag of results, or the running nodes."""
    results: Path | None = options.results
    if options.live == (results is not None):
        raise CardboxError("expected either BAG or --live")
    if options.person is not None and options.live:
        raise CardboxError("--person chooses in results: leave out --live")
    check_outputs((options.save,), options.force, inputs=(results, options.truth))
    # A wrong input is reported before a missing library or display.
    truth = None if results is None else _truth_of(results, options.truth, options.person)
    from cardbox_tracker.applications.viewing.scene import Scene, layout, show_results
    from cardbox_tracker.applications.viewing.viewer import recording
    from cardbox_tracker.common.progress import progress_bar

    blueprint = layout(has_truth=truth is not None, is_live=options.live)
    with recording(blueprint, options.save, options.web) as (stream, address):
        if address:
            print(f"open {address} in a browser; Ctrl-C ends", flush=True)
        scene = Scene(stream, truth)
        if results is None:
            _show_nodes(scene)
        else:
            with progress_bar("view") as show:
                count = show_results(results, scene, show, options.person)
            print(f"shown: {count} images with a posture", flush=True)
            if options.web:
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


def _truth_of(
    results: Path, given: Path | None, person: int | None
) -> Mapping[int, TrueFrame] | None:
    """Check the results; return their true frames by stamp, None if there are none."""
    from cardbox_tracker.recordings.bag_reader import BagReader
    from cardbox_tracker.recordings.open_images import is_bag
    from cardbox_tracker.recordings.result_reader import results_in
    from cardbox_tracker.recordings.truth import load_ground_truth

    if results.exists() and not is_bag(results):
        raise CardboxError(f"{results} is no bag; give one that 'cardbox track --bag' has written")
    with BagReader(results) as bag:
        stamps = results_in(bag, person).stamp_ns.tolist()
    there = (folder / _TRUTH for folder in (results, results.parent))
    path = given or next((file for file in there if file.is_file()), None)
    if path is None:
        return None
    frames = load_ground_truth(path).frames
    if not frames.keys().isdisjoint(stamps):
        return frames
    if given is not None:
        raise CardboxError(
            f"{path} has no true frame for an image of {results}; give the ground truth of its "
            "recording"
        )
    return None
