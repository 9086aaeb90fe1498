"""The errors a user can cause; ``str(error)`` says what was wrong, what was expected, what to do.

CardboxError
    BodyModelError       a body model file or a size
    CameraError          a calibration or a CameraInfo
    EncodingError        an image's encoding or its bytes
    InitializationError  the reference silhouettes cannot give a body
    BackgroundFileError  a file with a learned background
    BagError             a recording that cannot be read or written
    NotFiniteError       a result with values that are not finite numbers
    RosMissingError      ROS 2 is not installed
"""

from __future__ import annotations


class CardboxError(Exception):
    """Base of every error a user can cause; programs show its text and no traceback."""


class BodyModelError(CardboxError):
    """A body model is incomplete, malformed or impossible."""


class CameraError(CardboxError):
    """A camera calibration is missing, malformed or unsupported."""


class BackgroundFileError(CardboxError):
    """A learned background cannot be read, written or used."""


class EncodingError(CardboxError):
    """An image's encoding is unsupported, or its bytes do not match it."""


class InitializationError(CardboxError):
    """The reference silhouettes do not allow the body to be measured."""


class BagError(CardboxError):
    """A recording cannot be read or written."""


class NotFiniteError(CardboxError):
    """A result has values that are not finite numbers."""


class RosMissingError(CardboxError):
    """ROS 2 is not installed, and what was asked for needs it."""

    def __init__(self, error: ImportError) -> None:
        """Say what could not be imported and what to do."""
        super().__init__(
            f"ROS 2 is not installed ({error}); use 'pip install cardbox_tracker[ros]' or source "
            "a ROS 2 Jazzy installation"
        )
