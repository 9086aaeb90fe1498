"""Tables of points: their rows, the camera's lens, and tables that are refused."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.image_points import COCO_NAMES, POINT_INDEX, ImagePoints
from cardbox_tracker.detectors.keypoint_json import LAYOUTS
from cardbox_tracker.detectors.point_table import GivenPoints, Image, PointTable, why_not

K = np.array([(500.0, 0.0, 320.0), (0.0, 510.0, 240.0), (0.0, 0.0, 1.0)])
PLAIN = Calibration(640, 480, K, np.zeros(5))
SIZE = (640, 480)
NONE = np.zeros((480, 640), np.uint8)
HEADER = "stamp_ns,joint,u,v,score"
LENSES = {
    "plumb_bob": [-0.2, 0.05, 0.001, 0.002, 0.0],
    "rational_polynomial": [0.1, 0.02, 0.001, 0.001, 0.0, 0.05, 0.01, 0.0],
    "equidistant": [0.02, -0.01, 0.003, -0.001],
}


def table(folder: Path, *rows: str, header: str = HEADER) -> PointTable:
    path = folder / "points.csv"
    path.write_text("\n".join([header, *rows, ""]))
    return PointTable(path)


def read(
    given: PointTable,
    camera: str | None = None,
    calibration: Calibration = PLAIN,
    size: tuple[int, int] = SIZE,
    tolerance_ns: int = 0,
) -> GivenPoints:
    return given.read(camera, SIZE).placed(calibration, size, tolerance_ns)


def test_points_are_those_of_the_stamp_at_the_working_size(tmp_path: Path) -> None:
    given = table(
        tmp_path,
        "5,nose,320,240,0.9",
        "5,left_knee,1,2,0.9",
        "5,left_wrist,nan,3,0",
        "5,right_wrist,3,3,0",
        "5,left_ear,,,",
        "7,nose,0,0,1",
    )
    found = read(given, size=(320, 240))
    first, second = found.at(Image(5), NONE), found.at(Image(7), NONE)
    assert first is not None and second is not None
    assert found.at(Image(6), NONE) is None
    # The centre of the first pixel is half a pixel inside the image.
    assert first.px[POINT_INDEX["nose"]] == pytest.approx((159.75, 119.75))
    assert first.scores.tolist() == [0.9, *[0.0] * 16]
    assert second.px[POINT_INDEX["nose"]] == pytest.approx((-0.25, -0.25))
    assert second.scores[POINT_INDEX["nose"]] == 1.0
    assert (found.images, found.used) == (3, 2)


@pytest.mark.parametrize("roll_rad", [0.0, 0.1])
@pytest.mark.parametrize("model", LENSES)
def test_points_go_where_the_lens_is_undone(tmp_path: Path, model: str, roll_rad: float) -> None:
    """A ray goes through the lens as OpenCV bends it, and comes back to the pinhole camera."""
    lens = np.array(LENSES[model])
    calibration = Calibration(640, 480, K, lens, model, roll_rad=roll_rad)
    rays = np.random.default_rng(0).uniform(-0.5, 0.5, (len(POINT_INDEX), 2))
    if model == "equidistant":
        bent = cv2.fisheye.distortPoints(rays[:, None], K, lens.reshape(4, 1))
    else:
        ahead, none = np.column_stack([rays, np.ones(len(rays))]), np.zeros(3)
        bent, _ = cv2.projectPoints(ahead, none, none, K, lens)
    rows = [
        f"5,{name},{u},{v},0.5"
        for name, (u, v) in zip(POINT_INDEX, bent.reshape(-1, 2).tolist(), strict=True)
    ]
    points = read(table(tmp_path, *rows), None, calibration, (320, 240)).at(Image(5), NONE)
    assert points is not None
    c, s = np.cos(roll_rad), np.sin(roll_rad)
    level = rays @ np.array([(c, s), (-s, c)])
    np.testing.assert_allclose(
        points.px, level * (250.0, 255.0) + (159.75, 119.75), atol=0.02, rtol=0
    )


def test_a_working_image_has_there_what_the_camera_s_image_has_at_the_point() -> None:
    calibration = Calibration(640, 480, K, np.array(LENSES["plumb_bob"]), roll_rad=0.1)
    rectifier = calibration.rectifier(640, 480)
    assert rectifier is not None
    for place in ((100.0, 90.0), (500.0, 400.0), (320.0, 60.0)):
        image = np.zeros((480, 640), np.uint8)
        cv2.circle(image, tuple(map(int, place)), 5, 255, -1)
        seen = np.argwhere(rectifier(image) > 127)[:, ::-1].mean(axis=0)
        px = calibration.rectified(np.array([place]), 640, 480)[0]
        np.testing.assert_allclose(px, seen, atol=0.5)


def test_each_camera_has_its_own_rows(tmp_path: Path) -> None:
    rows = "5,nose,10,20,0.9,left", "5,nose,30,40,0.9,right"
    given = table(tmp_path, *rows, header=f"{HEADER},camera")
    for camera, column in (("left", 10.0), ("right", 30.0)):
        points = read(given, camera).at(Image(5), NONE)
        assert points is not None
        assert points.px[POINT_INDEX["nose"], 0] == pytest.approx(column)
    assert read(given, "top").at(Image(5), NONE) is None


def test_a_table_of_a_spreadsheet_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    given = table(tmp_path, "5,nose,10,20,0.9", header=f"\ufeff{HEADER}")
    points = read(given).at(Image(5), NONE)
    assert points is not None
    assert points.px[POINT_INDEX["nose"], 0] == pytest.approx(10.0)


@pytest.mark.parametrize("between", [";", "\t"])
def test_a_table_of_a_spreadsheet_may_have_decimal_commas(tmp_path: Path, between: str) -> None:
    row = "5,nose,10.5,20,0.9".replace(",", between).replace(".", ",")
    given = table(tmp_path, row, header=HEADER.replace(",", between))
    points = read(given).at(Image(5), NONE)
    assert points is not None
    assert points.px[POINT_INDEX["nose"]] == pytest.approx([10.5, 20.0])


@pytest.mark.parametrize(
    ("header", "row", "camera", "words"),
    [
        ("stamp_ns,joint,u,v", "5,nose,1,2", None, "no column score"),
        ("", "", None, "no column stamp_ns, joint, u, v, score"),
        (HEADER, "5,nose,1,2,0.9", "left", "no column camera"),
        (HEADER.replace(",", " "), "5 nose 1 2 0.9", None, "separated by commas or semicolons"),
        (HEADER, "5,nose,one,2,0.9", None, "line 2, has a value that is no number .*one"),
        (HEADER, "5.5,nose,1,2,0.9", None, r"no number .*5\.5.*numbers in stamp_ns"),
        (HEADER, "5,nose,1", None, "no number"),
        (HEADER, "5,nose,nan,3,0.9", None, r"line 2: nose is at .*nan.* score 0 if the point is"),
        (HEADER, "5,nose,1,3,nan", None, "line 2: nose has the score nan"),
        (HEADER, "5,nose,1,3,87", None, "line 2: nose has the score 87; expected a chance"),
        (HEADER, f"5,{5000 * 'x'},1,3,87", None, r"line 2: x{9,999}\.\.\. has the score 87"),
        (HEADER, "5,left_knee,1,3000,0.9", None, "line 2: left_knee is at .*image of 640x480 px"),
        (HEADER, "5,nose,1,2,1\n5,nose,2,2,1", None, "line 3: stamp_ns 5 has nose again"),
        (
            HEADER,
            "5,nose,0.5,0.2,1\n5,left_eye,0.52,0.18,1\n5,left_hip,0.5,1.1,1",
            None,
            "line 2: all points .* shares of the image.* multiply columns by the width",
        ),
    ],
)
def test_a_table_that_is_none_is_refused(
    tmp_path: Path, header: str, row: str, camera: str | None, words: str
) -> None:
    with pytest.raises(CardboxError, match=words):
        table(tmp_path, row, header=header).read(camera, SIZE)


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(CardboxError, match=r"cannot read .*missing\.csv"):
        PointTable(tmp_path / "missing.csv").read(None)
    binary = tmp_path / "binary.csv"
    binary.write_bytes(b"\xff\xfe\x00stamp_ns")
    with pytest.raises(CardboxError, match=r"binary\.csv.*a CSV file in UTF-8"):
        PointTable(binary).read(None)


SIDES = ("left", 1.0), ("right", -1.0)


def person(column: float, row: float = 240.0) -> list[float]:
    """Return the points of COCO in a figure around a place, 200 px high, as JSON has them."""
    around = np.random.default_rng(0).uniform((-40, -100), (40, 100), (17, 2))
    places = around + np.array([column, row])
    return np.column_stack([places, np.full(17, 0.9)]).ravel().tolist()


def silhouette(column: int) -> np.ndarray:
    image = np.zeros((480, 640), np.uint8)
    image[130:350, column - 50 : column + 50] = 255
    return image


@pytest.mark.parametrize(("off_ns", "is_found"), [(1, True), (-49, True), (50, True), (51, False)])
def test_points_join_the_nearest_image_within_the_tolerance(
    tmp_path: Path, off_ns: int, is_found: bool
) -> None:
    given = table(tmp_path, f"{1000 + off_ns},nose,10,20,0.9", "1100,nose,99,20,0.9")
    found = read(given, tolerance_ns=50)
    points = found.at(Image(1000), NONE)
    assert (points is not None) == is_found
    if points is not None:
        assert points.px[0, 0] == pytest.approx(10.0)


def test_points_with_another_clock_are_said_with_a_stamp_of_each(tmp_path: Path) -> None:
    found = read(table(tmp_path, "5,nose,1,2,1", "9,nose,1,2,1"), tolerance_ns=16_000_000)
    for stamp_ns in (10**18, 2 * 10**18):
        assert found.at(Image(stamp_ns), NONE) is None
    assert "0 of 2 points of" in found.fault and "stamp_ns is 5 to 9" in found.fault
    assert f"that of the images {10**18} to {2 * 10**18}" in found.fault
    assert read(table(tmp_path, "5,nose,1,2,1")).fault == ""
    # It is said before an hour of tracking, if the clocks are apart.
    with pytest.raises(CardboxError, match=r"0 of 2 points .* fit an image: their stamp_ns is 5"):
        found.check_span(10**18, 2 * 10**18)
    found.check_span(0, 7)
    found.check_span(10**9, 10**10)


@pytest.mark.parametrize(
    ("column", "text"),
    [
        ("stamp_ns", "1.7e18"),
        ("stamp_us", "1700000000000000"),
        ("stamp_ms", "1700000000000.0"),
        ("stamp_s", "1700000000"),
        ("stamp", "1700000000.000000000"),
    ],
)
def test_stamps_may_have_other_units(tmp_path: Path, column: str, text: str) -> None:
    found = read(table(tmp_path, f"{text},nose,1,2,1", header=f"{column},joint,u,v,score"))
    assert found.persons(Image(1_700_000_000_000_000_000), 0)


@pytest.mark.parametrize("text", ["nan", "1e999999", "-1e30", "soon", ""])
def test_a_stamp_that_is_no_time_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(CardboxError, match=r"line 2, has a value .*numbers in stamp_ms"):
        read(table(tmp_path, f"{text},nose,1,2,1", header="stamp_ms,joint,u,v,score"))


def test_a_column_with_the_number_of_the_image_takes_the_place_of_stamps(tmp_path: Path) -> None:
    found = read(table(tmp_path, "0,nose,1,2,1", "2,nose,3,2,1", header="frame,joint,u,v,score"))
    seen = [found.at(Image(10**9 * number, number), NONE) for number in range(3)]
    assert [None if one is None else float(one.px[0, 0]) for one in seen] == [1.0, None, 3.0]
    assert found.at(Image(0, 7), NONE) is None and found.fault == ""
    found.restart()
    found.at(Image(0, 7), NONE)
    assert "frame is 0 to 2, that of the images 7 to 7" in found.fault


def test_of_several_people_the_one_in_the_silhouette_is_taken(tmp_path: Path) -> None:
    rows = [f"5,nose,{column},240,0.9,{who}" for column, who in ((100, "a"), (400, "b"))]
    found = read(table(tmp_path, *rows, header=f"{HEADER},person"))
    points = found.at(Image(5), silhouette(400))
    assert points is not None and points.px[0, 0] == pytest.approx(400.0)


@pytest.mark.parametrize(
    ("column", "row", "reason"),
    [
        (139.0, 240.0, "on the person only when they are mirrored"),
        (250.0, 240.0, "beside the person's silhouette; expected pixels of this camera's own"),
        (500.0, 240.0, "when columns and rows are exchanged; expected u, v"),
    ],
)
def test_points_beside_the_person_are_not_used_and_the_reason_is_said(
    tmp_path: Path, column: float, row: float, reason: str
) -> None:
    numbers = person(column, row)
    if "exchanged" in reason:
        numbers[0::3], numbers[1::3] = numbers[1::3], numbers[0::3]
    (tmp_path / "results.json").write_text(
        json.dumps([{"image_id": i, "keypoints": numbers} for i in range(3)])
    )
    found = read(PointTable(tmp_path / "results.json"))
    assert all(found.at(Image(0, number), silhouette(500)) is None for number in range(3))
    assert "used in 0 of 3 images" in found.fault and reason in found.fault
    assert "the points of 3 of 3 images are not used" in found.remark and reason in found.remark
    assert found.at(Image(0, 0), NONE) is not None  # an empty silhouette contradicts nothing


@pytest.mark.parametrize("people", [0, 2])
def test_exchanged_points_are_told_without_a_silhouette(tmp_path: Path, people: int) -> None:
    numbers = person(500, 240)
    for is_exchanged in (False, True):
        if is_exchanged:
            numbers[0::3], numbers[1::3] = numbers[1::3], numbers[0::3]
        entries = [{"image_id": i, "keypoints": numbers} for i in range(3)]
        (tmp_path / "results.json").write_text(json.dumps(entries))
        found = read(PointTable(tmp_path / "results.json", people))
        for number in range(3):
            image = Image(0, number)
            assert found.all_in(image) if people else found.at(image, NONE)
        assert ("columns and rows are exchanged" in found.remark) == is_exchanged


def test_exchanged_points_in_the_middle_of_the_person_are_told() -> None:
    """The person stands at (240, 240), where columns and rows are alike."""
    shown = np.zeros((480, 640), np.uint8)
    shown[130:350, 170:310] = 255
    at = {"shoulder": (18.0, 180.0), "hip": (12.0, 240.0), "wrist": (50.0, 230.0)}
    joints = {f"{s}_{n}": (240.0 + k * u, v, 0.9) for n, (u, v) in at.items() for s, k in SIDES}
    person = ImagePoints.of(joints)
    assert why_not(shown, person) == ""
    assert "columns and rows are exchanged" in why_not(
        shown, ImagePoints(person.px[:, ::-1], person.scores)
    )
    # Somebody who lies is as wide as that.
    assert why_not(shown.T.copy(), ImagePoints(person.px[:, ::-1], person.scores)) == ""


def test_wrong_points_are_not_used_where_they_lie_on_the_person_by_chance(tmp_path: Path) -> None:
    rows = [f"{i},nose,{500 if i in (12, 15) else 250},240,0.9" for i in range(40)]
    found = read(table(tmp_path, *rows))
    assert all(found.at(Image(i), silhouette(500)) is None for i in range(40))
    # Those of the tracked person are used though somebody else's are in between.
    rows = [f"{i},nose,{250 if 5 < i < 15 else 500},240,0.9" for i in range(40)]
    found = read(table(tmp_path, *rows))
    for i in range(40):
        found.at(Image(i), silhouette(500))
    assert (found.used, found.beside) == (31, 9)


def openpose(folder: Path, number: int, *people: list[float], **more: list[float]) -> None:
    folder.mkdir(exist_ok=True)
    content = {"people": [{"pose_keypoints_2d": one, **more} for one in people]}
    (folder / f"film2_{number:012d}_keypoints.json").write_text(json.dumps(content))


@pytest.mark.parametrize("count", LAYOUTS)
def test_openpose_files_name_points_by_their_number(tmp_path: Path, count: int) -> None:
    flat = [value for i in range(count) for value in (i + 1.0, 2.0 * i, 0.8)]
    if count == 25:
        # Eyes and ears are near the nose.
        flat[0:2] = 17.0, 32.0
    openpose(tmp_path / "points", 12, flat)
    openpose(tmp_path / "points", 13)
    points = read(PointTable(tmp_path / "points")).at(Image(0, 12), NONE)
    assert points is not None
    for name, index in POINT_INDEX.items():
        number = {
            133: {"left_index": 96, "right_little_finger": 129},
            136: {"left_index": 99, "right_little_finger": 132},
        }.get(count, {}).get(name)
        if name in COCO_NAMES[:13]:
            number = LAYOUTS[count].index(name)
        if number:
            assert points.px[index] == pytest.approx((number + 1.0, 2.0 * number)), name
    # OpenPose numbers the right arm first.
    expected = {17: 9, 18: 7, 25: 7, 26: 9, 133: 9, 136: 9}[count]
    assert points.px[POINT_INDEX["left_wrist"], 0] == pytest.approx(expected + 1.0)
    is_hip = points.px[POINT_INDEX["right_hip"], 0] - 1.0
    assert is_hip == {17: 12, 18: 8, 25: 9, 26: 12, 133: 12, 136: 12}[count]


def test_25_points_with_the_face_first_are_body_25b(tmp_path: Path) -> None:
    """OpenPose has two orders of 25 points, which its files do not tell apart."""
    names = (*COCO_NAMES, *("neck", "head"), *["foot"] * 6)
    face = {"nose": (300, 100), "left_eye": (305, 95), "right_eye": (295, 95)}
    flat = [
        value
        for i, name in enumerate(names)
        for value in (*face.get(name, (300 + 3 * i, 200 + 8 * i)), 0.0 if "ear" in name else 0.9)
    ]
    openpose(tmp_path / "points", 0, flat)
    points = read(PointTable(tmp_path / "points")).at(Image(0, 0), NONE)
    assert points is not None
    for name in ("left_shoulder", "right_wrist", "left_hip"):
        i = COCO_NAMES.index(name)
        assert points.px[POINT_INDEX[name]] == pytest.approx((300 + 3 * i, 200 + 8 * i))


def test_openpose_hands_give_the_knuckles(tmp_path: Path) -> None:
    hand = [value for i in range(21) for value in (300.0 + i, 200.0, 0.7)]
    openpose(tmp_path / "points", 0, person(320), hand_left_keypoints_2d=hand)
    points = read(PointTable(tmp_path / "points")).at(Image(0, 0), NONE)
    assert points is not None
    assert points.px[POINT_INDEX["left_index"], 0] == pytest.approx(305.0)
    assert points.px[POINT_INDEX["left_little_finger"], 0] == pytest.approx(317.0)
    assert points.scores[POINT_INDEX["right_index"]] == 0.0


def test_hidden_files_of_macos_beside_those_of_openpose_are_passed_over(tmp_path: Path) -> None:
    folder = tmp_path / "points"
    openpose(folder, 3, person(320))
    (folder / "._film2_000000000003_keypoints.json").write_bytes(b"\0\5\26\7" + bytes(30))
    assert read(PointTable(folder)).at(Image(0, 3), NONE) is not None


def annotations(flags: int) -> dict[str, object]:
    keypoints = [flags if i % 3 == 2 else value for i, value in enumerate(person(320))]
    return {
        "images": [{"id": 77, "file_name": "left/img_0004.png"}],
        "annotations": [{"image_id": 77, "category_id": 1, "keypoints": keypoints}],
    }


def test_annotations_of_coco_join_by_the_name_of_the_file(tmp_path: Path) -> None:
    file = tmp_path / "annotations.json"
    for flags, score in ((2, 1.0), (1, 0.5)):
        file.write_text(json.dumps(annotations(flags)))
        found = read(PointTable(file))
        points = found.at(Image(0, 9, "img_0004.png"), NONE)
        assert points is not None and points.scores[0] == score
        assert found.at(Image(0, 4, "img_0005.png"), NONE) is None
        # Images of a video have no names.
        assert found.at(Image(0, 4), NONE) is not None
    found.restart()
    found.at(Image(0, 9, "other.png"), NONE)
    assert "'img_0004.png', that of the images 'other.png'" in found.fault


@pytest.mark.parametrize("style", ["left_elbow", "LElbow", "elbow-l", "Left Elbow"])
def test_the_order_that_a_file_declares_counts(tmp_path: Path, style: str) -> None:
    def named(name: str) -> str:
        side, _, part = name.rpartition("_")
        if not side or style == "left_elbow":
            return name
        return {
            "LElbow": f"{side[0].upper()}{part.title()}",
            "elbow-l": f"{part}-{side[0]}",
            "Left Elbow": f"{side} {part}".title(),
        }[style]

    rng = np.random.default_rng(3)
    order = [*rng.permutation(COCO_NAMES), "tail"]
    rows = {name: [100.0 + 9 * i, 200.0, 2] for i, name in enumerate(COCO_NAMES)}
    rows["tail"] = [5.0, 5.0, 2]
    content = annotations(2)
    content["categories"] = [
        {"id": 1, "keypoints": [*map(named, order)]},
        {"id": 2, "keypoints": ["nose", "tail"]},
        {"id": 3, "name": "chair"},
    ]
    content["annotations"] = [
        {
            "image_id": 77,
            "category_id": kind,
            "keypoints": [v for name in names for v in rows[name]],
        }
        for kind, names in ((1, order), (2, ("nose", "tail")), (3, ()))
    ]
    (tmp_path / "points.json").write_text(json.dumps(content))
    (points,) = read(PointTable(tmp_path / "points.json")).all_in(Image(0, 0, "img_0004.png"))
    assert points.px[:13, 0].tolist() == [100.0 + 9 * i for i in range(13)]
    assert points.legs is not None and points.legs.px[0, 0] == 100.0 + 9 * 13


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("is_named", [False, True])
def test_mmpose_numbers_the_images_of_a_film(tmp_path: Path, first: int, is_named: bool) -> None:
    flat = person(320)
    order = [*range(17)][::-1] if is_named else range(17)
    one = {
        "keypoints": [flat[3 * i : 3 * i + 2] for i in order],
        "keypoint_scores": [flat[3 * i + 2] for i in order],
    }
    frames = [{"frame_id": first, "instances": []}, {"frame_id": first + 1, "instances": [one]}]
    names = {str(n): COCO_NAMES[i] for n, i in enumerate(order)}
    meta = {"meta_info": {"keypoint_id2name": names}, "instance_info": frames}
    (tmp_path / "points.json").write_text(json.dumps(meta if is_named else frames))
    found = read(PointTable(tmp_path / "points.json"))
    assert found.all_in(Image(0, 0)) == []
    (points,) = found.all_in(Image(0, 1))
    np.testing.assert_allclose(points.px[:13], np.reshape(flat, (-1, 3))[:13, :2])


def test_mmpose_writes_a_file_for_each_image_of_a_folder(tmp_path: Path) -> None:
    rows = np.reshape(person(320), (-1, 3))
    one = {"keypoints": rows[:, :2].tolist(), "keypoint_scores": rows[:, 2].tolist()}
    (tmp_path / "img_0.json").write_text("[]")
    (tmp_path / "img_1.json").write_text(json.dumps([one]))
    (points,) = read(PointTable(tmp_path)).all_in(Image(0, 1))
    np.testing.assert_allclose(points.px[:13], rows[:13, :2])


@pytest.mark.parametrize("score", [1.407, 5.5, 10.0])
@pytest.mark.parametrize("is_table", [False, True])
def test_a_score_above_1_counts_as_1_and_is_told(
    tmp_path: Path, score: float, is_table: bool
) -> None:
    if is_table:
        found = read(table(tmp_path, f"5,nose,1,2,{score}", "5,left_eye,1,2,0.5"))
    else:
        flat = person(320)
        flat[2], flat[5], flat[8] = score, 0.5, -0.1
        openpose(tmp_path / "points", 5, flat)
        found = read(PointTable(tmp_path / "points"))
    (points,) = found.all_in(Image(5, 5))
    assert points.scores[:3].tolist() == [1.0, 0.5, 0.0]
    assert f"reach {score:g}; those above 1 count as 1" in found.remark


@pytest.mark.parametrize("nobody", [{}, None, [], {"pose_keypoints_2d": []}])
def test_people_without_points_are_nobody(tmp_path: Path, nobody: object) -> None:
    openpose(tmp_path / "points", 0, person(320))
    (tmp_path / "points" / "film2_000000000001.json").write_text(json.dumps({"people": [nobody]}))
    (tmp_path / "points" / "film2_000000000002.json").write_text(json.dumps({"people": None}))
    (tmp_path / "points" / "film2_000000000003.json").write_text("{}")
    found = read(PointTable(tmp_path / "points"))
    assert [len(found.all_in(Image(0, i))) for i in range(4)] == [1, 0, 0, 0]
    entries = [{"image_id": 0, "keypoints": person(320)}, {"image_id": 1, "keypoints": None}]
    (tmp_path / "points.json").write_text(json.dumps(entries))
    found = read(PointTable(tmp_path / "points.json"))
    assert [len(found.all_in(Image(0, i))) for i in range(2)] == [1, 0]


@pytest.mark.parametrize("count", [200, 201])
@pytest.mark.parametrize("name", ["a.json", "a.csv", "people/f_7_keypoints.json"])
def test_a_crowd_in_one_image_is_refused(tmp_path: Path, name: str, count: int) -> None:
    file, points = tmp_path / name, [30.0, 20.0, 0.9] * 17
    file.parent.mkdir(exist_ok=True)
    if file.suffix == ".csv":
        rows = (f"7,nose,30,20,0.9,{person}\n" for person in range(count))
        file.write_text(f"frame,joint,u,v,score,person\n{''.join(rows)}")
    elif name == "a.json":
        file.write_text(json.dumps([{"image_id": 7, "keypoints": points}] * count))
    else:
        file.write_text(json.dumps({"people": [{"pose_keypoints_2d": points}] * count}))
    read = partial(PointTable(file if name.startswith("a") else file.parent).read, None, (64, 48))
    if count == 200:
        assert read().kind == "frame"
    else:
        with pytest.raises(CardboxError, match="image 7 has more than 200 people; expected"):
            read()


def test_the_number_of_an_image_is_the_one_that_changes(tmp_path: Path) -> None:
    for number in range(3):
        content = {"people": [{"pose_keypoints_2d": person(100.0 * (number + 1))}]}
        (tmp_path / f"{number:06d}_04.json").write_text(json.dumps(content))
    found = read(PointTable(tmp_path))
    for number in range(3):
        (points,) = found.all_in(Image(0, number))
        assert points.px[0, 0] == pytest.approx(100.0 * (number + 1), abs=20)


def test_each_camera_has_its_folder_or_file(tmp_path: Path) -> None:
    openpose(tmp_path / "cam0", 0, person(100))
    (tmp_path / "cam1.json").write_text(json.dumps([{"image_id": 0, "keypoints": person(500)}]))
    for camera, column in (("cam0", 100), ("cam1", 500)):
        points = read(PointTable(tmp_path), camera).at(Image(0, 0), NONE)
        assert isinstance(points, ImagePoints)
        assert np.nanmean(points.px[:, 0]) == pytest.approx(column, abs=20)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("{", "expected JSON"),
        ("[" * 100_000, "expected JSON"),
        ("{}", "has no 'annotations'"),
        ('[{"image_id": 1}]', "has no point of anybody"),
        ('{"annotations": [], "categories": [{"id": 1, "keypoints": ["a", "b"]}]}', "'a, b'; exp"),
        ('[{"frame_id": "a", "instances": []}]', "no frame_id"),
        ("[5]", "entry 0 has no image_id"),
        (
            '[{"image_id": 1, "keypoints": [1, 2]}]',
            "entry 0, has 2 numbers; .* 17, 18, 25, 26, 133 or",
        ),
        ('[{"image_id": 1, "keypoints": 5}]', "entry 0, has no numbers"),
        ('[{"image_id": 1, "keypoints": KEYPOINTS}]', "entry 0, has a value that is no number"),
        ('[{"image_id": 1, "keypoints": FAR}]', "entry 0: nose is at .* px; expected a place"),
        ('[{"image_id": 1, "keypoints": NAN}]', "entry 0: nose has the score nan"),
        ('[{"image_id": 1, "keypoints": SHARES}]', "entry 0: all points .* shares of the image"),
        ('{"images": null, "annotations": []}', "has no point of anybody"),
    ],
)
def test_json_that_has_no_points_is_refused(tmp_path: Path, content: str, words: str) -> None:
    for name, value in (
        ("KEYPOINTS", [[]] * 51),
        ("FAR", [1e9, 1, 1] * 17),
        ("NAN", [1, 1, float("nan")] * 17),
        ("SHARES", [0.5, 0.4, 1] * 17),
    ):
        content = content.replace(name, json.dumps(value))
    (tmp_path / "points.json").write_text(content)
    with pytest.raises(CardboxError, match=words):
        PointTable(tmp_path / "points.json").read(None, SIZE)


def test_a_folder_without_files_of_openpose_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CardboxError, match="has no JSON files; expected those of OpenPose"):
        PointTable(tmp_path).read(None)
    (tmp_path / "points.json").write_text('{"version": 1}')
    with pytest.raises(CardboxError, match="has no number; expected that of the image"):
        PointTable(tmp_path).read(None)
    (tmp_path / "points.json").rename(tmp_path / "points_1.json")
    with pytest.raises(CardboxError, match="has no list 'people'"):
        PointTable(tmp_path).read(None)


@pytest.mark.parametrize("first", [0, 1, 2])
def test_numbers_of_images_that_begin_with_1_are_told(tmp_path: Path, first: int) -> None:
    """Programs that take images out of a video often count them from 1."""
    for number in range(first, 5):
        openpose(tmp_path / "points", number, [10.0, 20.0, 0.9] * 17)
    found = read(PointTable(tmp_path / "points"))
    found.all_in(Image(0, 0))
    assert ("numbered from 1 on" in found.remark) == (first == 1)


def test_a_table_may_spell_joints_in_other_ways_but_must_know_one(tmp_path: Path) -> None:
    found = read(table(tmp_path, "5,LShoulder,1,2,1", "5,Right Shoulder,3,4,1", "5,tail,5,6,1"))
    (points,) = found.all_in(Image(5, 5))
    assert points.px[POINT_INDEX["left_shoulder"]].tolist() == [1.0, 2.0]
    assert points.px[POINT_INDEX["right_shoulder"]].tolist() == [3.0, 4.0]
    with pytest.raises(CardboxError, match="names its points 'hombro, tail'; expected"):
        read(table(tmp_path, "5,hombro,1,2,1", "5,tail,5,6,1"))
    with pytest.raises(CardboxError, match="line 2, has a value that is no number"):
        read(table(tmp_path, "5"))
