"""`ft.table`: one line for each of several updates."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.testing import example_deck, example_test


def update(folder: Path, sd: float, names: tuple[str, ...]) -> ft.RunResult:
    fields = {"root": "PBAR 1 I1", "E": "MAT1 1 E"}
    return ft.update(
        ft.read_deck(example_deck(folder), units="m-kg-s"),
        ft.read_test(example_test(folder)),
        modes={"count": 5},
        parameters=[ft.Parameter(name, fields=[fields[name]], lower=0.5, upper=2.0) for name in names],
        residuals=[ft.FrequencyResidual(sd=sd)],
        output=folder / f"run_{sd}",
    )


@pytest.mark.slow
def test_a_sweep_has_a_line_for_each_result(tmp_path: Path) -> None:
    found = {0.01: update(tmp_path, 0.01, ("root",)), "both": update(tmp_path, 0.02, ("root", "E"))}
    rows = ft.table(found, csv=tmp_path / "sweep.csv")
    assert rows.columns == (
        "case", "status", "error_before_percent", "error_after_percent", "root", "root_sd", "E", "E_sd",
    )  # fmt: skip
    assert [row.case for row in rows] == [0.01, "both"]
    assert [row.root for row in rows] == [result.values["root"] for result in found.values()]
    assert [row.E for row in rows] == [None, found["both"].values["E"]]
    assert all(row.error_after_percent <= row.error_before_percent for row in rows)
    with (tmp_path / "sweep.csv").open() as stream:
        written = list(csv.DictReader(stream))
    assert [float(line["root_sd"]) for line in written] == [row.root_sd for row in rows]
    assert written[0]["E"] == ""
    assert [row.case for row in ft.table(list(found.values()))] == [1, 2]
    with pytest.raises(ft.FemtuneError) as caught:
        ft.table(found, csv=tmp_path / "no folder" / "a.csv")
    assert caught.value.code == "run.unwritable"


@pytest.mark.slow
def test_parameters_named_as_other_columns_replace_none(tmp_path: Path) -> None:
    done = ft.update(
        ft.own_model(lambda v: [v["status"], 2.0 * v["a"], 3.0 * v["a_sd"]], count=3, units="m-kg-s"),
        ft.modal_test([1.0, 2.2, 3.6]),
        parameters=[
            ft.Parameter(name, absolute=True, nominal=1.0, lower=0.5, upper=2.0) for name in ("status", "a", "a_sd")
        ],
        residuals=[ft.FrequencyResidual(sd=0.01)],
        output=tmp_path / "run",
    )
    (row,) = ft.table([done])
    assert row["status"] == done.status
    assert [row[name] for name in ("status_value", "a", "a_sd_value")] == list(done.values.values())
    assert [row[name] for name in ("status_value_sd", "a_sd", "a_sd_value_sd")] == list(done.parameters.column("sd"))


def test_a_table_of_nothing_has_no_rows() -> None:
    assert ft.table([]) == []
    assert ft.table({}).columns == ()


@pytest.mark.parametrize("wrong", [[3], {"a": None}, "run", 3], ids=str)
def test_what_is_no_result_is_refused(wrong: object) -> None:
    with pytest.raises(ft.FemtuneError) as caught:
        ft.table(wrong)  # type: ignore[arg-type]
    assert caught.value.code == "call.argument"
    check_shown(f"call.argument, table, {wrong}", caught.value)
