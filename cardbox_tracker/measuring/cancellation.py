"""Cancellation of a guided initialization by a service or at the end of the node."""

from __future__ import annotations

import threading

from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.measuring.guidance import CANCELLED, FAILED, FINISHED


class Cancellation:
    """Allows one initialization at a time; :meth:`cancel` and :meth:`stop` end its waits."""

    def __init__(self) -> None:
        """Begin without a running initialization."""
        self._busy = threading.Lock()
        self._ended = threading.Event()
        self._is_stopped = False
        self._why = ""

    @property
    def is_running(self) -> bool:
        """Whether an initialization runs."""
        return self._busy.locked()

    def begin(self) -> bool:
        """Begin an initialization, which ends with :meth:`end`; return False if one is running."""
        if not self._busy.acquire(blocking=False):
            return False
        if not self._is_stopped:
            self._ended.clear()
        return True

    def end(self, success: bool) -> str:
        """End the initialization; return the last words to the person."""
        is_cancelled = self._ended.is_set()
        self._busy.release()
        if success:
            return FINISHED
        return CANCELLED if is_cancelled else FAILED

    def cancel(self) -> str:
        """End the running initialization at its next wait; return the answer of the service.

        Raises:
            InitializationError: no initialization is running.
        """
        if not self.is_running:
            raise InitializationError("nothing to cancel: no initialization is running")
        self._why = "the initialization was cancelled; call initialize to start again"
        self._ended.set()
        return "the initialization ends now; its own answer says so, too"

    def stop(self) -> None:
        """End the running initialization and all later ones."""
        self._why, self._is_stopped = "the initializer was stopped", True
        self._ended.set()

    def wait(self, duration_s: float) -> None:
        """Wait for ``duration_s``.

        Raises:
            InitializationError: the initialization was cancelled or stopped.
        """
        if self._ended.wait(duration_s):
            raise InitializationError(self._why)
