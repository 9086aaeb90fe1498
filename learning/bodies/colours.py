"""Random colours of skin, hair and clothes."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass, replace

import numpy as np

from learning.bodies.outfit import Outfit, along_limbs, hair_of
from learning.bodies.rigged import INDEX, RiggedBody

Colour = tuple[int, int, int]

_SKIN_LIGHT, _SKIN_DARK = np.array([242.0, 205.0, 180.0]), np.array([70.0, 45.0, 35.0])
_HAIR = ((25, 20, 18), (60, 40, 28), (105, 70, 40), (190, 150, 95), (140, 60, 30), (175, 175, 172))


@dataclass(frozen=True)
class Palette:
    """Colours (RGB, 0 to 255)."""

    skin: Colour
    hair: Colour
    shirt: Colour
    trousers: Colour
    shoes: Colour


def draw_palette(rng: np.random.Generator) -> Palette:
    """Return random colours; clothes have any hue, and often are grey, black or white."""
    tone = _SKIN_LIGHT + rng.beta(1.2, 1.6) * (_SKIN_DARK - _SKIN_LIGHT)
    skin = np.clip(tone + rng.normal(0.0, 8.0, 3), 0, 255)
    hair = np.clip(np.array(_HAIR[rng.integers(len(_HAIR))]) + rng.normal(0.0, 8.0, 3), 0, 255)
    return Palette(_rgb(skin), _rgb(hair), _cloth(rng), _cloth(rng), _cloth(rng, darkest=0.5))


def painted(body: RiggedBody, outfit: Outfit, palette: Palette, skin_vertices: int) -> RiggedBody:
    """Return the body in colours.

    Args:
        body: the body.
        outfit: where sleeves, trousers and the shirt end.
        palette: the colours.
        skin_vertices: vertices from this one on belong to added cloth or hair.
    """
    part, height = body.part, body.vertices[:, 2]
    colours = np.empty((len(part), 3), np.uint8)
    colours[:] = palette.shirt
    sleeve = along_limbs(body, "upper_arm", "forearm", "hand")
    leg = along_limbs(body, "thigh", "shin", "foot")
    hem = body.joints[0, 2] + outfit.hem_m
    colours[(leg >= 0) | ((part == 0) & (height < hem))] = palette.trousers
    colours[(sleeve > outfit.sleeve) | ((leg > outfit.trouser) & (leg < 2))] = palette.skin
    colours[np.isin(part, [INDEX["left_foot"], INDEX["right_foot"]])] = palette.shoes
    colours[np.isin(part, [INDEX["neck"], INDEX["head"]])] = palette.skin
    colours[hair_of(body) > 0.5] = palette.hair
    added = np.arange(len(part)) >= skin_vertices
    hairy = np.isin(part, [INDEX["head"], INDEX["chest"]])
    colours[added & hairy] = palette.hair
    colours[added & ~hairy] = palette.trousers if outfit.skirt_m else palette.shirt
    return replace(body, colours=colours)


def _cloth(rng: np.random.Generator, darkest: float = 1.0) -> Colour:
    """Return the colour of cloth, at most as bright as ``darkest`` (0..1)."""
    colourful = rng.random() < 0.6
    saturation = rng.uniform(0.2, 0.9) if colourful else rng.uniform(0.0, 0.08)
    value = darkest * rng.uniform(0.08, 0.97)
    red, green, blue = colorsys.hsv_to_rgb(rng.random(), saturation, value)
    return _rgb(255 * np.array([red, green, blue]))


def _rgb(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Colour:
    red, green, blue = (int(value) for value in values)
    return red, green, blue
