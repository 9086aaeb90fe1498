"""Python's search for garbage: seldom until a node is ready, and then in new objects only.

Almost everything that is made before stays until the end, mainly modules and compiled code, and
each search through it would delay the start, or an image.
"""

from __future__ import annotations

import gc

_USUAL = gc.get_threshold()
# A start makes three times as many objects, but the compiler's garbage must not fill the memory.
_SELDOM = 50_000


def search_seldom() -> None:
    """Search after every 50,000 new objects, not after hundreds."""
    gc.set_threshold(_SELDOM, *_USUAL[1:])


def keep_all() -> None:
    """Take all existing objects out of the search, and search new ones as usual."""
    gc.freeze()
    gc.set_threshold(*_USUAL)
