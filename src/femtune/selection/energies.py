"""Strain and kinetic energy of modes by element: where a stiffness or a mass parameter can do anything.

Of a mode with φᵀMφ = 1 element e holds the share φᵀK_eφ/λ of the strain energy and φᵀM_eφ of the kinetic energy;
a factor on its stiffness moves λ by just that share, one on its mass by minus the other.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.fem.fields import MatrixKind
from femtune.model import EigenSolution, ModelPoint
from femtune.model.terms import Term


def element_energies(point: ModelPoint, kind: MatrixKind, vectors: Reals) -> tuple[Integers, Reals]:
    """vᵀA_e v of every element e and every column v.

    Parameters
    ----------
    kind : "stiffness" or "mass"
    vectors : (n_free, m)

    Returns
    -------
    numbers (e,) ascending and energies (e, m); matrices that no element made, and masses that a configuration adds,
    are not among them
    """
    configured = point.configured
    motion = np.vstack([configured.transformation @ vectors, np.zeros((1, vectors.shape[1]))])
    off, table = list(configured.configuration.elements_off), configured.model.table(point.x).without_derivatives()
    numbers, parts = [np.zeros(0, np.int64)], [np.zeros((0, vectors.shape[1]))]
    for term in configured.model.terms:
        if isinstance(term, Term) and term.matrix == kind:
            factor = np.ones(1) if term.coefficient is None else term.coefficient(table).value
            keep = ~np.isin(term.elements, off)
            numbers.append(term.elements[keep])
            parts.append(_energies(term, factor, motion)[keep])
    return _summed(np.concatenate(numbers), np.concatenate(parts))


def _energies(term: Term, factor: Reals, motion: Reals) -> Reals:
    out = np.empty((len(term.elements), motion.shape[1]))
    for part in term.parts():
        displacements = motion[term.dofs[part]]
        out[part] = factor[term.columns[part], None] * np.einsum(
            "eim,eim->em", displacements, term.matrices(part) @ displacements
        )
    return out


def _summed(numbers: Integers, energies: Reals) -> tuple[Integers, Reals]:
    unique, at = np.unique(numbers, return_inverse=True)
    out = np.zeros((len(unique), energies.shape[1]))
    np.add.at(out, at, energies)
    return unique, out


@dataclass(frozen=True)
class EnergyMap:
    """Shares of the strain and the kinetic energy of m modes in g groups of elements; (g, m) each.

    What is missing to one is held by elements of no group, by matrices that no element made and by added masses. A
    share of strain energy can be negative where an element's matrix is (an offset, a stiffness below zero).
    """

    groups: tuple[str, ...]
    freq_hz: Reals
    strain: Reals
    kinetic: Reals

    def strongest(self, mode: int, kind: str = "strain", count: int = 3) -> tuple[tuple[str, float], ...]:
        """Groups with the largest shares of a mode (position), the largest first."""
        shares = (self.strain if kind == "strain" else self.kinetic)[:, mode]
        return tuple((self.groups[i], float(shares[i])) for i in np.argsort(-shares)[:count])


def energy_map(
    solution: EigenSolution, groups: Mapping[str, Iterable[int]] | None = None, modes: Iterable[int] | None = None
) -> EnergyMap:
    """Energy shares of modes by groups of elements, every element its own group where none are given.

    Parameters
    ----------
    groups : element numbers by name
    modes : positions; all wanted modes where None. Rigid-body modes have no strain energy: NaN
    """
    at = list(range(solution.wanted) if modes is None else modes)
    stiff, strain, whole = _strain(solution, at)
    heavy, kinetic = element_energies(solution.point, "mass", solution.shapes[:, at])
    named = {str(n): (n,) for n in np.union1d(stiff, heavy).tolist()} if groups is None else groups
    shares = _grouped(stiff, strain, named) / whole
    return EnergyMap(tuple(named), solution.freq_hz[at], shares, _grouped(heavy, kinetic, named))


def strain_shares(solution: EigenSolution, modes: Sequence[int]) -> tuple[Integers, Reals]:
    """Numbers (e,) of the elements and their shares (e, m) of the strain energy of the modes at these positions.

    Rigid-body modes have no strain energy: NaN.
    """
    numbers, energies, whole = _strain(solution, modes)
    return numbers, energies / whole


def _strain(solution: EigenSolution, modes: Sequence[int]) -> tuple[Integers, Reals, Reals]:
    """Numbers and strain energies of the elements, and those of whole modes (m,), NaN for rigid-body modes."""
    at = list(modes)
    values = solution.eigenvalues[at]
    whole = np.where(values > 1e-8 * np.abs(solution.eigenvalues).max(initial=0.0), values, np.nan)
    return *element_energies(solution.point, "stiffness", solution.shapes[:, at]), whole


def _grouped(numbers: Integers, energies: Reals, groups: Mapping[str, Iterable[int]]) -> Reals:
    rows = [energies[np.isin(numbers, list(members))].sum(axis=0) for members in groups.values()]
    return np.array(rows).reshape(len(groups), energies.shape[1])
