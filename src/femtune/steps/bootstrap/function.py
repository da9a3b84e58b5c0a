"""The function `bootstrap`: spread of the updated parameters, from the FRFs of one test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from femtune.arguments import checked
from femtune.steps.run.result import RunResult
from femtune.study.described import StudySource, Test, source_of
from femtune.study.progress import silent

if TYPE_CHECKING:
    from femtune.files.study_file.parameter import Parameter
    from femtune.study.progress import Progress
from femtune.steps.run_study import _run


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
