"""Spring-mass models with parameters, and tests simulated on them: problems with known answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import scipy.sparse as sp

from femtune.dofs import DofSet
from femtune.fem import FieldRef, Structure
from femtune.modal import ModeSet
from femtune.model import Assignment, Configuration, ConfiguredModel, configure, parametric_model, solve_modes
from femtune.parameters import Parameter, ParameterSet
from femtune.residuals import ComparedCase
from structures.frames import make_structure, scalars


def spring_structure(springs: Sequence[tuple[int, int, float]], masses: Sequence[float]) -> Structure:
    """Masses that move along X, at grid points 1 … n, and springs (a, b, k) between them; −1 is ground.

    Springs are elements 1, 2, …, masses 1001, 1002, …; every one has a value of its own.
    """
    n = len(masses)
    xyz = np.column_stack([np.arange(n, dtype=float), np.zeros((n, 2))])
    ends = np.array([[_dof(a), _dof(b)] for a, b, _ in springs])
    parts = [
        scalars("spring", ends, "K", [k for *_, k in springs]),
        scalars("scalar-mass", [[_dof(i), -1] for i in range(n)], "M", list(masses)),
    ]
    kinds = {1 + i: "CELAS2" for i in range(len(springs))} | {1001 + i: "CMASS2" for i in range(n)}
    return make_structure(xyz, parts, element_kinds=kinds)


def _dof(i: int) -> int:
    return 6 * i if i >= 0 else -1


def factor_model(
    structure: Structure,
    groups: Mapping[str, Sequence[int]],
    bounds: tuple[float, float] = (0.2, 3.0),
    configuration: Configuration | None = None,
    more: Sequence[Parameter] = (),
) -> ConfiguredModel:
    """A configured model whose parameters are factors on groups of springs (below 1000) and masses.

    `more` are further parameters: tied ones, or replacements of a group's own with other bounds and priors.
    """
    given = {p.name: p for p in more}
    own = [given.pop(name, Parameter(name, 1.0, *bounds)) for name in groups]
    assignments = [Assignment(name, _field(i)) for name, ids in groups.items() for i in ids]
    model = parametric_model(structure, ParameterSet((*own, *given.values())), assignments)
    return configure(model, configuration or Configuration())


def _field(element: int) -> FieldRef:
    return FieldRef("CMASS2", element, "M") if element > 1000 else FieldRef("CELAS2", element, "K")


def sensor_rows(configured: ConfiguredModel, sensors: Sequence[int]) -> sp.csr_array:
    """Rows that pick free DOFs by position."""
    at = np.asarray(sensors)
    return sp.csr_array((np.ones(len(at)), (np.arange(len(at)), at)), shape=(len(at), configured.n_free))


def simulated_case(
    configured: ConfiguredModel, truth: Sequence[float], sensors: Sequence[int], n_modes: int, **more: object
) -> ComparedCase:
    """A case whose test is the model itself at the normalised parameters `truth`: `n_modes` modes at some free DOFs.

    `more` are further fields of ComparedCase.
    """
    rows = sensor_rows(configured, sensors)
    modes = solve_modes(configured.at(np.array(truth, dtype=float)), n_modes)
    shapes = (rows @ modes.shapes)[:, :n_modes]
    test = ModeSet(modes.freq_hz[:n_modes], shapes, DofSet(configured.free_dof(i) for i in sensors), source="simulated")
    return ComparedCase(configured, test, rows, **{"count": n_modes, **more})  # type: ignore[arg-type]
