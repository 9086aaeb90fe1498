"""Tables of points that any detector has found in the images of a recording."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.common.errors import CardboxError, quoted
from cardbox_tracker.common.files import UnreadableFileError, regular_file
from cardbox_tracker.detectors.detector import FindPoints
from cardbox_tracker.detectors.image_points import POINT_INDEX, ImagePoints

COLUMNS = ("stamp_ns", "joint", "u", "v", "score")
"""Columns that a table needs."""
# An hour of all points at 30 Hz has 100 MB.
_MOST_BYTES = 256 * 1024 * 1024


class PointTable(NamedTuple):
    """A CSV table with a row for each point.

    Its columns are ``stamp_ns`` of the image, ``joint``, one of ``POINT_NAMES`` (others are not
    used), ``u`` and ``v``, column and row in the camera's own image, px, and ``score``, 0 to 1. A
    recording of several cameras also needs ``camera``, the camera's namespace.

    Attributes:
        path: the file.
    """

    path: Path

    def read(
        self, camera: str | None, calibration: Calibration, size: tuple[int, int]
    ) -> FindPoints:
        """Return the points of one camera, undistorted and at the working ``size``.

        Raises:
            CardboxError: the file cannot be read, lacks a column, or has a value that is no number.
        """
        found: dict[int, dict[str, tuple[float, float, float]]] = {}
        try:
            # Spreadsheets begin a file with a byte order mark.
            with (
                regular_file(self.path, _MOST_BYTES) as data,
                io.TextIOWrapper(data, newline="", encoding="utf-8-sig") as file,
            ):
                rows = csv.DictReader(file)
                self._check(rows.fieldnames or (), camera)
                for row in rows:
                    if camera is not None and row["camera"] != camera:
                        continue
                    if row["joint"] in POINT_INDEX:
                        joints = found.setdefault(int(row["stamp_ns"]), {})
                        joints[row["joint"]] = float(row["u"]), float(row["v"]), float(row["score"])
        except UnreadableFileError as error:
            raise CardboxError(f"cannot read {self.path}: {error}; give a CSV file") from None
        except OSError as error:
            raise CardboxError(f"cannot read {self.path}: {error.strerror}") from None
        except (UnicodeDecodeError, csv.Error) as error:
            raise CardboxError(
                f"{self.path} is not a table in UTF-8 ({quoted(str(error))}); give a CSV file with "
                f"the columns {', '.join(COLUMNS)}"
            ) from None
        except (ValueError, TypeError) as error:
            raise CardboxError(
                f"{self.path}, line {rows.line_num}, has a value that is no number "
                f"({quoted(str(error))}); expected whole numbers in stamp_ns, and numbers in u, v "
                "and score"
            ) from None
        placed: dict[int, ImagePoints] = {}
        for stamp_ns, joints in found.items():
            points = ImagePoints.of(joints)
            points = ImagePoints(calibration.rectified(points.px, *size), points.scores)
            # In a mirrored image, a detector takes the left side for the right one.
            placed[stamp_ns] = points.exchanged() if calibration.is_mirrored else points
        return lambda stamp_ns, image: placed.get(stamp_ns)

    def _check(self, names: Sequence[str], camera: str | None) -> None:
        expected = COLUMNS if camera is None else (*COLUMNS, "camera")
        missing = [name for name in expected if name not in names]
        if missing:
            raise CardboxError(
                f"{self.path} has no column {', '.join(missing)}; a table of points has the "
                f"columns {', '.join(expected)}, separated by commas"
            )
