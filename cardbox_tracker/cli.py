"""The ``cardbox`` command; each subcommand is a few lines around a function of the package."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cardbox_tracker import __version__
from cardbox_tracker.body.model_file import load_body_model, save_body_model
from cardbox_tracker.body.posture import SIDE_TURNS
from cardbox_tracker.body.urdf import urdf_from_body
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation.config import PRESETS
from cardbox_tracker.estimation.initialization import InitializationConfig
from cardbox_tracker.estimation.resampling import STRATEGIES
from cardbox_tracker.offline.initialize import describe, initialize_from_recording
from cardbox_tracker.offline.result_bag import ResultBag
from cardbox_tracker.offline.silhouettes import SilhouetteSource, TimeSpan
from cardbox_tracker.offline.track import track_recording
from cardbox_tracker.progress import progress_bar
from cardbox_tracker.ros.bag_reader import BagReader


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``cardbox``; return its exit code: 0, or 1 after an error told in words."""
    options = build_parser().parse_args(arguments)
    try:
        options.run(options)
    except CardboxError as error:
        print(f"cardbox {options.command}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"cardbox {options.command}: interrupted", file=sys.stderr)
        return 130
    return 0


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the command and all its subcommands."""
    parser = argparse.ArgumentParser(
        prog="cardbox", description="Upper-body posture of one person from silhouettes."
    )
    parser.add_argument("--version", action="version", version=f"cardbox {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def command(name: str, run: object, text: str) -> argparse.ArgumentParser:
        added = commands.add_parser(
            name,
            help=text,
            description=text,
            formatter_class=argparse.ArgumentDefaultsHelpFormatter,
        )
        added.set_defaults(run=run)
        return added

    demo = command("demo", _demo, "Run the whole chain on a synthetic bag, through real nodes.")
    demo.add_argument("--output", type=Path, default=Path("demo_output"), help="folder of results")
    demo.add_argument("--preset", choices=PRESETS, default="paper", help="tracker settings")
    demo.add_argument("--seed", type=_seed, default=0, help="seed of session and filters")

    synthesize = command("synthesize", _synthesize, "Write a synthetic session with ground truth.")
    synthesize.add_argument("--motion", default="all", help="wave, bend, bow or all")
    synthesize.add_argument("--output", type=Path, required=True, help="bag to write")
    synthesize.add_argument("--seed", type=_seed, default=0, help="seed of the noise")
    synthesize.add_argument("--storage", choices=("mcap", "sqlite3"), default="mcap")
    synthesize.add_argument("--compressed", action="store_true", help="write JPEG pictures")

    initialize = command("initialize", _initialize, "Measure a person from a recording.")
    _add_recording(initialize)
    for name in ("front", "side", "arms"):
        initialize.add_argument(
            f"--{name}", type=_span, required=True, metavar="T0:T1", help="when it is held, s"
        )
    initialize.add_argument("--distance", type=float, required=True, help="to the person, m")
    initialize.add_argument("--side-turn", choices=SIDE_TURNS, default="left")
    initialize.add_argument(
        "--camera-pitch-deg", type=float, default=0.0, help="positive when the camera looks down"
    )
    initialize.add_argument("--seed", type=_seed, default=0, help="seed of the hypotheses")
    initialize.add_argument("--output", type=Path, required=True, help="body model to write")

    track = command("track", _track, "Follow the posture through a recording.")
    _add_recording(track)
    track.add_argument("--model", type=Path, required=True, help="body model of the person")
    track.add_argument("--start", type=_time, required=True, help="front posture held, s")
    track.add_argument("--csv", type=Path, required=True, help="table to write")
    track.add_argument("--preset", choices=PRESETS, default="default", help="tracker settings")
    track.add_argument("--strategy", choices=STRATEGIES, default="drs", help="resampling")
    track.add_argument("--particles", type=_count, default=None, help="N of each filter")
    track.add_argument("--bag", type=Path, default=None, help="bag of results to write")
    track.add_argument("--video", type=Path, default=None, help="overlay video to write, .mp4")
    track.add_argument("--seed", type=_seed, default=0, help="seed of the filters")

    evaluate = command("evaluate", _evaluate, "Repeat the paper's experiments; can be resumed.")
    evaluate.add_argument("--runs", type=_runs, default=100, help="of each strategy and motion")
    evaluate.add_argument("--output", type=Path, required=True, help="folder of results")
    evaluate.add_argument("--quick", action="store_true", help="everything smaller, in two minutes")
    evaluate.add_argument(
        "--session", type=Path, default=None, help="a recording with ground_truth.json instead"
    )
    evaluate.add_argument("--jobs", type=_jobs, default=None, help="processes; all cores without")
    evaluate.add_argument("--seed", type=_seed, default=0, help="seed of sessions and filters")

    urdf = command("urdf", _urdf, "Print the URDF of a measured person.")
    urdf.add_argument("model", type=Path, help="body model")
    return parser


def _add_recording(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", type=Path, metavar="BAG", help="rosbag2 folder or file")
    parser.add_argument(
        "--background", type=_span, required=True, metavar="T0:T1", help="empty scene, s"
    )


def _span(text: str) -> TimeSpan:
    try:
        return TimeSpan.parse(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _time(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r} is no time; expected seconds from the start")
    return value


def _seed(text: str) -> int:
    return _integer(text, 0, "seed")


def _count(text: str) -> int:
    return _integer(text, 2, "number of particles")


def _runs(text: str) -> int:
    return _integer(text, 2, "number of runs")


def _jobs(text: str) -> int:
    return _integer(text, 1, "number of processes")


def _integer(text: str, lowest: int, what: str) -> int:
    try:
        value = int(text)
    except ValueError:
        value = lowest - 1
    if value < lowest:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no {what}; expected a whole number from {lowest} on"
        )
    return value


def _demo(options: argparse.Namespace) -> None:
    from cardbox_tracker.demo.run import run_demo

    run_demo(options.output, options.preset, options.seed)


def _synthesize(options: argparse.Namespace) -> None:
    from cardbox_tracker.simulation.session import synthesize_session

    with progress_bar("synthesize") as show:
        synthesize_session(
            options.output,
            motion=options.motion,
            seed=options.seed,
            storage=options.storage,
            compressed=options.compressed,
            progress=show,
        )
    print(f"wrote {options.output}")


def _initialize(options: argparse.Namespace) -> None:
    try:
        config = InitializationConfig(
            distance_m=options.distance,
            camera_pitch_rad=float(np.radians(options.camera_pitch_deg)),
            side_turn=options.side_turn,
            seed=options.seed,
        )
    except ValueError as error:
        raise CardboxError(str(error)) from None
    spans = {name: getattr(options, name) for name in ("front", "side", "arms")}
    with BagReader(options.recording) as bag:
        source = SilhouetteSource(bag, options.background)
        with progress_bar("initialize") as show:
            result = initialize_from_recording(source, spans, config, show)
    save_body_model(result.body, options.output)
    print(describe(result))
    print(f"wrote {options.output}")


def _track(options: argparse.Namespace) -> None:
    body = load_body_model(options.model)
    config = replace(PRESETS[options.preset](), strategy=options.strategy)
    if options.particles is not None:
        config = config.with_particles(options.particles)
    with BagReader(options.recording) as bag:
        source = SilhouetteSource(bag, options.background)
        total_s = max(1e-9, bag.duration_s - options.start)
        with (
            ResultBag(options.bag, body, source.frame_id) as results,
            progress_bar("track") as show,
        ):
            summary = track_recording(
                source,
                body,
                config,
                options.seed,
                options.start,
                options.csv,
                options.video,
                observers=(
                    results.add,
                    lambda frame, *_: show((frame.time_s - options.start) / total_s),
                ),
            )
    print(
        f"tracked {summary.frames_tracked} of {summary.frames} pictures, "
        f"mean cost {summary.mean_cost_px:.0f} px, mean IoU {summary.mean_iou:.3f}"
    )
    for path in (options.csv, options.video, options.bag):
        if path is not None:
            print(f"wrote {path}")


def _evaluate(options: argparse.Namespace) -> None:
    from cardbox_tracker.evaluation.evaluate import evaluate
    from cardbox_tracker.evaluation.runner import default_jobs

    evaluate(
        options.output,
        options.runs,
        options.seed,
        options.quick,
        options.session,
        options.jobs or default_jobs(),
    )
    print(f"wrote {options.output}/report.md, and all numbers to {options.output}/results.json")


def _urdf(options: argparse.Namespace) -> None:
    print(urdf_from_body(load_body_model(options.model)))


if __name__ == "__main__":
    sys.exit(main())
