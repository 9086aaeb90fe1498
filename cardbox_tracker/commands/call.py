"""``cardbox call``: calls a service of the running nodes."""

from __future__ import annotations

from dataclasses import MISSING, dataclass

from cardbox_tracker.commands.arguments import Options, option
from cardbox_tracker.common.errors import RosMissingError


@dataclass(frozen=True)
class Arguments(Options):
    """A service of the running nodes.

    Attributes:
        service: such as initializer/initialize
    """

    service: str = option("SERVICE", default=MISSING)


def run(given: Arguments) -> None:
    """Call the service and print its answer."""
    try:
        from cardbox_tracker.ros.runtime.call import call_service
    except ImportError as error:
        raise RosMissingError(error) from None
    said = [""]

    def say(text: str) -> None:
        said.append(text)
        print(text, flush=True)

    answer = call_service(given.service, say)
    # Some answers repeat the last status of a node.
    if answer != said[-1]:
        print(answer)
