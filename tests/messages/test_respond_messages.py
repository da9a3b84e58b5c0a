"""Messages of the step respond."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError

_DECK = """SOL 111
CEND
BEGIN BULK
GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
CBAR,1,1,1,2,0.,1.,0.
PBAR,1,1,1.-3,2.-7,5.-7,4.-7
MAT1,1,2.1+11,,.3,7850.
ENDDATA
"""
_HEAD = """[study]
title = "Beam"
deck = "beam.bdf"
units = "m-kg-s"
[[configuration]]
name = "held"
supports_added = ["1:123456"]
"""
_LINES = "from_hz = 1.0\nto_hz = 9.0\nstep_hz = 1.0\n"


def _refused(folder: Path, text: str, **options: Any) -> FemtuneError:
    (folder / "beam.bdf").write_text(_DECK)
    (folder / "study.toml").write_text(_HEAD + text)
    with pytest.raises(FemtuneError) as caught:
        ft.respond(folder / "study.toml", **options)
    return caught.value


@pytest.mark.quick(7)
@pytest.mark.parametrize(
    ("text", "code", "line", "words"),
    [
        ("", "response.nothing-asked", None, "neither [response] nor [[load]]"),
        (f"[response]\n{_LINES}", "response.no-inputs", 8, "no inputs are given, and it has no test"),
        ('[response]\ninputs = ["2Z+"]\n', "response.no-lines", 8, "no frequency lines of the responses are given"),
        (f'[response]\ninputs = ["3Z+"]\n{_LINES}', "model.unknown-node", 9, "grid point 3 does not exist"),
        (f'[response]\ninputs = ["2S+"]\n{_LINES}', "model.component", 9, "has no component 0"),
        (f'[response]\ninputs = ["1RX+"]\n{_LINES}', "response.held-port", 9, "cannot move, because it is constrained"),
        (f'[response]\ninputs = ["2Z+", "2Z-"]\n{_LINES}', "dof.duplicate", 9, "occurs twice"),
        (f'[response]\ninputs = ["2Z"]\n{_LINES}', "dof.syntax", 9, "not a degree of freedom"),
        ('[response]\nfrom_hz = 9.0\nto_hz = 1.0\nlines = 3\n', "study.response-lines", 10, "must be below to_hz"),
        ('[response]\nstep_hz = 1.0\n', "study.response-lines", 9, "'step_hz' requires from_hz and to_hz"),
        (f'[response]\n{_LINES}lines = 9\n', "study.response-lines", 12, "both a frequency step"),
        ('[response]\nfrom_hz = 0.0\nto_hz = 9.0\nstep_hz = 1e-9\n', "study.response-lines", 11, "more than 1000000"),
        ('[response]\nmodes = 3\nmax_hz = 4.0\n', "study.modes", 10, "both modes and max_hz"),
        ('[response]\nratio = 0.1\nratios = [0.1]\n', "study.response-ratios", 10, "both ratio and ratios"),
        (f'[response]\ninputs = ["2Z+"]\nratios = [0.1]\nmodes = 3\n{_LINES}', "damping.too-few-modes", 10, "1 modes"),
        ('[[load]]\nname = "a"\nforces = { "7Z+" = 1.0 }\n', "model.unknown-node", 10, "grid point 7"),
        ('[[load]]\nname = "a"\nforces = { "2Z+" = 0.0 }\n', "response.zero-load", 10, "zero or cancel"),
        ('[response]\nfrom_hz = 1.0\nto_hz = 1e300\nlines = 3\n', "study.value", 10, "less than or equal to 1000"),
        ('[[load]]\nname = "a"\nforces = { "2Z+" = 1.0 }\n' * 2, "study.duplicate-name", 12, "already used by"),
    ],
)  # fmt: skip
def test_the_line_at_fault_is_named(tmp_path: Path, text: str, code: str, line: int | None, words: str) -> None:
    error = _refused(tmp_path, text)
    assert error.code == code
    assert words in error.what
    assert error.where is not None
    assert error.where.line == line
    assert error.hint


def test_too_many_values(tmp_path: Path) -> None:
    axes = [f'"2{d}+"' for d in ("X", "Y", "Z", "RX", "RY", "RZ")]
    dofs = ", ".join(a.replace("2", str(node)) for node in (1, 2, 3) for a in axes)
    asked = f"[response]\ninputs = [{dofs}]\noutputs = [{dofs}]\nfrom_hz = 1.0\nto_hz = 2.0\nlines = 1000000\n"
    (tmp_path / "beam.bdf").write_text(_DECK.replace("GRID,2,,1.", "GRID,3,,2.,.5,0.\nGRID,2,,1.").replace(
        "ENDDATA", "CBAR,2,1,2,3,0.,1.,0.\nENDDATA"))  # fmt: skip
    study = tmp_path / "free.toml"
    study.write_text(_HEAD.partition("[[configuration]]")[0] + asked)
    with pytest.raises(FemtuneError) as caught:
        ft.respond(study)
    assert caught.value.code == "response.too-many-values"


def test_zero_hertz_of_a_free_structure(tmp_path: Path) -> None:
    # the bar's turning about itself has no mass
    (tmp_path / "beam.bdf").write_text(_DECK.replace("ENDDATA", "SPC1,1,4,1\nENDDATA").replace("CEND", "CEND\nSPC = 1"))
    options = {"inputs": ("2Z+",), "from_hz": 0.0, "to_hz": 2.0, "lines": 3, "ratio": 0.01}
    with pytest.raises(FemtuneError, match="the response at 0 Hz is infinite") as caught:
        ft.respond(tmp_path / "beam.bdf", **options)
    assert caught.value.code == "response.free-at-zero"


@pytest.mark.parametrize("method", ["direct", "real modes", "complex modes"])
def test_zero_hertz_of_free_masses_with_modal_damping(tmp_path: Path, method: str) -> None:
    deck = "SOL 103\nCEND\nBEGIN BULK\nGRID,1,,0.,0.,0.,,23456\nGRID,2,,0.,0.,0.,,23456\nCELAS2,1,800.,1,1,2,1\n"
    (tmp_path / "free.bdf").write_text(deck + "CMASS2,2,2.,2,1\nCMASS2,5,6.,1,1\nCDAMP2,3,4.,1,1,2,1\nENDDATA\n")
    options = {"inputs": ("2X+",), "from_hz": 0.0, "to_hz": 2.0, "lines": 3, "ratio": 0.02, "method": method}
    with pytest.raises(FemtuneError) as caught:
        ft.respond(tmp_path / "free.bdf", **options)
    assert caught.value.code == "response.free-at-zero"


def test_two_files_of_one_name(tmp_path: Path) -> None:
    (tmp_path / "beam.bdf").write_text(_DECK)
    options = {"inputs": ("2Z+",), "from_hz": 1.0, "to_hz": 2.0, "lines": 3}
    one = tmp_path / "a.uff"
    with pytest.raises(FemtuneError, match="another file that is to be written") as caught:
        ft.respond(tmp_path / "beam.bdf", report=one, **options, uff=one, units="m-kg-s")
    assert caught.value.code == "write.overwrites-input"
    assert not one.exists()


def test_a_universal_file_without_a_folder(tmp_path: Path) -> None:
    text = f'[response]\ninputs = ["2Z+"]\n{_LINES}'
    error = _refused(tmp_path, text, uff=tmp_path / "none" / "a.uff")
    assert error.code == "uff.cannot-write"
    assert "folder" in error.hint


def test_negative_damping_is_told(tmp_path: Path) -> None:
    deck = (
        "SOL 103\nCEND\nBEGIN BULK\nGRID,2,,0.,0.,0.,,23456\nCELAS2,1,800.,2,1\nCMASS2,2,2.,2,1\n"
        "CDAMP2,3,-4.,2,1\nENDDATA\n"
    )
    options = {"inputs": ("2X+",), "from_hz": 1.0, "to_hz": 9.0, "lines": 9}
    for sign, told in (("-4.", ["response.unstable"]), ("4.", [])):
        (tmp_path / "one.bdf").write_text(deck.replace("-4.", sign))
        (found,) = ft.respond(tmp_path / "one.bdf", **options)
        assert [a.code for a in found.alerts] == told
        assert [p.freq_hz for p in found.poles] == ([pytest.approx(20.0 / 6.283185307179586)] if told else [])


def test_a_universal_file_of_a_deck_needs_units(tmp_path: Path) -> None:
    (tmp_path / "beam.bdf").write_text(_DECK)
    options = {"inputs": ("2Z+",), "from_hz": 1.0, "to_hz": 2.0, "lines": 3}
    with pytest.raises(FemtuneError) as caught:
        ft.respond(tmp_path / "beam.bdf", **options, uff=tmp_path / "a.uff")
    assert caught.value.code == "response.units-needed"
    with pytest.raises(FemtuneError) as caught:
        ft.respond(tmp_path / "beam.bdf", **options, uff=tmp_path / "beam.bdf", units="m-kg-s")
    assert caught.value.code == "write.overwrites-input"
    error = _refused(tmp_path, f'[response]\ninputs = ["2Z+"]\n{_LINES}', units="mm-t-s")
    assert error.code == "response.units-given"
    error = _refused(tmp_path, '[[load]]\nname = "a"\nforces = { "2Z+" = 1.0 }\n', uff=tmp_path / "a.uff")
    assert error.code == "response.nothing-asked"


def test_an_option_does_not_point_to_the_line_that_it_replaces(tmp_path: Path) -> None:
    error = _refused(tmp_path, f'[response]\ninputs = ["2Z+"]\n{_LINES}', inputs=("8Z+",))
    assert error.code == "model.unknown-node"
    assert error.where is not None
    assert error.where.line == 8
    error = _refused(tmp_path, f'[response]\ninputs = ["2Z+"]\n{_LINES}', kind="inertance")
    assert (error.code, error.where and error.where.file) == ("study.value", "option or argument")


def test_too_few_modes(tmp_path: Path) -> None:
    (tmp_path / "beam.bdf").write_text(_DECK)
    (tmp_path / "study.toml").write_text(_HEAD + f'[response]\ninputs = ["2Z+"]\nratio = 0.01\nmodes = 1\n{_LINES}')
    (found,) = ft.respond(tmp_path / "study.toml", residual_vectors=False)
    (alert,) = found.alerts
    assert alert.code == "response.truncated"
    assert "residual_vectors = false of [response] limits them" in alert.sentence
    check_shown("response.truncated", f"[{alert.code}] {alert.sentence}")
