"""The step select: which parameters, and which combinations of them, the data determine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.results.checks import model_checks
from femtune.results.fisher import fisher_results
from femtune.results.selection import selection_measures
from femtune.results.solved import solutions_of
from femtune.results.update import selection_results
from femtune.selection import estimated_size, identifiability

if TYPE_CHECKING:
    from femtune.assembly.progress import Progress
    from femtune.assembly.study import Study
    from femtune.residuals import Evaluation
    from femtune.results.update import SelectionResults
    from femtune.selection import CosineDistances


def check_parameters(study: Study) -> None:
    """Refuse a study without free parameters (error ``study.no-parameters``)."""
    if not study.parameters.free:
        raise FemtuneError(
            "study.no-parameters",
            where=study.file.where("parameter") if study.file.parameter else study.file.where("study"),
        )


def select_at(study: Study, at: Evaluation, arrays: dict[str, NDArray], progress: Progress) -> SelectionResults:
    """Which parameters, and which combinations of them, the data determine at an evaluation."""
    progress.step("sensitivities", 0, None)
    names = tuple(p.name for p in study.parameters.free)
    stated = study.file.residuals.scatter == "stated"
    size = 1.0 if stated else estimated_size(at.jacobian, at.residuals, sum(at.lost.values()))
    known = identifiability(at.jacobian, np.asarray(study.parameters.prior[1]), names, size)
    found = selection_results(study, known, at, arrays)
    progress.step("measures of the parameters", 0, None)
    near, remarks = _distances(study, at)
    measures = selection_measures(study, known, at, near, remarks)
    more = {"measures": measures, "fisher": fisher_results(study, at, "before")}
    return found.model_copy(update={"model_checks": model_checks(study, solutions_of(at), progress), **more})


def _distances(study: Study, at: Evaluation) -> tuple[CosineDistances | None, tuple[str, ...]]:
    """Distances from the covariance of the repeats, before any update, and why there are none."""
    if study.file.quantify is None:
        return None, ()
    # most studies have no repeats
    from femtune.study.quantify import distances_at  # noqa: PLC0415

    found = distances_at(study, at.x)
    return (None, (found,)) if isinstance(found, str) else (found, ())
