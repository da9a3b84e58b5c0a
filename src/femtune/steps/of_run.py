"""Steps that write a run folder: update, candidates, validate, run, and reading such a folder."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from femtune.arguments import checked
from femtune.assembly.described import StudySource, Test, source_of
from femtune.assembly.inputs import check_outputs, inputs_of_study
from femtune.assembly.progress import silent
from femtune.assembly.study import read_study
from femtune.errors import FemtuneError, Where
from femtune.files.study_file import BootstrapTable, StudyFile, is_deck, read_study_file
from femtune.journal.run_files import REPORT_FILE
from femtune.results import folder as run_folder
from femtune.results.provenance import Stopwatch, call, inputs_of, provenance, study_facts
from femtune.results.results import Results
from femtune.results.step_results import CandidatesResult, RunResult
from femtune.steps.pages import checked_page, report, with_page
from femtune.study.executor import check_executor, with_jobs
from femtune.study.run import Run
from femtune.study.run_folder import held
from femtune.study.select import check_parameters
from femtune.study.solutions import keeping, warnings_of

if TYPE_CHECKING:
    from femtune.assembly.progress import Progress
    from femtune.assembly.study import Study
    from femtune.files.study_file.objects import Parameter


@checked
def update(
    source: StudySource,
    test: Test = None,
    *,
    parameters: Sequence[Parameter | Mapping[str, Any]] | None = None,
    residuals: Sequence[Any] | Mapping[str, Any] | None = None,
    output: Path | str | None = None,
    wide: bool | None = None,
    fresh: bool = False,
    jobs: int | None = None,
    progress: Progress = silent,
    **tables: Any,
) -> RunResult:
    """Update the parameters and write the updated deck: all steps of a study except the report.

    Solutions of an earlier run in the folder, interrupted or not, are read from its journal.

    Parameters
    ----------
    source, test, tables : as for `correlate`
    parameters, residuals : as for `Study`
    output : run folder instead of the study's, which is ``run`` beside it
    wide : write changed cards in large-field format; None: as stated in the study
    fresh : empty the journal and solve everything again
    jobs : the most runs at a time that do not depend on each other, such as starts, in place of [parallel]
    progress : receives progress reports

    Raises
    ------
    FemtuneError : errors in the study, its files or the run folder; ``run.locked`` where another run is
        at work there. Once the parameters are found results.json is written, whatever happens to the deck afterwards

    Source: Mottershead, Link and Friswell (2011).

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    >>> fields = {"root": "PBAR 1 I1", "tip": "PBAR 2 I1"}
    >>> free = [ft.Parameter(name, fields=[field], lower=0.5, upper=2.0) for name, field in fields.items()]
    >>> result = ft.update(model, test, parameters=free, residuals=[ft.FrequencyResidual(sd=0.01)])
    >>> result.status
    'CONVERGED'
    >>> {name: round(value, 3) for name, value in result.values.items()}
    {'root': 0.9, 'tip': 1.15}
    >>> result.deck.name
    'updated.bdf'
    """
    study = source_of(source, test=test, parameters=parameters, residuals=residuals, **tables)
    return _run(study, "update", output, wide, fresh, progress, jobs)


@checked
def validate(
    source: StudySource,
    test: Test = None,
    *,
    parameters: Sequence[Parameter | Mapping[str, Any]] | None = None,
    residuals: Sequence[Any] | Mapping[str, Any] | None = None,
    output: Path | str | None = None,
    fresh: bool = False,
    jobs: int | None = None,
    progress: Progress = silent,
    **tables: Any,
) -> RunResult:
    """Compare the updated model with data that the update did not use; see ``verdicts`` of the result.

    The model is updated first, as by `update`; solutions of an earlier run are read from its journal.

    Parameters
    ----------
    source, test, parameters, residuals, output, fresh, jobs, progress, tables : as for `update`

    Raises
    ------
    FemtuneError : as `update`

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    >>> fields = {"root": "PBAR 1 I1", "tip": "PBAR 2 I1"}
    >>> free = [ft.Parameter(name, fields=[field], lower=0.5, upper=2.0) for name, field in fields.items()]
    >>> result = ft.validate(model, test, parameters=free, hold_out=[{"modes": ["3"]}])
    >>> [row.freq_error_percent < 1.0 for row in result.predictions]
    [True]
    """
    study = source_of(source, test=test, parameters=parameters, residuals=residuals, **tables)
    return _run(study, "validate", output, None, fresh, progress, jobs)


@checked
def bootstrap(
    source: StudySource,
    test: Test = None,
    *,
    parameters: Sequence[Parameter | Mapping[str, Any]] | None = None,
    residuals: Sequence[Any] | Mapping[str, Any] | None = None,
    output: Path | str | None = None,
    fresh: bool = False,
    jobs: int | None = None,
    progress: Progress = silent,
    **tables: Any,
) -> RunResult:
    """Spread of the updated parameters by a bootstrap of the measured FRFs; see ``bootstrap`` of the result.

    The model is updated first, as by `update`. Runs of an earlier, interrupted bootstrap are read from the run folder.

    Parameters
    ----------
    source, test, parameters, residuals, output, fresh, jobs, progress, tables : as for `update`; without a table
        ``bootstrap`` the study gets one with its default values

    Raises
    ------
    FemtuneError : as `update`; ``bootstrap.*`` where the study compares other data than FRFs, or has no optimum

    Source: Efron and Tibshirani (1993); Wu (1986).

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    >>> fields = {"root": "PBAR 1 I1", "tip": "PBAR 2 I1"}
    >>> free = [ft.Parameter(name, fields=[field], lower=0.5, upper=2.0) for name, field in fields.items()]
    >>> sd = [ft.FrequencyResidual(sd=0.01)]
    >>> noise = {"method": "noise", "runs": 50}
    >>> found = ft.bootstrap(model, test, parameters=free, residuals=sd, bootstrap=noise).bootstrap
    >>> [(row.parameter, row.cov_percent < 10.0) for row in found]
    [('root', True), ('tip', True)]
    """
    study = source_of(source, test=test, parameters=parameters, residuals=residuals, **tables)
    return _run(study, "bootstrap", output, None, fresh, progress, jobs)


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
    # what the other steps do without
    from femtune.study.candidates import candidate_citations, compare_candidates  # noqa: PLC0415

    given = source_of(source, test=test, parameters=parameters, residuals=residuals, **tables)
    watch = Stopwatch(call("candidates", given))
    page = checked_page(report)
    arrays: dict[str, NDArray[Any]] = {}
    file, folder = _opened(given, jobs, output)
    with held(file, folder, "candidates") as place:
        with watch.step("read"):
            study = read_study(file, progress)
            study.problem()
            check_parameters(study)
            check_executor(study)
            inputs = inputs_of(study)
        place.check(study)
        _check_page(page, study)
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


@checked
def run(
    source: StudySource,
    test: Test = None,
    *,
    parameters: Sequence[Parameter | Mapping[str, Any]] | None = None,
    residuals: Sequence[Any] | Mapping[str, Any] | None = None,
    output: Path | str | None = None,
    wide: bool | None = None,
    fresh: bool = False,
    jobs: int | None = None,
    progress: Progress = silent,
    **tables: Any,
) -> RunResult:
    """Run all steps; the run folder receives results.json, arrays.npz, updated.bdf and report.html.

    Parameters
    ----------
    source, test, parameters, residuals, output, wide, fresh, jobs, progress, tables : as for `update`

    Raises
    ------
    FemtuneError : as `update`

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    >>> fields = {"root": "PBAR 1 I1", "tip": "PBAR 2 I1"}
    >>> free = [ft.Parameter(name, fields=[field], lower=0.5, upper=2.0) for name, field in fields.items()]
    >>> result = ft.run(model, test, parameters=free, output="cantilever")
    >>> result.report.name, result.folder.name
    ('report.html', 'cantilever')
    """
    study = source_of(source, test=test, parameters=parameters, residuals=residuals, **tables)
    result = _run(study, "run", output, wide, fresh, progress, jobs)
    return replace(result, report=report(result, progress=progress))


def _run(
    source: Path | str | StudyFile,
    word: str,
    output: Path | str | None,
    wide: bool | None,
    fresh: bool,
    progress: Progress,
    jobs: int | None,
) -> RunResult:
    """The run of a study; `word` is the function recorded in the provenance."""
    watch = Stopwatch(call(word, source))
    file, folder = _opened(source, jobs, output)
    with held(file, folder, word) as place:
        if word == "run":
            checked_page(folder / REPORT_FILE)
        # the folder is held before a solver is started
        with watch.step("read"):
            study = read_study(file, progress, fresh=fresh)
            if word == "bootstrap" and study.file.bootstrap is None:
                study = replace(study, file=study.file.model_copy(update={"bootstrap": BootstrapTable()}))
            study.problem()
            check_parameters(study)
            if study.file.update.starts > 1 or study.file.bootstrap is not None:
                check_executor(study)
            inputs = inputs_of(study)
        place.check(study)
        study, journal = keeping(study, folder, fresh)
        if fresh:
            place.forget()
        wide = study.file.write.wide if wide is None else wide
        return Run(study, place, wide, watch, progress, inputs, journal).go()


def _opened(source: Path | str | StudyFile, jobs: int | None, output: Path | str | None) -> tuple[StudyFile, Path]:
    """The study with its run folder, which `output` replaces for all that is kept there."""
    given = with_jobs(source, jobs)
    if not isinstance(given, StudyFile):
        if is_deck(given):
            raise FemtuneError("study.deck-alone", where=Where(str(given)))
        given = read_study_file(given)
    if output is None:
        return given, given.output_folder
    table = given.output.model_copy(update={"folder": os.path.abspath(output)})
    return given.model_copy(update={"output": table}), Path(output)


def _check_page(page: Path | None, study: Study) -> None:
    """Refuse a page in place of an input (error ``write.overwrites-input``)."""
    if page is not None:
        check_outputs(inputs_of_study(study), [page])


@checked
def read_results(folder: Path | str) -> RunResult:
    """Read a run folder: results, arrays and report.

    Parameters
    ----------
    folder : the run folder

    Raises
    ------
    FemtuneError : ``run.missing``, ``run.damaged``, ``run.version`` or ``run.arrays``

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    >>> fields = {"root": "PBAR 1 I1", "tip": "PBAR 2 I1"}
    >>> free = [ft.Parameter(name, fields=[field], lower=0.5, upper=2.0) for name, field in fields.items()]
    >>> made = ft.update(model, test, parameters=free, output="cantilever")
    >>> ft.read_results("cantilever").values == made.values
    True
    """
    folder = Path(folder)
    page = folder / REPORT_FILE
    return RunResult(folder, *run_folder.read_results(folder), page if page.is_file() else None)
