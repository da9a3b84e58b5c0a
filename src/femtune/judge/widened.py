"""A model with further fields as parameters: factors of one, which move nothing and whose derivatives are exact.

A field that a parameter already sets, on all elements or in a region, is multiplied by the factor there too: the
parameter p becomes p·c on the elements of the factor c.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from femtune.arrays import Reals
from femtune.fem.fields import FieldRef
from femtune.model import Assignment, ParametricModel, configure, parametric_model
from femtune.parameters import Parameter, ParameterSet, parse_expression
from femtune.residuals import CaseState, Evaluation, UpdateProblem
from femtune.updating import NoRegularisation, SensitivityMethod, UpdateResult


@dataclass(frozen=True)
class Factor:
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


def widened(model: ParametricModel, factors: Sequence[Factor]) -> ParametricModel:
    """The model with free factors after its own parameters; at their value of one it is the same.

    Raises
    ------
    FemtuneError : as `parametric_model`
    """
    given = model.structure if model.given is None else model.given
    by_field: dict[FieldRef, list[Factor]] = {}
    for factor in factors:
        by_field.setdefault(factor.ref, []).append(factor)
    assignments: list[Assignment] = []
    products: dict[tuple[str, str], Parameter] = {}
    for a in model.assignments:
        users = _users(model, a)
        for factor in by_field.get(a.ref, ()):
            shared = users & factor.elements
            if shared:
                tied = products.setdefault((a.parameter, factor.name), _product(a.parameter, factor.name))
                assignments.append(replace(a, parameter=tied.name, elements=shared))
                users -= shared
        if a.ref not in by_field:
            assignments.append(a)
        elif users:
            assignments.append(replace(a, elements=users))
    set_by_parameters = {ref: frozenset[int]() for ref in by_field}
    for a in model.assignments:
        if a.ref in by_field:
            set_by_parameters[a.ref] |= _users(model, a)
    for factor in factors:
        left = factor.elements - set_by_parameters[factor.ref]
        if left:
            assignments.append(Assignment(factor.name, factor.ref, True, left))
    free = tuple(Parameter(f.name, 1.0, f.lower, f.upper) for f in factors)
    parameters = ParameterSet((*model.parameters.parameters, *free, *products.values()))
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


def widened_problem(result: UpdateResult, model: ParametricModel, factors: Sequence[Factor]) -> UpdateProblem:
    """The comparisons at the end of an update on the full model, with free factors after the parameters.

    Raises
    ------
    FemtuneError : as `parametric_model` and `configure`
    """
    wide = widened(model, factors)
    after = result.after
    cases = tuple(
        replace(case, configured=configure(wide, case.configured.configuration), full=None)
        for case in (state.case.on_full_model for state in after.states)
    )
    return UpdateProblem(cases, wide.parameters, common_sd=after.common_sd)


def widened_end(result: UpdateResult, problem: UpdateProblem) -> Evaluation:
    """The end of the update in the widened problem: nothing is solved again, and the pairing is the same."""
    x = np.concatenate([result.x, np.zeros(len(problem.parameters.free) - len(result.x))])
    states = []
    for case, state in zip(problem.cases, result.after.states, strict=True):
        point, known = case.configured.at(x), state.solved
        # the factors of a matrix are those of the same matrix
        solution = None if known is None else replace(known, point=point)
        states.append(CaseState(case, point, state.groups, solution))
    return problem.assess(x, states)


def freed(result: UpdateResult, method: SensitivityMethod, count: int) -> SensitivityMethod:
    """The method of an update with `count` further parameters, on which its side constraint does not act.

    The minimum itself is looked for, not the smallest change near it.
    """
    side = result.side
    if side.renewed is not None:
        return replace(method, regularisation=NoRegularisation(), adapt=False, smallest_change=0.0)
    more = np.zeros((len(side.matrix), count))
    held = np.hstack([side.held, np.zeros((len(side.held), count))])
    wide = replace(side, matrix=np.hstack([side.matrix, more]), held=held)
    return replace(method, regularisation=wide, adapt=False, smallest_change=0.0)
