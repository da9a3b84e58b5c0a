"""The function `validate`: the updated model compared with data that the update did not use."""

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
