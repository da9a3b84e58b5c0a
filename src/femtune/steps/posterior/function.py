"""The function `posterior`: a sampled distribution of the parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femtune.arguments import checked
from femtune.steps.report.function import checked_page
from femtune.steps.report.function import report as page_of
from femtune.steps.run.result import RunResult
from femtune.steps.run_study import _run
from femtune.study.described import StudySource, Test, source_of
from femtune.study.progress import silent

if TYPE_CHECKING:
    from femtune.files.study_file.parameter import Parameter
    from femtune.study.progress import Progress


@checked
def posterior(
    source: StudySource,
    test: Test = None,
    *,
    parameters: Sequence[Parameter | Mapping[str, Any]] | None = None,
    residuals: Sequence[Any] | Mapping[str, Any] | None = None,
    output: Path | str | None = None,
    report: Path | str | None = None,
    fresh: bool = False,
    jobs: int | None = None,
    progress: Progress = silent,
    **tables: Any,
) -> RunResult:
    """Sampled distribution of the parameters, with the size of the errors learned from the data.

    The model is updated first, as by `update`. Solutions of an earlier, interrupted run are read from the run folder.
    The samples are in ``arrays`` of the result, under ``posterior/samples`` with ``posterior/weights``; the intervals
    are in ``posterior``.

    Parameters
    ----------
    source, test, parameters, residuals, output, fresh, jobs, progress, tables : as for `update`; without a table
        ``posterior`` the study gets one with its default values
    report : HTML page to write, with a first page to sign: a single self-contained file

    Raises
    ------
    FemtuneError : as `update`; ``posterior.*`` where there is no likelihood or no optimum

    Source: Vehtari and others (2024) on the weights; Neal (2011) on the chains.

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    >>> fields = {"root": "PBAR 1 I1", "tip": "PBAR 2 I1"}
    >>> free = [ft.Parameter(name, fields=[field], lower=0.5, upper=2.0) for name, field in fields.items()]
    >>> sd = [ft.FrequencyResidual(sd=0.01)]
    >>> asked = {"noise": "stated", "draws": 100, "starts": 0}
    >>> found = ft.posterior(model, test, parameters=free, residuals=sd, posterior=asked).posterior
    >>> [(row.parameter, row.sd < 0.1 * row.mean) for row in found]
    [('root', True), ('tip', True)]
    """
    study = source_of(source, test=test, parameters=parameters, residuals=residuals, **tables)
    page = checked_page(report)
    found = _run(study, "posterior", output, None, fresh, progress, jobs)
    return found if page is None else replace(found, report=page_of(found, page, progress=progress))
