"""Craig-Bampton: modes with the interface held and static shapes of the interface; components joined there."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import ArrayLike, NDArray

from femtune.errors import FemtuneError
from femtune.model.factorise import Factor
from femtune.model.reduce.condensation import slaves_factor, static_shapes
from femtune.model.reduce.masters import Matrix, Partition, Reduction

Reals = NDArray[np.float64]

_DENSE_UP_TO = 1500


def craig_bampton(K: Matrix, M: Matrix, interface: ArrayLike, modes: int) -> Reduction:
    """Interface DOFs and the `modes` lowest fixed-interface modes: T = [[1, 0], [−K_oo⁻¹K_oa, Φ]].

    Exact with all modes, and the static condensation without any. The reduced stiffness has no coupling of interface
    and modes, the mass has the unit matrix at the modes. Fewer modes are taken where the slaves have fewer.

    Source: Craig and Bampton 1968. Raises FemtuneError ``reduce.masters``, ``reduce.slaves-loose``.
    """
    parts = Partition.of(K, M, interface)
    factor = slaves_factor(parts)
    fixed = fixed_interface_modes(parts, factor, modes)
    T = np.zeros((parts.K.shape[0], len(parts.masters) + fixed.shape[1]))
    T[:, : len(parts.masters)] = parts.transformation(static_shapes(parts, factor))
    T[parts.slaves, len(parts.masters) :] = fixed
    return parts.reduced(T)


def fixed_interface_modes(parts: Partition, factor: Factor | None, count: int) -> Reals:
    """(n − m, k) mass-normalised lowest modes of the slaves with the masters held."""
    size = len(parts.slaves)
    if factor is None or count <= 0:
        return np.zeros((size, 0))
    K, M = (parts.block(A, parts.slaves, parts.slaves) for A in (parts.K, parts.M))
    if size <= _DENSE_UP_TO or 2 * count >= size:
        return _dense(K, M, count)
    inverse = spla.LinearOperator(K.shape, matvec=factor.solve, dtype=np.float64)
    start = factor.solve(M @ np.random.default_rng(4).standard_normal(size))
    _, shapes = spla.eigsh(K, k=count, M=M, sigma=0.0, OPinv=inverse, v0=start, tol=0.0)
    return np.asarray(shapes)


def _dense(K: sp.csr_array, M: sp.csr_array, count: int) -> Reals:
    """By Mφ = θKφ, so that M may be singular; motions without mass are no modes."""
    theta, shapes = la.eigh(M.toarray(), K.toarray())
    finite = int(np.sum(theta > 1e-14 * theta.max(initial=0.0)))
    kept = slice(-1, -min(count, finite) - 1, -1)
    return np.asarray(shapes[:, kept] / np.sqrt(theta[kept])) if finite else shapes[:, :0]


@dataclass(frozen=True, eq=False)
class Component:
    """A reduced component and the names of its first coordinates, the interface; equal names are one DOF."""

    reduction: Reduction
    names: Sequence[Hashable]


@dataclass(frozen=True, eq=False)
class Coupled:
    """Components joined at their interfaces.

    Parameters
    ----------
    stiffness, mass : (r, r)
    names : interface DOFs, the first coordinates; the components' own coordinates follow
    places : for each component the positions of its coordinates
    """

    stiffness: Reals
    mass: Reals
    names: tuple[Hashable, ...]
    places: tuple[NDArray[np.int64], ...]

    def shapes(self, component: Component, i: int, q: Reals) -> Reals:
        """Motions of all DOFs of component i for coupled coordinates (r, k)."""
        return component.reduction.transformation @ q[self.places[i]]


def couple(components: Sequence[Component]) -> Coupled:
    """Assemble components by the names of their interface DOFs.

    Raises
    ------
    FemtuneError : ``reduce.interface`` where a component has not one name for each interface DOF
    """
    names: dict[Hashable, int] = {}
    for component in components:
        _check_names(component)
        for name in component.names:
            names.setdefault(name, len(names))
    places, end = [], len(names)
    for component in components:
        own = len(component.reduction.mass) - len(component.names)
        places.append(np.array([*(names[n] for n in component.names), *range(end, end + own)], dtype=np.int64))
        end += own
    k, m = np.zeros((end, end)), np.zeros((end, end))
    for component, at in zip(components, places):
        k[np.ix_(at, at)] += component.reduction.stiffness
        m[np.ix_(at, at)] += component.reduction.mass
    return Coupled(k, m, tuple(names), tuple(places))


def _check_names(component: Component) -> None:
    wanted, given = len(component.reduction.masters), len(component.names)
    if given != wanted or len(set(component.names)) != given:
        raise FemtuneError(
            "reduce.interface",
            f"{given} names are given for {wanted} interface DOFs of a component",
            hint="name each interface DOF once, in the order of the component's masters",
        )
