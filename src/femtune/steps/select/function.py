"""The function `select`: which parameters the data determine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from femtune.arguments import checked
from femtune.steps.correlate.versions import start
from femtune.steps.held_folder import held_for_solver
from femtune.steps.select.result import SelectResult
from femtune.study.described import StudySource, Test, source_of
from femtune.study.progress import silent
from femtune.study.solutions import looking_up
from femtune.study.study import read_study

if TYPE_CHECKING:
    from femtune.files.study_file.parameter import Parameter
    from femtune.study.progress import Progress


@checked
def select(
    source: StudySource,
    test: Test = None,
    *,
    parameters: Sequence[Parameter | Mapping[str, Any]] | None = None,
    residuals: Sequence[Any] | Mapping[str, Any] | None = None,
    fresh: bool = False,
    progress: Progress = silent,
    **tables: Any,
) -> SelectResult:
    """Which parameters and combinations of parameters the data determine.

    Parameters
    ----------
    source, test, fresh, progress, tables : as for `correlate`
    parameters, residuals : as for `Study`

    Raises
    ------
    FemtuneError : ``study.no-parameters``, and as `correlate`

    Source: Friswell and Mottershead (1995).

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    >>> fields = {"root": "PBAR 1 I1", "tip": "PBAR 2 I1"}
    >>> free = [ft.Parameter(name, fields=[field], lower=0.5, upper=2.0) for name, field in fields.items()]
    >>> found = ft.select(model, test, parameters=free, residuals=[ft.FrequencyResidual(sd=0.01)])
    >>> found
    SelectResult: 2 of 2 combinations of parameters are determined
      The data determine all 2 free parameters, some better than others.
    >>> found.jacobian.shape
    (4, 2)
    """
    # imported here, because the other steps do not need it
    from femtune.steps.select.run import check_parameters, select_at  # noqa: PLC0415

    given = source_of(source, test=test, parameters=parameters, residuals=residuals, **tables)
    with held_for_solver(given, "select"):
        study = read_study(given, progress)
    check_parameters(study)
    arrays: dict[str, NDArray[Any]] = {}
    with looking_up(study, fresh) as found:
        at = start(found.study, progress)
        record = select_at(found.study, at, arrays, progress)
        if found.study.file.select.missing:
            # few studies ask for it
            from femtune.steps.judge.facts.missing import fields_before_update  # noqa: PLC0415

            missing = fields_before_update(found.study, at, progress)
            record = record.model_copy(update={"missing": missing})
    return SelectResult(record, arrays, tuple(found.remarks))
