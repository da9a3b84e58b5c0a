"""Messages of the model, its modes and residuals: each is the example that its page shows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.fem import FieldRef, Structure
from femtune.model import (
    AddedMass,
    Assignment,
    Configuration,
    configure,
    parametric_model,
    solve_modes,
    subspace_derivative,
)
from femtune.model.derivatives import modes as derivatives
from femtune.model.eigen import krylov as iteration
from femtune.model.eigen import pairs as eigenpairs
from femtune.model.eigen import solution as eigen
from femtune.model.eigen import sturm
from femtune.model.solvers import factorise, pardiso
from femtune.parameters import Parameter, ParameterSet
from femtune.residuals import DampingResidual, FrequencyResidual, UpdateProblem
from femtune.residuals.aligned import align
from structures.frames import make_structure, scalars
from structures.springs import factor_model, simulated_case, spring_structure

from .patched import patched

CHAIN = [(i - 1, i, 1e3) for i in range(5)]


def _structure() -> Structure:
    return replace(spring_structure(CHAIN, [1.0] * 5), support_sets={1: np.array([0]), 2: np.array([6])})


def _configured(**overlay: object) -> Callable[[], object]:
    def act() -> object:
        model = parametric_model(_structure(), ParameterSet(()), ())
        return configure(model, Configuration("BC", **overlay))  # type: ignore[arg-type]

    return act


def _modes(links: list[tuple[int, int, float]], weights: list[float], **wanted: object) -> Callable[[], object]:
    def act() -> object:
        model = parametric_model(spring_structure(links, weights), ParameterSet(()), ())
        return solve_modes(configure(model, Configuration("BC")).at(np.zeros(0)), **wanted)  # type: ignore[arg-type]

    return act


def _assigned(*assignments: Assignment) -> Callable[[], object]:
    names = ParameterSet(tuple(Parameter(n) for n in dict.fromkeys(a.parameter for a in assignments)))
    return lambda: parametric_model(_structure(), names, assignments)


def _held() -> object:
    held = make_structure([[0.0, 0.0, 0.0]], [scalars("spring", [[0, -1]], "K", 1.0)], permanent=np.arange(6))
    return solve_modes(configure(parametric_model(held, ParameterSet(()), ()), Configuration("BC")).at(np.zeros(0)))


def _rough(pencil: object, shift: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    values, shapes = DENSE(pencil, shift, count)
    return values, shapes + 1e-3 * np.arange(shapes.size).reshape(shapes.shape)


def _counts(number: int | None) -> Callable[..., sturm.Count]:
    return lambda pencil, value: sturm.Count(value, number)


def _other_start() -> object:
    model = factor_model(_structure(), {"a": [1]})
    modes = solve_modes(model.at(np.zeros(1)), 2)
    return solve_modes(model.at(np.ones(1)), 2, start=replace(modes, shapes=modes.shapes[:3]))


def _derivative() -> object:
    chain = [(i - 1, i, 1e3 + i) for i in range(60)]
    model = factor_model(spring_structure(chain, [1.0] * 60), {"a": [1, 40]})
    return subspace_derivative(solve_modes(model.at(np.zeros(1)), 1), [0])


def _no_scatter() -> object:
    model = factor_model(_structure(), {"a": [1]})
    case = simulated_case(model, (0.0,), (0, 1), 2)
    problem = UpdateProblem((case,), model.model.parameters, (FrequencyResidual("test"),))
    return problem.start(np.zeros(1))


def _no_damping() -> object:
    model = factor_model(_structure(), {"a": [1]})
    case = replace(simulated_case(model, (0.0,), (0, 1), 2), residuals=(DampingResidual(sd=0.1),))
    return UpdateProblem((case,), model.model.parameters).start(np.zeros(1))


def _overdamped() -> object:
    structure = spring_structure(CHAIN, [1.0] * 5, [(-1, 4, 150.0)])
    case = simulated_case(factor_model(structure, {"a": [1]}), (0.0,), range(5), 2)
    test = replace(case.test, damping_ratio=np.full(2, 0.1))
    problem = replace(case, test=test, residuals=(DampingResidual(sd=0.1),))
    return UpdateProblem((problem,), case.configured.model.parameters).start(np.zeros(1))


def _unseen() -> object:
    model = factor_model(_structure(), {"a": [1]})
    derivative = subspace_derivative(solve_modes(model.at(np.zeros(1)), 2), [0])
    return align(replace(derivative, shapes=0.0 * derivative.shapes), np.ones((5, 1)))


def _pardiso_fails() -> object:
    raise pardiso.failure(-3, 50000, 700000, 60_000_000)


DENSE = eigenpairs.dense
K1 = FieldRef("CELAS2", 1, "K")
CASES: dict[str, Callable[[], object]] = {
    "configuration.unknown-element": _configured(elements_off=frozenset({3, 1234})),
    "configuration.unknown-set": _configured(support_set=44),
    "configuration.not-held": _configured(supports_removed=((2, "12"),)),
    "model.unknown-node": _configured(masses=(AddedMass(99, 1.0),)),
    "model.component": _configured(supports_added=((2, "7"),)),
    "parameter.unknown-field": _assigned(Assignment("p", FieldRef("PBAR", 77, "I1"))),
    "parameter.zero-nominal": lambda: parametric_model(
        spring_structure([(-1, 0, 0.0)], [1.0]), ParameterSet((Parameter("p"),)), [Assignment("p", K1)]
    ),
    "parameter.field-twice": _assigned(Assignment("p", K1), Assignment("q", K1)),
    "eigen.mechanism": _modes([*CHAIN, (5, 6, 1e3), (6, 7, 1e3)], [1.0] * 5 + [0.0] * 3),
    "eigen.no-dofs": _held,
    "eigen.no-mass": _modes([(-1, 0, 1.0)], [0.0]),
    "eigen.negative": _modes([(-1, 0, -20.0), (0, 1, 10.0)], [1.0, 1.0]),
    "eigen.inaccurate": patched(_modes(CHAIN, [1.0] * 5), (eigenpairs, "dense", _rough)),
    "eigen.missed-modes": patched(_modes(CHAIN, [1.0] * 5, count=2), (eigen, "count_below", _counts(7))),
    "eigen.uncounted": patched(_modes(CHAIN, [1.0] * 5, max_hz=80.0), (eigen, "count_below", _counts(None))),
    "eigen.no-convergence": patched(
        _modes([(i - 1, i, 1e3) for i in range(500)], [1.0] * 500),
        (iteration, "most_columns", lambda operator, count, block: count + 2 * block),
        (iteration, "MOST_RESTARTS", 1),
    ),
    "eigen.other-start": _other_start,
    "derivative.not-converged": patched(_derivative, (derivatives, "MOST_STEPS", 1)),
    "residual.no-scatter": _no_scatter,
    "residual.no-damping": _no_damping,
    "residual.no-complex-mode": _overdamped,
    "residual.unseen-mode": _unseen,
    "solver.unavailable": patched(
        lambda: factorise.factorise(sp.eye_array(3, format="csr"), "PARDISO"),
        (factorise, "available_solvers", lambda: ("SuperLU",)),
    ),
    "solver.failed": _pardiso_fails,
}


def raised(code: str) -> str:
    with pytest.raises(FemtuneError) as caught:
        CASES[code]()
    assert caught.value.code == code
    return str(caught.value)


@pytest.mark.quick(17)
@pytest.mark.parametrize("code", CASES)
def test_message_is_the_example_of_its_page(code: str):
    check_shown(code, raised(code))


def test_notice_of_uncounted_modes_is_the_example_of_its_page():
    act = patched(_modes(CHAIN, [1.0] * 5), (eigen, "count_below", _counts(None)))
    (notice,) = act().notices  # type: ignore[attr-defined]
    check_shown("eigen.not-counted", notice)
