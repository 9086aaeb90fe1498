"""Selection of a corrector by the setting ``corrector``: the package's, none, or from a file."""

from __future__ import annotations

import importlib
from pathlib import Path

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation.filtering.correction import (
    N_ANSWERS,
    N_FEATURES,
    NetworkCorrector,
    learned,
)
from cardbox_tracker.estimation.filtering.corrector import MakeCorrector
from cardbox_tracker.estimation.filtering.networks import read_recurrent_network

_EXPECTED = "expected learned, none, FILE.npz or MODULE:FUNCTION"


def load_corrector(name: str) -> MakeCorrector | None:
    """Return the factory of the named corrector; None for ``none``.

    Args:
        name: ``learned``, ``none``, the path of a network as ``learning/correction.py`` writes
            it, or ``MODULE:FUNCTION``: a :data:`~.corrector.MakeCorrector` function in a Python
            module on the import path. The code of the module is executed, so it must be trusted.

    Raises:
        CardboxError: the corrector does not exist, or the file is not a network of this kind.
    """
    if name == "none":
        return None
    if name == "learned":
        return learned
    if name.endswith(".npz"):
        network = read_recurrent_network(Path(name))
        sizes = len(network.mean), len(network.unit)
        if sizes != (N_FEATURES, N_ANSWERS):
            raise CardboxError(
                f"{name} is a network of {sizes[0]} features and {sizes[1]} answers; expected "
                f"{N_FEATURES} and {N_ANSWERS}: one that learning/correction.py of this version "
                "has written"
            )
        return lambda cost, camera, _: NetworkCorrector(cost, camera, network)
    module, colon, function = name.partition(":")
    if not colon or not all(part.isidentifier() for part in (*module.split("."), function)):
        raise CardboxError(f"corrector is '{name}'; {_EXPECTED}")
    try:
        made: MakeCorrector = getattr(importlib.import_module(module), function)
    except (ImportError, AttributeError) as error:
        raise CardboxError(
            f"corrector is '{name}', but {error}; {_EXPECTED}, whose folder is on PYTHONPATH"
        ) from None
    if not callable(made):
        raise CardboxError(f"corrector is '{name}', which is no function; {_EXPECTED}")
    return made
