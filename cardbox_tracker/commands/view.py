"""``cardbox view``: shows results in the viewer Rerun, from a bag or from running nodes."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from cardbox_tracker.commands.arguments import Written, at_least, check_outputs, option
from cardbox_tracker.common.errors import CardboxError, RosMissingError

if TYPE_CHECKING:
    from cardbox_tracker.recordings.truth import TrueFrame

_TRUTH = "ground_truth.json"


@dataclass(frozen=True, kw_only=True)
class Arguments(Written):
    """A bag of results or the running nodes, and how they are shown.

    Attributes:
        results: bag of 'cardbox track --bag'
        live: show the results of the running nodes
        save: write a file for the viewer
        web: serve the viewer to a browser on this computer
        truth: ground_truth.json of the recording, to plot the error; not needed if it lies beside
            BAG
        person: whom of several people (default: 1)
    """

    results: Path | None = option("BAG", flag="results", nargs="?")
    live: bool = option(default=False)
    save: Path | None = option("FILE.rrd")
    web: bool = option(default=False)
    truth: Path | None = option("FILE")
    person: int | None = option("K", at_least(1))


def run(given: Arguments) -> None:
    """Show a bag of results, or the running nodes."""
    results = given.results
    if given.live == (results is not None):
        raise CardboxError("expected either BAG or --live")
    if given.person is not None and given.live:
        raise CardboxError("--person chooses in results: leave out --live")
    check_outputs((given.save,), given.force, inputs=(results, given.truth))
    # A wrong input is reported before a missing library or display.
    truth = None if results is None else _truth_of(results, given.truth, given.person)
    from cardbox_tracker.applications.viewing.scene import Scene, layout, show_results
    from cardbox_tracker.applications.viewing.viewer import recording
    from cardbox_tracker.common.progress import progress_bar

    blueprint = layout(has_truth=truth is not None, is_live=given.live)
    with recording(blueprint, given.save, given.web) as (stream, address):
        if address:
            print(f"open {address} in a browser; Ctrl-C ends", flush=True)
        scene = Scene(stream, truth)
        if results is None:
            try:
                from cardbox_tracker.ros.live_view import show_nodes
            except ImportError as error:
                raise RosMissingError(error) from None
            show_nodes(scene)
        else:
            with progress_bar("view") as show:
                count = show_results(results, scene, show, given.person)
            print(f"shown: {count} images with a posture", flush=True)
            if given.web:
                stream.flush()
                with suppress(KeyboardInterrupt):
                    while True:
                        time.sleep(1.0)
    if given.save is not None:
        print(f"wrote {given.save}; look at it with 'rerun {given.save}'")


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
