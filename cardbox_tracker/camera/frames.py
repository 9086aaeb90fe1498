"""Tells the images of a second camera that takes turns with the first one on a topic."""

from __future__ import annotations


class OneFrame:
    """Follows the names of frames; a name that comes back after another is that of one camera.

    Names that change for good are of one camera, whose driver was started again.

    Attributes:
        kept: name of the frame whose images are used; None while all are.
        others: names of those that are left out.
    """

    def __init__(self) -> None:
        """Begin without names."""
        self.kept: str | None = None
        self.others = set[str]()
        self._seen: list[str] = []

    def takes(self, frame_id: str) -> bool:
        """Take the name of the next image; return whether it is of the camera that is used."""
        frame_id = frame_id.lstrip("/")
        if self.kept is None and frame_id in self._seen[:-1]:
            self.kept = frame_id
            self.others = set(self._seen) - {frame_id}
        if frame_id not in self._seen:
            self._seen.append(frame_id)
        if self.kept in (None, frame_id):
            return True
        self.others.add(frame_id)
        return False

    def remark(self, topic: str) -> str:
        """Return what is left out of a topic; empty if nothing is."""
        if self.kept is None:
            return ""
        return (
            f"cameras take turns on {topic}: images of the frame {', '.join(sorted(self.others))} "
            f"are left out, and those of {self.kept or 'no name'} used; give each camera a topic "
            "of its own"
        )
