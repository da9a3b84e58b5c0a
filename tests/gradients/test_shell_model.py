"""A model of shells: derivatives by E, ν, ρ, thickness, offset and added mass against complex steps."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.fem import FieldRef
from femtune.model import Assignment, Configuration, configure, parametric_model
from femtune.parameters import Parameter, ParameterSet
from femtune.testing import check_matrix_derivatives
from structures.shells import Isotropic, Section, ShellPart, cylinder, dofs_of, shell_mesh, shell_structure

FIELDS = {
    "E": ("MAT1", "E"), "nu": ("MAT1", "NU"), "rho": ("MAT1", "RHO"),
    "t": ("PSHELL", "T"), "z0": ("PSHELL", "ZOFFS"), "nsm": ("PSHELL", "NSM"),
}  # fmt: skip


@pytest.mark.slow
def test_matrices_of_a_curved_offset_shell():
    mesh = shell_mesh(cylinder(1.0, 1.0, 0.0, 1.0), 2, 2, distort=0.2)
    part = ShellPart(mesh.cells, Section(Isotropic(200.0, 0.3, 2.0), 0.05, 0.1, NSM=0.3))
    structure = shell_structure(mesh.xyz, [part], held=dofs_of(mesh.edge("v0"), "123456"))
    parameters = ParameterSet(tuple(Parameter(name) for name in FIELDS))
    assignments = [Assignment(name, FieldRef(card, 1, field)) for name, (card, field) in FIELDS.items()]
    point = configure(parametric_model(structure, parameters, assignments), Configuration("clamped"))
    check_matrix_derivatives(point.at(np.array([0.1, -0.2, 0.05, 0.2, -0.1, 0.3])))
