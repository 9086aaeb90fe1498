"""Rigged bodies of several families, with random shapes, clothes and colours."""

from learning.bodies.random_body import FAMILIES, draw
from learning.bodies.rigged import Posed, RiggedBody

__all__ = ["FAMILIES", "Posed", "RiggedBody", "draw"]
