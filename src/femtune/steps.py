"""The words of the command line as functions: info, modes, respond, correlate, select, update, quantify, validate, run.

`report` writes that of a run again; `modes_report` is ``modes --report``, `respond_report` is ``respond --report``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from femtune.files.study_file import read_study_file
from femtune.study.identification import IdentifiedFolder
from femtune.study.identification import identify as find_modes
from femtune.study.modes_results import modes_results
from femtune.study.progress import Progress, silent
from femtune.study.respond import respond_results
from femtune.study.results import Results
from femtune.study.results_response import ResponseResults
from femtune.study.run_folder import read_results
from femtune.study.steps import (
    RunFolder,
    SimulatedTest,
    correlate,
    info,
    mode_sets,
    modes,
    quantify,
    select,
    update,
    validate,
)

__all__ = [
    "IdentifiedFolder",
    "RunFolder",
    "SimulatedTest",
    "correlate",
    "identify",
    "info",
    "mode_sets",
    "modes",
    "modes_report",
    "quantify",
    "report",
    "respond",
    "respond_report",
    "run",
    "select",
    "update",
    "validate",
]

REPORT_FILE = "report.html"


def run(
    path: Path | str,
    output: Path | str | None = None,
    wide: bool | None = None,
    progress: Progress = silent,
    *,
    fresh: bool = False,
) -> RunFolder:
    """All steps in their order: a run folder with results.json, arrays.npz, updated.bdf and report.html.

    Parameters
    ----------
    path : the study file
    output : run folder instead of the study's
    wide : write changed cards in large field; the study decides where None
    fresh : empty the journal of earlier runs in the folder and solve everything again

    Raises
    ------
    FemtuneError : whatever is wrong with the study, its files or the run folder
    """
    folder = update(path, output, wide, progress, fresh=fresh, word="run")
    return replace(folder, report=report(folder.folder, progress))


def modes_report(
    path: Path | str,
    page: Path | str,
    progress: Progress = silent,
    *,
    fresh: bool = False,
    remarks: list[str] | None = None,
    count: int | None = None,
    max_hz: float | None = None,
    simulate: SimulatedTest | None = None,
) -> Results:
    """Write a page of the natural modes of a study, or of a deck alone, with a picture of each; returns what it shows.

    Parameters
    ----------
    path : the study file, or the deck
    page : the HTML file to write: one file that loads nothing from elsewhere
    fresh, remarks, count, max_hz, simulate : as for `modes`

    Raises
    ------
    FemtuneError : ``run.unwritable`` before anything is solved, ``write.overwrites-input``, and as `modes`
    """
    # as in `report`
    from femtune.report import build_modes_page, check_page, write_html  # noqa: PLC0415

    page = Path(page)
    check_page(page)
    results, arrays = modes_results(
        path, progress, fresh=fresh, remarks=remarks, keep=[page], count=count, max_hz=max_hz, simulate=simulate
    )
    progress.step("drawing the modes", 0, None)
    write_html(build_modes_page(results, arrays), page, progress)
    return results


def respond(
    path: Path | str,
    progress: Progress = silent,
    arrays: dict[str, NDArray] | None = None,
    *,
    options: Mapping[str, Any] | None = None,
    uff: Path | str | None = None,
    units: str | None = None,
    fresh: bool = False,
    remarks: list[str] | None = None,
) -> tuple[ResponseResults, ...]:
    """Frequency responses, complex modes and static displacements of a study, or of a deck alone.

    Parameters
    ----------
    arrays : gets the functions that the records refer to by key
    options : keys of [response] that take the place of the study's, or stand for them: ``{"inputs": ("12Z+",)}``
    uff : Universal File to write the functions to; with several configurations each has its own, numbered
    units : length-mass-s of a deck alone, where a Universal File is wanted
    fresh, remarks : as for `modes`

    Raises
    ------
    FemtuneError : ``response.*``, ``write.overwrites-input``, ``uff.cannot-write``, and as `modes`
    """
    file = None if uff is None else Path(uff)
    found = respond_results(path, options or {}, progress, fresh=fresh, remarks=remarks, uff=file, units=units)
    if arrays is not None:
        arrays.update(found[1])
    return found[0].responses


def respond_report(
    path: Path | str,
    page: Path | str,
    progress: Progress = silent,
    *,
    options: Mapping[str, Any] | None = None,
    uff: Path | str | None = None,
    units: str | None = None,
    fresh: bool = False,
    remarks: list[str] | None = None,
) -> Results:
    """Write a page of the responses of a study, or of a deck alone, with pictures; returns what it shows.

    Parameters
    ----------
    page : the HTML file to write: one file that loads nothing from elsewhere
    options, uff, units, fresh, remarks : as for `respond`

    Raises
    ------
    FemtuneError : ``run.unwritable`` before anything is solved, and as `respond`
    """
    # as in `report`
    from femtune.report import build_responses_page, check_page, write_html  # noqa: PLC0415

    page, file = Path(page), None if uff is None else Path(uff)
    check_page(page)
    results, arrays = respond_results(
        path, options or {}, progress, fresh=fresh, remarks=remarks, uff=file, units=units, keep=[page]
    )
    progress.step("drawing the responses", 0, None)
    write_html(build_responses_page(results, arrays), page, progress)
    return results


def identify(
    path: Path | str,
    output: Path | str | None = None,
    progress: Progress = silent,
    *,
    options: Mapping[str, Any] | None = None,
) -> IdentifiedFolder:
    """Modes of a record in time or of measured functions: a folder with modes, poles, their tables and report.html.

    Parameters
    ----------
    path : an identification file (TOML), or the measured file itself
    output : folder instead of that of the file
    options : keys of [identify] that take the place of the file's: ``{"band_hz": (2.0, 40.0)}``

    Raises
    ------
    FemtuneError : ``record.*``, ``uff.*``, ``identify.*``, ``run.unwritable``
    """
    # as in `report`
    from femtune.report import build_identification_page, write_html  # noqa: PLC0415

    made = find_modes(path, output, progress, options=options)
    made = replace(made, files=(REPORT_FILE, *made.files))
    progress.step("drawing the page", 0, None)
    write_html(build_identification_page(made), made.folder / REPORT_FILE, progress)
    return made


def report(path: Path | str, progress: Progress = silent) -> Path:
    """Write the report of a run again from its results; `path` is the run folder, or the study.

    Raises
    ------
    FemtuneError : ``run.missing``, ``run.damaged``, ``run.version``, ``run.unwritable``
    """
    # pictures take a second to import, and the other steps need none
    from femtune.report import build_report, write_html  # noqa: PLC0415

    folder = Path(path)
    if folder.is_file():
        folder = read_study_file(folder).output_folder
    progress.step("writing the report", 0, None)
    results, arrays = read_results(folder)
    return write_html(build_report(results, arrays), folder / REPORT_FILE, progress)
