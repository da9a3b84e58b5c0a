"""The words of the command line as functions: info, modes, correlate, select, update, report, run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from femtune.files.study_file import read_study_file
from femtune.study.progress import Progress, silent
from femtune.study.run_folder import read_results
from femtune.study.steps import RunFolder, correlate, info, mode_sets, modes, select, update

__all__ = ["RunFolder", "correlate", "info", "mode_sets", "modes", "report", "run", "select", "update"]

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
