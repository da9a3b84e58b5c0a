"""Mistakes whose fix is known: decimal commas, backslashes, values in place of factors, names of files."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.document.document import Document
from femtune.errors import FemtuneError
from femtune.files.study_file import read_study_file
from femtune.model.eigen.solution import EigenSolution
from femtune.reporting.html import write_html
from femtune.steps.run_folder import RESULTS_FILE, read_results
from femtune.testing import example_deck, example_test

PARAMETER = '[[parameter]]\nname = "E"\nfields = ["MAT1 1 E"]\n'


def study(folder: Path, text: str, deck: str = "") -> Path:
    name = deck or example_deck(folder).name
    (folder / "study.toml").write_text(f'[study]\ntitle = "x"\ndeck = "{name}"\nunits = "m-kg-s"\n{text}')
    return folder / "study.toml"


def message(folder: Path, text: str, deck: str = "") -> str:
    with pytest.raises(FemtuneError) as caught:
        read_study_file(study(folder, text, deck))
    return str(caught.value).replace(f"{folder}/", "")


def test_a_decimal_comma(tmp_path: Path) -> None:
    check_shown("study.syntax, decimal comma", message(tmp_path, PARAMETER + "lower = 0,8\nupper = 1,2  # wide\n"))


def test_a_windows_path(tmp_path: Path) -> None:
    check_shown("study.syntax, backslash", message(tmp_path, "", "C:\\Users\\me\\frame.bdf"))


def test_a_windows_path_that_is_valid_toml(tmp_path: Path) -> None:
    shown = message(tmp_path, "", "C:\\temp\\frame.bdf")
    assert "read as an escape sequence" in shown
    assert "forward slashes" in shown


def updated(folder: Path, text: str, **more: str) -> ft.RunResult:
    test = example_test(folder)
    rest = f'[test]\nfile = "{test.name}"\n[residuals]\nfrequency_sd = 0.01\n[update]\nregularisation = "none"\n'
    return ft.run(study(folder, rest + PARAMETER + text, **more))


@pytest.mark.parametrize("lower", ["150e9", "0.5"])
def test_values_where_factors_are_expected(tmp_path: Path, lower: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        updated(tmp_path, f"lower = {lower}\nupper = 250e9\n")
    shown = str(caught.value).replace(f"{tmp_path}/", "")
    assert "absolute = true" in shown
    check_shown(f"parameter.bounds, values with lower = {lower}", shown)


@pytest.mark.parametrize("name", ["results.json", "Report.html", "arrays.npz", "journal"])
@pytest.mark.slow
def test_an_include_that_is_called_like_a_file_of_the_run(tmp_path: Path, name: str) -> None:
    lines = example_deck(tmp_path).read_text().splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("MAT1"))
    (tmp_path / name).write_text(lines[at] + "\n")
    lines[at] = f"INCLUDE '{name}'"
    (tmp_path / "frame.bdf").write_text("\n".join(lines) + "\n")
    made = updated(tmp_path, 'lower = 0.5\nupper = 2.0\n[output]\nfolder = "out"\n', deck="frame.bdf")
    # the run folder can be read, and the updated deck has the updated value
    read_results(made.folder)
    written = ft.read_deck(made.folder / "updated.bdf", units="m-kg-s")
    found = ft.modes(written, count=1).frequencies
    again = ft.modes(example_deck(tmp_path), count=1).frequencies
    assert abs(found[0]["freq_hz"] / again[0]["freq_hz"] - 1.0) > 1e-3


def test_results_that_are_a_pipe_are_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / RESULTS_FILE)
    with pytest.raises(FemtuneError, match="not an ordinary file"):
        read_results(tmp_path)


def test_a_page_is_not_written_through_a_link(tmp_path: Path) -> None:
    (tmp_path / "deck.bdf").write_text("input")
    (tmp_path / "report.html").symlink_to("deck.bdf")
    write_html(Document("x", "x.", "info", (), (), (), "Report"), tmp_path / "report.html")
    assert (tmp_path / "deck.bdf").read_text() == "input"
    assert (tmp_path / "report.html").read_text().startswith("<!DOCTYPE html>")


def test_recalled_modes_must_be_modes(tmp_path: Path) -> None:
    from femtune.journal.solver import check_pairs  # noqa: PLC0415

    solved = solution_of(tmp_path)
    check_pairs(solved.point, solved.eigenvalues, solved.shapes)
    for values, shapes in (
        (solved.eigenvalues * np.where(np.arange(len(solved.eigenvalues)) == 1, 1.001, 1.0), solved.shapes),
        (solved.eigenvalues, 1.001 * solved.shapes),
        (solved.eigenvalues, solved.shapes[::-1]),
        (solved.eigenvalues, solved.shapes[:, ::-1]),
        (solved.eigenvalues, solved.shapes + 1e-2 * np.abs(solved.shapes).max()),
    ):
        with pytest.raises(ValueError, match="do not satisfy"):
            check_pairs(solved.point, values, shapes)


def solution_of(folder: Path) -> EigenSolution:
    from femtune.model import solve_modes  # noqa: PLC0415
    from femtune.study.study import load_study  # noqa: PLC0415

    loaded = load_study(study(folder, ""))
    return solve_modes(loaded.cases[0].configured.at(np.zeros(0)), 4)
