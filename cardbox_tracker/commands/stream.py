"""``cardbox stream``: results in real time, as programs that teleoperate robots read people."""

from __future__ import annotations

import sys
from contextlib import closing, nullcontext
from dataclasses import dataclass

from cardbox_tracker.applications.teleoperation.full_body import at_rate, bodies_of
from cardbox_tracker.applications.teleoperation.sending import (
    PACKETS,
    Packets,
    ZmqSender,
    in_real_time,
)
from cardbox_tracker.commands.arguments import (
    TrackedResults,
    between,
    choice,
    option,
    print_remarks,
)


@dataclass(frozen=True, kw_only=True)
class Arguments(TrackedResults):
    """Results, and how they are sent.

    Attributes:
        to: sonic: frames of its protocol v3; isaac: msgpack of Isaac Teleop's full body; json: a
            line for each time (docs/retargeting.md)
        rate: packets a second
        address: publish by ZMQ, as tcp://127.0.0.1:5556 (default: the standard output)
        fast: do not wait for the time of a packet
    """

    to: str = choice(PACKETS, required=True)
    rate: float = option("HZ", between(1, 1000), default=50.0)
    address: str | None = option("ADDRESS")
    fast: bool = option(default=False)


def run(given: Arguments) -> None:
    """Read the results and send them."""
    results = given.read()
    results.check_body()
    bodies = at_rate(bodies_of(results), given.rate)
    packets = Packets(given.to, given.rate)
    sent = number = 0
    with closing(ZmqSender(given.address)) if given.address else nullcontext() as sender:
        print_remarks(sender.remarks if sender else ())
        for body in bodies if given.fast else in_real_time(bodies, given.rate):
            made = packets.of(body)
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
