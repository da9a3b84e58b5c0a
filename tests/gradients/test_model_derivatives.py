"""Derivatives of matrices, modes and subspaces, each by the check that holds for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from femtune.fem import FieldRef
from femtune.model import (
    Assignment,
    Configuration,
    ModelPoint,
    configure,
    parametric_model,
    solve_modes,
    subspace_derivative,
)
from femtune.parameters import Parameter, ParameterSet, tied
from femtune.testing import (
    ModelDerivativeChecks,
    check_derivative_equation,
    check_matrix_derivatives,
    check_model,
    check_simple_mode,
)
from structures.frames import bars, make_structure, masses
from structures.springs import factor_model, spring_structure

SECTION = {"E": 2.1e11, "G": 8.1e10, "A": 2e-4, "I1": 1.5e-8, "I2": 6e-9, "J": 1.1e-8, "rho": 7850.0}
CHAIN = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0), (0, 2, 150.0)]


class TestSpringChain(ModelDerivativeChecks):
    """Springs and masses, one parameter tied to two others by a curved expression."""

    simple_modes = (0, 1, 2, 3)
    clusters = ((0, 1), (1, 2, 3))

    def make_point(self) -> ModelPoint:
        structure = spring_structure(CHAIN, [1.0, 2.0, 1.5, 1.0])
        groups = {"a": [1, 2], "b": [3], "m": [1002], "c": [4, 5]}
        model = factor_model(structure, groups, more=[tied("c", "sqrt(a) * b**2 / (1 + m)")])
        return model.at(np.array([0.1, -0.2, 0.3]))


def bar_frame(parameters: dict[str, tuple[FieldRef, ...]], shear: bool) -> ModelPoint:
    """A small clamped space frame of consistent mass: every free DOF has mass."""
    xyz = [[0, 0, 0], [0, 0, 1], [1, 0, 1.1], [1.2, 0.1, 0], [0.5, 0.6, 1.2]]
    values = {**SECTION, "K1": 0.8, "K2": 0.7} if shear else SECTION
    part = bars([[0, 1], [1, 2], [2, 3], [1, 4], [2, 4]], values, orientation=(0.3, 1.0, 0.2))
    clamped = np.r_[0:6, 18:24]
    structure = make_structure(
        xyz,
        [part, masses([4], {"M": 0.4, "I11": 1e-3, "I22": 2e-3, "I33": 1e-3}, (0.02, 0.0, 0.05))],
        permanent=clamped,
        consistent_mass=True,
    )
    names = ParameterSet(tuple(Parameter(name) for name in parameters))
    assignments = [Assignment(name, ref) for name, refs in parameters.items() for ref in refs]
    model = configure(parametric_model(structure, names, assignments), Configuration())
    return model.at(np.full(len(parameters), 0.07))


def field_of_all(name: str) -> tuple[FieldRef, ...]:
    return tuple(FieldRef("CBAR", i, name) for i in range(1, 6))


class TestFrame(ModelDerivativeChecks):
    """Exact terms of bars without shear flexibility."""

    simple_modes = (0, 1, 2, 5)
    clusters = ((0, 1), (2, 3, 4))

    def make_point(self) -> ModelPoint:
        parameters = {name: field_of_all(name) for name in ("E", "A", "I1", "I2", "rho")}
        return bar_frame({**parameters, "mass": (FieldRef("CONM2", 1001, "M"),)}, shear=False)


class TestShearFlexibleFrame(ModelDerivativeChecks):
    """Coefficients that are rational in the section's values, one column an element."""

    simple_modes = (0, 3)

    def make_point(self) -> ModelPoint:
        parameters = {name: field_of_all(name) for name in ("I1", "A", "K1", "G")}
        return bar_frame({**parameters, "single": (FieldRef("CBAR", 2, "I2"),)}, shear=True)


def test_simple_modes_reach_the_accuracy_of_the_complex_step():
    point = TestSpringChain().make_point()
    solution = solve_modes(point, 4)
    assert max(check_simple_mode(solution, j, 1e-12) for j in range(4)) < 1e-12


def test_modes_that_were_not_solved_for_count_too():
    """One mode of 60 DOFs, six more as extras: the rest comes from the iterative solve."""
    chain = [(i - 1, i, 1000.0 + 13.0 * (i % 7)) for i in range(60)]
    structure = spring_structure(chain, [1.0 + 0.1 * (i % 3) for i in range(60)])
    groups = {"a": range(1, 21), "b": [21, 30, 44], "m": [1007, 1050]}
    model = factor_model(structure, groups)  # type: ignore[arg-type]
    check_model(model.at(np.array([0.1, -0.3, 0.2])), [0, 1])


def test_second_derivatives_of_a_product():
    """E·I: ∂²K/∂E∂I = ∂K/∂E at I's relative unit."""
    point = bar_frame({"E": field_of_all("E"), "I1": field_of_all("I1"), "I2": field_of_all("I2")}, shear=False)
    both = point.stiffness_second_derivative(0, 1) + point.stiffness_second_derivative(0, 2)
    assert abs(point.stiffness_second_derivative(0, 0)).max() == 0.0
    assert abs(both).max() > 0.0
    check_matrix_derivatives(point)


def test_a_wrong_derivative_is_found():
    point = TestSpringChain().make_point()
    solution = solve_modes(point, 2)
    wrong = [m * (1.0 + 1e-6) for m in point.stiffness_derivatives]
    point.__dict__["stiffness_derivatives"] = tuple(wrong)
    point.__dict__["small_derivatives"] = (np.array([m.toarray() for m in wrong]), point.small_derivatives[1])
    with pytest.raises(AssertionError, match="derivative 0"):
        check_matrix_derivatives(point)
    with pytest.raises(AssertionError, match="eigenvalue off"):
        check_simple_mode(solution, 0)


def test_a_wrong_subspace_is_found(monkeypatch: pytest.MonkeyPatch):
    solution = solve_modes(TestSpringChain().make_point(), 2)
    right = subspace_derivative(solution, [0])
    spoilt = replace(right, outside=right.outside * 1.001)
    monkeypatch.setattr("femtune.testing.derivatives.subspace_derivative", lambda *a: spoilt)
    with pytest.raises(AssertionError, match="equation is off"):
        check_derivative_equation(solution, [0])


def pair_of_oscillators() -> ModelPoint:
    """K = I, M = I, and K' = [[0, 1], [1, 0]] by a spring of negative and two of positive rate (all factor 1)."""
    structure = spring_structure([(-1, 0, 1.0), (-1, 1, 1.0), (0, 1, 1e-9)], [1.0, 1.0])
    ref = FieldRef("CELAS2", 3, "K")
    parameters = ParameterSet((Parameter("c", 0.0, -0.5, 0.5), tied("d", "1 - c")))
    assignments = [Assignment("c", ref, False)]
    assignments += [Assignment("d", FieldRef("CELAS2", i, "K"), False) for i in (1, 2)]
    return configure(parametric_model(structure, parameters, assignments), Configuration()).at(np.zeros(1))


def test_repeated_eigenvalues_move_by_plus_and_minus_one():
    """K(c) = [[1, −c], [−c, 1]]: the branches are 1 ± c, whatever vectors the solver chose at c = 0."""
    point = pair_of_oscillators()
    solution = solve_modes(point, 2)
    d = subspace_derivative(solution, [0, 1])
    np.testing.assert_allclose(d.eigenvalues, 1.0, rtol=1e-12)
    slopes = np.linalg.eigvalsh(d.stiffness[0] - d.mass[0] * d.eigenvalues)
    # bounds are 1 wide and the nominal value is zero, so that x is c itself
    np.testing.assert_allclose(slopes, [-1.0, 1.0], atol=1e-9)
    moved = solve_modes(point.configured.at(np.array([1e-3])), 2).eigenvalues
    np.testing.assert_allclose(moved, [1.0 - 1e-3, 1.0 + 1e-3], rtol=1e-12)
