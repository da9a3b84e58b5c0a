"""Checks of the model for errors that updating cannot correct."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from femtune.correlation.unit_factor import mass_factor_words
from femtune.errors import FemtuneError
from femtune.fem.checks import MassProperties, mass_properties
from femtune.model import EigenSolution, grid_matrix
from femtune.model.mesh_error import MOST_DOFS, USUAL_DOFS, MeshChange, mass_change, mesh_change, too_large
from femtune.steps.info.merged_points import of_merged_points
from femtune.steps.info.neutral_axis import of_neutral_axis, of_unknown_neutral_axis
from femtune.study.record import Alert
from femtune.study.solved import nominal, solve

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.study.cases import StudyCase
    from femtune.study.progress import Progress
    from femtune.study.study import Study
from femtune.steps.info.record.checks import ModelCheck, ModeMeshError

Found = TypeVar("Found")
Vector = tuple[float, float, float]
Solutions = Mapping[str, EigenSolution]


MASS = "weighed mass"
CENTRE = "weighed centre of gravity"
INERTIA = "weighed moments of inertia"
LUMPING = "lumped or consistent mass"
MESH = "mesh"


_EQUAL_CHANGE = 1e-6
"""Relative difference up to which changes of two modes are equal.

It is above the rounding of an eigenvalue and far below a change that matters.
"""


_OFF = "refinement = false in [checks]"


_IN_PARAMETERS = "an update would absorb this error into the parameters"


def mass_checks(study: Study) -> tuple[ModelCheck, ...]:
    """Measured and computed mass of each configuration; centre of gravity and moments of inertia where given."""
    return tuple(check for case in study.cases for check in _weighing(study, case))


def _weighing(study: Study, case: StudyCase) -> Iterator[ModelCheck]:
    configuration, limit = case.configured.configuration, 100.0 * study.file.checks.mass_error
    weighed, centre, inertia = configuration.weighed_mass, configuration.weighed_centre, configuration.weighed_inertia
    if weighed is None:
        yield _untested(case, MASS, limit, "no measured mass is given (weighed_mass in the configuration)")
    if weighed is None and centre is None and inertia is None:
        return
    nodes = study.model.structure.nodes
    of_model = mass_properties(nodes, grid_matrix(study.model, configuration, "mass"))
    if weighed is not None:
        yield _mass(case, of_model, weighed, limit)
    if centre is not None:
        placed = nodes.has_coordinates
        yield _centre(case, of_model, centre, limit) if placed else _untested(case, CENTRE, limit, _NO_PLACES)
    if inertia is not None:
        placed = nodes.has_coordinates
        yield _inertia(case, of_model, inertia, limit) if placed else _untested(case, INERTIA, limit, _NO_PLACES)


_NO_PLACES = "the grid points have no coordinates"


def _mass(case: StudyCase, of_model: MassProperties, weighed: float, limit: float) -> ModelCheck:
    ratio = of_model.mass / weighed
    difference, cause = 100.0 * (ratio - 1.0), mass_factor_words(ratio)
    sentence = f"the mass of the model differs by {difference:+.2g} % from the measured mass"
    return _tested(case, MASS, limit, difference, f"{sentence}; {cause}" if cause else sentence)


def _centre(case: StudyCase, of_model: MassProperties, measured: Vector, limit: float) -> ModelCheck:
    """The distance over the radius of gyration, which is the size that a shift has in the moments of inertia."""
    shift = of_model.centre - np.array(measured)
    gyration = float(np.sqrt(max(np.trace(of_model.central_inertia) / (2.0 * (of_model.mass or 1.0)), 0.0)))
    if gyration == 0.0:
        return _untested(case, CENTRE, limit, "the model is a point or has no mass")
    distance = float(np.linalg.norm(shift))
    along = ", ".join(f"{x:+.3g}" for x in shift)
    share = 100.0 * distance / gyration
    sentence = (
        f"the centre of gravity of the model is {distance:.3g} from the measured one ({along} along x, y, z), "
        f"{share:.2g} % of the radius of gyration"
    )
    return _tested(case, CENTRE, limit, share, sentence)


def _inertia(case: StudyCase, of_model: MassProperties, measured: Vector, limit: float) -> ModelCheck:
    """The largest relative difference of the three moments."""
    differences = 100.0 * (np.diag(of_model.central_inertia) / np.array(measured) - 1.0)
    worst = int(np.abs(differences).argmax())
    sentence = (
        f"the moment of inertia of the model about {'xyz'[worst]} differs by {differences[worst]:+.2g} % from the "
        "measured one"
    )
    return _tested(case, INERTIA, limit, float(differences[worst]), sentence)


def model_checks(study: Study, solutions: Solutions, progress: Progress) -> tuple[ModelCheck, ...]:
    """All checks of the configurations that the update uses, at the deck's values."""
    checks = list(mass_checks(study))
    for case in study.cases:
        if case.used is not None and case.name in solutions:
            progress.step(f"mass and mesh: {case.name}", 0, None)
            checks += [_lumping(study, case, solutions[case.name]), mesh_check(study, case, solutions[case.name])]
    return tuple(checks)


def _lumping(study: Study, case: StudyCase, solution: EigenSolution) -> ModelCheck:
    limit = 100.0 * study.file.checks.mesh_error
    change = _of_optional_check(lambda: mass_change(solution))
    if isinstance(change, str):
        return _untested(case, LUMPING, limit, change)
    worst = _worst(case, solution, change)
    if worst is None:
        return _untested(case, LUMPING, limit, "no elastic mode was computed")
    mode, value = worst
    kind = "consistent" if case.configured.model.structure.consistent_mass else "lumped"
    other = "lumped" if kind == "consistent" else "consistent"
    sentence = f"{other} instead of {kind} mass changes the frequency of mode {mode} by {value:+.2g} %"
    return _tested(case, LUMPING, limit, value, sentence)


def _of_optional_check(check: Callable[[], Found | str]) -> Found | str:
    """What a check found, or why it could not: a check that fails must not cost the result that it belongs to."""
    try:
        return check()
    except (FemtuneError, ArithmeticError, ValueError, LookupError, np.linalg.LinAlgError) as error:
        return f"the check could not be computed ({type(error).__name__}: {error})"


def checks_of_modes(study: Study) -> tuple[list[ModelCheck], list[Alert]]:
    """Checks of the mesh and of the mass of beams by the modes of each configuration, if the model is small enough."""
    reason, limit = mesh_not_checked(study), 100.0 * study.file.checks.mesh_error
    checks: list[ModelCheck] = []
    told: list[Alert] = []
    for case in study.cases:
        problem = reason
        if not reason:
            try:
                solution = solve(study, case, nominal(study))
                checks.append(mesh_check(study, case, solution))
                told += of_neutral_axis(case.name, solution)
                merge = _of_optional_check(lambda: tuple(of_merged_points(case)))  # noqa: B023  called at once
                told += () if isinstance(merge, str) else merge
            except FemtuneError as error:
                problem = f"the modes could not be computed ({error.code})"
        if problem:
            checks.append(_untested(case, MESH, limit, problem))
            told += of_unknown_neutral_axis(case.name, case.configured.at(nominal(study)))
    return checks, told


def mesh_not_checked(study: Study) -> str:
    """The reason where neither the study nor the size of the model lets the mesh be checked; "" otherwise."""
    return _OFF if study.file.checks.refinement is False else too_large(study.model.structure, _most_dofs(study))


def _most_dofs(study: Study) -> int:
    return MOST_DOFS if study.file.checks.refinement else USUAL_DOFS


def mesh_check(study: Study, case: StudyCase, solution: EigenSolution) -> ModelCheck:
    """Errors of the frequencies due to the mesh; of small models by default, of others if the study requests it."""
    checks = study.file.checks
    limit = 100.0 * checks.mesh_error
    if checks.refinement is False:
        return _untested(case, MESH, limit, _OFF)
    change = _of_optional_check(lambda: mesh_change(solution, _most_dofs(study)))
    if isinstance(change, str):
        return _untested(case, MESH, limit, change)
    worst = _worst(case, solution, change.error)
    if worst is None:
        reason = "no mode of the refined mesh resembles a mode of the original mesh" + _drilling(change)
        return _untested(case, MESH, limit, reason)
    mode, value = worst
    k = mode - 1
    sentence = (
        f"with elements of half the size ({change.free_dofs} free DOFs), mode {mode} changes from "
        f"{change.freq_hz[k]:.5g} to {change.refined_hz[k]:.5g} Hz; its discretisation error is about {value:+.2g} %"
    )
    if change.whole:
        sentence += f"; {', '.join(change.whole)} elements were not divided"
    check = _tested(case, MESH, limit, value, sentence)
    modes = tuple(_mode_errors(change))
    return check.model_copy(update={"modes": modes, "sentence": check.sentence + _drilling(change)})


def _drilling(change: MeshChange) -> str:
    """Part of a sentence on modes without an estimate because of the drilling stiffness."""
    if not change.drilling:
        return ""
    modes = f"mode{'s' if len(change.drilling) > 1 else ''} {', '.join(map(str, change.drilling))}"
    return f"; no estimate for {modes}, whose drilling stiffness (K6ROT) falls with the size of the elements"


def _mode_errors(change: MeshChange) -> Iterator[ModeMeshError]:
    for i in np.flatnonzero(np.isfinite(change.freq_hz)):
        known = bool(np.isfinite(change.error[i]))
        yield ModeMeshError(
            mode=int(i) + 1,
            freq_hz=float(change.freq_hz[i]),
            refined_hz=float(change.refined_hz[i]) if known else None,
            error_percent=100.0 * float(change.error[i]) if known else None,
            converged_hz=float(change.converged_hz[i]) if known else None,
        )


def _worst(case: StudyCase, solution: EigenSolution, values: Reals) -> tuple[int, float] | None:
    """Number and value in % of the worst mode within the frequencies of the test."""
    top = np.inf if case.modal is None else 1.05 * float(case.modal.test.freq_hz.max(initial=0.0))
    inside = np.where(solution.freq_hz[: len(values)] <= top, np.abs(values), np.nan)
    if not np.isfinite(inside).any():
        return None
    # modes in two planes change equally: the first of them is named, whatever the rounding of the others
    mode = int(np.flatnonzero(inside >= (1.0 - _EQUAL_CHANGE) * np.nanmax(inside))[0])
    return mode + 1, 100.0 * float(values[mode])


def _tested(case: StudyCase, check: str, limit: float, value: float, sentence: str) -> ModelCheck:
    passed = abs(value) <= limit
    tail = "" if passed else f", more than {limit:.2g} %: {_IN_PARAMETERS}"
    return ModelCheck(
        configuration=case.name, check=check, measured=value, limit=limit,
        verdict="pass" if passed else "fail", sentence=f"{sentence}{tail}",
    )  # fmt: skip


def _untested(case: StudyCase, check: str, limit: float, reason: str) -> ModelCheck:
    return ModelCheck(
        configuration=case.name, check=check, measured=None, limit=limit, verdict="not tested", sentence=reason
    )
