"""The function `update`: the free parameters of a study, updated, with their uncertainty."""

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
    jobs : maximum number of parallel runs, such as starts; overrides [parallel]
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
