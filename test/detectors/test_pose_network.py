"""The geometry around the pose networks, and the networks themselves where they are installed."""

from __future__ import annotations

import os

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors import pose_network
from cardbox_tracker.detectors.detector import PersonDetector
from cardbox_tracker.detectors.model_files import installed_models
from cardbox_tracker.detectors.pose_network import LANDMARKS, Detection, PoseNetwork, Square


def test_a_square_that_is_not_turned_keeps_the_axes_of_the_image() -> None:
    square = Square(100.0, 50.0, 40.0, 0.0)
    points = square.to_image(np.array([[0.5, 0.5], [0.0, 0.0], [1.0, 0.5]]))
    np.testing.assert_allclose(points, [[100.0, 50.0], [80.0, 30.0], [120.0, 50.0]])


def test_a_square_turned_by_a_quarter_has_its_right_side_below() -> None:
    square = Square(100.0, 50.0, 40.0, np.pi / 2)
    np.testing.assert_allclose(square.to_image(np.array([[1.0, 0.5]])), [[100.0, 70.0]], atol=1e-9)


@given(
    angle=st.floats(-3.1, 3.1),
    reach=st.floats(5.0, 200.0),
    u=st.floats(-50.0, 400.0),
    v=st.floats(-50.0, 400.0),
)
def test_the_square_around_a_person_points_to_the_rim(
    angle: float, reach: float, u: float, v: float
) -> None:
    centre = np.array([u, v])
    rim = centre + reach * np.array([np.sin(angle), -np.cos(angle)])
    square = pose_network._square_of(centre, rim)
    # The rim lies above the centre, at 0.4 of the side: the circle fills 1 / 1.25 of the square.
    np.testing.assert_allclose(square.to_image(np.array([[0.5, 0.1]]))[0], rim, atol=1e-6)


def test_the_detector_has_two_anchors_in_the_first_cell() -> None:
    anchors = pose_network._anchors()
    assert anchors.shape == (2254, 2)
    np.testing.assert_allclose(anchors[:3], [[4 / 224, 4 / 224]] * 2 + [[12 / 224, 4 / 224]])


def test_overlapping_detections_are_averaged_by_their_scores() -> None:
    one, other, far = (np.full(12, value) for value in (0.5, 0.52, 0.9))
    for row in (one, other, far):
        row[2:4] = 0.2
    merged, second = pose_network._merged(np.array([one, other, far]), np.array([0.9, 0.6, 0.8]))
    assert second[0] == 0.9
    assert merged[0] == pytest.approx((0.9 * 0.5 + 0.6 * 0.52) / 1.5)


def test_a_point_moves_to_the_centroid_of_its_heat() -> None:
    heat = np.full((64, 64, 1), -60.0)
    heat[20, 30:32] = np.log(0.6 / 0.4)
    refined = pose_network._refined(np.array([[29.2 / 64, 20.5 / 64]]), heat)
    np.testing.assert_allclose(refined, [[30.5 / 64, 20.0 / 64]])


def test_a_point_without_heat_stays() -> None:
    point = np.array([[0.4, 0.6]])
    np.testing.assert_array_equal(pose_network._refined(point, np.full((64, 64, 1), -60.0)), point)


def test_a_point_outside_of_the_heat_map_stays() -> None:
    point = np.array([[1.2, -0.1]])
    np.testing.assert_array_equal(pose_network._refined(point, np.ones((64, 64, 1))), point)


def test_a_mask_lies_where_its_square_is() -> None:
    logits = np.full((256, 256), 60.0)
    mask = pose_network._mask_in_image(logits, Square(60.0, 40.0, 20.0, 0.0), (100, 120))
    assert mask.shape == (100, 120)
    assert mask[40, 60] == 255 and mask[40, 75] == 0 and mask[25, 60] == 0


def test_a_file_that_is_no_network_is_refused(tmp_path: object) -> None:
    pytest.importorskip("ai_edge_litert", reason="ai-edge-litert is not installed")
    from pathlib import Path

    path = Path(str(tmp_path)) / "network.tflite"
    path.write_bytes(b"nothing")
    with pytest.raises(CardboxError, match=r"network\.tflite.*detector --install"):
        PoseNetwork(path, path)


def test_loading_leaves_the_terminal_to_us(capfd: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("ai_edge_litert", reason="ai-edge-litert is not installed")
    try:
        models = installed_models()
    except CardboxError as error:
        pytest.skip(str(error))
    PoseNetwork(*models)
    os.write(2, b"ours")
    assert capfd.readouterr() == ("", "ours")


@pytest.fixture(scope="module")
def network() -> PoseNetwork:
    pytest.importorskip("ai_edge_litert", reason="ai-edge-litert is not installed")
    try:
        return PoseNetwork(*installed_models())
    except CardboxError as error:
        pytest.skip(str(error))


def test_nobody_is_found_in_an_empty_image(network: PoseNetwork) -> None:
    network.forget()
    assert network(np.full((240, 320, 3), 120, np.uint8)) is None


@pytest.mark.parametrize("shape", [(1, 1, 3), (7, 5, 3), (480, 64, 3)])
def test_images_of_odd_sizes_are_searched(network: PoseNetwork, shape: tuple[int, ...]) -> None:
    network.forget()
    found = network(np.zeros(shape, np.uint8))
    assert found is None or isinstance(found, Detection)


RED, BLUE, GREEN = (40, 40, 220), (220, 60, 40), (40, 200, 60)


class SeveralPeople(PoseNetwork):
    """A network before people at columns in clothes of one colour, whom it misses at times."""

    def __init__(self, *people: tuple[float, tuple[int, int, int]]) -> None:
        self.people, self.misses, self.searched = list(people), False, 0
        self.forget()

    def _people(self, image: np.ndarray) -> list[Square]:
        self.searched += 1
        self.several += len(self.people) > 1
        return [Square(column, 50.0, 60.0, 0.0) for column, _ in self.people]

    def located(
        self, image: np.ndarray, square: Square, others: NDArray[np.uint8] | None = None
    ) -> tuple[Detection, Square] | None:
        columns = [c for c, _ in self.people if abs(c - square.u) < 30.0 and not self.misses]
        if not columns:
            return None
        column = min(columns, key=lambda one: abs(one - square.u))
        points = np.tile([column, 50.0], (len(LANDMARKS), 1))
        for side, sign in (("left", 1.0), ("right", -1.0)):
            points[LANDMARKS.index(f"{side}_shoulder")] += sign * 8.0, -20.0
            points[LANDMARKS.index(f"{side}_hip")] += sign * 6.0, 10.0
        mask = np.full(image.shape[:2], 255, np.uint8)
        found = Detection(points, np.ones(len(LANDMARKS)), mask)
        return found, Square(column, 50.0, 60.0, 0.0)


def columns_of(network: SeveralPeople, images: int) -> list[float]:
    image = np.zeros((100, 200, 3), np.uint8)
    for column, colour in reversed(network.people):
        image[:, int(column) - 15 : int(column) + 15] = colour
    found = [network(image) for _ in range(images)]
    return [-1.0 if one is None else float(one.points_px[0, 0]) for one in found]


def test_the_most_certain_one_is_followed_and_nobody_else() -> None:
    network = SeveralPeople((40.0, BLUE), (120.0, RED))
    assert columns_of(network, 6) == [40.0] * 6
    # The person leaves; others are there, one of them in the same place.
    network.people = [(120.0, RED), (45.0, GREEN)]
    assert columns_of(network, 60)[2:] == [-1.0] * 58
    # The person comes back elsewhere, which the clothes tell.
    network.people.append((170.0, BLUE))
    assert columns_of(network, 2) == [170.0] * 2
    # A cut: no person moves so far within an image, whatever they wear.
    network.people = [(20.0, BLUE)]
    assert columns_of(network, 3) == [-1.0] * 3
    # A cut that is known begins anew, and people who were counted remain so.
    several = network.several
    PersonDetector(network).start_anew()
    assert columns_of(network, 3) == [20.0] * 3
    assert network.several == several > 0


def test_somebody_who_steps_before_the_person_is_not_followed() -> None:
    network = SeveralPeople((60.0, BLUE), (150.0, RED))
    assert columns_of(network, 6) == [60.0] * 6
    # The square of the person shows who is in front; the other one stands beside them.
    network.people = [(62.0, RED), (150.0, GREEN)]
    assert columns_of(network, 10)[3:] == [-1.0] * 7
    network.people = [(66.0, RED), (50.0, BLUE)]
    assert columns_of(network, 3) == [50.0] * 3
    # Nobody who is hidden for longer is mistaken for the one who hides them.
    network.people = [(60.0, RED)]
    assert columns_of(network, 10)[3:] == [-1.0] * 7


def test_somebody_who_is_alone_may_hold_something_before_the_chest() -> None:
    network = SeveralPeople((60.0, BLUE))
    columns_of(network, 6)
    network.people = [(62.0, RED)]
    assert columns_of(network, 10) == [62.0] * 10


def test_several_people_are_noticed_while_one_is_followed() -> None:
    network = SeveralPeople((120.0, RED))
    detector = PersonDetector(network)
    columns_of(network, 25)
    assert detector.remark == "" and network.searched == 1
    network.people.append((30.0, BLUE))
    columns_of(network, 10)
    assert "sees several people and follows the most certain one; --person" in detector.remark
    assert network.searched == 2
