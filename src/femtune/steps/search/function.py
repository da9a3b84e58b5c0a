"""The function `search`: the minimum of the residuals in the whole box."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femtune.arguments import checked
from femtune.steps.report.function import checked_page, with_page
from femtune.study.described import StudySource, Test, source_of
from femtune.study.progress import silent

if TYPE_CHECKING:
    from femtune.files.study_file.parameter import Parameter
    from femtune.steps.search.result import SearchResult
    from femtune.study.progress import Progress


@checked
def search(
    source: StudySource,
    test: Test = None,
    *,
    parameters: Sequence[Parameter | Mapping[str, Any]] | None = None,
    residuals: Sequence[Any] | Mapping[str, Any] | None = None,
    csv: Path | str | None = None,
    report: Path | str | None = None,
    fresh: bool = False,
    jobs: int | None = None,
    progress: Progress = silent,
    **options: Any,
) -> SearchResult:
    """The minimum of the squared residuals in the whole box, on a surrogate or on the model, confirmed on the model.

    Parameters
    ----------
    source, test, parameters, residuals : as for `correlate` and `Study`
    csv : table to write of the front, if there is one: values of the free parameters, and both objectives
    report : HTML page to write, with tables and a picture
    fresh : ignore the journal of an earlier run of the study and solve everything again
    jobs : maximum number of parallel runs; overrides [parallel]
    progress : receives progress reports
    options : keys of [search] that replace those of the study: ``on``, ``runs``, ``method``, ``seeds`` …

    Raises
    ------
    FemtuneError : ``search.*``, ``surrogate.*``, ``study.no-test``, ``study.no-parameters``, and as `correlate`

    Source: Sacks and others (1989); Storn and Price (1997).

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    >>> fields = {"root": "PBAR 1 I1", "tip": "PBAR 2 I1"}
    >>> free = [ft.Parameter(name, fields=[field], lower=0.5, upper=2.0) for name, field in fields.items()]
    >>> found = ft.search(model, test, parameters=free, residuals=[ft.FrequencyResidual(sd=0.01)], runs=20)
    >>> {name: round(value, 4) for name, value in found.values.items()}
    {'root': 0.9, 'tip': 1.15}
    """
    from femtune.steps.search.run import search_minimum  # noqa: PLC0415

    page = checked_page(report)
    given = source_of(source, test=test, parameters=parameters, residuals=residuals)
    table = None if csv is None else Path(csv)
    return with_page(
        search_minimum(given, options, progress, fresh=fresh, jobs=jobs, table_of_front=table), page, progress
    )
