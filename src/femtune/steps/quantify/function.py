"""The function `quantify`: mean and covariance of the parameters from repeated tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from femtune.arguments import checked
from femtune.errors import FemtuneError
from femtune.steps.held_folder import held_for_solver
from femtune.steps.quantify.result import QuantifyResult
from femtune.study.described import StudySource, Test, source_of
from femtune.study.progress import silent
from femtune.study.solutions import looking_up
from femtune.study.solved import nominal
from femtune.study.study import read_study

if TYPE_CHECKING:
    from femtune.files.study_file.parameter import Parameter
    from femtune.study.progress import Progress


@checked
def quantify(
    source: StudySource,
    test: Test = None,
    *,
    parameters: Sequence[Parameter | Mapping[str, Any]] | None = None,
    residuals: Sequence[Any] | Mapping[str, Any] | None = None,
    fresh: bool = False,
    jobs: int | None = None,
    progress: Progress = silent,
    **tables: Any,
) -> QuantifyResult:
    """Mean and covariance of the free parameters from repeated tests, starting from the initial values.

    `run` starts from the updated values.

    Parameters
    ----------
    source, test, fresh, progress, tables : as for `correlate`
    parameters, residuals : as for `Study`
    jobs : the most samples of the forward check at a time, in place of [parallel]

    Raises
    ------
    FemtuneError : ``quantify.no-repeats`` without [quantify], and others of ``quantify.*``

    Source: Govers and Link (2010); Silva and others (2016).

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_deck, example_test
    >>> model, test = ft.read_deck(example_deck(), units="m-kg-s"), ft.read_test(example_test())
    >>> fields = {"root": "PBAR 1 I1"}
    >>> free = [ft.Parameter(name, fields=[field], lower=0.5, upper=2.0) for name, field in fields.items()]
    >>> import numpy as np
    >>> hz = test.modes.freq_hz * (1.0 + 0.01 * np.random.default_rng(1).standard_normal((12, 1)))
    >>> np.savetxt("repeats.csv", hz, delimiter=",", header="1,2,3,4", comments="")
    >>> found = ft.quantify(model, test, parameters=free, quantify={"repeats": "repeats.csv"})
    >>> found.frequencies.column("repeats")
    array([12., 12., 12., 12.])
    """
    from femtune.steps.quantify.run import quantify_at, repeats_of  # noqa: PLC0415
    from femtune.steps.select.run import check_parameters  # noqa: PLC0415
    from femtune.study.executor import with_jobs  # noqa: PLC0415

    given = source_of(source, test=test, parameters=parameters, residuals=residuals, **tables)
    with held_for_solver(given, "quantify"):
        study = read_study(with_jobs(given, jobs), progress)
    check_parameters(study)
    repeats = repeats_of(study)
    if repeats is None:
        raise FemtuneError("quantify.no-repeats", where=study.file.where("study"))
    arrays: dict[str, NDArray[Any]] = {}
    with looking_up(study, fresh) as found:
        case = next(c for c in found.study.cases if c.name == repeats.case.name)
        record = quantify_at(found.study, replace(repeats, case=case), nominal(study), arrays, progress)
    return QuantifyResult(record, arrays, tuple(found.remarks))
