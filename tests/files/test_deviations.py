"""Standard deviations of identified modes in a file, written and read."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.dofs import DofSet
from femtune.errors import FemtuneError, FemtuneErrors, Where
from femtune.files.deviations import deviations_text, with_deviations
from femtune.modal import ModeSet


def identified() -> ModeSet:
    shapes = np.array([[1.0, 0.5], [-2.0, 1.0], [0.4, np.nan]])
    sd = np.array([[0.01, 0.02], [0.03, 0.04], [0.05, np.nan]])
    root = np.tril(np.arange(1.0, 17.0).reshape(4, 4)) * 1e-3
    covariance = root @ root.T
    spread = np.sqrt(np.diag(covariance))
    return ModeSet(
        np.array([10.0, 25.0]), shapes, DofSet.parse(["1X+", "2X+", "3Z-"]), freq_sd_hz=spread[:2], shapes_sd=sd,
        damping_sd=spread[2:], covariance=covariance,
    )  # fmt: skip


def bare(scale: float = 1.0) -> ModeSet:
    """The same modes as a Universal File has them: other order and scale, without deviations."""
    modes = identified().select_dofs(DofSet.parse(["3Z+", "1X+", "2X+"]))
    return ModeSet(modes.freq_hz, scale * modes.shapes, modes.dofs)


def test_deviations_come_back_in_the_order_and_scale_of_the_test(tmp_path: Path) -> None:
    path, modes = tmp_path / "deviations.json", identified()
    path.write_text(str(deviations_text(modes)))
    found = with_deviations(bare(100.0), path)
    np.testing.assert_allclose(found.freq_sd_hz, modes.freq_sd_hz)
    np.testing.assert_allclose(found.damping_sd, modes.damping_sd)
    np.testing.assert_allclose(found.covariance, modes.covariance)
    np.testing.assert_allclose(found.shapes_sd, 100.0 * modes.shapes_sd[[2, 0, 1]])


def test_modes_without_deviations_need_no_file() -> None:
    assert deviations_text(bare()) is None


GOOD = json.loads(str(deviations_text(identified())))
BAD = {
    "another form": ({**GOOD, "more": 1}, "test.deviations"),
    "a text": ({**GOOD, "freq_sd_hz": ["a", "b"]}, "test.deviations"),
    "a negative deviation": ({**GOOD, "freq_sd_hz": [-1.0, 1.0]}, "test.deviations"),
    "too few rows": ({**GOOD, "shape_sd": GOOD["shape_sd"][:1]}, "test.deviations"),
    "too few deviations": ({**GOOD, "damping_sd": [0.1]}, "test.deviations"),
    "a covariance of another size": ({**GOOD, "covariance": [[1.0]]}, "test.deviations"),
    "a covariance that is not symmetric": (
        {**GOOD, "covariance": [[1.0, 2.0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 0], [0, 0, 0, 1.0]]}, "test.deviations",
    ),
    "a label that is none": ({**GOOD, "dofs": ["a", "b", "c"]}, "test.deviations"),
    "other frequencies": ({**GOOD, "freq_hz": [10.0, 26.0]}, "test.deviations/other-test"),
    "other sensors": ({**GOOD, "dofs": ["1X+", "2X+", "4Z+"]}, "test.deviations/other-test"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_what_does_not_fit_is_refused(tmp_path: Path, name: str) -> None:
    content, code = BAD[name]
    path = tmp_path / "deviations.json"
    path.write_text(json.dumps(content))
    with pytest.raises(FemtuneError) as error:
        with_deviations(bare(), path)
    assert error.value.code == code.partition("/")[0]
    if name in ("another form", "other frequencies"):
        check_shown(f"{error.value.code}, {name}", str(error.value).replace(str(path), "/home/anna/deviations.json"))


def test_no_json_and_no_file_are_refused(tmp_path: Path) -> None:
    for content in (None, b"{", b"[1, 2]", b'{"freq_hz": [NaN, 1.0], "dofs": []}'):
        path = tmp_path / "deviations.json"
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(FemtuneError) as error:
            with_deviations(bare(), path)
        assert error.value.code == "test.deviations"


TABLE = """mode;sigma;dof
1;0,02;frequency
2;0.002;damping
1;0.1;2X-
1;0.2;1X+
1;0.3;3Z+
2;0.4;2X+
"""


def test_a_table_states_standard_deviations_of_modes_and_entries(tmp_path: Path) -> None:
    path = tmp_path / "sd.csv"
    path.write_text(TABLE)
    found = with_deviations(bare(), path)
    np.testing.assert_array_equal(found.freq_sd_hz, [0.02, np.nan])
    np.testing.assert_array_equal(found.damping_sd, [np.nan, 0.002])
    # relative to the largest entries, 2 and 1; the order of the sensors is 3Z, 1X, 2X
    np.testing.assert_allclose(found.shapes_sd, [[0.6, np.nan], [0.4, np.nan], [0.2, 0.4]])
    path.write_text("mode,dof,sigma\nb,frequency,0.01\na,frequency,0.02\n")
    found = with_deviations(bare(), path, ("a", "b"))
    np.testing.assert_allclose(found.freq_sd_hz, [0.02, 0.01])
    assert found.shapes_sd is None


_ONE = "mode,dof,sigma\n1,frequency,0.1\n"
BAD_TABLES = {
    "lines": ("mode,dof,sigma", None),
    "heading": ("mode,dof\n1,frequency\n", 1),
    "fields": (_ONE + "1,2,3,4\n", 3),
    "mode": (_ONE + "3,frequency,0.1\n", 3),
    "sensor": (_ONE + "\n1,4X+,0.1\n", 4),
    "not-measured": (_ONE + "2,3Z+,0.1\n", 3),
    "twice": (_ONE + "1,1X+,0.1\n1,1X-,0.1\n", 4),
    "number": (_ONE + "2,frequency,0\n", 3),
    "negative": (_ONE + "2,frequency,-1\n", 3),
    "nan": (_ONE + "2,frequency,nan\n", 3),
}


@pytest.mark.parametrize("name", BAD_TABLES)
def test_what_is_wrong_in_a_table_is_told_with_its_line(tmp_path: Path, name: str) -> None:
    path = tmp_path / "sd.csv"
    text, line = BAD_TABLES[name]
    path.write_text(text)
    with pytest.raises(FemtuneError) as error:
        with_deviations(bare(), path)
    assert error.value.code == "test.deviations-table"
    assert error.value.where == Where(str(path), line)
    path.write_text(text.replace("frequency", "9X+"))
    if name in ("mode", "number"):
        with pytest.raises(FemtuneErrors) as several:
            with_deviations(bare(), path)
        assert [one.where for one in several.value.errors] == [Where(str(path), 2), Where(str(path), 3)]
    if name in ("heading", "sensor", "mode", "twice", "number"):
        shown = f"test.deviations-table, {name}"
        check_shown(shown, str(error.value).replace(str(path), "/home/anna/sd.csv"))
