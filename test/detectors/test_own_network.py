"""A detector of one's own: what it returns becomes detections, and one person is followed."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.own_network import OwnModel
from cardbox_tracker.detectors.pose_network import LANDMARKS, image_points

IMAGE = np.random.default_rng(0).integers(0, 255, (120, 160, 3), np.uint8)
FRAME_NS = 40_000_000


def person(column: float) -> dict[str, Any]:
    """A person whose trunk begins at a column, with one arm."""
    return {
        "left_shoulder": (column + 20, 30, 0.9),
        "right_shoulder": (column, 30, 0.8),
        "left_hip": (column + 18, 70, 0.7),
        "right_hip": (column + 2, 70, 0.6),
        "left_wrist": (column + 25, 65, 0.5),
        "right_wrist": (0.0, 0.0, 0.0),
    }


class Scripted:
    """Returns the people of image after image."""

    def __init__(self, *images: Any) -> None:
        self.images = list(images)

    def detect(self, image: np.ndarray) -> Sequence[Mapping[str, Any]]:
        assert image.shape == IMAGE.shape and image.flags.c_contiguous
        return self.images.pop(0)


def detector(*images: Any, **asked: Any) -> Detector:
    return Detector(OwnModel.of(Scripted(*images), "it"), **asked)


def test_points_by_name_become_those_of_the_tracker() -> None:
    found = detector([person(40)]).start()(IMAGE, 0)
    assert found is not None
    points = image_points(found)
    assert found.points_px[LANDMARKS.index("left_wrist")].tolist() == [65.0, 65.0]
    assert sorted(points.scores.tolist()) == [0.0] * 12 + [0.5, 0.6, 0.7, 0.8, 0.9]
    # Without a mask the figure of limbs and trunk is drawn.
    assert found.silhouette()[50, 50] == 255
    assert found.silhouette()[50, 110] == 0


def test_a_mask_is_the_silhouette() -> None:
    mask = np.zeros((120, 160), bool)
    mask[3:9, 4] = True
    found = detector([person(40) | {"mask": mask}]).start()(IMAGE, 0)
    assert found is not None
    assert np.array_equal(found.silhouette() > 0, mask)


@pytest.mark.parametrize(
    ("people", "expected"),
    [
        (7, r"Scripted.detect returns 7; expected a list of people"),
        ([{}, {"left_hand": (1, 2, 1)}], "person 1: 'left_hand' is no point; those are nose"),
        ([{"nose": (1, 2, 87)}], "person 0: nose has the score 87; .* divide percentages by 100"),
        ([{"nose": (1, 2)}], "person 0: .*expected column, row and score"),
        ([{"nose": (float("nan"), 2, 1)}], r"nose is at \(nan, 2.0\) px; expected a place"),
        ([dict.fromkeys(LANDMARKS[:4], (0.2, 0.4, 1))], "shares of the image"),
        ([person(40) | {"mask": np.zeros((9, 9))}], "mask"),
        ([[1, 2]], "person 0: .*expected column, row and score"),
    ],
)
def test_what_are_no_people_is_told(people: Any, expected: str) -> None:
    with pytest.raises(CardboxError, match=expected):
        detector(people).start()(IMAGE, 0)


class Unprintable(BaseException):
    def __str__(self) -> str:
        raise SystemExit(0)

    def __repr__(self) -> str:
        raise KeyError("no name")

    def __float__(self) -> float:
        raise SystemExit(0)


def raising(error: BaseException) -> Iterator[Any]:
    """Yield a person, and raise an error after it."""
    yield person(40)
    raise error


@pytest.mark.parametrize(
    ("people", "expected"),
    [
        (raising(SystemExit(3)), "Scripted.detect fails: SystemExit: 3"),
        (raising(GeneratorExit()), "Scripted.detect fails: GeneratorExit"),
        (raising(OSError("no model")), "Scripted.detect fails: OSError: no model"),
        (
            [{"nose": (10**400, 2, 1)}],
            "Scripted.detect, person 0: a value is missing, or",
        ),
        ([{"nose": repeat(1.0)}], "Scripted.detect, person 0: nose has 7 numbers or more"),
        (Unprintable(), "Scripted.detect returns a value of type Unprintable"),
        (raising(Unprintable()), "Scripted.detect fails: Unprintable: its text is unknown"),
        ([{"nose": (Unprintable(), 2, 1)}], "Scripted.detect fails: SystemExit: 0"),
        ([{Unprintable(): (1, 2, 1)}], "person 0: a value of type Unprintable is no point"),
        ([person(40)] * 5000, "Scripted.detect returns more than 200 people"),
        (repeat(person(40)), "Scripted.detect returns more than 200 people"),
    ],
)
def test_a_detector_that_fails_is_named(people: Any, expected: str) -> None:
    with pytest.raises(CardboxError, match=expected):
        detector(people).start()(IMAGE, 0)


def test_a_detector_that_stops_is_named() -> None:
    """StopIteration would end the images without a word."""

    class Stops(Scripted):
        def detect(self, image: np.ndarray) -> Sequence[Mapping[str, Any]]:
            raise StopIteration

    with pytest.raises(CardboxError, match=r"Stops.detect fails: StopIteration"):
        Detector(OwnModel.of(Stops(), "it")).start()(IMAGE, 0)


@pytest.mark.parametrize("ends", [SystemExit(3), RuntimeError("no weights")])
def test_a_detector_that_does_not_start_is_named(ends: BaseException) -> None:
    class Heavy(Scripted):
        def __init__(self) -> None:
            raise ends

    with pytest.raises(CardboxError, match=f"it does not start: {type(ends).__name__}"):
        Detector(OwnModel.of(Heavy, "it")).start()


def test_numbers_that_cannot_be_read_are_named() -> None:
    class Elsewhere:
        def __float__(self) -> float:
            raise RuntimeError("on the GPU")

    with pytest.raises(CardboxError, match=r"Scripted.detect, person 0: on the GPU"):
        detector([{"nose": (Elsewhere(), 1, 1)}]).start()(IMAGE, 0)


def test_a_detector_ends_no_process_but_its_own() -> None:
    class Ends(Scripted):
        def detect(self, image: np.ndarray) -> Sequence[Mapping[str, Any]]:
            if (copy := os.fork()) == 0:
                os._exit(4)
            os._exit(os.waitstatus_to_exitcode(os.waitpid(copy, 0)[1]))

    with pytest.raises(CardboxError, match=r"Ends.detect fails: SystemExit: 4"):
        Detector(OwnModel.of(Ends(), "it")).start()(IMAGE, 0)


def test_a_detector_that_changes_the_folder_moves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model").mkdir()

    class Wanders(Scripted):
        def __init__(self) -> None:
            super().__init__([person(40)])
            os.chdir(tmp_path / "model")

        def detect(self, image: np.ndarray) -> Sequence[Mapping[str, Any]]:
            os.chdir(tmp_path / "model")
            # That of a second camera, in another thread.
            with ThreadPoolExecutor() as pool:
                pool.submit(Detector(OwnModel.of(Wanders, "it")).start).result()
            return super().detect(image)

    Detector(OwnModel.of(Wanders, "it")).start()(IMAGE, 0)
    assert Path.cwd() == tmp_path


def test_a_detector_that_draws_leaves_the_image() -> None:
    class Draws(Scripted):
        def detect(self, image: np.ndarray) -> Sequence[Mapping[str, Any]]:
            image[:] = 255
            return super().detect(image)

    image = IMAGE.copy()
    Detector(OwnModel.of(Draws([person(40)]), "it")).start()(image, 0)
    assert np.array_equal(image, IMAGE)


def test_one_person_is_followed_whatever_the_order() -> None:
    # A person is known after five images.
    before = [[person(20), person(110)], *[[person(110), person(21)]] * 5]
    start = detector(*before, [person(110)], [person(110), person(25)]).start()
    columns = []
    for number in range(8):
        found = start(IMAGE, number * FRAME_NS)
        columns.append(None if found is None else float(np.nanmin(found.points_px[:, 0])))
    assert columns == [20.0, *[21.0] * 5, None, 25.0]
    assert start.missed == 1
    assert "follows the most certain one" in start.remark


def test_all_people_are_found_if_several_are_wanted() -> None:
    start = detector([person(20), {}, person(110)], [], people=3).start()
    assert len(start.all_in(0, IMAGE)) == 2
    assert start.all_in(FRAME_NS, IMAGE) == []
    assert start.missed == 1


def test_what_does_not_detect_is_refused() -> None:
    with pytest.raises(CardboxError, match=r"the detector int has no function detect\(image\)"):
        OwnModel.of(7, "the detector int")
