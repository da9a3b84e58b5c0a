"""Spring-mass models with parameters, and tests simulated on them: problems with known answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.dofs import DofSet
from femtune.fem import FieldRef, Structure
from femtune.modal import ModeSet
from femtune.model import Assignment, Configuration, ConfiguredModel, configure, parametric_model, solve_modes
from femtune.model.response import DampingRatios, complex_modes
from femtune.parameters import Parameter, ParameterSet
from femtune.residuals import ComparedCase
from structures.frames import make_structure, scalars

Link = tuple[int, int, float]


def spring_structure(
    springs: Sequence[Link], masses: Sequence[float], dashpots: Sequence[Link] = (), loss: Sequence[float] | float = 0.0
) -> Structure:
    """Masses that move along X, at grid points 1 … n, springs (a, b, k) and dashpots between them; −1 is ground.

    Springs are elements 1, 2, …, masses 1001, 1002, …, dashpots 2001, 2002, …; every one has a value of its own, and
    springs a loss factor.
    """
    n = len(masses)
    xyz = np.column_stack([np.arange(n, dtype=float), np.zeros((n, 2))])
    spring = scalars("spring", _ends(springs), "K", [k for *_, k in springs])
    if np.any(loss):
        spring = replace(spring, values={**spring.values, "GE": loss})
    parts = [spring, scalars("scalar-mass", [[_dof(i), -1] for i in range(n)], "M", list(masses))]
    if dashpots:
        parts.append(scalars("dashpot", _ends(dashpots), "B", [c for *_, c in dashpots]))
    kinds = {1 + i: "CELAS2" for i in range(len(springs))} | {1001 + i: "CMASS2" for i in range(n)}
    kinds |= {2001 + i: "CDAMP2" for i in range(len(dashpots))}
    return make_structure(xyz, parts, element_kinds=kinds)


def _ends(links: Sequence[Link]) -> NDArray[np.int64]:
    return np.array([[_dof(a), _dof(b)] for a, b, _ in links])


def _dof(i: int) -> int:
    return 6 * i if i >= 0 else -1


def factor_model(
    structure: Structure,
    groups: Mapping[str, Sequence[int]],
    bounds: tuple[float, float] = (0.2, 3.0),
    configuration: Configuration | None = None,
    more: Sequence[Parameter] = (),
) -> ConfiguredModel:
    """A configured model whose parameters are factors on groups of springs (below 1000), masses and dashpots.

    `more` are further parameters: tied ones, or replacements of a group's own with other bounds and priors.
    """
    given = {p.name: p for p in more}
    own = [given.pop(name, Parameter(name, 1.0, *bounds)) for name in groups]
    assignments = [Assignment(name, _field(i)) for name, ids in groups.items() for i in ids]
    model = parametric_model(structure, ParameterSet((*own, *given.values())), assignments)
    return configure(model, configuration or Configuration())


def _field(element: int) -> FieldRef:
    card, role = {0: ("CELAS2", "K"), 1: ("CMASS2", "M"), 2: ("CDAMP2", "B")}[element // 1000]
    return FieldRef(card, element, role)


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


def with_poles(case: ComparedCase, truth: Sequence[float], damping: DampingRatios | None = None) -> ComparedCase:
    """The case with frequencies and damping ratios of the complex modes at `truth`, in the order of the real modes."""
    found = complex_modes(solve_modes(case.configured.at(np.array(truth, dtype=float)), case.count), damping=damping)
    m = len(case.test)
    test = replace(case.test, freq_hz=found.freq_hz[:m], damping_ratio=found.damping_ratio[:m])
    return replace(case, test=test)
