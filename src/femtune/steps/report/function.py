"""The function `report`: the HTML page of a result, or of a run folder."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

from femtune.arguments import checked
from femtune.errors import FemtuneError, Where
from femtune.files.study_file import read_study_file
from femtune.files.whole_file import digest_of, is_digest, write_whole
from femtune.journal.owner import check_owner
from femtune.journal.run_files import ARRAYS_FILE, DIGEST_FILE, REPORT_FILE, RESULTS_FILE
from femtune.steps.result import ResultWithPage
from femtune.steps.run.result import RunResult
from femtune.study.described import Study
from femtune.study.progress import silent
from femtune.study.record import InputFile

if TYPE_CHECKING:
    from femtune.document.document import Document
    from femtune.steps.identify.result import IdentifyResult
    from femtune.study.progress import Progress

R = TypeVar("R", bound=ResultWithPage)


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
    if page is None:
        return result
    # every result is a dataclass, its base is none
    written: R = replace(cast("Any", result), report=report(result, page, progress=progress))
    return written


@checked
def report(
    source: Path | str | Study | RunResult | ResultWithPage | IdentifyResult,
    path: Path | str | None = None,
    *,
    progress: Progress = silent,
) -> Path:
    """Write the HTML page of a result, or rewrite that of a run folder; returns its path.

    Parameters
    ----------
    source : what `run`, `update`, `validate`, `identify` or a step with a page of its own (`modes`, `plan`, `screen`,
        `search`, `candidates`, `respond`) returned; or a run folder, or the study whose run folder is meant
    path : HTML file to write; ``report.html`` in the folder of the result by default
    progress : receives progress reports

    Raises
    ------
    FemtuneError : ``run.missing``, ``run.damaged``, ``run.version``, ``run.unwritable``, ``run.other-study``

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
    written = write_html(document_of(result), page, progress)
    if isinstance(result, RunResult) and written.name == REPORT_FILE and written.parent.samefile(result.folder):
        write_digest(written)
    return written


def write_digest(page: Path) -> Path:
    """Write the SHA-256 of a page beside it, in the format of ``sha256sum``.

    Raises
    ------
    FemtuneError : ``run.unwritable``; ``run.other-file`` for a file there that is no digest
    """
    beside = page.with_name(DIGEST_FILE)
    if os.path.lexists(beside) and not is_digest(beside):
        raise FemtuneError("run.other-file", where=Where(str(beside)), name=DIGEST_FILE)
    try:
        write_whole(beside, f"{digest_of(page)}  {page.name}\n".encode())
    except OSError as error:
        raise FemtuneError("run.unwritable/report", where=Where(str(beside)), reason=error.strerror or error) from error
    return beside


def _read(source: Path | str | Study) -> RunResult:
    # imported here, because they import the records of all steps
    from femtune.steps.held_folder import identity  # noqa: PLC0415
    from femtune.steps.run_folder import read_results  # noqa: PLC0415

    if not isinstance(source, Study) and not Path(source).is_file():
        return RunResult(Path(source), *read_results(source))
    file = source.file if isinstance(source, Study) else read_study_file(source)
    check_owner(file.output_folder, *identity(file), file.where("output", "folder"))
    return RunResult(file.output_folder, *read_results(file.output_folder))


def files_of(folder: Path) -> tuple[InputFile, ...]:
    """The results in a run folder with their digests; () for a folder without them."""
    paths = [folder / name for name in (RESULTS_FILE, ARRAYS_FILE)]
    return tuple(InputFile(path=path.name, sha256=digest_of(path)) for path in paths if path.is_file())


def document_of(result: RunResult | ResultWithPage | IdentifyResult) -> Document:
    """The page of a result as data."""
    # imported here, because pictures take a second to import and most calls need none
    from femtune.steps.identify.page import build_identification_page  # noqa: PLC0415
    from femtune.steps.report.build import build_page, build_report  # noqa: PLC0415

    if isinstance(result, RunResult):
        return build_report(result.results, result.arrays, files_of(result.folder))
    if isinstance(result, ResultWithPage):
        return build_page(result.page, result.results, result.arrays)
    return build_identification_page(result)
