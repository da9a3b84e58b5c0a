"""The step specimens: each specimen of a study calibrated separately, and compared with the joint calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.steps.update.run import with_noise_of_tests
from femtune.study.stages import bottom_up, reduction_rules
from femtune.study.update_method import method_of
from femtune.updating import update, update_reduced
from femtune.updating.on_reduced_model import unassessed

if TYPE_CHECKING:
    from femtune.steps.update.run import FoundParameters
    from femtune.study.progress import Progress
    from femtune.study.study import Study
    from femtune.updating import UpdateResult


def calibrate_each(study: Study, parameters: FoundParameters, progress: Progress) -> dict[str, UpdateResult]:
    """The calibration of each specimen alone, which starts where the joint one ended; with stages as the study says.

    None where all parameters are individual: then the joint calibration is the separate one of each specimen.

    Raises
    ------
    FemtuneError : what the update method raises
    """
    specimens = study.specimens
    if specimens is None or all(study.in_study(p.name) != p.name for p in study.parameters.free):
        return {}
    out: dict[str, UpdateResult] = {}
    for i, name in enumerate(specimens.names):
        progress.step(f"calibration of specimen {name} alone", i, len(specimens.names))
        specimen_study = study.of_specimen(name)
        if any(case.used is not None for case in specimen_study.cases):
            out[name], _ = with_noise_of_tests(specimen_study, _alone(specimen_study, parameters))
    return out


def _alone(study: Study, parameters: FoundParameters) -> UpdateResult:
    if study.file.stage:
        start = study.problem().start(parameters.result.before.x)
        return bottom_up(study, start, lambda stage, seed, iteration: None)[0]
    problem, method = study.problem(), method_of(study.file.update, study.parameters)
    active = tuple(p.name for p in study.parameters.free if p.name not in study.model.foreign)
    rules = reduction_rules(study)
    if rules is None:
        return update(problem, method, start=problem.start(parameters.result.x), active=active)
    search = None if parameters.search is None else parameters.search.part(problem)
    # derivatives of many FRFs by the full model take longer than the whole search
    start = (
        problem.start(parameters.result.x)
        if search is None
        else search.assessed(unassessed(problem, parameters.result.x))
    )
    return update_reduced(problem, method, rules, start=start, active=active, search=search).result
