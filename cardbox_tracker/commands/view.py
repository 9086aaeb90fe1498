"""``cardbox view``: shows results in the viewer Rerun, from a recording or from running nodes."""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
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
    parser.add_argument(
        "--beside",
        type=Path,
        metavar="RESULTS",
        help="second bag of results of the same recording, such as with other settings, to show "
        "beside the first",
    )
    add_tracking(parser, needs_recording=False)
    add_force(parser)


def run(options: argparse.Namespace) -> None:
    """Show a bag of results, a recording that is tracked meanwhile, or the running nodes."""
    if options.live == (options.recording is not None):
        raise CardboxError("expected either BAG or --live")
    if options.person is not None and options.live:
        raise CardboxError("--person chooses in a recording or in results: leave out --live")
    inputs = *inputs_of(options), options.truth, options.beside
    check_outputs((options.save,), options.force, inputs=inputs)
    # A wrong input is reported before a missing library or display.
    results = [] if options.live else _results_of(options)
    request = None if options.live or results else _request_of(options)
    if options.beside is not None and not results:
        raise CardboxError(
            "--beside needs a bag of results as BAG; 'cardbox track --bag' writes one"
        )
    from cardbox_tracker.applications.viewing.scene import Scene, columns, layout
    from cardbox_tracker.applications.viewing.sources import check_same_images
    from cardbox_tracker.applications.viewing.viewer import recording

    first_ns = (
        check_same_images(results[0], results[1], options.person) if len(results) > 1 else None
    )
    truth = None if options.live else _truth_of(options, results)
    shown = columns(_names_of(results))
    blueprint = layout(shown, has_truth=truth is not None, is_live=options.live)
    with recording(blueprint, options.save, options.web) as (stream, address):
        if address:
            print(f"open {address} in a browser; Ctrl-C ends", flush=True)
        if options.live:
            _show_nodes(Scene(stream))
        elif request is not None:
            count = _track(request, Scene(stream, truth=truth))
            print(f"shown: {count} images with a posture", flush=True)
        scenes = [Scene(stream, column, first_ns, truth) for column in shown[: len(results)]]
        for column, count in zip(
            shown, _show_results(results, scenes, options.person), strict=False
        ):
            print(column.named(f"shown: {count} images with a posture"), flush=True)
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


def _results_of(options: argparse.Namespace) -> list[Path]:
    """Return the bags of results to show; none if the recording is to be tracked.

    Raises:
        CardboxError: the recording cannot be read.
    """
    from cardbox_tracker.recordings.bag_reader import BagReader
    from cardbox_tracker.recordings.open_images import is_bag
    from cardbox_tracker.recordings.result_reader import has_results, read_results

    if is_bag(options.recording) or not options.recording.exists():
        with BagReader(options.recording) as bag:
            if has_results(bag):
                for path in (options.recording, options.beside):
                    if path is not None:
                        read_results(path, options.person)
                return [path for path in (options.recording, options.beside) if path is not None]
    return []


def _request_of(options: argparse.Namespace) -> TrackingRequest:
    """Return what is tracked in a recording without results.

    Raises:
        CardboxError: options are missing or wrong.
    """
    try:
        return tracking_request(options)
    except OptionsError as error:
        raise CardboxError(
            f"{options.recording} has no results to show; give a bag of 'cardbox track --bag', or "
            f"the options of 'cardbox track', to track it now: {error}"
        ) from None


def _names_of(results: Sequence[Path]) -> list[str]:
    """Return a name for each bag: that of its folder, or as much of the path as differs."""
    parts = [path.resolve().parts for path in results]
    longest = max(map(len, parts), default=0)
    lengths = (n for n in range(1, longest) if len({p[-n:] for p in parts}) == len(parts))
    length = next(lengths, longest)
    return ["/".join(part[-length:]) for part in parts]


def _truth_of(
    options: argparse.Namespace, results: Sequence[Path]
) -> Mapping[int, TrueFrame] | None:
    """Return the true frames by stamp, of which results must have one; None if there are none.

    Raises:
        CardboxError: the ground truth cannot be read, or is given for other images.
    """
    from cardbox_tracker.applications.viewing.sources import image_stamps
    from cardbox_tracker.recordings.truth import load_ground_truth

    path = options.truth or _truth_beside(options.recording)
    if path is None:
        return None
    frames = load_ground_truth(path).frames
    if not results or not frames.keys().isdisjoint(image_stamps(results[0], options.person)):
        return frames
    if options.truth is not None:
        raise CardboxError(
            f"{path} has no true frame for an image of {results[0]}; give the ground truth of its "
            "recording"
        )
    return None


def _show_results(paths: Sequence[Path], scenes: Sequence[Scene], person: int | None) -> list[int]:
    """Show the results in bags; return the number of images with a posture of each."""
    from cardbox_tracker.applications.viewing.sources import show_together
    from cardbox_tracker.common.progress import progress_bar
    from cardbox_tracker.recordings.bag_reader import BagReader

    if not paths:
        return []
    with ExitStack() as stack:
        bags = [stack.enter_context(BagReader(path)) for path in paths]
        show = stack.enter_context(progress_bar("view"))
        return show_together(list(zip(bags, scenes, strict=False)), show, person)


def _track(request: TrackingRequest, scene: Scene) -> int:
    """Track a recording and show it; return the number of images with a posture."""
    from cardbox_tracker.applications.viewing.sources import ShownTracking

    shown = ShownTracking(scene)
    track(request, observers=(shown,))
    return shown.count


def _truth_beside(bag: Path) -> Path | None:
    for folder in (bag, bag.parent):
        if (folder / _TRUTH).is_file():
            return folder / _TRUTH
    return None
