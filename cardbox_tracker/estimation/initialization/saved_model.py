"""The file in which the initializer keeps the body model, checked when the node starts."""

from __future__ import annotations

import os

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.model_file import load_body_model, save_body_model
from cardbox_tracker.errors import CardboxError, InitializationError
from cardbox_tracker.files import check_writable, user_path


class SavedModel:
    """The file of the parameter ``model_file``, or none.

    Attributes:
        body: what the file held at the start, if it was there.
        warning: why it cannot be replaced, if so.
    """

    def __init__(self, name: str) -> None:
        """Read the file, or find out whether it can be written.

        Raises:
            CardboxError: it is no body model, or is not there and cannot be written.
        """
        self._path = user_path(name) if name else None
        self.body: BodyModel | None = None
        self.warning = ""
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
        """Write ``body``, if a file was asked for; return where it was saved, for a person.

        Raises:
            InitializationError: it cannot be written.
        """
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
