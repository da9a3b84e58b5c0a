"""What goes wrong in a whole study: each message has its code, file, line and fix, and nothing is written."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from tests.study.cantilever import EI

import femtune as ft
from femtune.dofs import DofSet
from femtune.errors import FemtuneError, FemtuneErrors
from femtune.files.uff import write_uff_modes
from femtune.journal.run_files import OWNER_FILE
from femtune.modal import ModeSet
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI

DECK = """SOL 103
CEND
SPC = 1
BEGIN BULK
GRID    1               0.0     0.0     0.0
GRID    2               0.5     0.0     0.0
GRID    3               1.0     0.0     0.0
MAT1    1       2.1+11          0.3     7850.
PBAR    1       1       1.0-3   2.0-7   5.0-7   4.0-7
PBAR    2       1       1.0-3   2.0-7   5.0-7   4.0-7
PBAR    3       1       1.0-3   2.0-7   0.0     4.0-7
CBAR    1       1       1       2       0.0     1.0     0.0
CBAR    2       2       2       3       0.0     1.0     0.0
CONM2   9       3               2.0
SPC1    1       123456  1
ENDDATA
"""

STUDY = f"""[study]
title = "Beam"
deck = "beam.bdf"
units = "m-kg-s"

[modes]
count = 4

[[configuration]]
name = "as found"
test = "beam.uff"
{EI}"""

FREE = "SPC1    1       123456  1"
CONFIGURATION = 'test = "beam.uff"\n'


@dataclass
class Files:
    """A study in a folder that can be spoilt."""

    folder: Path

    def deck(self, old: str, new: str) -> None:
        self._change("beam.bdf", old, new)

    def study(self, old: str, new: str) -> None:
        self._change("study.toml", old, new)

    def configuration(self, line: str) -> None:
        self.study(CONFIGURATION, f"{CONFIGURATION}{line}\n")

    def tail(self, text: str) -> None:
        self.study('[[parameter]]\nname = "tip"', f'{text}\n[[parameter]]\nname = "tip"')

    def cut(self, name: str, end: int) -> None:
        path = self.folder / name
        path.write_bytes(path.read_bytes()[:end])

    def test(self, factor: float = 1.0, lift: float = 0.0) -> None:
        """The modes of the deck with coordinates as wanted."""
        xyz = factor * np.array([[0.5, 0.0, 0.0], [1.0, lift, 0.0]])
        shapes = np.array([[0.3, 0.3], [1.0, -0.2]])
        modes = ModeSet(np.array([26.0, 200.0]), shapes, DofSet.parse(["2Y+", "3Y+"]))
        write_uff_modes(
            self.folder / "beam.uff", ModalTest("left wing", SI, WireFrame(np.array([2, 3]), xyz), modes=modes)
        )

    def _change(self, name: str, old: str, new: str) -> None:
        path = self.folder / name
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new, 1))


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Files:
    monkeypatch.chdir(tmp_path)
    made = Files(tmp_path)
    (tmp_path / "beam.bdf").write_text(DECK)
    (tmp_path / "study.toml").write_text(STUDY)
    made.test()
    return made


@dataclass(frozen=True)
class Case:
    code: str
    spoil: Callable[[Files], object]
    file: str
    line: int | None
    says: str
    fix: str = ""


def _without_units(f: Files) -> None:
    text = (f.folder / "beam.uff").read_text()
    (f.folder / "beam.uff").write_text(text[text.index("    -1\n", 6) + 7 :])


def _nan(f: Files) -> None:
    text = (f.folder / "beam.uff").read_text()
    at = text.rindex("E+00")
    (f.folder / "beam.uff").write_text(text[: at - 9] + "         NaN".rjust(13) + text[at + 4 :])


def _no_modes(f: Files) -> None:
    sets = (f.folder / "beam.uff").read_text().split("    -1\n    -1\n")
    (f.folder / "beam.uff").write_text(
        "    -1\n    -1\n".join(s for s in sets if not s.startswith("    55")) + "    -1\n"
    )


def _run_over_the_deck(f: Files) -> None:
    f.study("beam.bdf", "updated.bdf")
    f.tail('[output]\nfolder = "."\n')
    (f.folder / "beam.bdf").rename(f.folder / "updated.bdf")


def _no_mass(f: Files) -> None:
    f.deck("0.3     7850.", "0.3")
    f.deck("CONM2   9       3               2.0\n", "")


CASES = (
    # the deck
    Case("deck.truncated", lambda f: f.deck("ENDDATA\n", "CONM2,10,2,,1.,,,,,+A\n"),
         "beam.bdf", 16, "in the middle of a card", "truncated"),
    Case("deck.no-points", lambda f: f.cut("beam.bdf", 0), "beam.bdf", None, "neither grid points", "bulk data"),
    Case("deck.unknown-property", lambda f: f.deck("CBAR    2       2 ", "CBAR    2       7 "),
         "beam.bdf", 13, "property 7", "known: 1, 2"),
    Case("deck.duplicate-id", lambda f: f.deck("GRID    2               0.5", "GRID    1               0.5"),
         "beam.bdf", 6, "defined twice", "remove one"),
    Case("deck.missing-include", lambda f: f.deck("MAT1 ", "INCLUDE 'mat.inc'\nMAT1 "),
         "beam.bdf", 8, "'mat.inc' does not exist", "correct the path"),
    Case("deck.unsupported-element",
         lambda f: f.deck("CONM2 ", "CTRIAX6 20        1       PROP    2       3\nCONM2 "),
         "beam.bdf", 14, "1 CTRIAX6", 'allow_ignored = ["CTRIAX6"]'),
    Case("eigen.mechanism",
         lambda f: f.deck("CONM2 ", "GRID,98\nGRID,99\nCELAS2,91,100.,98,1,99,1\nCONM2 "),
         "beam.bdf", 14, "98X, 99X", "constrain these DOFs"),
    Case("eigen.no-dofs", lambda f: f.deck(FREE, FREE + "       THRU    3"),
         "beam.bdf", None, "all DOFs are constrained", "remove supports"),
    Case("eigen.no-mass", _no_mass, "beam.bdf", None, "no mass", "density"),
    # the test
    Case("uff.truncated", lambda f: f.cut("beam.uff", -60), "beam.uff", 40, "ends inside data set 55", "truncated"),
    Case("uff.no-units", _without_units, "beam.uff", None, "no data set 164", 'test_units = "m-kg-s"'),
    Case("uff.units-contradict", lambda f: f.configuration('test_units = "mm-t-s"'),
         "beam.uff", 1, "length in data set 164 = 1 m", "units of the test"),
    Case("uff.value", _nan, "beam.uff", None, "'NaN' is not a finite number", "export the file again"),
    Case("uff.no-record", lambda f: f.configuration('records = "right wing"'),
         "beam.uff", 14, "left wing", "leave out records"),
    Case("uff.not-uff", lambda f: (f.folder / "beam.uff").write_text("hello"),
         "beam.uff", None, "not a Universal File", "export"),
    Case("study.no-test", _no_modes, "study.toml", None, "beam.uff has no modes", "data sets 55"),
    Case("sensor.unmatched", lambda f: f.test(lift=0.1),
         "study.toml", 11, "3Y+ = at (1, 0.1, 0), nearest grid point 3, distance 0.1", "increase the tolerance"),
    Case("sensor.unmatched", lambda f: f.test(1000.0), "study.toml", 11, "2 of 2 sensors", "look like millimetres"),
    Case("correlate.no-pairs", lambda f: f.tail("[correlate]\nfrequency_gate = 1e-6\n"),
         "study.toml", 11, "test mode 1 (26 Hz) = the best candidate", "gates"),
    # the study
    Case("study.missing-file", lambda f: f.study("beam.bdf", "baem.bdf"),
         "study.toml", 3, "the deck does not exist", "relative to the folder of the study"),
    Case("study.unknown-key", lambda f: f.study("count", "cuont"),
         "study.toml", 7, "'cuont' is not a key of [modes]", "did you mean 'count'?"),
    Case("study.no-parameters", lambda f: (f.folder / "study.toml").write_text(STUDY[: STUDY.index("[[param")]),
         "study.toml", 1, "no free parameter", "[[parameter]]"),
    Case("study.unknown-field", lambda f: f.study("PBAR 1 I1", "PBAR 7 I1"),
         "study.toml", 13, "the deck has no PBAR 7", "known: 1, 2, 3"),
    Case("study.unknown-field", lambda f: f.study("PBAR 1 I1", "PBAR 1 I9"),
         "study.toml", 13, "no field 'I9'", "I1, I12, I2"),
    Case("study.unknown-mode", lambda f: f.configuration('leave_out = [{ mode = "9", reason = "x" }]'),
         "study.toml", 12, "1 (26 Hz), 2 (200 Hz)", "one of these"),
    Case("study.unknown-mode", lambda f: f.configuration('leave_out = [{ hz = 30.0, reason = "x" }]'),
         "study.toml", 12, "within 1 % of 30 Hz", "one of these"),
    Case("study.unknown-mode", lambda f: f.configuration('pairs = [{ test = "9", model = 1 }]'),
         "study.toml", 12, "the test has no mode '9'", "one of these"),
    Case("study.mode-labels", lambda f: f.configuration('mode_labels = ["a"]'),
         "study.toml", 12, "1 labels, but the test has 2 modes", "one label for each"),
    Case("correlate.fixed-pair", lambda f: f.configuration('pairs = [{ test = "1", model = 40 }]'),
         "study.toml", 12, "model mode (from 1) = 40", "more model modes"),
    Case("parameter.bounds", lambda f: f.study("lower = 0.5", "lower = 3.0"),
         "study.toml", 16, "is above the upper bound", "exchange the bounds"),
    Case("parameter.touches-nothing", lambda f: f.study("PBAR 1 I1", "PBAR 3 I1"),
         "study.toml", 13, "PBAR 3 I1", "used by elements of the model"),
    Case("parameter.touches-nothing", lambda f: f.study('I1"]', 'I1"]\nelements = [2]'),
         "study.toml", 13, "any element of the region", "elements of the region"),
    Case("parameter.derived-field", lambda f: f.study("PBAR 1 I1", "MAT1 1 G"),
         "study.toml", 13, "follows from E and NU", "update E and NU"),
    Case("parameter.field-twice", lambda f: f.study("PBAR 2 I1", "PBAR 1 I1"),
         "study.toml", 19, "also set by another parameter", "tie one"),
    Case("parameter.no-start", lambda f: f.tail('[[parameter]]\nname = "q"\nabsolute = true\nlower = 1\nupper = 2\n'),
         "study.toml", 19, "no field from which the value", "give nominal"),
    Case("configuration.unknown-element", lambda f: f.configuration("elements_off = [9, 77, 78]"),
         "study.toml", 12, "77, 78", "elements_off"),
    Case("configuration.unknown-set", lambda f: f.configuration("spc = 4"),
         "study.toml", 9, "no SPC set 4", "known sets"),
    Case("configuration.not-held", lambda f: f.configuration('supports_removed = ["3:1"]'),
         "study.toml", 12, "the support 3:1", "info"),
    Case("model.unknown-node", lambda f: f.configuration("masses = [{ node = 44, mass = 1.0 }]"),
         "study.toml", 12, "grid point 44", "correct the number"),
    Case("model.unknown-node", lambda f: f.configuration('supports_added = ["66:3"]'),
         "study.toml", 12, "grid point 66", "correct the number"),
    Case("model.unknown-node", lambda f: f.tail('[sensors]\nnodes = { "2" = 99 }\n'),
         "study.toml", 20, "grid point 99", "correct the number"),
    Case("model.component", lambda f: f.tail('[[sensor]]\nname = "2Y+"\nterms = [{ node = 3, component = "S" }]\n'),
         "study.toml", 21, "no component 0", "RX RY RZ"),
    Case("residual.no-scatter", lambda f: f.tail('[residuals]\nfrequency_sd = "test"\n'),
         "study.toml", 20, "does not give the standard deviation of the frequency of mode 1", "a number"),
    # the run folder
    Case("run.unwritable", lambda f: (f.folder / "run").write_text("a file"),
         "run", None, "run is a file, not a folder", "another folder"),
    Case("run.unwritable", lambda f: f.tail('[output]\nfolder = "beam.uff/run"\n'),
         "beam.uff/run", None, "beam.uff is a file", "another folder"),
    Case("write.overwrites-input", _run_over_the_deck, "study.toml", None, "the deck would be overwritten",
         "another name or folder"),
)  # fmt: skip


def _contents(folder: Path) -> dict[Path, bytes]:
    """All files but the journal, which keeps what was solved before an error, and the note whose it is."""
    files = (p for p in folder.rglob("*") if p.is_file() and p.parent.name != "journal" and p.name != OWNER_FILE)
    return {p: p.read_bytes() for p in files}


def _error(files: Files) -> FemtuneError:
    before = _contents(files.folder)
    with pytest.raises(FemtuneError) as caught:
        ft.run("study.toml")
    assert _contents(files.folder) == before
    several = caught.value
    return several.errors[0] if isinstance(several, FemtuneErrors) else several


@pytest.mark.quick(8)
@pytest.mark.parametrize("case", CASES, ids=lambda c: f"{c.code}: {c.says}")
def test_message_names_file_line_and_fix(files: Files, case: Case) -> None:
    case.spoil(files)
    error = _error(files)
    assert error.code == case.code, error
    assert error.where is not None, error
    assert os.path.relpath(error.where.file) == case.file, error
    if case.line is not None:
        assert error.where.line == case.line, error
    assert case.says in str(error), error
    assert case.fix in error.hint, error
    assert error.hint


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_folder(files: Files) -> None:
    (files.folder / "run").mkdir(mode=0o500)
    assert _error(files).code == "run.unwritable"


def test_problems_of_study_deck_and_test_are_shown_together(files: Files) -> None:
    files.study("PBAR 1 I1", "PBAR 7 I1")
    files.study("PBAR 2 I1", "MAT1 1 G")
    files.configuration('leave_out = [{ mode = "9", reason = "x" }]')
    with pytest.raises(FemtuneErrors) as caught:
        ft.run("study.toml")
    assert [e.code for e in caught.value.errors] == [
        "study.unknown-field", "parameter.derived-field", "study.unknown-mode",
    ]  # fmt: skip


def test_a_test_that_several_configurations_share_is_complained_of_once(files: Files) -> None:
    files.study("[[parameter]]", '[[configuration]]\nname = "b"\ntest = "beam.uff"\n\n[[parameter]]')
    (files.folder / "beam.uff").write_text("hello")
    with pytest.raises(FemtuneError) as caught:
        ft.run("study.toml")
    assert not isinstance(caught.value, FemtuneErrors)
