"""``cardbox stream``: results in real time, as programs that teleoperate robots read people."""

from __future__ import annotations

import argparse
import sys
from contextlib import closing, nullcontext

from cardbox_tracker.commands.arguments import add_results, between, results_of


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox stream``."""
    from cardbox_tracker.applications.teleoperation.sending import PACKETS

    add_results(parser)
    add = parser.add_argument
    add(
        "--to",
        choices=PACKETS,
        required=True,
        help="sonic: frames of its protocol v3; isaac: msgpack of Isaac Teleop's full body; json: "
        "a line for each time (docs/retargeting.md)",
    )
    add("--rate", type=between(1, 1000), default=50.0, metavar="HZ", help="packets a second")
    add(
        "--address",
        metavar="ADDRESS",
        help="publish by ZMQ, as tcp://127.0.0.1:5556 (default: the standard output)",
    )
    add("--fast", action="store_true", help="do not wait for the time of a packet")


def run(options: argparse.Namespace) -> None:
    """Read the results and send them."""
    from cardbox_tracker.applications.teleoperation.full_body import at_rate, bodies_of
    from cardbox_tracker.applications.teleoperation.sending import ZmqSender, in_real_time, packet

    results = results_of(options.results, options.person)
    results.check_body()
    bodies = at_rate(bodies_of(results), options.rate)
    sent = number = 0
    with closing(ZmqSender(options.address)) if options.address else nullcontext() as sender:
        for body in bodies if options.fast else in_real_time(bodies, options.rate):
            made = packet(options.to, body, number)
            number += 1
            if made is None:
                continue
            sent += 1
            if sender is not None:
                sender.send(made)
            else:
                sys.stdout.buffer.write(made)
                sys.stdout.buffer.flush()
    print(f"cardbox: sent {sent} packets of {number} times", file=sys.stderr)
