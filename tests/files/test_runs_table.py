"""Tables of runs: written and read again, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.dofs import DofSet
from femtune.errors import FemtuneError, FemtuneErrors
from femtune.files.runs_table import RunsTable, read_runs_table, write_runs_table


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    shapes = rng.normal(size=(5, 3, 2))
    hz = np.sort(rng.uniform(1.0, 9.0, (5, 2)), axis=1)
    hz[2] = shapes[2] = np.nan
    states = ("done", "done", "time-out", "done", "done")
    dofs = DofSet.parse(["2Z-", "1X+", "1RY+"])
    table = RunsTable({"E": rng.uniform(1e11, 2e11, 5), "t": rng.uniform(size=5)}, hz, shapes, dofs, states)
    write_runs_table(tmp_path / "runs.csv", table)
    found = read_runs_table(tmp_path / "runs.csv")
    at, signs = found.dofs.align(dofs)
    np.testing.assert_array_equal(found.points(("E", "t")), table.points(("E", "t")))
    np.testing.assert_array_equal(found.freq_hz, hz)
    assert found.shapes is not None
    np.testing.assert_array_equal(found.shapes, shapes[:, at] * signs[:, None])
    assert (found.states, found.usable.tolist()) == (states, [True, True, False, True, True])


@pytest.mark.parametrize(
    "text", ["E;f1_hz;remark\n1,5;2,25;first run\n\n2,5;;lost\n", "E\tf1_hz\tremark\n1.5\t2.25\tx\n2.5\tnan\ty\n"]
)
def test_tables_of_spreadsheets(text: str, tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text(f"\ufeff{text}", encoding="utf-8")
    found = read_runs_table(tmp_path / "runs.csv")
    assert set(found.columns) == {"E"}
    np.testing.assert_array_equal(found.columns["E"], [1.5, 2.5])
    np.testing.assert_array_equal(found.freq_hz[:, 0], [2.25, np.nan])


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("E,f1_hz\n", "no values"),
        ("E,f2_hz\n1,2\n", "no frequencies"),
        ("E,E,f1_hz\n1,2,3\n", "heading twice"),
        ("E,f1_hz\n1,2\n1\n", "number of fields"),
        ("E,f1_hz\n1,2\n1,2x\n", "not a number"),
        ("E,f1_hz\n1,2\n1.2.3,2\n", "not a number in a parameter"),
        ("E,f1_hz,f2_hz,shape1_1X,shape2_2X\n1,2,3,4,5\n", "shapes"),
        ("E,f1_hz,shape1_1X,shape1_1X-\n1,2,3,4\n", "shape twice"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(text: str, name: str, tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text(text)
    with pytest.raises(FemtuneError) as caught:
        read_runs_table(tmp_path / "runs.csv")
    check_shown(f"runs.table, {name}", str(caught.value).replace(str(tmp_path), "FOLDER"))


def test_all_lines_that_are_wrong_are_told_together(tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text("E,f1_hz\n1,2x\n1.2.3,2\n1\n2,-5\n3,6\n4,1e300\n")
    with pytest.raises(FemtuneErrors) as caught:
        read_runs_table(tmp_path / "runs.csv")
    assert [error.where and error.where.line for error in caught.value.errors] == [2, 3, 4, 5, 7]


def test_all_rows_of_a_parquet_file_that_are_wrong_are_told_together(tmp_path: Path) -> None:
    path = written(tmp_path / "runs.parquet", {"E": [1.0, float("inf")], "f1_hz": [-1.0, 2.0]})
    with pytest.raises(FemtuneErrors) as caught:
        read_runs_table(path)
    assert [error.where and error.where.line for error in caught.value.errors] == [1, 2]


def test_headings_of_shapes_with_a_sign(tmp_path: Path) -> None:
    (tmp_path / "runs.csv").write_text("E,f1_hz,shape1_1X+,shape1_2RZ-,shape1_3Y\n1,2,3,4,5\n2,3,4,5,6\n")
    found = read_runs_table(tmp_path / "runs.csv")
    assert set(found.columns) == {"E"}
    assert found.shapes is not None
    assert list(map(str, found.dofs)) == ["1X+", "2RZ+", "3Y+"]
    np.testing.assert_array_equal(found.shapes[:, :, 0], [[3.0, -4.0, 5.0], [4.0, -5.0, 6.0]])


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    for content in (None, b"\xff\xfe\x00binary"):
        if content:
            (tmp_path / "runs.csv").write_bytes(content)
        with pytest.raises(FemtuneError) as caught:
            read_runs_table(tmp_path / "runs.csv")
        assert caught.value.code == "runs.table"


@pytest.mark.parametrize(("value", "told"), [("-5", "negative"), ("1e300", "huge")])
def test_a_frequency_that_is_none_is_named_with_its_line(value: str, told: str, tmp_path: Path) -> None:
    path = tmp_path / "runs.csv"
    path.write_text(f"E,f1_hz,f2_hz\n1,2,3\n2,3,{value}\n", encoding="utf-8")
    with pytest.raises(FemtuneError) as caught:
        read_runs_table(path)
    assert caught.value.where is not None
    assert caught.value.where.line == 3
    check_shown(f"runs.table, {told} frequency", str(caught.value).replace(str(tmp_path), "…"))


def written(path: Path, columns: dict[str, Any]) -> Path:
    """A Parquet file of columns."""
    reason = "pyarrow is not installed: pip install femtune[parquet]"
    arrow = pytest.importorskip("pyarrow", reason=reason)
    pytest.importorskip("pyarrow.parquet", reason=reason).write_table(arrow.table(columns), path)
    return path


def test_a_parquet_file_is_read_as_the_same_table_in_text(tmp_path: Path) -> None:
    shapes = {f"shape{j}_{dof}": [1.0 * j, 2.0, None] for j in (1, 2) for dof in ("1X", "2RZ")}
    columns = {
        "E": [1.5, 2.5, 3.5], "n": [1, 2**60, 3], "remark": ["a", "b", "c"],
        "f1_hz": [2.25, 2.5, None], "f2_hz": [3.0, 4.0, None], **shapes, "state": ["done", "done", "time-out"],
    }  # fmt: skip
    found = read_runs_table(written(tmp_path / "runs.parquet", columns))
    rows = zip(*columns.values())
    text = "\n".join(",".join("" if v is None else str(v) for v in row) for row in [columns, *rows])
    (tmp_path / "runs.csv").write_text(text + "\n", encoding="utf-8")
    same = read_runs_table(tmp_path / "runs.csv")
    assert set(found.columns) == {"E", "n"} == set(same.columns)
    np.testing.assert_array_equal(found.points(("E", "n")), same.points(("E", "n")))
    np.testing.assert_array_equal(found.freq_hz, same.freq_hz)
    assert found.shapes is not None
    np.testing.assert_array_equal(found.shapes, same.shapes)
    assert list(found.dofs) == list(same.dofs)
    assert (found.states, found.usable.tolist()) == (("done", "done", "time-out"), [True, True, False])


@pytest.mark.parametrize(
    ("columns", "name"),
    [
        ({"E": [], "f1_hz": []}, "Parquet without values"),
        ({"E": [1.0], "f2_hz": [1.0]}, "Parquet without frequencies"),
        ({"E": [1.0, float("inf")], "f1_hz": [1.0, 2.0]}, "Parquet not a number"),
        ({"E": [1.0, 2.0], "f1_hz": [1.0, -2.0]}, "Parquet negative frequency"),
        ({"E": [1.0, 2.0], "f1_hz": ["1", "2x"]}, "Parquet column of text"),
    ],
)
def test_what_is_wrong_in_a_parquet_file(columns: dict[str, Any], name: str, tmp_path: Path) -> None:
    with pytest.raises(FemtuneError) as caught:
        read_runs_table(written(tmp_path / "runs.parquet", columns))
    check_shown(f"runs.table, {name}", str(caught.value).replace(str(tmp_path), "FOLDER"))


@pytest.mark.parametrize("part", [0.0, 0.3, 0.9])
def test_parquet_files_that_are_damaged(part: float, tmp_path: Path) -> None:
    path = written(tmp_path / "runs.parquet", {"E": [1.0, 2.0], "f1_hz": [1.0, 2.0]})
    content = path.read_bytes()
    path.write_bytes(content[: int(part * len(content))])
    with pytest.raises(FemtuneError, match="cannot be read"):
        read_runs_table(path)


def test_a_parquet_file_without_the_library(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(FemtuneError) as caught:
        read_runs_table(tmp_path / "runs.parquet")
    check_shown("install.missing, pyarrow", caught.value)
