"""Condensation on master DOFs: Guyan, dynamic at a frequency, IRS and iterated IRS, SEREP.

K and M are symmetric matrices (n, n), dense or sparse, without constraints; `masters` are positions of the DOFs that
are kept. The formulas are written for u = [u_a, u_o] with slaves o.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

from femtune.arrays import Integers, Reals
from femtune.errors import FemtuneError
from femtune.model.configured import ConfiguredModel
from femtune.model.eigen.pairs import EigenSearch, lowest
from femtune.model.eigen.pencil import Inverse, Pencil
from femtune.model.eigen.sturm import count_below
from femtune.model.linear.symmetric import symmetric
from femtune.model.solvers.factorise import factorise
from femtune.model.solvers.interface import Factor, SingularMatrixError

# ----------------------------------------------------------------------------------------------------
# Master DOFs of a condensation, and the blocks that they divide K and M into.


Matrix: TypeAlias = NDArray[np.float64] | sp.sparray

_MASTER_SETS = ("ASET", "BSET", "CSET")


@dataclass(frozen=True, eq=False)
class Reduction:
    """A condensed model: u = T q.

    Parameters
    ----------
    transformation : T (n, r)
    stiffness, mass : (r, r) TᵀKT and TᵀMT
    masters : (m,) DOFs that the first m coordinates are; further ones are amplitudes of modes
    """

    transformation: Reals
    stiffness: Reals
    mass: Reals
    masters: Integers


@dataclass(frozen=True, eq=False)
class Partition:
    """K and M by masters (a) and slaves (o)."""

    K: sp.csr_array
    M: sp.csr_array
    masters: Integers

    @classmethod
    def of(cls, K: Matrix, M: Matrix, masters: ArrayLike) -> Partition:
        """From full symmetric matrices (n, n) and the positions of the masters.

        Raises
        ------
        FemtuneError : ``reduce.masters``
        """
        chosen = np.asarray(masters, dtype=np.int64).ravel()
        n = K.shape[0]
        if not chosen.size or len(set(chosen.tolist())) < chosen.size or chosen.min() < 0 or chosen.max() >= n:
            raise FemtuneError("reduce.masters", values={"masters": int(chosen.size), "degrees of freedom": n})
        return cls(sp.csr_array(K), sp.csr_array(M), chosen)

    @cached_property
    def slaves(self) -> Integers:
        """(n − m,) DOFs that are condensed."""
        kept = np.zeros(self.K.shape[0], bool)
        kept[self.masters] = True
        return np.flatnonzero(~kept)

    def block(self, A: sp.csr_array, rows: Integers, columns: Integers) -> sp.csr_array:
        """Some rows and columns of a matrix."""
        return sp.csr_array(A[rows][:, columns])

    def transformation(self, of_slaves: Reals) -> Reals:
        """T (n, m) from the slaves' part (n − m, m): masters move as prescribed."""
        T = np.zeros((self.K.shape[0], len(self.masters)))
        T[self.masters] = np.eye(len(self.masters))
        T[self.slaves] = of_slaves
        return T

    def reduced(self, T: Reals) -> Reduction:
        """K and M on T."""
        k, m = T.T @ (self.K @ T), T.T @ (self.M @ T)
        return Reduction(T, 0.5 * (k + k.T), 0.5 * (m + m.T), self.masters)


def deck_masters(configured: ConfiguredModel) -> Integers:
    """Positions of the free DOFs that the deck's sets keep: ASET, BSET and CSET, or all but OMIT.

    Raises
    ------
    FemtuneError : ``reduce.no-masters`` where the deck has no such set, or none of its DOFs is free
    """
    sets = configured.model.structure.dof_sets
    kept = _joined(sets[name] for name in _MASTER_SETS if name in sets)
    if kept.size:
        masters = np.flatnonzero(np.isin(configured.free, kept))
    else:
        omitted = sets.get("OMIT", np.zeros(0, np.int64))
        masters = np.flatnonzero(~np.isin(configured.free, omitted)) if omitted.size else omitted
    if not masters.size:
        raise FemtuneError(
            "reduce.no-masters",
            values={"sets": ", ".join(sets) or "none"},
            configuration=configured.configuration.name,
        )
    return masters


def _joined(sets: Iterable[Integers]) -> Integers:
    return np.unique(np.concatenate([np.zeros(0, np.int64), *sets]))


_SINGULAR = 1e-12
"""Singular value of the shapes at the masters, relative to the largest, below which modes cannot be told apart."""
_LOST = 1e-4
"""Relative residual of a solve for a random load above which the factors are lost to rounding: a motion is not held."""


def guyan(K: Matrix, M: Matrix, masters: ArrayLike) -> Reduction:
    """Static condensation u_o = −K_oo⁻¹K_oa u_a: exact for static loads on the masters.

    Source: Guyan 1965. Raises FemtuneError ``reduce.masters``, ``reduce.slaves-loose``.
    """
    parts = Partition.of(K, M, masters)
    return parts.reduced(parts.transformation(static_shapes(parts, slaves_factor(parts))))


def dynamic(K: Matrix, M: Matrix, masters: ArrayLike, freq_hz: float) -> Reduction:
    """Condensation u_o = −(K − ω²M)_oo⁻¹(K − ω²M)_oa u_a: exact for motion at `freq_hz`.

    Source: Leung 1978. Raises FemtuneError ``reduce.masters``, and ``reduce.slaves-loose`` where the frequency is a
    natural one of the slaves with the masters held.
    """
    parts = Partition.of(K, M, masters)
    square = (2.0 * np.pi * freq_hz) ** 2
    shifted = Partition(parts.K - square * parts.M, parts.M, parts.masters)
    return parts.reduced(parts.transformation(static_shapes(shifted, slaves_factor(shifted))))


def irs(K: Matrix, M: Matrix, masters: ArrayLike, iterations: int = 1) -> Reduction:
    """Improved reduced system: the inertia of the slaves acts as it does in the condensed model before.

    T_o = −K_oo⁻¹K_oa + K_oo⁻¹(M_oa + M_oo T_o)M_a⁻¹K_a; more `iterations` tend to the lowest modes exactly.
    Source: O'Callahan 1989; Friswell, Garvey and Penny 1995 (iterated). Raises as `guyan`.
    """
    parts = Partition.of(K, M, masters)
    factor = slaves_factor(parts)
    static = static_shapes(parts, factor)
    oa, oo = (parts.block(parts.M, parts.slaves, c) for c in (parts.masters, parts.slaves))
    reduced, of_slaves = parts.reduced(parts.transformation(static)), static
    for _ in range(iterations):
        inertia = oa.toarray() + oo @ of_slaves
        of_slaves = static + _solved(factor, inertia @ la.solve(reduced.mass, reduced.stiffness, assume_a="sym"))
        reduced = parts.reduced(parts.transformation(of_slaves))
    return reduced


def serep(K: Matrix, M: Matrix, masters: ArrayLike, shapes: Reals) -> Reduction:
    """System equivalent reduction expansion: T = Φ Φ_a⁺, exact for the modes Φ (n, k ≤ m) that are kept.

    With fewer modes than masters the reduced matrices are singular: they have the rank k.
    Source: O'Callahan, Avitabile and Riemer 1989. Raises FemtuneError ``reduce.masters``, and
    ``reduce.modes-unseen`` if the modes cannot be told apart at the masters.
    """
    parts = Partition.of(K, M, masters)
    at_masters = shapes[parts.masters]
    singular = la.svdvals(at_masters / np.linalg.norm(shapes, axis=0))
    if shapes.shape[1] > len(parts.masters) or singular[-1] <= _SINGULAR * singular[0]:
        raise FemtuneError("reduce.modes-unseen", modes=shapes.shape[1], masters=len(parts.masters))
    return parts.reduced(shapes @ la.pinv(at_masters))


def static_shapes(parts: Partition, factor: Factor | None) -> Reals:
    """(n − m, m) static shapes −K_oo⁻¹K_oa of the slaves, for unit motions of the masters."""
    return -_solved(factor, parts.block(parts.K, parts.slaves, parts.masters).toarray())


def _solved(factor: Factor | None, b: Reals) -> Reals:
    return b if factor is None else factor.solve(np.asfortranarray(b))


def slaves_factor(parts: Partition) -> Factor | None:
    """Factors of K_oo, None without slaves (error ``reduce.slaves-loose``)."""
    if not parts.slaves.size:
        return None
    A = parts.block(parts.K, parts.slaves, parts.slaves)
    try:
        factor = factorise(A)
    except SingularMatrixError as error:
        raise _loose() from error
    # a pivot that is zero except for rounding shows in the residual of a solve
    probe = np.random.default_rng(3).standard_normal(A.shape[0])
    left = np.linalg.norm(A @ factor.solve(probe) - probe)
    if not left <= _LOST * np.linalg.norm(probe):
        raise _loose()
    return factor


def _loose() -> FemtuneError:
    return FemtuneError("reduce.slaves-loose")


# ----------------------------------------------------------------------------------------------------
# Craig-Bampton: modes with the interface held and static shapes of the interface; components joined there.


_FIRST_COUNT = 20
"""Modes that are computed first if the solver cannot count those below a frequency; then twice as many, and so on."""
_EXTRA_MODES = 6
"""Modes that are computed beyond the wanted ones, since the iteration converges at its last modes slowly."""


def craig_bampton(K: Matrix, M: Matrix, interface: ArrayLike, modes: int) -> Reduction:
    """Interface DOFs and the `modes` lowest fixed-interface modes: T = [[1, 0], [−K_oo⁻¹K_oa, Φ]].

    Exact with all modes, and the static condensation without any. The reduced stiffness has no coupling of interface
    and modes, the mass has the unit matrix at the modes. If the slaves have fewer modes, all of them are taken.

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
    if factor is None:
        return np.zeros((len(parts.slaves), 0))
    return _lowest(_pencil_of_slaves(parts), factor, count)[1]


def fixed_interface_modes_up_to(parts: Partition, factor: Factor | None, max_hz: float) -> Reals:
    """(n − m, k) mass-normalised modes of the slaves with the masters held, all up to a frequency.

    Their number is that of the negative pivots of K_oo − ω²M_oo; where the solver gives none, modes are computed until
    they exceed the frequency.
    """
    if factor is None:
        return np.zeros((len(parts.slaves), 0))
    pencil, value = _pencil_of_slaves(parts), (2.0 * np.pi * max_hz) ** 2
    below = count_below(pencil, value).below
    count = _FIRST_COUNT if below is None else below
    while True:
        values, shapes = _lowest(pencil, factor, count)
        if below is not None:
            return shapes
        if len(values) < count or values[-1] > value:
            return np.ascontiguousarray(shapes[:, values <= value])
        count *= 2


def _lowest(pencil: Pencil, factor: Factor, count: int) -> tuple[Reals, Reals]:
    """Eigenvalues (k,) and shapes (n, k) of the lowest modes; motions without mass are no modes."""
    count = min(count, pencil.heavy.size)
    if count <= 0:
        return np.zeros(0), np.zeros((pencil.n, 0))
    asked = min(count + _EXTRA_MODES, pencil.heavy.size)
    values, shapes, _ = lowest(EigenSearch(Inverse(pencil, 0.0, factor)), asked, count)
    return values[:count], np.ascontiguousarray(shapes[:, :count])


def _pencil_of_slaves(parts: Partition) -> Pencil:
    """K_oo and M_oo on one pattern."""
    K, M = (parts.block(A, parts.slaves, parts.slaves) for A in (parts.K, parts.M))
    return Pencil(symmetric(_on_both(K, M)), symmetric(_on_both(M, K)))


def _on_both(A: sp.csr_array, other: sp.csr_array) -> sp.csr_array:
    """A with zeros where only another matrix has entries, and on its diagonal."""
    entries, more, at = A.tocoo(), other.tocoo(), np.arange(A.shape[0])
    zeros = np.zeros(more.nnz + len(at))
    rows, cols = np.concatenate([entries.row, more.row, at]), np.concatenate([entries.col, more.col, at])
    return sp.csr_array(sp.coo_array((np.concatenate([entries.data, zeros]), (rows, cols)), shape=A.shape))


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
        own_coordinates = len(component.reduction.mass) - len(component.names)
        places.append(
            np.array([*(names[n] for n in component.names), *range(end, end + own_coordinates)], dtype=np.int64)
        )
        end += own_coordinates
    k, m = np.zeros((end, end)), np.zeros((end, end))
    for component, at in zip(components, places):
        k[np.ix_(at, at)] += component.reduction.stiffness
        m[np.ix_(at, at)] += component.reduction.mass
    return Coupled(k, m, tuple(names), tuple(places))


def _check_names(component: Component) -> None:
    wanted, given = len(component.reduction.masters), len(component.names)
    if given != wanted or len(set(component.names)) != given:
        raise FemtuneError("reduce.interface", given=given, wanted=wanted)
