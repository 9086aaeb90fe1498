"""Garbage is searched for seldom during a start, and as usual afterwards."""

from __future__ import annotations

import gc

from cardbox_tracker.common import garbage


def test_the_usual_search_comes_back_without_the_objects_of_the_start() -> None:
    usual = gc.get_threshold()
    gc.unfreeze()
    try:
        garbage.search_seldom()
        assert gc.isenabled()
        assert gc.get_threshold()[0] > 10 * usual[0]
        assert gc.get_freeze_count() == 0
        garbage.keep_all()
        assert gc.get_freeze_count() > 1000
    finally:
        gc.unfreeze()
        after = gc.get_threshold()
        gc.set_threshold(*usual)
    assert after == usual
