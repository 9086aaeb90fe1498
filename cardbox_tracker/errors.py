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
    """The reference silhouettes do not allow the body to be measured.

    Attributes:
        words: what the person in front of the camera should do, in a few words.
    """

    def __init__(self, text: str, words: str = "Once more, please") -> None:
        """``text`` says what was wrong and what to do, to whoever runs the program."""
        super().__init__(text)
        self.words = words


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


_MOST_CHARACTERS = 200
_MOST_OF_A_VALUE = 60


def cut(text: str, most: int = _MOST_CHARACTERS) -> str:
    """Return ``text`` or its beginning: what strangers send must not fill the log."""
    return text if len(text) <= most else f"{text[:most]}..."


def quoted(value: object) -> str:
    """Return ``value`` as it would be written in Python, or the beginning of that."""
    if isinstance(value, str):
        return repr(value[:_MOST_OF_A_VALUE]) + "..." * (len(value) > _MOST_OF_A_VALUE)
    try:
        return cut(repr(value), _MOST_OF_A_VALUE)
    except (ValueError, RecursionError):  # such as of a number of thousands of digits
        return f"a value of type {type(value).__name__}"
