"""The functions `run` and `read_results`: the whole run of a study, and a run folder read back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femtune.arguments import checked
from femtune.steps import run_folder
from femtune.steps.report.function import report
from femtune.steps.run.result import RunResult
from femtune.study.described import StudySource, Test, source_of
from femtune.study.progress import silent

if TYPE_CHECKING:
    from femtune.files.study_file.parameter import Parameter
    from femtune.study.progress import Progress
from femtune.steps.run_study import _run


@checked
def run(
    source: StudySource,
    test: Test = None,
    *,
    parameters: Sequence[Parameter | Mapping[str, Any]] | None = None,
    residuals: Sequence[Any] | Mapping[str, Any] | None = None,
    choices: Path | str | None = None,
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
    choices : file of choices that were made on the page of a report
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
    study = source_of(source, test=test, parameters=parameters, residuals=residuals, choices=choices, **tables)
    result = _run(study, "run", output, wide, fresh, progress, jobs)
    return replace(result, report=report(result, progress=progress))


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
    page = folder / "report.html"
    return RunResult(folder, *run_folder.read_results(folder), page if page.is_file() else None)
