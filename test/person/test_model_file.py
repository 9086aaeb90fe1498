"""The YAML file of a body: what is written is read back, and what is wrong is named."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.common.errors import BodyModelError
from cardbox_tracker.person import model_file
from cardbox_tracker.person.model import BodyModel, CameraPose, Person, Placement
from cardbox_tracker.person.model_file import (
    dumps_body_model,
    load_body_model,
    loads_body_model,
    save_body_model,
)
from cardbox_tracker.person.sizes import DEFAULT_SIZES, SIZE_LIMITS

MODEL = BodyModel.of(
    sizes=DEFAULT_SIZES * 1.07,
    distance_m=2.34,
    hip_height_m=-0.61,
    lateral_m=0.12,
    camera_pitch_rad=0.05,
    side_turn="right",
)
TEXT = dumps_body_model(BodyModel())


def replaced(old: str, new: str) -> str:
    """``TEXT`` with the line that begins with ``old`` replaced by ``new``."""
    lines = TEXT.splitlines()
    found = [i for i, line in enumerate(lines) if line.strip().startswith(old)]
    assert len(found) == 1
    lines[found[0]] = new
    return "\n".join(lines)


@given(
    st.lists(st.floats(0, 1), min_size=18, max_size=18),
    st.floats(0.3, 20),
    st.floats(-5, 5),
    st.floats(-5, 5),
    st.floats(-1.4, 1.4),
    st.sampled_from(["left", "right"]),
)
def test_any_body_is_read_back_to_the_last_bit(
    share: list[float], distance: float, height: float, lateral: float, pitch: float, turn: str
) -> None:
    low, high = SIZE_LIMITS.T
    sizes = np.clip(low + np.array(share) * (high - low), low, high)
    model = BodyModel(Person(sizes), Placement(distance, height, lateral), CameraPose(pitch), turn)
    assert loads_body_model(dumps_body_model(model)) == model


@pytest.mark.parametrize("name", ["lateral_m", "camera_pitch_rad", "hip_height_m"])
@pytest.mark.parametrize("value", [1e-05, -2e-17])
def test_a_body_with_a_tiny_value_is_read_back(name: str, value: float) -> None:
    model = BodyModel.of(**{name: value})
    assert loads_body_model(dumps_body_model(model)) == model


def test_a_body_written_to_a_file_is_read_back(tmp_path: Path) -> None:
    path = tmp_path / "body.yaml"
    save_body_model(MODEL, path)
    assert load_body_model(path) == MODEL
    assert load_body_model(str(path)) == MODEL
    assert path.read_text() == dumps_body_model(MODEL)
    # Others than the writer may read it.
    assert path.stat().st_mode & 0o777 == 0o644


def test_the_file_explains_itself() -> None:
    lines = TEXT.splitlines()
    assert "units: {length: m, angle: rad}" in lines
    assert "  upper_arm_length: 0.27  # shoulder joint to elbow joint" in lines


def test_whole_numbers_are_numbers_too() -> None:
    assert loads_body_model(replaced("distance_m", "distance_m: 3")).placement.distance_m == 3.0


@pytest.mark.parametrize("name", ["version", "stamp_ns"])
@pytest.mark.parametrize("value", [float("nan"), "new"])
def test_a_version_is_a_whole_number(name: str, value: object) -> None:
    with pytest.raises(BodyModelError, match=f"{name} is .*; expected a whole number"):
        BodyModel().with_values(**{name: value})


@pytest.mark.parametrize("name", ["pitch_stddev_rad", "height_stddev_m", "distance_m", "unknown"])
@pytest.mark.parametrize("value", [float("nan"), -1.0, 1e300, None, len])
def test_a_number_is_one_within_its_limits(name: str, value: object) -> None:
    with pytest.raises(BodyModelError, match=f"{name} .*; expected"):
        BodyModel().with_values(**{name: value})


FOREARM = "forearm_length:"


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (TEXT + "shoe_size: 44\n", "'shoe_size'"),
        (TEXT + "  shoe_size: 44\n", "'sizes.shoe_size'"),
        (replaced("distance_m:", ""), "'distance_m'"),
        (replaced("side_turn:", ""), "'side_turn'"),
        (replaced("units:", ""), "'units'"),
        (replaced(FOREARM, ""), "'sizes.forearm_length'"),
        (replaced("units:", "units: {length: m}"), "'units.angle'"),
        (replaced("units:", "units: {length: cm, angle: rad}"), "units.length is 'cm'"),
        (replaced("units:", "units: {length: m, angle: deg}"), "units.angle is 'deg'"),
        (replaced("units:", "units: m"), "units is 'm'"),
        (replaced("format:", "format: cardbox_body_model/9"), "format is 'cardbox_body_model/9'"),
        (replaced(FOREARM, "  forearm_length: -0.36"), "forearm_length is -0.36"),
        (replaced(FOREARM, "  forearm_length: 0"), "forearm_length is 0 m"),
        (replaced(FOREARM, "  forearm_length: .nan"), "forearm_length is nan"),
        (replaced(FOREARM, "  forearm_length: .inf"), "forearm_length is inf"),
        (replaced(FOREARM, "  forearm_length: 27"), "forearm_length is 27 m.*in centimetres"),
        (replaced(FOREARM, "  forearm_length: 360"), "forearm_length is 360 m.*in millimetres"),
        (replaced(FOREARM, "  forearm_length: long"), "'sizes.forearm_length' is 'long'"),
        (replaced(FOREARM, "  forearm_length: 27 cm"), "'sizes.forearm_length' is '27 cm'"),
        (replaced(FOREARM, "  forearm_length:"), "'sizes.forearm_length' is None"),
        (replaced(FOREARM, "  forearm_length: yes"), "'sizes.forearm_length' is True"),
        (replaced(FOREARM, "  forearm_length: [0.36]"), r"'sizes.forearm_length' is \[0.36\]"),
        (replaced("distance_m:", "distance_m: 200"), "distance_m is 200 m.*in centimetres"),
        (replaced("distance_m:", "distance_m: -2"), "distance_m is -2"),
        (replaced("camera_pitch_rad:", "camera_pitch_rad: 10"), "camera_pitch_rad is 10 rad"),
        (replaced("side_turn:", "side_turn: back"), "side_turn is 'back'"),
        (replaced("side_turn:", "side_turn: [left]"), r"side_turn is \['left'\]"),
        (TEXT + "  forearm_length: 0.3\n", "'forearm_length'.* twice"),
        (TEXT + "distance_m: 3.0\n", "'distance_m'.* twice"),
        (TEXT.split("sizes:")[0] + "sizes: small\n", "sizes is 'small'"),
        (TEXT.split("sizes:")[0] + "sizes:\n", "sizes is None"),
        ("a: [1, 2", "YAML"),
        ("\x00", "YAML"),
        ("", "mapping"),
        ("- 1\n- 2\n", "mapping"),
        ("!!python/object/apply:os.getcwd []", "tag:yaml.org,2002:python/"),
        ("{}", "'format'"),
    ],
)
def test_what_is_wrong_is_named(text: str, named: str) -> None:
    with pytest.raises(BodyModelError, match=f"^/some/where: .*{named}|^/some/where {named}"):
        loads_body_model(text, source="/some/where")


@pytest.mark.parametrize(
    "text",
    [
        TEXT + "? [1, 2]\n: 3\n",
        TEXT + "? {a: 1}\n: 3\n",
        TEXT + "1: 2\n",
        TEXT + "<<: 5\n",
        "a: &a [*a]",
        replaced(FOREARM, "  forearm_length: 2001-99-99"),
        replaced(FOREARM, "  forearm_length: " + "9" * 400),
    ],
)
def test_strange_yaml_is_refused_in_words(text: str) -> None:
    with pytest.raises(BodyModelError):
        loads_body_model(text)


@given(st.text(max_size=60))
def test_any_text_is_refused_in_words(text: str) -> None:
    with pytest.raises(BodyModelError):
        loads_body_model(text)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(BodyModelError, match=r"none\.yaml: No such"):
        load_body_model(tmp_path / "none.yaml")


def test_a_folder_and_a_binary_file_are_no_body(tmp_path: Path) -> None:
    with pytest.raises(BodyModelError, match="directory"):
        load_body_model(tmp_path)
    (tmp_path / "body.yaml").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(BodyModelError, match=r"body\.yaml.* text"):
        load_body_model(tmp_path / "body.yaml")


def test_the_error_of_a_file_names_its_path(tmp_path: Path) -> None:
    path = tmp_path / "body.yaml"
    path.write_text(replaced("distance_m:", ""))
    with pytest.raises(BodyModelError, match=rf"^{path}: .*'distance_m'"):
        load_body_model(path)


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_write_that_fails_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    path = tmp_path / "body.yaml"
    save_body_model(MODEL, path)

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(model_file.os, call, full)
    with pytest.raises(BodyModelError, match=r"body\.yaml: No space left"):
        save_body_model(BodyModel(), path)
    monkeypatch.undo()
    assert load_body_model(path) == MODEL
    assert os.listdir(tmp_path) == ["body.yaml"]


def test_the_new_file_takes_the_old_ones_place_whole(tmp_path: Path) -> None:
    path = tmp_path / "body.yaml"
    save_body_model(MODEL, path)
    with path.open() as reader:
        save_body_model(BodyModel(), path)
        # Who had the old file open goes on reading it, untorn.
        assert reader.read() == dumps_body_model(MODEL)
    assert load_body_model(path) == BodyModel()


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(BodyModelError, match=r"none/body\.yaml: No such"):
        save_body_model(MODEL, tmp_path / "none" / "body.yaml")
