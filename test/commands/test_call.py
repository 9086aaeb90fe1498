"""What ``cardbox call`` prints of a service's answer."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from cardbox_tracker.commands import call as command
from cardbox_tracker.ros.runtime import call


@pytest.mark.parametrize(
    ("statuses", "printed"),
    [
        (["measuring", "measured"], "measuring\nmeasured\n"),
        (["playing"], "playing\nmeasured\n"),
        ([], "measured\n"),
    ],
)
def test_an_answer_that_was_the_last_status_is_printed_once(
    statuses: list[str],
    printed: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def answered(service: str, say: Callable[[str], None]) -> str:
        for status in statuses:
            say(status)
        return "measured"

    monkeypatch.setattr(call, "call_service", answered)
    command.run(Namespace(service="initializer/initialize"))
    assert capsys.readouterr().out == printed
