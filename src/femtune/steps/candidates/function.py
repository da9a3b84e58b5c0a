"""The function `candidates`: several sets of parameters, updated and compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from femtune.arguments import checked
from femtune.steps.candidates.result import CandidatesResult
from femtune.steps.held_folder import held
from femtune.steps.report.function import checked_page, with_page
from femtune.steps.results import Results
from femtune.steps.run_study import opened
from femtune.steps.select.run import check_parameters
from femtune.study.described import StudySource, Test, source_of
from femtune.study.executor import check_executor
from femtune.study.inputs import check_outputs, inputs_of_study
from femtune.study.progress import silent
from femtune.study.provenance import Stopwatch, call, inputs_of, provenance, study_facts
from femtune.study.solutions import warnings_of
from femtune.study.study import read_study

if TYPE_CHECKING:
    from femtune.files.study_file.parameter import Parameter
    from femtune.study.progress import Progress


@checked
def candidates(
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
) -> CandidatesResult:
    """Update several sets of parameters from the same test, and compare these candidate models.

    Runs of an earlier, interrupted comparison are read from the run folder.

    Parameters
    ----------
    source, test, parameters, residuals, output, fresh, jobs, progress, tables : as for `update`; the sets are those of
        ``candidate`` (a list of tables) and ``candidates`` (subsets of the free parameters)
    report : HTML page to write, with tables and a picture

    Raises
    ------
    FemtuneError : ``candidates.*``, and as `update`

    Source: Beck and Yuen (2004); Goulet and Smith (2013).

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    >>> fields = {"root": "PBAR 1 I1", "tip": "PBAR 2 I1"}
    >>> free = [ft.Parameter(name, fields=[field], lower=0.5, upper=2.0) for name, field in fields.items()]
    >>> sd = [ft.FrequencyResidual(sd=0.005)]
    >>> found = ft.candidates(model, test, parameters=free, residuals=sd, candidates={"subsets": "all"})
    >>> [(row.name, row.rank, row.admissible) for row in found.candidates]
    [('initial values', 0, False), ('S1', 1, False), ('S2', 1, False), ('S1.2', 2, True)]
    """
    # imported here, because the other steps do not need it
    from femtune.steps.candidates.run import candidate_citations, compare_candidates  # noqa: PLC0415

    given = source_of(source, test=test, parameters=parameters, residuals=residuals, **tables)
    watch = Stopwatch(call("candidates", given))
    page = checked_page(report)
    arrays: dict[str, NDArray[Any]] = {}
    file, folder = opened(given, jobs, output)
    with held(file, folder, "candidates") as place:
        with watch.step("read"):
            study = read_study(file, progress)
            study.problem()
            check_parameters(study)
            check_executor(study, progress)
            inputs = inputs_of(study)
        place.check(study)
        if page is not None:
            check_outputs(inputs_of_study(study), [page])
        if fresh:
            place.forget()
        with watch.step("candidates"):
            record = compare_candidates(study, folder, study.file.study.journal, arrays, progress)
    results = Results(
        provenance=provenance(inputs, watch), study=study_facts(study), candidates=record,
        citations=candidate_citations(),
    )  # fmt: skip
    result = CandidatesResult(record, results, arrays, tuple(warnings_of(study)))
    return with_page(result, page, progress)
