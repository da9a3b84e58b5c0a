"""Studies of objects in memory do what the same study does as a file, and nothing is read twice."""

from __future__ import annotations

import dataclasses
import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
from tests.study.cantilever import EI

import femtune as ft
from femtune.testing import example_deck, example_test
from femtune.testing.examples import TRUTH

FIELDS = {"root": "PBAR 1 I1", "tip": "PBAR 2 I1"}
STUDY = f"""
[study]
title = "cantilever.bdf"
deck = "cantilever.bdf"
units = "m-kg-s"

[modes]
count = 8

[test]
file = "cantilever.uff"
{EI}
[[residual]]
kind = "frequency"
sd = 0.01
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with a deck, a test and a study."""
    example_deck(tmp_path)
    example_test(tmp_path, frequency_scatter=0.002)
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _free() -> list[ft.Parameter]:
    return [ft.Parameter(name, fields=[field], lower=0.5, upper=2.0) for name, field in FIELDS.items()]


def _words(**more: Any) -> dict[str, Any]:
    return {"parameters": _free(), "residuals": [ft.FrequencyResidual(sd=0.01)], "modes": {"count": 8}, **more}


def _same(a: Any, b: Any) -> None:
    """Records but for where they come from and how long it took."""
    drop = {"provenance", "journal", "alerts"}
    a, b = (json.loads(one.model_dump_json(exclude=drop)) for one in (a, b))
    for data in (a, b):
        # paths are as they were named: one is relative, the other absolute
        data["study"].pop("deck_file")
        for sensors in data["sensors"]:
            sensors.pop("test_file")
        for edit in data["write_back"]["edits"]:
            edit.pop("file")
    assert a == b


@pytest.mark.slow
def test_objects_and_file_give_the_same_to_the_last_digit(folder: Path) -> None:
    of_file = ft.update("study.toml", output="one")
    model, test = ft.read_deck("cantilever.bdf", units="m-kg-s"), ft.read_test("cantilever.uff")
    of_objects = ft.update(model, test, output="two", **_words())
    _same(of_file.results, of_objects.results)
    assert of_file.values == of_objects.values
    for key, array in of_file.arrays.items():
        np.testing.assert_array_equal(array, of_objects.arrays[key])
    assert (folder / "one" / "updated.bdf").read_text() == (folder / "two" / "updated.bdf").read_text()


@pytest.mark.slow
def test_true_values_are_found(folder: Path) -> None:
    test = ft.simulate(ft.write_deck("cantilever.bdf", TRUTH, "true.bdf", wide=True), ["2 THRU 5:23"], units="m-kg-s")
    result = ft.update("cantilever.bdf", test, units="m-kg-s", **_words())
    truth = {name: TRUTH[field] / 2.0e-7 for name, field in FIELDS.items()}
    assert result.values == pytest.approx(truth, rel=1e-5)


@pytest.mark.slow
def test_what_was_read_is_not_read_again(folder: Path) -> None:
    model, test = ft.read_deck("cantilever.bdf", units="m-kg-s"), ft.read_test("cantilever.uff")
    with_files = ft.update(model, test, output="with", **_words())
    for name in ("cantilever.bdf", "cantilever.uff"):
        (folder / name).unlink()
    assert len(ft.correlate(model, test).pairs) == 4
    assert len(ft.modes(model, count=2).freq_hz) == 2
    without = ft.update(model, test, output="without", **_words())
    assert without.values == with_files.values
    assert [f.sha256 for f in without.results.provenance.input_files] == [""]
    assert (folder / "without" / "updated.bdf").read_text() == (folder / "with" / "updated.bdf").read_text()


def test_a_test_of_another_system_of_units_is_converted(folder: Path) -> None:
    test = ft.simulate("cantilever.bdf", ["2 THRU 5:23"], units="m-kg-s", count=4)
    in_mm = ft.simulate(
        ft.read_deck(_in_mm(folder), units="mm-t-s"), ["2 THRU 5:23"], count=4
    )  # fmt: skip
    assert in_mm.units.word == "mm-t-s"
    found = [ft.correlate("cantilever.bdf", one, units="m-kg-s").mac for one in (test, in_mm)]
    np.testing.assert_allclose(found[0], found[1], atol=1e-9)


def _in_mm(folder: Path) -> Path:
    """The cantilever in mm, t, s."""
    text = (folder / "cantilever.bdf").read_text()
    for old, new in (
        ("0.25    0.0", "250.    0.0"), ("0.5     0.0", "500.    0.0"), ("0.75    0.0", "750.    0.0"),
        ("1.0     0.0     0.0\nMAT1", "1000.   0.0     0.0\nMAT1"), ("2.1+11  ", "2.1+5   "), ("7850.", "7.85-9"),
        ("1.0-3   2.0-7   5.0-7   4.0-7", "1.0+3   2.0+5   5.0+5   4.0+5"),
        ("5               2.0", "5               2.0-3"),
    ):  # fmt: skip
        assert old in text
        text = text.replace(old, new)
    path = folder / "mm.bdf"
    path.write_text(text)
    return path


def test_a_file_and_words_of_python_together(folder: Path) -> None:
    """Words take the place of tables of the file; the others stay."""
    study = ft.Study("study.toml", modes={"count": 5}, parameters=_free()[:1])
    assert (study.file.modes.count, [p.name for p in study.file.parameter]) == (5, ["root"])
    assert study.file.residual[0].sd == 0.01
    again = ft.Study(study, modes={"count": 6})
    assert (again.file.modes.count, [p.name for p in again.file.parameter]) == (6, ["root"])
    assert len(ft.correlate("study.toml", modes={"count": 5})[0].mac_model_numbers) == 5


@pytest.mark.slow
def test_a_study_that_is_only_read_is_the_file_itself(folder: Path) -> None:
    assert ft.Study("study.toml").file.model_dump() == ft.Study(ft.Study("study.toml")).file.model_dump()
    run = ft.update(ft.Study("study.toml"), output="one")
    assert run.results.provenance.study_file.path == "study.toml"
    assert run.results.provenance.command == "femtune.update(Study('cantilever.bdf'))"


@pytest.mark.slow
def test_what_is_in_memory_is_told_by_its_content(folder: Path) -> None:
    model, test = ft.read_deck("cantilever.bdf", units="m-kg-s"), ft.read_test("cantilever.uff")
    runs = [ft.update(model, test, output=name, **_words(), title=title) for name, title in (("a", "x"), ("b", "y"))]
    sums = [run.results.provenance.study_file for run in runs]
    assert [s.path for s in sums] == ["(in memory)", "(in memory)"]
    assert sums[0].sha256 != sums[1].sha256
    files = [f.path for f in runs[0].results.provenance.input_files]
    assert [Path(f).name for f in files] == ["cantilever.bdf", "cantilever.uff"]


@pytest.mark.slow
def test_a_test_without_a_file_is_a_test(folder: Path) -> None:
    test = dataclasses.replace(ft.read_test("cantilever.uff"), source="", sensors=())
    model = ft.read_deck("cantilever.bdf", units="m-kg-s")
    result = ft.update(model, test, **_words())
    assert result.ok
    assert [f.path for f in result.results.provenance.input_files] == ["cantilever.bdf"]


def test_configurations_with_tests_of_their_own(folder: Path) -> None:
    model = ft.read_deck("cantilever.bdf", units="m-kg-s")
    mass = {"node": 3, "mass": 1.0}
    bare, heavy = ft.Configuration("bare"), ft.Configuration("heavy", masses=[mass])
    both = ft.Study(model=model, configurations=[bare, heavy])
    tests = [ft.simulate(both, ["2 THRU 5:23"], configuration=name, count=4) for name in ("bare", "heavy")]
    study = ft.Study(
        model=model,
        configurations=[
            ft.Configuration("bare", test=tests[0]),
            ft.Configuration("heavy", test=tests[1], masses=[mass], use="validation"),
        ],
    )
    found = ft.correlate(study)
    assert found.configurations == ("bare", "heavy")
    np.testing.assert_allclose(found.pairs.column("freq_error_percent"), 0.0, atol=1e-6)
    assert found["heavy"].configuration == "heavy"
    assert set(found.macs) == {"bare", "heavy"}
    with pytest.raises(ft.FemtuneError) as several:
        _ = found.mac
    assert several.value.code == "study.unknown-configuration"
    with pytest.raises(ft.FemtuneError) as unknown:
        _ = found["heavi"]
    assert "heavy" in unknown.value.hint


def test_matrices_are_a_model_too(folder: Path) -> None:
    K, M = np.array([[2000.0, -1000.0], [-1000.0, 1000.0]]), np.diag([1.0, 0.5])
    scipy.io.mmwrite("k.mtx", sp.csr_array(K), symmetry="symmetric")
    scipy.io.mmwrite("m.mtx", sp.csr_array(M), symmetry="symmetric")
    model = ft.read_matrices(stiffness="k.mtx", mass="m.mtx", units="m-kg-s")
    exact = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real)) / (2.0 * np.pi)
    np.testing.assert_allclose(ft.modes(model, count=2).freq_hz, exact, rtol=1e-9)
    with pytest.raises(ft.FemtuneError) as refused:
        ft.write_deck(model, {}, "a.bdf")
    assert refused.value.code == "write.no-deck"


def test_all_that_is_wrong_is_told_at_once_with_its_place(folder: Path) -> None:
    with pytest.raises(ft.FemtuneError) as wrong:
        ft.Study(
            model="cantilever.bdf", test="none.uff", units="m-kg-s", updaet={},
            parameters=[ft.Parameter("root", fields=["PBAR 1 I1"], lower=0.5)],
            residuals=[ft.FrequencyResidual(sd=0.0)],
        )  # fmt: skip
    found = {e.code: str(e.where) for e in wrong.value.errors}  # type: ignore[attr-defined]
    assert found == {
        "study.unknown-key": "Study (updaet)",
        "study.missing-file": "Study (test.file)",
        "study.missing-key": "Study (parameter[1].upper)",
        "residual.zero-variance": "Study (residual[1].sd)",
    }


@pytest.mark.quick(4)
@pytest.mark.parametrize(
    ("make", "code"),
    [
        (lambda: ft.Parameter("E", fields="MAT1 1 E"), "study.type"),
        (lambda: ft.Parameter("E", feilds=["MAT1 1 E"]), "study.unknown-key"),
        (lambda: ft.Parameter("E", fields=["MAT1"]), "study.field"),
        (ft.MacResidual, "study.missing-key"),
        (lambda: ft.ShapeResidual(sd=0.1, scaling="unit"), "study.value"),
        (lambda: ft.read_deck("cantilever.bdf", units="mm-kg"), "units.unknown"),
        (lambda: ft.Configuration("a", masses=[{"node": 0, "mass": 1.0}]), "study.value"),
        (lambda: ft.update("cantilever.bdf"), "study.deck-alone"),
        (lambda: ft.correlate(ft.read_deck("cantilever.bdf", units="m-kg-s")), "study.no-test"),
    ],
)
def test_a_wrong_word_is_a_clear_error(make: Any, code: str, folder: Path) -> None:
    with pytest.raises(ft.FemtuneError) as wrong:
        make()
    assert wrong.value.code == code


def test_numbers_of_numpy_are_numbers(folder: Path) -> None:
    given = ft.Parameter("E", fields=np.array(["MAT1 1 E"]), lower=np.float32(0.5), upper=np.int64(2))
    assert (given.lower, given.upper) == (0.5, 2.0)


@pytest.mark.slow
def test_a_residual_of_ones_own_is_compared(folder: Path) -> None:
    """Here that of the house, as an object that no word of the file stands for."""
    from femtune.residuals.frequency import FrequencyResidual  # noqa: PLC0415

    model, test = ft.read_deck("cantilever.bdf", units="m-kg-s"), ft.read_test("cantilever.uff")
    own = ft.update(model, test, parameters=_free(), residuals=[FrequencyResidual(0.01)], output="own",
                    modes={"count": 8}, update={"tolerance": 1e-12})  # fmt: skip
    usual = ft.update(model, test, output="usual", **_words(update={"tolerance": 1e-12}))
    assert own.values == pytest.approx(usual.values, rel=1e-6)


@pytest.mark.slow
def test_results_are_short_and_escaped(folder: Path) -> None:
    run = ft.run("study.toml", title="<b>bold</b> & more")
    assert len(repr(run).splitlines()) < 10
    assert len(repr(run.results)) < 2000
    assert len(repr(run.results.update)) < 2000
    html = run._repr_html_() + run.alerts._repr_html_()
    assert "<b>bold" not in html
    assert "<table>" in html
    rows = ft.modes("cantilever.bdf").frequencies
    assert type(rows) is not list
    assert isinstance(rows, list)
    assert all(isinstance(row, dict) and row.keys() == rows[0].keys() for row in rows)
    flat = (int, float, str, bool, type(None))
    tables = [run.parameters, run.frequencies, run.pairs, run.history, run.alerts, run.before.criteria, run.after.comac]
    assert all(isinstance(value, flat) for table in tables for row in table for value in row.values())
    assert tomllib.loads(STUDY)["study"]["title"] not in html


def test_pandas_takes_a_table_as_it_is(folder: Path) -> None:
    pandas = pytest.importorskip("pandas")
    rows = ft.modes("cantilever.bdf").frequencies
    frame = pandas.DataFrame(rows)
    assert list(frame.columns) == list(rows.columns)
    assert frame["freq_hz"].tolist() == rows.column("freq_hz").tolist()
