"""The ``cardbox`` command; each subcommand is a few lines around a function of the package."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cardbox_tracker import __version__
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.model_file import load_body_model, save_body_model
from cardbox_tracker.body.posture import SIDE_TURNS
from cardbox_tracker.description.urdf import urdf_from_body
from cardbox_tracker.errors import CardboxError, RosMissingError
from cardbox_tracker.estimation.config import PRESETS
from cardbox_tracker.estimation.filtering.resampling import STRATEGIES
from cardbox_tracker.estimation.initialization.measure import InitializationConfig
from cardbox_tracker.progress import progress_bar
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.initialize import describe, initialize_from_recording
from cardbox_tracker.recordings.result_bag import ResultBag
from cardbox_tracker.recordings.silhouettes import SilhouetteSource, TimeSpan
from cardbox_tracker.recordings.track import track_recording


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``cardbox``; return its exit code: 0, or 1 after an error told in words."""
    options = build_parser().parse_args(arguments)
    try:
        options.run(options)
        sys.stdout.flush()
    except CardboxError as error:
        print(f"cardbox {options.command}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"cardbox {options.command}: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # As in 'cardbox urdf MODEL.yaml | head': nobody reads on, which is no error of ours.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        # Such as a disk that is full; what was being written is not left behind half.
        where = f"{error.filename}: " if error.filename else ""
        print(f"cardbox {options.command}: {where}{error.strerror or error}", file=sys.stderr)
        return 1
    return 0


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the command and all its subcommands."""
    parser = argparse.ArgumentParser(
        prog="cardbox",
        formatter_class=_Formatter,
        description="The 3D posture of one person's upper body, from the silhouettes that one\n"
        "fixed camera sees. These commands work on recordings (rosbag2, sqlite3 or mcap);\n"
        "live, use the nodes background, initializer, tracker, camera and play_bag.",
        epilog="in this order, on a recording of your own or on a synthetic one:\n"
        "  cardbox synthesize --motion wave --output session\n"
        "  cardbox initialize session --background 0:3.9 --front 6.8:8.2 --side 9.8:11.2 \\\n"
        "      --arms 12.8:14.2 --distance 2.0 --output person.yaml\n"
        "  cardbox track session --model person.yaml --background 0:3.9 --start 15.6 \\\n"
        "      --csv person.csv --video person.mp4\n"
        "Times are seconds from the recording's start; 'cardbox COMMAND --help' explains each.",
    )
    parser.add_argument("--version", action="version", version=f"cardbox {__version__}")
    commands = parser.add_subparsers(
        dest="command", required=True, metavar="COMMAND", title="commands"
    )

    def command(name: str, run: object, text: str) -> argparse.ArgumentParser:
        added = commands.add_parser(
            name, help=text, description=f"{text[0].upper()}{text[1:]}.", formatter_class=_Formatter
        )
        added.set_defaults(run=run)
        return added

    demo = command("demo", _demo, "run the whole chain on a synthetic recording, with real nodes")
    demo.add_argument(
        "--output", type=Path, default=Path("demo_output"), metavar="DIR", help="folder of results"
    )
    _add_preset(demo, "paper")
    demo.add_argument("--seed", type=_seed, default=0, help="of the recording and of the filters")

    synthesize = command("synthesize", _synthesize, "record a synthetic person, with ground truth")
    synthesize.add_argument(
        "--motion",
        default="all",
        help="what follows the reference postures: wave, bend, bow or all",
    )
    synthesize.add_argument(
        "--output",
        type=Path,
        required=True,
        metavar="BAG",
        help="recording to write; must not exist",
    )
    synthesize.add_argument("--seed", type=_seed, default=0, help="of noise and sway")
    synthesize.add_argument(
        "--storage", choices=("mcap", "sqlite3"), default="mcap", help="format of the recording"
    )
    synthesize.add_argument(
        "--compressed", action="store_true", help="write JPEG images instead of raw ones"
    )

    initialize = command("initialize", _initialize, "measure the person in a recording")
    _add_recording(initialize)
    for name, posture in (
        ("front", "faces the camera, arms hanging 20 degrees away from the body"),
        ("side", "stands the same, turned by 90 degrees"),
        ("arms", "faces the camera, both arms stretched sideways"),
    ):
        initialize.add_argument(
            f"--{name}",
            type=_span,
            required=True,
            metavar="T0:T1",
            help=f"seconds while the person {posture}",
        )
    initialize.add_argument(
        "--distance",
        type=float,
        required=True,
        metavar="M",
        help="from the camera to the person, metres along the floor; all sizes are proportional "
        "to it",
    )
    initialize.add_argument(
        "--side-turn",
        choices=SIDE_TURNS,
        default="left",
        help="which way the person turns for --side, as they see it",
    )
    initialize.add_argument(
        "--camera-pitch-deg",
        type=float,
        default=0.0,
        metavar="P",
        help="positive when the camera looks down",
    )
    initialize.add_argument("--seed", type=_seed, default=0, help="of the hypotheses")
    initialize.add_argument(
        "--output", type=Path, required=True, metavar="MODEL.yaml", help="body model to write"
    )

    track = command("track", _track, "follow the posture through a recording")
    _add_recording(track)
    track.add_argument(
        "--model",
        type=Path,
        required=True,
        metavar="MODEL.yaml",
        help="the person, from 'cardbox initialize' or the node initializer",
    )
    track.add_argument(
        "--start",
        type=_time,
        required=True,
        metavar="T",
        help="second at which the person stands as for --front; tracking starts there",
    )
    track.add_argument(
        "--csv", type=Path, required=True, metavar="OUT.csv", help="table to write, a row an image"
    )
    _add_preset(track, "default")
    track.add_argument(
        "--strategy",
        choices=STRATEGIES,
        default="drs",
        help="resampling; drs is the paper's deterministic one",
    )
    track.add_argument(
        "--particles",
        type=_count,
        default=None,
        metavar="N",
        help="particles of each of the three filters; without it, the preset's",
    )
    track.add_argument(
        "--bag", type=Path, default=None, metavar="OUT", help="also write the topics of the tracker"
    )
    track.add_argument(
        "--video", type=Path, default=None, metavar="OUT.mp4", help="also write an overlay video"
    )
    track.add_argument("--seed", type=_seed, default=0, help="of the filters")

    benchmark = command("benchmark", _benchmark, "measure how fast it is on this machine")
    benchmark.add_argument(
        "--json", type=Path, required=True, metavar="FILE", help="results to write"
    )
    benchmark.add_argument("--report", type=Path, metavar="FILE.md", help="report to write")

    urdf = command("urdf", _urdf, "print the robot description (URDF) of a measured person")
    urdf.add_argument("model", type=Path, metavar="MODEL.yaml", help="the person")

    call = command(
        "call", _call, "call a service of the running nodes, as 'ros2 service call' does"
    )
    call.add_argument("service", metavar="SERVICE", help="such as initializer/initialize")

    evaluate = command(
        "evaluate", _evaluate, "repeat the paper's experiments; goes on where it was interrupted"
    )
    evaluate.add_argument(
        "--runs", type=_runs, default=100, metavar="N", help="runs of each strategy and motion"
    )
    evaluate.add_argument(
        "--output", type=Path, required=True, metavar="DIR", help="folder of results"
    )
    evaluate.add_argument("--quick", action="store_true", help="everything smaller, in two minutes")
    evaluate.add_argument(
        "--session",
        type=Path,
        default=None,
        metavar="DIR",
        help="a recording with ground_truth.json instead of synthetic ones",
    )
    evaluate.add_argument(
        "--jobs", type=_jobs, default=None, metavar="N", help="processes; without it, all cores"
    )
    evaluate.add_argument("--seed", type=_seed, default=0, help="of recordings and filters")
    return parser


class _Formatter(argparse.RawDescriptionHelpFormatter):
    """Tells a default only where there is one."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=26)

    def _get_help_string(self, action: argparse.Action) -> str | None:
        default = action.default
        if default is None or default is False or default == argparse.SUPPRESS:
            return action.help
        return f"{action.help} (default: %(default)s)"


def _add_recording(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", type=Path, metavar="BAG", help="rosbag2 folder or file")
    parser.add_argument(
        "--background",
        type=_span,
        required=True,
        metavar="T0:T1",
        help="seconds while nobody is in the image",
    )


def _add_preset(parser: argparse.ArgumentParser, default: str) -> None:
    parser.add_argument(
        "--preset",
        choices=PRESETS,
        default=default,
        help="tracker settings: the paper's Table I, or what tracks best",
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
    config = InitializationConfig(
        distance_m=options.distance,
        camera_pitch_rad=float(np.radians(options.camera_pitch_deg)),
        side_turn=options.side_turn,
        seed=options.seed,
    )
    # Absurd constants are refused by their own names, before anything follows from them.
    BodyModel.of(distance_m=config.distance_m, camera_pitch_rad=config.camera_pitch_rad)
    folder = options.output.parent
    if not folder.is_dir():
        reason = "Not a directory" if folder.exists() else "No such file or directory"
        raise CardboxError(f"cannot write {options.output}: {reason}; choose a folder that exists")
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
        try:
            config = config.with_particles(options.particles)
        except ValueError as error:
            raise CardboxError(str(error)) from None
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
        f"tracked {summary.frames_tracked} of {summary.frames} images, "
        f"mean cost {summary.mean_cost_px:.0f} px, mean IoU {summary.mean_iou:.3f}"
    )
    for path in (options.csv, options.video, options.bag):
        if path is not None:
            print(f"wrote {path}")


def _evaluate(options: argparse.Namespace) -> None:
    from cardbox_tracker.evaluation.paper.evaluate import evaluate
    from cardbox_tracker.evaluation.paper.runner import default_jobs

    evaluate(
        options.output,
        options.runs,
        options.seed,
        options.quick,
        options.session,
        options.jobs or default_jobs(),
    )
    print(f"wrote {options.output}/report.md, and all numbers to {options.output}/results.json")


def _call(options: argparse.Namespace) -> None:
    try:
        from cardbox_tracker.ros.runtime.call import call_service
    except ImportError as error:
        raise RosMissingError(error) from None
    print(call_service(options.service, lambda text: print(text, flush=True)))


def _benchmark(options: argparse.Namespace) -> None:
    from cardbox_tracker.benchmarks.run import run_benchmark, short_table

    print(short_table(run_benchmark(options.json, options.report)))
    print(f"wrote {options.json}" + (f" and {options.report}" if options.report else ""))


def _urdf(options: argparse.Namespace) -> None:
    print(urdf_from_body(load_body_model(options.model)))


if __name__ == "__main__":
    sys.exit(main())
