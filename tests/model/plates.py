"""Free plates whose thicknesses are parameters."""

from __future__ import annotations

import numpy as np

from femtune.fem import FieldRef
from femtune.model import Assignment, Configuration, ConfiguredModel, configure, parametric_model
from femtune.parameters import Parameter, ParameterSet
from structures.shells import Isotropic, Section, ShellPart, rectangle, shell_mesh, shell_structure

_STEEL = Isotropic(2.1e11, 0.3, 7850.0)


def two_halves(nx: int, ny: int) -> ConfiguredModel:
    """A distorted mesh of two thicknesses; parameters are both, t1 and t2, and E."""
    mesh = shell_mesh(rectangle(1.0, 0.7), nx, ny, distort=0.2)
    half = nx * ny // 2
    parts = [
        ShellPart(cells, Section(_STEEL, t)) for cells, t in ((mesh.cells[:half], 0.01), (mesh.cells[half:], 0.02))
    ]
    structure = shell_structure(mesh.xyz, parts, consistent_mass=True)
    names = ("t1", "t2", "E")
    fields = [FieldRef("PSHELL", 1, "T"), FieldRef("PSHELL", 2, "T"), FieldRef("MAT1", 1, "E")]
    assignments = [Assignment(n, f) for n, f in zip(names, fields)]
    model = parametric_model(structure, ParameterSet(tuple(map(Parameter, names))), assignments)
    return configure(model, Configuration())


def three_thirds() -> ConfiguredModel:
    """A mesh of 8 by 6 elements and three thicknesses, the parameters t1, t2 and t3 between 0.75 and 1.25."""
    mesh = shell_mesh(rectangle(1.0, 0.7), 8, 6, distort=0.1)
    parts = [ShellPart(c, Section(_STEEL, 0.01 + 0.002 * i)) for i, c in enumerate(np.array_split(mesh.cells, 3))]
    structure = shell_structure(mesh.xyz, parts, consistent_mass=True)
    names = ("t1", "t2", "t3")
    parameters = ParameterSet(tuple(Parameter(n, lower=0.75, upper=1.25) for n in names))
    assignments = [Assignment(n, FieldRef("PSHELL", i + 1, "T")) for i, n in enumerate(names)]
    return configure(parametric_model(structure, parameters, assignments), Configuration())
