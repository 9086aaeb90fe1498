"""A digest of the sources that decide the figures of the preset ``paper``.

It ignores comments, docstrings and layout, which change no figure.
"""

from __future__ import annotations

import ast
import hashlib
from pathlib import Path
from typing import Any

import cardbox_tracker
from cardbox_tracker.person.skeleton import POSTURE_GROUPS, joints_of
from cardbox_tracker.search.config import paper_preset

SOURCES = (
    # The filter.
    "search/hierarchy.py",
    "search/particle_filter.py",
    "search/particle_kernels.py",
    "search/resampling.py",
    "terms/compiled.py",
    "terms/cardbox_kernels.py",
    "terms/bit_masks.py",
    "terms/bit_planes.py",
    "terms/silhouette.py",
    "person/cardbox.py",
    "person/parts.py",
    # The simulation.
    "applications/simulation/motions.py",
    "applications/simulation/person.py",
    "applications/simulation/renderer.py",
    "applications/simulation/session.py",
    # The initialization.
    "measuring/measure.py",
    "measuring/config.py",
    "recordings/initialize.py",
)


def paper_digest() -> str:
    """Return the digest of ``SOURCES``, of the posture's joints and of Table I."""
    root = Path(cardbox_tracker.__file__).parent
    codes = [_code(ast.parse((root / name).read_bytes())) for name in SOURCES]
    paper = paper_preset()
    table = paper.torso, paper.arm, paper.strategy, paper.cycles, paper.average
    # Joints that the paper lacks are rows of the skeleton, too, so its posture counts alone.
    posture = [(joint.name, joint.limits) for joint in joints_of(*POSTURE_GROUPS)]
    codes.append([repr(table), repr(posture), paper.torso_beside_arms])
    return hashlib.sha256(repr(codes).encode()).hexdigest()[:16]


def _code(node: Any) -> Any:
    """Return the code of a syntax tree without docstrings, the same for all versions of Python."""
    if isinstance(node, list):
        return [_code(one) for one in node if not _is_text(one)]
    if not isinstance(node, ast.AST):
        return node
    fields = [(name, _code(value)) for name, value in ast.iter_fields(node)]
    return type(node).__name__, [field for field in fields if field[1] not in (None, [])]


def _is_text(node: Any) -> bool:
    is_constant = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    return is_constant and isinstance(node.value.value, str)
