"""The errors that users can cause; the text has the fault, the expectation and the remedy."""

from __future__ import annotations

import re


class CardboxError(Exception):
    """Base of all errors that users can cause; programs print the text without a traceback."""


class BodyModelError(CardboxError):
    """A body model is incomplete, malformed or impossible."""


class CameraError(CardboxError):
    """A camera calibration is missing, malformed or unsupported."""


class BackgroundFileError(CardboxError):
    """A learned background cannot be read, written or used."""


class EncodingError(CardboxError):
    """An image's encoding is unsupported, or its bytes do not match it."""


class InitializationError(CardboxError):
    """The body cannot be measured from the reference silhouettes.

    Attributes:
        words: short instruction for the person in front of the camera.
    """

    def __init__(self, text: str, words: str = "Once more, please") -> None:
        """Store fault and remedy for the operator in ``text``, the instruction in ``words``."""
        super().__init__(text)
        self.words = words


class BagError(CardboxError):
    """A recording cannot be read or written."""


class NotFiniteError(CardboxError):
    """A result has values that are not finite numbers."""


class RosMissingError(CardboxError):
    """The requested command needs ROS 2, which is not installed."""

    def __init__(self, error: ImportError) -> None:
        """Name the module that cannot be imported and the remedy."""
        super().__init__(
            f"ROS 2 is not installed ({error}); use pip install 'cardbox_tracker[ros]' or source "
            "a ROS 2 Jazzy installation"
        )


_MOST_CHARACTERS = 200
_MOST_OF_A_VALUE = 60
_MOST_OF_A_TEXT = 2000


def cut(text: str, most: int = _MOST_CHARACTERS) -> str:
    """Return ``text``, or its beginning if it is long, so that foreign input cannot fill a log."""
    return text if len(text) <= most else f"{text[:most]}..."


def plain(text: str, most: int = _MOST_OF_A_TEXT) -> str:
    """Return a text for a log or a terminal: bounded, without control characters but line breaks.

    Names and fields that others wrote may have escape codes.
    """
    shown = (c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in cut(text, most))
    return "".join(shown)


def in_cell(text: str) -> str:
    """Return a text as a cell of a table: without tabs and line breaks, see :func:`plain`."""
    return plain(text).replace("\n", "\\n")


_NO_NUMBER = re.compile(
    r"(?:could not convert string to float|invalid literal for int\(\) with base 10): (.*)"
)
_OF_PYTHON = re.compile(
    r"object (is|has|cannot) |NoneType|codec|unpack|indices must|convert float|inhomogeneous"
    r"|array element|broadcast|reshape|dtype|not supported between"
)
_KINDS_OF_PYTHON = TypeError, AttributeError, IndexError, ArithmeticError, RecursionError


def reason_of(error: Exception) -> str:
    """Return why data of others cannot be read; the words of Python and NumPy become plain ones.

    Parsers of foreign formats can raise errors of any type.
    """
    reason = " ".join(str(getattr(error, "strerror", None) or error).split())
    if isinstance(error, CardboxError):
        return reason
    if isinstance(error, UnicodeDecodeError):
        return "it is no text in UTF-8"
    if isinstance(error, KeyError):
        return f"missing key {cut(reason)}"
    if found := _NO_NUMBER.search(reason):
        return f"{cut(found[1])} is no number"
    if isinstance(error, _KINDS_OF_PYTHON) or _OF_PYTHON.search(reason):
        return "a value is missing, or of another type, size or range than expected"
    return cut(reason) or type(error).__name__


def quoted(value: object) -> str:
    """Return the ``repr`` of ``value``, or its beginning if it is long."""
    if isinstance(value, str):
        return repr(value[:_MOST_OF_A_VALUE]) + "..." * (len(value) > _MOST_OF_A_VALUE)
    try:
        return cut(repr(value), _MOST_OF_A_VALUE)
    except Exception:  # of foreign classes, or an integer with thousands of digits
        return f"a value of type {type(value).__name__}"
