"""Contribution: what an element gives to a matrix, as constant matrices with scalar coefficients."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from femtune.fem.fields import MatrixKind
from femtune.parameters.jet import Jet

Coefficient = Callable[[Mapping[str, Jet], Mapping[str, NDArray]], Jet]


@dataclass(frozen=True, eq=False)
class LowRank:
    """m symmetric matrices RᵀCR.

    Parameters
    ----------
    rows : (m, r, d) R; all contributions of an element that are of low rank have the same
    middle : (m, r, r) C, symmetric
    """

    rows: NDArray[np.float64]
    middle: NDArray[np.float64]

    def full(self) -> NDArray[np.float64]:
        """(m, d, d), exactly symmetric."""
        half = np.swapaxes(self.rows, 1, 2) @ (0.5 * self.middle @ self.rows)
        return np.asarray(half + np.swapaxes(half, 1, 2))


@dataclass(frozen=True)
class Contribution:
    """One exact term of a batch: Σ_e coefficient_e(p) · matrix_e.

    Parameters
    ----------
    matrix : "stiffness", "mass" or "viscous" (a damping matrix C)
    label : short name for messages and tests, "axial"
    at : (m,) positions of the elements in their batch
    stored : (m, d, d) constant symmetric matrices on the batch's DOFs, in the displacement frames of the nodes; or
        these by their low rank
    roles : names of the values that the coefficient needs
    coefficient : (jets of the roles, facts) -> jet of shape (m,); plain arithmetic, complex-safe
    facts : (m,) constants that enter the coefficient (a length); empty where it depends on the values only, so that
        elements of the same values share one scalar
    loss : name of the value that is the loss factor η of a stiffness; where the batch has it, η·coefficient·matrix
        is the imaginary, hysteretic stiffness that goes with this one
    """

    matrix: MatrixKind
    label: str
    at: NDArray[np.int64]
    stored: NDArray[np.float64] | LowRank
    roles: tuple[str, ...]
    coefficient: Coefficient
    facts: Mapping[str, NDArray] = field(default_factory=dict)
    loss: str = "GE"

    @property
    def matrices(self) -> NDArray[np.float64]:
        """(m, d, d) the matrices."""
        return self.stored.full() if isinstance(self.stored, LowRank) else self.stored


def product(*roles: str) -> Coefficient:
    """The coefficient that is the product of some values (a role may stand twice)."""

    def multiply(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        out = values[roles[0]]
        for name in roles[1:]:
            out = out * values[name]
        return out

    return multiply


def hysteretic(part: Contribution) -> Contribution:
    """The imaginary stiffness that a loss factor makes of a stiffness."""

    return replace(times(part, part.loss), matrix="hysteretic")


def times(part: Contribution, *factors: str) -> Contribution:
    """The contribution multiplied with further values of the batch (one may stand twice)."""

    def coefficient(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        out = part.coefficient(values, facts)
        for name in factors:
            out = values[name] * out
        return out

    return replace(part, roles=tuple(dict.fromkeys((*part.roles, *factors))), coefficient=coefficient)


def joined(pieces: Iterable[list[Contribution]]) -> list[Contribution]:
    """Contributions of pieces of a batch as those of the whole; those of one label and coefficient are one."""
    groups: dict[tuple[str, str, Coefficient], list[Contribution]] = {}
    for part in (part for piece in pieces for part in piece):
        groups.setdefault((part.matrix, part.label, part.coefficient), []).append(part)
    return [_join(group) for group in groups.values()]


def _join(group: list[Contribution]) -> Contribution:
    facts = {name: np.concatenate([p.facts[name] for p in group]) for name in group[0].facts}
    at = np.concatenate([p.at for p in group])
    return replace(group[0], at=at, stored=np.concatenate([p.matrices for p in group]), facts=facts)
