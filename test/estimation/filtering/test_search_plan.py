"""What depends on the number of cameras."""

from __future__ import annotations

import pytest

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation.filtering.search_plan import SearchPlan
from cardbox_tracker.estimation.filtering.whole_body_config import WholeBodyConfig

CONFIG = WholeBodyConfig()


def test_with_one_camera_the_settings_are_those_given() -> None:
    assert SearchPlan.of(CONFIG, 1) == SearchPlan(CONFIG)


def test_with_several_cameras_the_search_is_another_one() -> None:
    plan = SearchPlan.of(CONFIG, 2)
    assert plan == SearchPlan.of(CONFIG, 4)
    assert plan.crosses and plan.fits_outlines and plan.keeps_result
    assert plan.config.smoothing < CONFIG.smoothing
    rated = [c.arms // c.candidates for c in (plan.config, CONFIG)]
    assert rated[0] > rated[1]


def test_more_arms_than_several_cameras_may_have_are_refused_with_the_reason() -> None:
    config = WholeBodyConfig(arms=30_000)
    with pytest.raises(CardboxError, match=r"several cameras propose 4 times .* arms is 120000"):
        SearchPlan.of(config, 2)
