"""A study with everything in it, what becomes of its values, and hostile files."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pydantic import ValidationError

from femtune.dofs import Dof
from femtune.errors import FemtuneError
from femtune.fem.fields import FieldRef
from femtune.files.study_file import StudyFile, element_list, read_study_file, study_from_text
from femtune.model.configuration import AddedMass
from femtune.study.cases import overlay

from .whole_study import STUDY

_LEAST = '[study]\ntitle = "t"\ndeck = "building.bdf"\nunits = "m-kg-s"\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files that the study names."""
    place = tmp_path_factory.mktemp("study")
    for name in ("building.bdf", "building.uff"):
        (place / name).touch()
    return place


@pytest.fixture(scope="module")
def full(folder: Path) -> StudyFile:
    """The study with everything in it."""
    (folder / "study.toml").write_text(STUDY)
    return read_study_file(folder / "study.toml")


def test_paths_are_relative_to_the_study(full: StudyFile, folder: Path) -> None:
    assert full.path_of("building.bdf") == folder / "building.bdf"
    assert full.output_folder == folder / "out" / "run"
    assert full.path == folder / "study.toml"


def test_units(full: StudyFile) -> None:
    assert (full.study.unit_system.length, full.study.unit_system.mass) == (1.0, 1.0)


def test_overlay_is_what_the_model_takes(full: StudyFile) -> None:
    state = overlay(full.configurations[0])
    assert state.elements_off == {201, 202, 204, 205, 206, 207, 208, 301}
    assert state.supports_added == ((12, "123"), (13, "3"), (14, "3"), (15, "3"))
    assert state.supports_removed == ((9, "0"),)
    assert (state.support_set, state.multipoint_set, state.weighed_mass) == (1, 2, 7500.0)
    assert state.masses == (
        AddedMass(11, 0.35, (0, 0, 0.1), ((1, 0, 0), (0, 2, 0), (0, 0, 3.5)), "sensor"),
        AddedMass(12, 1, (0, 0, 0), ((2, 0.5, 0), (0.5, 2, 0), (0, 0, 3)), ""),
    )
    assert overlay(full.configurations[1]).elements_off == {7, 8}


def test_parameters(full: StudyFile) -> None:
    free, tied = full.parameter
    assert free.targets == (FieldRef("PBAR", 1, "I1"), FieldRef("MAT1", 2, "E"))
    assert free.elements is not None
    assert element_list(free.elements).among(range(10)) == (1, 2, 3, 4)
    assert tied.elements is not None
    assert element_list(tied.elements).among(range(10)) == (5, 6)
    assert (free.free, tied.free) == (True, False)


def test_sensors(full: StudyFile) -> None:
    assert full.sensors.nodes == {101: 12}
    assert full.sensor[0].label == Dof(11, "X")
    assert full.rigid_floor[0].digits == "126"


def test_where_names_the_line(full: StudyFile) -> None:
    assert str(full.where("parameter", 1, "tie")).endswith("study.toml:72 (parameter[2].tie)")
    assert full.where("parameter", 1, "lower").line == full.where("parameter", 1).line == 69


def test_study_is_frozen(full: StudyFile) -> None:
    with pytest.raises(ValidationError, match="frozen"):
        full.study.title = "other"  # type: ignore[misc]


def test_least_study_has_one_state_as_the_deck(folder: Path) -> None:
    study = study_from_text(_LEAST, folder / "s.toml")
    assert [(c.name, c.test) for c in study.configurations] == [("baseline", None)]
    assert study.modes.count is None


def test_single_test_belongs_to_the_state_as_the_deck(folder: Path) -> None:
    text = _LEAST + '[modes]\nmax_hz = 20\n[test]\nfile = "building.uff"\nunits = "mm-t-s"\nmode_labels = ["1"]\n'
    study = study_from_text(text, folder / "s.toml")
    (state,) = study.configurations
    assert (state.name, state.test, state.test_units, state.mode_labels) == (
        "baseline", "building.uff", "mm-t-s", ("1",),
    )  # fmt: skip
    assert study.modes.count is None


def test_lines_that_end_as_on_windows(folder: Path) -> None:
    (folder / "dos.toml").write_bytes(STUDY.replace("\n", "\r\n").encode())
    assert read_study_file(folder / "dos.toml").where("parameter", 1, "tie").line == 72


_WORDS = ["[", "]", "{", "}", "=", '"', "'", '"""', "\n", "#", ",", ".", "nan", "-1", "1e999", "9" * 400, "0",
          "[]", "{}", "true", '"x"', "\x00", "\\", "[[parameter]]", "[study]", "é", "\r", "1979-05-27", "0x1",
          "inf"]  # fmt: skip
_EDITS = st.lists(
    st.tuples(st.integers(0, len(STUDY)), st.integers(0, 12), st.sampled_from(_WORDS) | st.text(max_size=4)),
    min_size=1,
    max_size=4,
)


def _only_femtune_errors(text: str, folder: Path) -> None:
    try:
        study_from_text(text, folder / "fuzz.toml")
    except FemtuneError as error:
        message = str(error)
    else:
        return
    assert message.count("fuzz.toml") >= 1


@pytest.mark.slow
@given(_EDITS)
def test_damaged_text_gives_femtune_errors_only(folder: Path, edits: list[tuple[int, int, str]]) -> None:
    text = STUDY
    for at, length, word in edits:
        text = text[:at] + word + text[at + length :]
    _only_femtune_errors(text, folder)


_LINES = STUDY.split("\n")
_SCALARS = (  # values of every type that TOML has
    st.integers(-(10**20), 10**20).map(str)
    | st.floats().map(str)
    | st.sampled_from(
        ["true", '""', '"ALL"', '"1 THRU 2"', "1979-05-27", "07:32:00", "9" * 400, '"\\u0000"', '"a/../b"']
    )
)
_VALUES = st.recursive(
    _SCALARS,
    lambda inner: (
        st.lists(inner, max_size=3).map(lambda v: f"[{', '.join(v)}]")
        | st.tuples(st.sampled_from(["node", "mass", "mode", "test", "1"]), inner).map(
            lambda p: f"{{ {p[0]} = {p[1]} }}"
        )
    ),
    max_leaves=4,
)


@pytest.mark.slow
@given(st.lists(st.tuples(st.integers(0, len(_LINES) - 1), _VALUES), min_size=1, max_size=3))
@example([(_LINES.index("elements_off = [7, 8]"), "[" + "9" * 400 + "]")])
@example([(_LINES.index("shape_sd = 0.1"), "9" * 400)])
def test_values_of_any_type_give_femtune_errors_only(folder: Path, edits: list[tuple[int, str]]) -> None:
    lines = list(_LINES)
    for at, value in edits:
        if " = " in lines[at]:
            lines[at] = f"{lines[at].split(' = ')[0]} = {value}"
    _only_femtune_errors("\n".join(lines), folder)
