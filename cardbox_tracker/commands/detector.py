"""``cardbox detector``: installs the network files of the person detector."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cardbox_tracker.commands.arguments import Options, option


@dataclass(frozen=True)
class Arguments(Options):
    """What is installed.

    Attributes:
        install: take the files out of the wheel of mediapipe 0.10.21, which pip downloads; nothing
            is downloaded later
        wheel: with --install: a wheel that is on this machine already, of any platform
    """

    install: bool = option(default=False)
    wheel: Path | None = option("FILE")


def run(given: Arguments) -> None:
    """Install the files if asked to, load the networks, and print their places."""
    from cardbox_tracker.detectors.hand_network import HandNetwork
    from cardbox_tracker.detectors.model_files import (
        install_models,
        installed_hands,
        installed_models,
    )
    from cardbox_tracker.detectors.pose_network import PoseNetwork

    models = install_models(given.wheel) if given.install else installed_models()
    hands = installed_hands()
    PoseNetwork(*models)
    HandNetwork(hands)
    for path in (*models, hands):
        print(path)
    print("the detector is ready: cardbox track RECORDING --silhouettes detector ...")
