"""The step select: which parameters, and which combinations of them, the data determine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.selection import estimated_size, identifiability
from femtune.selection.smooth import Smoothness, smoothness
from femtune.steps.info.checks import model_checks
from femtune.steps.select.fisher import fisher_results, known_of_frfs
from femtune.steps.select.measures import selection_measures
from femtune.steps.select.record.identifiability import SmoothnessRecord
from femtune.steps.update.facts.update import selection_results
from femtune.study.solved import solutions_of
from femtune.study.stages import reduction_rules
from femtune.updating.on_reduced_model import NOBODY, train, unassessed

if TYPE_CHECKING:
    from femtune.residuals import Evaluation
    from femtune.selection import CosineDistances
    from femtune.steps.select.record.identifiability import SelectionResults
    from femtune.study.progress import Progress
    from femtune.study.study import Study


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
    record = selection_results(study, known, at, arrays)
    progress.step("measures of the parameters", 0, None)
    near, remarks = _distances(study, at)
    measures = selection_measures(study, known, at, near, remarks)
    smooth = _smoothness(study, at, progress)
    more = {
        "measures": measures,
        "fisher": fisher_results(study, at, "before", known_of_frfs(study, at, "before")),
        "smoothness": smooth,
        "sentences": (*record.sentences, *(s.sentence for s in smooth if s.sentence)),
    }
    return record.model_copy(update={"model_checks": model_checks(study, solutions_of(at), progress), **more})


def _smoothness(study: Study, at: Evaluation, progress: Progress) -> tuple[SmoothnessRecord, ...]:
    """The misfit along each parameter, on reduced models where the study has them."""
    if not study.file.select.smoothness:
        return ()
    problem, rules = study.problem(), reduction_rules(study)
    if rules is not None:
        progress.step("reduced models", 0, None)
        search = train(problem, rules, unassessed(problem), NOBODY)
        problem = search.reduced_problem()
        at = problem.start(at.x)
    lines = smoothness(problem, at, report=lambda i, k: progress.step("misfit along the parameters", i, k))
    scale, nominal = study.parameters.scale, study.parameters.nominal
    return tuple(_smooth(f, float(nominal[i]), float(scale[i])) for i, f in enumerate(lines))


def _smooth(smoothness: Smoothness, nominal: float, scale: float) -> SmoothnessRecord:
    where, minima = nominal + scale * smoothness.where, tuple(float(nominal + scale * x) for x in smoothness.minima)
    return SmoothnessRecord(
        parameter=smoothness.name, verdict=smoothness.verdict, holds_percent=100.0 * smoothness.holds,
        where=where, minima=minima, points=len(smoothness.x), failed=smoothness.failed,
        sentence=_words(smoothness, where, minima),
    )  # fmt: skip


def _words(smoothness: Smoothness, where: float, minima: tuple[float, ...]) -> str:
    """Why a misfit is not smooth, and what helps."""
    head = f"The misfit is not smooth along {smoothness.name}, the other parameters at their initial values"
    several = f"; it has minima near {_listed(minima)}" if len(minima) > 1 else ""
    if smoothness.verdict == "no solution":
        return f"The misfit along {smoothness.name} is not known: the model could not be solved between its bounds."
    if smoothness.verdict == "smooth":
        return ""
    if smoothness.verdict == "several minima":
        return f"Along {smoothness.name} the misfit has several minima, near {_listed(minima)}: {_HELP}."
    if smoothness.holds == 0.0:
        return f"{head}: near {where:.4g} it has a kink or a jump{several}. {_HELP[:1].upper()}{_HELP[1:]}."
    part = f"near {where:.4g} its slope holds over {100.0 * smoothness.holds:.2g} % of the range only"
    return f"{head}: {part}{several}. {_HELP[:1].upper()}{_HELP[1:]}."


def _listed(values: tuple[float, ...]) -> str:
    return ", ".join(f"{v:.4g}" for v in values)


_HELP = (
    "an update from far away may not find the best value; use several starts, narrower bounds, more frequency lines or "
    "a larger equalised damping, or fix the parameter"
)


def _distances(study: Study, at: Evaluation) -> tuple[CosineDistances | None, tuple[str, ...]]:
    """Distances from the covariance of the repeats, before any update, and why there are none."""
    if study.file.quantify is None:
        return None, ()
    # most studies have no repeats
    from femtune.steps.quantify.run import distances_at  # noqa: PLC0415

    distances = distances_at(study, at.x)
    return (None, (distances,)) if isinstance(distances, str) else (distances, ())
