"""The function `report`: the HTML page of a result, or of a run folder."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from femtune.arguments import checked
from femtune.errors import FemtuneError
from femtune.files.study_file import read_study_file
from femtune.journal.run_files import REPORT_FILE
from femtune.steps.candidates.result import CandidatesResult
from femtune.steps.modes.result import ModesResult
from femtune.steps.plan.result import PlanResult
from femtune.steps.respond.result import RespondResult
from femtune.steps.run.result import RunResult
from femtune.steps.screen.result import ScreenResult
from femtune.steps.search.result import SearchResult
from femtune.study.described import Study
from femtune.study.progress import silent

if TYPE_CHECKING:
    from femtune.document.document import Document
    from femtune.steps.identify.result import IdentifyResult
    from femtune.study.progress import Progress

R = TypeVar("R", CandidatesResult, ModesResult, PlanResult, RespondResult, ScreenResult, SearchResult)


def checked_page(path: Path | str | None) -> Path | None:
    """The page, checked to be writable before solving (error ``run.unwritable``); None without a page."""
    if path is None:
        return None
    # imported here, because pictures take a second to import and most calls need none
    from femtune.reporting.html import check_page  # noqa: PLC0415

    check_page(Path(path))
    return Path(path)


def with_page(result: R, page: Path | None, progress: Progress) -> R:
    """The result, with its page written if requested."""
    return result if page is None else replace(result, report=report(result, page, progress=progress))


@checked
def report(
    source: Path
    | str
    | Study
    | RunResult
    | ModesResult
    | PlanResult
    | CandidatesResult
    | ScreenResult
    | SearchResult
    | RespondResult
    | IdentifyResult,
    path: Path | str | None = None,
    *,
    progress: Progress = silent,
) -> Path:
    """Write the HTML page of a result, or rewrite that of a run folder; returns its path.

    Parameters
    ----------
    source : what `run`, `update`, `validate`, `modes`, `plan`, `screen`, `search`, `candidates`, `respond` or
        `identify` returned; or a run folder, or the study whose run folder is meant
    path : HTML file to write; ``report.html`` in the folder of the result by default
    progress : receives progress reports

    Raises
    ------
    FemtuneError : ``run.missing``, ``run.damaged``, ``run.version``, ``run.unwritable``

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck
    >>> ft.report(ft.modes(example_deck()), "modes.html").name
    'modes.html'
    """
    from femtune.reporting.html import write_html  # noqa: PLC0415

    page = checked_page(path)
    result = _read(source) if isinstance(source, Path | str | Study) else source
    if page is None:
        folder = getattr(result, "folder", None)
        if folder is None:
            raise FemtuneError("run.unwritable/no-folder")
        page = checked_page(Path(folder) / REPORT_FILE)
        assert page is not None
    progress.step("writing the report", 0, None)
    return write_html(document_of(result), page, progress)


def _read(source: Path | str | Study) -> RunResult:
    # imported here, because it imports the records of all steps
    from femtune.steps.run_folder import read_results  # noqa: PLC0415

    if isinstance(source, Study):
        folder = source.file.output_folder
    else:
        folder = Path(source)
        folder = read_study_file(folder).output_folder if folder.is_file() else folder
    return RunResult(folder, *read_results(folder))


_PAGES: dict[type[object], str] = {
    ModesResult: "modes", PlanResult: "plan", CandidatesResult: "candidates", SearchResult: "search",
    ScreenResult: "screen", RespondResult: "responses",
}  # fmt: skip
"""The page of each result."""


def document_of(
    result: RunResult
    | ModesResult
    | PlanResult
    | CandidatesResult
    | ScreenResult
    | SearchResult
    | RespondResult
    | IdentifyResult,
) -> Document:
    """The page of a result as data."""
    # imported here, because pictures take a second to import and most calls need none
    from femtune.steps.identify.page import build_identification_page  # noqa: PLC0415
    from femtune.steps.report.build import build_page, build_report  # noqa: PLC0415

    if isinstance(result, RunResult):
        return build_report(result.results, result.arrays)
    if isinstance(result, ModesResult | PlanResult | CandidatesResult | SearchResult | ScreenResult | RespondResult):
        return build_page(_PAGES[type(result)], result.results, result.arrays)
    return build_identification_page(result)
