"""Eigenvalues of solids: exact derivatives by moduli, Poisson's ratio, density and entries of a law."""

from __future__ import annotations

import numpy as np
import pytest
from tests.fem.solid_parts import KINDS, lean

from femtune.fem import FieldRef
from femtune.model import Configuration, configure, parametric_model, solve_modes
from femtune.model.parametric import Assignment
from femtune.model.products import derivative_energies
from femtune.parameters import Parameter, ParameterSet
from structures.shells import Isotropic, dofs_of
from structures.solids import Law, solid_mesh, solid_model

PLY_LAW = np.diag([200.0, 120.0, 90.0, 50.0, 40.0, 30.0]) + 35.0 * np.kron([[1, 0], [0, 0]], 1.0 - np.eye(3))
FIELDS = {
    "isotropic": (Isotropic(200.0, 0.3, 2.0), (("MAT1", "E"), ("MAT1", "NU"), ("MAT1", "RHO"))),
    "anisotropic": (Law(PLY_LAW, 2.0), (("MAT9", "G11"), ("MAT9", "G12"), ("MAT9", "G66"))),
}


@pytest.mark.quick(0)
@pytest.mark.parametrize("law", FIELDS)
@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_of_eigenvalues(kind: str, law: str):
    """φᵀ(K' − λM')φ by each field against central differences of the eigenvalues of a distorted block."""
    material, fields = FIELDS[law]
    mesh = solid_mesh(lean, (3, 2, 2), kind, distort=0.2)
    structure = solid_model(mesh, material, held=dofs_of(mesh.face("u0"), "123"))
    names = [f"p{i}" for i in range(3)]
    chosen = [Assignment(name, FieldRef(card, 1, entry)) for name, (card, entry) in zip(names, fields)]
    model = parametric_model(structure, ParameterSet(tuple(Parameter(name) for name in names)), chosen)
    configured, step = configure(model, Configuration("as it is")), 1e-4
    solution = solve_modes(configured.at(np.zeros(3)), 4)
    energies = [derivative_energies(solution.point, matrix, solution.shapes) for matrix in ("stiffness", "mass")]
    exact = energies[0] - solution.eigenvalues[: energies[0].shape[-1]] * energies[1]
    for i, own in enumerate(np.eye(3) * step):
        ahead, back = (solve_modes(configured.at(x), 4).eigenvalues[:4] for x in (own, -own))
        size = np.abs(solution.eigenvalues[:4])
        np.testing.assert_allclose((ahead - back) / (2 * step) / size, exact[i][:4] / size, atol=1e-6)
