"""Small damped models with known answers, for the tests of responses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.fem import FieldRef, Structure
from femtune.model import Assignment, Configuration, ConfiguredModel, ModelPoint, configure, parametric_model
from femtune.model.damping import ModalDamping, damping_table
from femtune.parameters import Parameter, ParameterSet
from structures.frames import bars, make_structure, scalars

Link = tuple[int, int, float]


def rising(ratio: float, at_hz: float) -> ModalDamping:
    """Modal damping that grows in proportion to the frequency."""
    return damping_table([0.0, at_hz], [0.0, ratio])


def chain(
    springs: Sequence[Link], masses: Sequence[float], dashpots: Sequence[Link] = (), loss: Sequence[float] | float = 0.0
) -> Structure:
    """Masses along X at grid points 1 …; springs (a, b, k) with loss factors and dashpots (a, b, c), −1 for ground."""
    n = len(masses)
    xyz = np.column_stack([np.arange(n, dtype=float), np.zeros((n, 2))])
    spring = scalars("spring", _ends(springs), "K", [k for *_, k in springs])
    parts = [
        replace(spring, values={**spring.values, "GE": loss}),
        scalars("scalar-mass", [[_dof(i), -1] for i in range(n)], "M", list(masses)),
    ]
    if dashpots:
        parts.append(scalars("dashpot", _ends(dashpots), "B", [c for *_, c in dashpots]))
    return make_structure(xyz, parts)


def _ends(links: Sequence[Link]) -> NDArray[np.int64]:
    return np.array([[_dof(a), _dof(b)] for a, b, _ in links])


def _dof(i: int) -> int:
    return 6 * i if i >= 0 else -1


CARDS = {"K": ("CELAS2", 0), "GE": ("CELAS2", 0), "M": ("CMASS2", 1000), "B": ("CDAMP2", 2000)}


def configured(structure: Structure, factors: Mapping[str, tuple[str, int]] | None = None) -> ConfiguredModel:
    """A model whose parameters are factors on values of the chain's elements: name -> (role, number from 1)."""
    given = factors or {}
    fields = {name: FieldRef(CARDS[role][0], CARDS[role][1] + i, role) for name, (role, i) in given.items()}
    names = ParameterSet(tuple(Parameter(name, 1.0, 0.1, 5.0) for name in given))
    assignments = [Assignment(name, field) for name, field in fields.items()]
    return configure(parametric_model(structure, names, assignments), Configuration())


def point(structure: Structure, factors: Mapping[str, tuple[str, int]] | None = None) -> ModelPoint:
    """The nominal point of such a model."""
    return configured(structure, factors).at(np.zeros(len(factors or {})))


def matrices(at: ModelPoint) -> tuple[Any, ...]:
    """Dense K, M, C, H."""
    return tuple(m.toarray() for m in (at.stiffness, at.mass, at.viscous, at.hysteretic))


def dense_receptance(at: ModelPoint, freq_hz: NDArray, more_viscous: NDArray) -> NDArray:
    """(n, n, k) inverse of the dynamic stiffness by dense linear algebra; `more_viscous` (n, n, k) is added to C."""
    K, M, C, H = matrices(at)
    w = 2 * np.pi * np.asarray(freq_hz, float)
    return np.stack(
        [np.linalg.inv(K + 1j * H - x * x * M + 1j * x * (C + D)) for x, D in zip(w, more_viscous.T)], axis=-1
    )


SECTION = {"E": 2.1e11, "G": 8.1e10, "A": 2e-4, "I1": 1.5e-8, "I2": 6e-9, "J": 1.1e-8, "rho": 7850.0}
LENGTH = 1.0
PLANE = (1, 5)
"""Components that a beam in the plane keeps: deflection and slope."""


def beam(
    n: int,
    components: Sequence[int] = PLANE,
    clamped: bool = False,
    dashpots: Sequence[Link] = (),
    consistent: bool = True,
    **more: float,
) -> ModelPoint:
    """n bars along X, of which the given components (0 to 5) may move; dashpots between g-set DOFs."""
    xyz = np.column_stack([np.linspace(0.0, LENGTH, n + 1), np.zeros((n + 1, 2))])
    parts = [bars(np.stack([np.arange(n), np.arange(1, n + 1)], axis=1), {**SECTION, **more})]
    if dashpots:
        parts.append(scalars("dashpot", [[a, b] for a, b, _ in dashpots], "B", [c for *_, c in dashpots]))
    held = {6 * i + c for i in range(n + 1) for c in range(6) if c not in components} | set(range(6 * clamped))
    structure = make_structure(xyz, parts, consistent_mass=consistent, permanent=np.array(sorted(held)))
    return configured(structure).at(np.zeros(0))
