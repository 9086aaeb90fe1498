"""``cardbox call``: calls a service of the running nodes."""

from __future__ import annotations

import argparse

from cardbox_tracker.common.errors import RosMissingError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox call``."""
    parser.add_argument("service", metavar="SERVICE", help="such as initializer/initialize")


def run(options: argparse.Namespace) -> None:
    """Call the service and print its answer."""
    try:
        from cardbox_tracker.ros.runtime.call import call_service
    except ImportError as error:
        raise RosMissingError(error) from None
    said = [""]

    def say(text: str) -> None:
        said.append(text)
        print(text, flush=True)

    answer = call_service(options.service, say)
    # Some answers repeat the last status of a node.
    if answer != said[-1]:
        print(answer)
