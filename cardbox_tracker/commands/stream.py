"""``cardbox stream``: results as programs that move robots and avatars read people."""

from __future__ import annotations

import sys
from contextlib import closing, nullcontext
from dataclasses import dataclass
from pathlib import Path

from cardbox_tracker.applications.teleoperation.full_body import at_rate, bodies_of
from cardbox_tracker.applications.teleoperation.sending import (
    PACKETS,
    Packets,
    in_real_time,
    sender_of,
)
from cardbox_tracker.applications.teleoperation.smpl import write_npz
from cardbox_tracker.commands.arguments import (
    TrackedResults,
    Written,
    between,
    check_outputs,
    choice,
    option,
    print_remarks,
)
from cardbox_tracker.common.errors import CardboxError

_FILE = "npz"


@dataclass(frozen=True, kw_only=True)
class Arguments(TrackedResults, Written):
    """Results, and how they are sent.

    Attributes:
        to: sonic: frames of its protocol v3; isaac: msgpack of Isaac Teleop's full body; json: a
            line for each time; vmc: bones of avatars, by UDP; npz: a file of SMPL's joints, for GMR
            (docs/retargeting.md)
        output: the file to write with --to npz
        rate: packets a second
        address: publish by ZMQ, as tcp://127.0.0.1:5556, or send vmc to udp://127.0.0.1:39539
            (default: the standard output)
        fast: do not wait for the time of a packet
    """

    to: str = choice((*PACKETS, _FILE), required=True)
    output: Path | None = option("FILE")
    rate: float = option("HZ", between(1, 1000), default=50.0)
    address: str | None = option("ADDRESS")
    fast: bool = option(default=False)


def run(given: Arguments) -> None:
    """Read the results and send them."""
    is_sent = given.address is not None or given.fast
    if (given.output is None) == (given.to == _FILE) or (given.to == _FILE and is_sent):
        raise CardboxError(
            f"--to {_FILE} needs --output, and neither --address nor --fast; the others need none"
        )
    check_outputs((given.output,), given.force, inputs=(given.results,))
    results = given.read()
    results.check_body()
    bodies = at_rate(bodies_of(results), given.rate)
    if given.output is not None:
        write_npz(list(bodies), given.rate, given.output)
        print(f"wrote {given.output}")
        return
    packets = Packets(given.to, given.rate)
    sent = number = 0
    with closing(sender_of(given.to, given.address)) if given.address else nullcontext() as sender:
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
