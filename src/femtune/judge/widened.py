"""A model with further parameters at its own values, which move nothing and whose derivatives are exact.

They are factors of one on fields, masses of zero at grid points, and compliances of zero at supports.

A field that a parameter already sets, on all elements or in a region, is multiplied by the factor there too: the
parameter p becomes p·c on the elements of the factor c.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from femtune.arrays import Reals
from femtune.fem.fields import FieldRef
from femtune.judge.point_masses import PointMass, with_point_masses
from femtune.judge.supports import GivingWay, Support, SupportRows, with_carriers
from femtune.model import Assignment, EigenSolution, ParametricModel, SubspaceDerivative, configure, parametric_model
from femtune.model.derivatives.sensors import sensor_derivatives
from femtune.model.full_model import ModelSolver, direct
from femtune.parameters import Parameter, ParameterSet, parse_expression
from femtune.residuals import CaseState, Evaluation, UpdateProblem
from femtune.residuals.case import Residual
from femtune.residuals.frf.antiresonance import AntiresonanceResidual
from femtune.residuals.frf.model_way import settled
from femtune.residuals.frf.on_reduced import served
from femtune.residuals.frf.residual import FrfResidual
from femtune.residuals.state import followed
from femtune.updating import ReductionRules, UpdateResult
from femtune.updating.on_reduced_model import keep_functions

_TOLERANCE = 1e-4
"""Error of the derivatives of a shape at the sensors: far below what noise leaves of a column, and above what many
solutions would be needed for."""

_FRF_DOFS = 1_000
"""Free DOFs up to which derivatives of FRFs by many factors are those of all modes of the band. Those of larger models
follow from a reduced model there, which those of antiresonances do not."""


@dataclass(frozen=True)
class WideningFactor:
    """A factor on a field for some of the elements that use it; factors of one field have no element in common.

    Parameters
    ----------
    name : an identifier that no parameter has
    lower, upper : bounds, for an update that frees it
    """

    name: str
    ref: FieldRef
    elements: frozenset[int]
    lower: float = 0.5
    upper: float = 2.0


def widened(
    model: ParametricModel,
    factors: Sequence[WideningFactor],
    masses: Sequence[PointMass] = (),
    supports: Sequence[Support] = (),
) -> ParametricModel:
    """The model with free factors, masses and compliances after its own parameters; at one and zero it is the same.

    Compliances of supports act only where `GivingWay` solves the model.

    Raises
    ------
    FemtuneError : as `parametric_model`
    """
    given = model.structure if model.given is None else model.given
    taken: dict[FieldRef, frozenset[int]] = {factor.ref: frozenset() for factor in factors}
    assignments, products = list[Assignment](), dict[str, Parameter]()
    for a in model.assignments:
        if a.ref not in taken:
            assignments.append(a)
            continue
        users = _users(model, a)
        taken[a.ref] |= users
        for factor in factors:
            shared = users & factor.elements if factor.ref == a.ref else frozenset()
            if shared:
                tied = _product(a.parameter, factor.name)
                products[tied.name] = tied
                assignments.append(replace(a, parameter=tied.name, elements=shared))
                users -= shared
        if users:
            assignments.append(replace(a, elements=users))
    own = ((f, f.elements - taken[f.ref]) for f in factors)
    assignments += [Assignment(f.name, f.ref, True, elements) for f, elements in own if elements]
    if masses:
        given, of_masses = with_point_masses(given, masses)
        assignments += of_masses
    if supports:
        given, of_supports = with_carriers(given, supports)
        assignments += of_supports
    free = (
        *(Parameter(f.name, 1.0, f.lower, f.upper) for f in factors),
        *(m.parameter for m in masses),
        *(Parameter(s.name, 0.0, 0.0, 1.0) for s in supports),
    )
    # neither the test nor its refits need second derivatives
    parameters = ParameterSet((*model.parameters.parameters, *free, *products.values()), curved=False)
    return parametric_model(given, parameters, assignments, model.tables)


def _users(model: ParametricModel, a: Assignment) -> frozenset[int]:
    structure = model.structure if model.given is None else model.given
    position = structure.values.index(a.ref)
    users = frozenset() if position is None else frozenset(int(n) for n in structure.users(position))
    return users if a.elements is None else users & a.elements


def _product(parameter: str, factor: str) -> Parameter:
    return Parameter(f"{parameter}_times_{factor}", tie=parse_expression(f"{parameter}*{factor}"))


# ----------------------------------------------------------------------------------------------------
# The end of an update with further parameters.


def widened_problem(
    result: UpdateResult,
    model: ParametricModel,
    factors: Sequence[WideningFactor],
    masses: Sequence[PointMass] = (),
    supports: Sequence[Support] = (),
    rows: Sequence[SupportRows] = (),
) -> UpdateProblem:
    """The comparisons at the end of an update on the full model, with what is free in it after the parameters.

    Of models above 1,000 free DOFs, antiresonances are left out, and FRFs that a reduced model does not serve: their
    derivatives by many factors take too long.

    Parameters
    ----------
    rows : of each configuration, where there are supports

    Raises
    ------
    FemtuneError : as `parametric_model` and `configure`
    """
    wide = widened(model, factors, masses, supports)
    after = result.after
    many: ModelSolver = _BySensors()
    solvers = [GivingWay(many, own, tuple(supports)) for own in rows] if supports else [many] * len(after.states)
    cases = tuple(
        replace(
            case, configured=configure(wide, case.configured.configuration), full=None, solver=solver,
            residuals=_compared(state),
        )
        for case, state, solver in zip((s.case.on_full_model for s in after.states), after.states, solvers, strict=True)
    )  # fmt: skip
    return UpdateProblem(cases, wide.parameters, common_sd=after.common_sd)


def _compared(state: CaseState) -> tuple[Residual, ...]:
    """The residuals of a case whose derivatives by many factors do not take too long."""
    residuals = state.case.on_full_model.residuals
    if state.case.on_full_model.configured.n_free <= _FRF_DOFS:
        return residuals
    few = [r for r in residuals if r.key not in (FrfResidual.key, AntiresonanceResidual.key)]
    frfs = served(state) if len(few) < len(residuals) else ()
    return tuple(r for r in residuals if r in few or settled(r) in frfs)


class _BySensors(type(direct)):  # type: ignore[misc]
    """As `direct`, but the derivatives by many factors follow from solutions for the sensors, which are fewer."""

    def derivative(self, solution: EigenSolution, members: Sequence[int], rows: sp.csr_array) -> SubspaceDerivative:
        """As `subspace_derivative`."""
        few = rows.shape[0] <= solution.point.n_parameters and max(members, default=0) < solution.wanted
        if few and not solution.point.depends_on_frequency:
            found = sensor_derivatives(solution, rows, _TOLERANCE).subspace(members)
            if found.error is not None and found.error <= _TOLERANCE:
                return found
        return direct.derivative(solution, members, rows)


def widened_end(result: UpdateResult, problem: UpdateProblem) -> Evaluation:
    """The end of the update in the widened problem: nothing is solved again, and the pairing is the same."""
    x = np.concatenate([result.x, np.zeros(len(problem.parameters.free) - len(result.x))])
    states = []
    for case, state in zip(problem.cases, result.after.states, strict=True):
        point, known = case.configured.at(x), state.solved
        # the factors of a matrix are those of the same matrix
        solution = None if known is None else replace(known, point=point)
        states.append(CaseState(case, point, state.groups, solution))
    return _assessed(problem, x, states)


def widened_beside(problem: UpdateProblem, x: Reals, before: Evaluation) -> Evaluation:
    """A widened problem at another point, with the pairs of an evaluation followed from there."""
    return _assessed(problem, x, [followed(state, x) for state in before.states])


def _assessed(problem: UpdateProblem, x: Reals, states: list[CaseState]) -> Evaluation:
    keep_functions(problem, ReductionRules(), states, _FRF_DOFS)
    return problem.assess(x, states)
