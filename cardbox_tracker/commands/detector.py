"""``cardbox detector``: installs the network files of the person detector."""

from __future__ import annotations

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox detector``."""
    parser.add_argument(
        "--install",
        action="store_true",
        help="take the files out of the wheel of mediapipe 0.10.21, which pip downloads; nothing "
        "is downloaded later",
    )
    parser.add_argument(
        "--wheel",
        type=Path,
        default=None,
        metavar="FILE",
        help="with --install: a wheel that is on this machine already, of any platform",
    )


def run(options: argparse.Namespace) -> None:
    """Install the files if asked to, load the networks, and print their places."""
    from cardbox_tracker.detectors.hand_network import HandNetwork
    from cardbox_tracker.detectors.model_files import (
        install_models,
        installed_hands,
        installed_models,
    )
    from cardbox_tracker.detectors.pose_network import PoseNetwork

    models = install_models(options.wheel) if options.install else installed_models()
    hands = installed_hands()
    PoseNetwork(*models)
    HandNetwork(hands)
    for path in (*models, hands):
        print(path)
    print("the detector is ready: cardbox track RECORDING --silhouettes detector ...")
