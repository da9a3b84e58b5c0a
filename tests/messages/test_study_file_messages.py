"""Messages of the study file: file, line, key, value and fix; each page of docs/errors shows a message that is real."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError, FemtuneErrors
from femtune.files.study_file import read_study_file, study_from_text

_BASE = """\
[study]
title = "Frame"
deck = "frame.bdf"
units = "m-kg-s"

[modes]
count = 8

[[configuration]]
name = "empty"
test = "frame.uff"
mode_labels = ["1", "2a", "2b"]

[[parameter]]
name = "EI"
fields = ["PBAR 1 I1"]
lower = 0.5
upper = 2.0
"""


@dataclass(frozen=True)
class _Case:
    """Replace `old` by `new` in the base: an error with `code` on `line` whose message holds `says`."""

    code: str
    old: str
    new: str
    line: int
    says: str

    @property
    def text(self) -> str:
        assert self.old in _BASE
        return _BASE.replace(self.old, self.new)


_ON_PAGES = (
    _Case("study.frequency-table", "[[parameter]]", '[reduction]\n\n[[frequency_table]]\nfields = ["MAT1 1 E"]\n'
          'freq_hz = [0.0, 100.0]\nfactor = [1.0, 1.5]\n\n[[parameter]]', 16, "cannot be combined with [reduction]"),
    _Case("study.syntax", "count = 8", "count = eight", 7, "not valid TOML: Invalid value"),
    _Case("study.version", "[study]", "schema_version = 2\n[study]", 1, "reads schema version 1"),
    _Case("study.missing-file", '"frame.uff"', '"frane.uff"', 11, "looked for"),
    _Case("study.unknown-key", "count = 8", "cuont = 8", 7, "did you mean 'count'?"),
    _Case("study.missing-key", 'units = "m-kg-s"\n', "", 1, "[study] lacks the key 'units'"),
    _Case("study.type", "count = 8", 'count = "8"', 7, "should be a whole number"),
    _Case("study.number", "upper = 2.0", "upper = nan", 18, "is not a finite number"),
    _Case("study.value", "count = 8", "count = 0", 7, "greater than or equal to 1"),
    _Case("study.list", '"frame.uff"', '"frame.uff"\nelements_off = "8 THRU 1"', 12, "is not ascending"),
    _Case("study.support", '"frame.uff"', '"frame.uff"\nsupports_added = ["12-123"]', 12, '"12:123"'),
    _Case("study.field", "PBAR 1 I1", "PBAR-1-I1", 16, "PBAR has A, I1, I2"),
    _Case("study.modes", "count = 8", "count = 8\nmax_hz = 200.0", 8, "both count and max_hz"),
    _Case(
        "study.duplicate-name", "[[parameter]]", '[[configuration]]\nname = "empty"\n\n[[parameter]]', 15, "on line 10"
    ),
    _Case("study.test-unused", "[modes]", '[test]\nfile = "frame.uff"\n\n[modes]', 6, "without [[configuration]]"),
    _Case("study.no-test", 'test = "frame.uff"\n', "", 11, "has no test"),
    _Case("study.leave-out", '"2b"]', '"2b"]\nleave_out = [{ reason = "noisy" }]', 13, 'write mode = "…"'),
    _Case(
        "study.unknown-mode", '"2b"]', '"2b"]\npairs = [{ test = "2bb", model = 3 }]', 13, "did you mean '2b'?"
    ),
    _Case(
        "study.nothing-compared", "[[parameter]]", "[residuals]\nfrequency_sd = 0\n\n[[parameter]]", 15, "above zero"
    ),
    _Case("study.hold-out", "[[parameter]]", '[[hold_out]]\nconfiguration = "empty"\n\n[[parameter]]', 14, "above_hz"),
    _Case("study.no-criteria", "[[parameter]]", '[validate]\nprofile = "own"\n\n[[parameter]]', 15, "frequency_error"),
    _Case("study.weight", "[[parameter]]", "[update]\nweight = 0.1\n\n[[parameter]]", 15, "minimum-change"),
    _Case("parameter.tied", "upper = 2.0", 'upper = 2.0\n\n[[parameter]]\nname = "GJ"\ntie = "EI"\nlower = 0.1', 23,
          "follows from other parameters"),
)  # fmt: skip

_OTHERS = (
    _Case("study.field", "PBAR 1 I1", "PSHELL 1 thickness", 16, "PSHELL has T, RI, TS, NSM"),
    _Case("study.field", "PBAR 1 I1", "pshell 1 t", 16, 'in capitals, as in "PSHELL 1 T"'),
    _Case("study.field", "PBAR 1 I1", "bending of column", 16, 'for example "PBAR 1 I1" or "MAT1 2 E"'),
    _Case("study.unknown-key", "[modes]", "[mode]", 6, "did you mean 'modes'?"),
    _Case("study.unknown-key", "[modes]", '[[pair]]\ntest = "1"\nmodel = 1\n\n[modes]', 6, "give --choices"),
    _Case("study.unknown-key", "lower = 0.5", "lower = 0.5\nlowr = 1", 18, "did you mean 'lower'?"),
    _Case("study.missing-key", "upper = 2.0\n", "", 14, "lacks the key 'upper'"),
    _Case("study.missing-key", 'name = "EI"\n', "", 14, "[[parameter]] lacks the key 'name'"),
    _Case("study.missing-file", '"frame.bdf"', '"deck.bdf"', 3, "relative to the folder of the study file"),
    _Case("study.type", "[study]", "write = 8\n[study]", 1, "write [name] on a line of its own"),
    _Case("study.type", "count = 8", "count = true", 7, "should be a whole number"),
    _Case("study.type", "count = 8", "count = 8.0", 7, "should be a whole number"),
    _Case("study.type", '"frame.uff"', "12", 11, "put it in quotes"),
    _Case("study.type", '["PBAR 1 I1"]', '"PBAR 1 I1"', 16, "put it in brackets"),
    _Case("study.type", '["PBAR 1 I1"]', '["PBAR 1 I1"]\nelements = [1, 2.5]', 17, "element numbers"),
    _Case("study.number", "count = 8", "max_hz = inf", 7, "is not a finite number"),
    _Case("study.value", "count = 8", "count = 8\n[residuals]\nshape_form = \"Mac\"", 9, "did you mean 'mac'?"),
    _Case("study.value", '"Frame"', '""', 2, "is empty"),
    _Case("study.list", '["PBAR 1 I1"]', '["PBAR 1 I1"]\nelements = "0, 1"', 17, "below 1"),
    _Case("study.list", '"frame.uff"', '"frame.uff"\nelements_off = "ALL"', 12, "list the elements"),
    _Case("study.list", '"frame.uff"', '"frame.uff"\nelements_off = "1 THRU 999999999"', 12, "more than a million"),
    _Case("study.support", '"frame.uff"', '"frame.uff"\nsupports_removed = ["12:11"]', 12, "each once"),
    _Case("units.unknown", '"m-kg-s"', '"m-kgs-s"', 4, "did you mean 'm-kg-s'?"),
    _Case("parameter.bounds", "lower = 0.5", "lower = 3.0", 17, "lower bound is above the upper bound"),
    _Case("parameter.bounds", "lower = 0.5", "lower = 2.0", 17, "equals the upper bound"),
    _Case("parameter.bounds", "lower = 0.5", "lower = 1.5", 17, "do not include 1"),
    _Case("parameter.bounds", "lower = 0.5", "nominal = 3.0\nlower = 0.5", 17, "nominal value lies outside"),
    _Case("parameter.name", '"EI"', '"E I"', 15, "letters, digits and _"),
    _Case("parameter.duplicate", "[[configuration]]", '[[parameter]]\nname = "EI"\ntie = "2.0"\n\n[[configuration]]',
          19, "line 10"),
    _Case("tie.syntax", "lower = 0.5\nupper = 2.0", 'tie = "__import__(1)"', 17, "exp, log"),
    _Case("tie.unknown", "upper = 2.0", 'upper = 2.0\n[[parameter]]\nname = "GJ"\ntie = "EIx"',
          21, "did you mean 'EI'?"),
    _Case("dof.syntax", "[[parameter]]", "[[sensor]]\nname = \"1Q\"\nterms = [{ node = 1, component = \"X\" }]\n\n"
          "[[parameter]]", 15, "101Z+"),
    _Case("study.hold-out", "[[parameter]]", '[[hold_out]]\nconfiguration = "full"\nmodes = ["1"]\n\n[[parameter]]', 15,
          "no configuration of this name"),
    _Case("study.hold-out", "[[parameter]]", 'use = "validation"\n[[hold_out]]\nconfiguration = "empty"\n'
          "above_hz = 9.0\n\n[[parameter]]", 16, "as a whole"),
    _Case("study.hold-out", "[[parameter]]", '[[configuration]]\nname = "bench"\n\n[[hold_out]]\n'
          'configuration = "bench"\nmodes = ["1"]\n\n[[parameter]]', 18, "has no test"),
    _Case("study.value", "upper = 2.0", "upper = 2.0\nsd = 1e-300", 19, "order of magnitude of its bounds"),
    _Case("study.value", "upper = 2.0", "upper = 2.0\nsd = 1e300", 19, "order of magnitude of its bounds"),
    _Case("study.type", "[[parameter]]", '[plan]\ndirections = "Z"\n\n[[parameter]]', 15,
          'write directions = ["X", "Y", "Z"]'),
    _Case("study.type", "[[parameter]]", '[plan]\ndirections = ["Q"]\n\n[[parameter]]', 15,
          'write directions = ["X", "Y", "Z"]'),
    _Case("study.type", "[[parameter]]", '[plan]\ndirections = []\n\n[[parameter]]', 15,
          'write directions = ["X", "Y", "Z"]'),
    _Case("study.type", "[[parameter]]", '[plan]\ndirections = ["X", "X"]\n\n[[parameter]]', 15,
          'write directions = ["X", "Y", "Z"]'),
    _Case("study.type", "[[parameter]]", '[plan]\ndirections = 3\n\n[[parameter]]', 15,
          'write directions = ["X", "Y", "Z"]'),
    _Case("study.type", "[[parameter]]", '[plan]\ndirections = [["X"]]\n\n[[parameter]]', 15,
          'write directions = ["X", "Y", "Z"]'),
    _Case("study.type", "[[parameter]]", '[update]\nregularisation = "distance"\nweight = "lcurve"\n\n[[parameter]]',
          16, 'write a number, "l-curve" or "gcv"'),
    _Case("study.value", "[[parameter]]", '[update]\nregularisation = "distance"\nweight = -1.0\n\n[[parameter]]', 16,
          "between 0 and 1e+12"),
    _Case("study.value", "[[parameter]]", '[update]\nregularisation = "identical"\nweight = 1.0\n'
          'identical = [["EI"]]\n\n[[parameter]]', 17, "give at least 2"),
    _Case("study.regularisation", "[[parameter]]", '[update]\nregularisation = "identical"\nweight = 1.0\n'
          'identical = [["EI", "EI"]]\n\n[[parameter]]', 17, "list each parameter once"),
    _Case("study.regularisation", "[[parameter]]", '[update]\nregularisation = "prior"\n'
          'correlations = [{ one = "EI", other = "EI", value = 0.5 }]\n\n[[parameter]]', 16, "with itself is always 1"),
    _Case("study.stage", "[[parameter]]", '[[stage]]\nname = "s"\nparameters = ["EI", "EI"]\n'
          'residuals = ["frequency"]\n\n[[parameter]]', 16, "'EI' twice"),
    _Case("test.rotation", '"2b"]', '"2b"]\nrotation = [[2,0,0],[0,1,0],[0,0,1]]', 13, "three orthogonal unit vectors"),
    _Case("test.mirrored", '"2b"]', '"2b"]\nrotation = [[1,0,0],[0,1,0],[0,0,-1]]', 13, "change the sign of one row"),
)  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with the files that the base study names."""
    for name in ("frame.bdf", "frame.uff"):
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _error(text: str) -> FemtuneError:
    with pytest.raises(FemtuneError) as caught:
        study_from_text(text, "study.toml")
    return caught.value


def test_the_base_is_a_study(folder: Path) -> None:
    assert study_from_text(_BASE, "study.toml").study.title == "Frame"


@pytest.mark.parametrize("case", [*_ON_PAGES, *_OTHERS], ids=lambda case: f"{case.code}-{case.says}")
def test_message_says_code_line_and_fix(case: _Case, folder: Path) -> None:
    error = _error(case.text)
    assert error.code == case.code, error
    assert error.where is not None
    assert (error.where.file, error.where.line) == ("study.toml", case.line), error
    assert case.says in str(error)
    assert error.hint


@pytest.mark.parametrize("case", _ON_PAGES, ids=lambda case: case.code)
def test_page_shows_the_real_message(case: _Case, folder: Path) -> None:
    check_shown(case.code, str(_error(case.text)).replace(os.path.abspath("."), "/home/anna/frame"))


def test_all_problems_are_shown_together_in_the_order_of_the_file(folder: Path) -> None:
    text = _BASE.replace("count", "cuont").replace("lower = 0.5", "lower = 3.0").replace("frame.bdf", "none.bdf")
    error = _error(text.replace('"m-kg-s"', "7"))
    assert isinstance(error, FemtuneErrors)
    lines = [e.where.line for e in error.errors if e.where]
    assert [e.code for e in error.errors] == [
        "study.missing-file", "study.type", "study.unknown-key", "parameter.bounds",
    ]  # fmt: skip
    assert lines == [3, 4, 7, 17]
    assert str(error).startswith("4 problems:")


def test_offending_value_is_shown_as_toml_spells_it(folder: Path) -> None:
    assert "  count = true\n" in str(_error(_BASE.replace("count = 8", "count = true")))
    assert '  deck = [1, "a"]\n' in str(_error(_BASE.replace('"frame.bdf"', '[1, "a"]')))


def test_value_cannot_steer_the_terminal(folder: Path) -> None:
    assert "\x1b" not in str(_error(_BASE.replace("count = 8", 'count = "\\u001b[31m"')))


def test_dotted_path_counts_tables_from_one(folder: Path) -> None:
    error = _error(_BASE + '\n[[parameter]]\nname = "b"\nlower = "x"\nupper = 2.0\n')
    assert error.where is not None
    assert (error.where.line, error.where.record) == (22, "parameter[2].lower")


def test_missing_study(tmp_path: Path) -> None:
    with pytest.raises(FemtuneError, match="the file does not exist") as caught:
        read_study_file(tmp_path / "none.toml")
    assert caught.value.code == "study.missing-file"


def test_folder_instead_of_a_study(tmp_path: Path) -> None:
    with pytest.raises(FemtuneError) as caught:
        read_study_file(tmp_path)
    assert caught.value.code == "study.missing-file"


def test_text_that_is_not_utf8_names_its_line(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_bytes(b"[study]\ntitle = '\xe9'\n")
    with pytest.raises(FemtuneError) as caught:
        read_study_file(tmp_path / "s.toml")
    assert caught.value.code == "study.syntax"
    assert str(caught.value.where).endswith("s.toml:2")


@pytest.mark.parametrize("text", ["a = " + "[" * 20000, "a = 1" + "0" * 5000, 'a = "', "a = 1\na = 2"])
def test_text_that_toml_refuses(text: str) -> None:
    assert _error(text).code == "study.syntax"


def test_unclosed_text_at_the_end_names_the_last_line() -> None:
    error = _error('[study]\ntitle = """Frame')
    assert error.where is not None
    assert error.where.line == 2


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("count = 8", "max_hz = 1e300", "'max_hz' should be less than or equal to"),
        ("[[configuration]]", "[residuals]\nfrequency_sd = 1e-300\n[[configuration]]", "zero or between 1e-12"),
        ("[[configuration]]", "[residuals]\nshape_sd = 1e300\n[[configuration]]", "zero or between 1e-12"),
        ("[[configuration]]", "[correlate]\nfrequency_gate = 30\n[[configuration]]", "less than or equal to 1"),
        ("[[configuration]]", "[sensors]\ntolerance = 0\n[[configuration]]", "greater than 0"),
        ('"2b"]', '"2b"]\nmasses = [{ node = 1, mass = 1, inertia = [1, -2, 3] }]', "negative principal moment"),
        (
            '"2b"]',
            '"2b"]\nmasses = [{ node = 1, mass = 1, inertia = [[1, 2, 0], [2, 1, 0], [0, 0, 1]] }]',
            "negative principal moment",
        ),
    ],
)
def test_numbers_that_no_structure_has(tmp_path: Path, old: str, new: str, says: str) -> None:
    for name in ("frame.bdf", "frame.uff"):
        (tmp_path / name).write_text("")
    with pytest.raises(FemtuneError) as caught:
        study_from_text(_BASE.replace(old, new), tmp_path / "study.toml")
    assert "study.value" in str(caught.value)
    assert says in str(caught.value)


def test_a_byte_order_mark_is_no_error(tmp_path: Path) -> None:
    for name in ("frame.bdf", "frame.uff"):
        (tmp_path / name).write_text("")
    (tmp_path / "study.toml").write_bytes(b"\xef\xbb\xbf" + _BASE.encode())
    assert read_study_file(tmp_path / "study.toml").study.title == "Frame"
