"""The words of the command line as functions: info, modes, correlate, select, update, report, run.

`modes_report` is ``modes --report``.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from femtune.files.study_file import read_study_file
from femtune.study.modes_results import modes_results
from femtune.study.progress import Progress, silent
from femtune.study.results import Results
from femtune.study.run_folder import read_results
from femtune.study.steps import RunFolder, correlate, info, mode_sets, modes, select, update

__all__ = ["RunFolder", "correlate", "info", "mode_sets", "modes", "modes_report", "report", "run", "select", "update"]

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
    folder = update(path, output, wide, progress, fresh=fresh)
    return replace(folder, report=report(folder.folder, progress))


def modes_report(
    path: Path | str,
    page: Path | str,
    progress: Progress = silent,
    *,
    fresh: bool = False,
    remarks: list[str] | None = None,
) -> Results:
    """Write a page of the natural modes of a study, or of a deck alone, with a picture of each; returns what it shows.

    Parameters
    ----------
    path : the study file, or the deck
    page : the HTML file to write: one file that loads nothing from elsewhere
    fresh, remarks : as for `modes`

    Raises
    ------
    FemtuneError : ``run.unwritable`` before anything is solved, ``write.overwrites-input``, and as `modes`
    """
    # as in `report`
    from femtune.report import build_modes_page, check_page, write_html  # noqa: PLC0415

    page = Path(page)
    check_page(page)
    results, arrays = modes_results(path, progress, fresh=fresh, remarks=remarks, keep=[page])
    progress.step("drawing the modes", 0, None)
    write_html(build_modes_page(results, arrays), page)
    return results


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
    return write_html(build_report(results, arrays), folder / REPORT_FILE)
