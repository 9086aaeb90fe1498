"""Wrong extrinsics reach the diagnostics, and the check does not hold up the tracking."""

from __future__ import annotations

import threading

from cardbox_tracker.tracking.camera_agreement import AgreementWatch


class Agreement:
    """Stands for a CameraAgreement whose check lasts until it is let go."""

    def __init__(self) -> None:
        self.is_due = True
        self.turned_deg: list[float | None] = [None]
        self.rolled_deg: list[float | None] = [None]
        self.checks = 0
        self.go_on = threading.Event()

    def check(self) -> None:
        self.checks += 1
        assert self.go_on.wait(60)
        self.turned_deg = [2.0]


def test_a_check_runs_beside_the_tracking_and_is_said() -> None:
    watch, agreement = AgreementWatch(["left", "right"]), Agreement()
    assert watch.values() == {}
    for _ in range(3):
        watch.see(agreement)  # type: ignore[arg-type]
    unknown = {"right turned (deg)": "not yet known", "right rolled (deg)": "not yet known"}
    assert watch.values() == unknown
    # Python waits for those that are no daemons; others in compiled code abort it at its end.
    assert [one.daemon for one in threading.enumerate() if one.name == "agreement"] == [False]
    agreement.go_on.set()
    watch.wait()
    assert agreement.checks == 1
    assert watch.values() == unknown | {"right turned (deg)": "2.0"}


def test_nothing_is_checked_before_it_is_due() -> None:
    watch, agreement = AgreementWatch(["left", "right"]), Agreement()
    agreement.is_due = False
    watch.see(agreement)  # type: ignore[arg-type]
    watch.see(None)
    watch.wait()
    assert agreement.checks == 0
    assert watch.values() == {}
