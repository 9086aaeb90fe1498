"""Wrong extrinsics reach the diagnostics, and the check does not hold up the tracking."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.tracking.camera_agreement import CameraAgreement
from cardbox_tracker.tracking.session import Session

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)


class Agreement(CameraAgreement):
    """A check that lasts until it is let go."""

    is_due = True

    def __init__(self) -> None:
        super().__init__(BodyModel(), CAMERA, [])
        self.checks, self.go_on = 0, threading.Event()

    def check(self, is_last: bool = False) -> None:
        self.checks += 1
        assert self.go_on.wait(60)
        raise OverflowError


def test_a_check_runs_beside_the_tracking_and_its_error_is_raised() -> None:
    agreement = Agreement()
    with ThreadPoolExecutor(1) as beside:
        session = Session([BodyModel()], CAMERA, beside=beside)
        session.trackers[0].agreement = agreement
        for _ in range(3):
            session.check_cameras()
        agreement.go_on.set()
    assert agreement.checks == 1
    with pytest.raises(OverflowError):
        session.check_cameras()
    agreement.is_due = False
    session.check_cameras()
    assert agreement.checks == 1
