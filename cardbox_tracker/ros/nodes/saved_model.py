"""The file in which the initializer saves the body model; it is checked at the node's start."""

from __future__ import annotations

import os

from cardbox_tracker.common.errors import CardboxError, InitializationError
from cardbox_tracker.common.files import check_writable, user_path
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import load_body_model, save_body_model


class SavedModel:
    """The file of the parameter ``model_file``; without a name nothing is read or saved.

    Attributes:
        body: content of the file at the start; None if the file did not exist.
        warning: reason why the file cannot be replaced; empty if it can.
    """

    def __init__(self, name: str) -> None:
        """Read the file if it exists; raise CardboxError if it is no model or cannot be written."""
        self._path, self.warning = user_path(name) if name else None, ""
        self.body: BodyModel | None = None
        if self._path is None:
            return
        if os.path.exists(self._path):
            self.body = load_body_model(self._path)
        try:
            check_writable(self._path)
        except CardboxError as error:
            if self.body is None:
                raise
            self.warning = f"{error}; until then a new measurement will not be saved"

    def save(self, body: BodyModel) -> str:
        """Write ``body`` to the file, if any; return words on it, or raise InitializationError."""
        if self._path is None:
            return ""
        try:
            save_body_model(body, self._path)
        except CardboxError as error:
            raise InitializationError(
                f"measured and published, but not saved: {error}. Mend it, then call initialize "
                "again: the references are kept, so nobody has to pose again"
            ) from None
        return f"; saved to {self._path}"
