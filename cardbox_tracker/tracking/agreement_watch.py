"""Periodic check of the extrinsics of several cameras, in a thread beside the tracking."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from cardbox_tracker.tracking.camera_agreement import CameraAgreement


class AgreementWatch:
    """Checks the extrinsics in a separate thread, one window of images after the other."""

    def __init__(self, cameras: Sequence[str]) -> None:
        """Prepare for the names of all ``cameras``, of which the first one is the reference."""
        self._names = list(cameras)[1:]
        self._thread: threading.Thread | None = None
        self._agreement: CameraAgreement | None = None

    def see(self, agreement: CameraAgreement | None) -> None:
        """Start a check if one is due and none is running."""
        self._agreement = agreement
        if agreement is None or not agreement.is_due:
            return
        if self._thread is None or not self._thread.is_alive():
            # No daemon thread: one that runs compiled code while Python ends aborts the process.
            # interrupts.py limits the wait at the end.
            self._thread = threading.Thread(target=agreement.check, name="agreement", daemon=False)
            self._thread.start()

    def wait(self) -> None:
        """Wait for a check that is running."""
        if self._thread is not None:
            self._thread.join()

    def values(self) -> dict[str, str]:
        """Return the estimated rotation error of each further camera, for the diagnostics."""
        if self._agreement is None:
            return {}
        errors = {"turned": self._agreement.turned_deg, "rolled": self._agreement.rolled_deg}
        return {
            f"{name} {how} (deg)": "not yet known" if degrees is None else f"{degrees:.1f}"
            for how, found in errors.items()
            for name, degrees in zip(self._names, found, strict=True)
        }
