"""Names of the values that element matrices are functions of: fields of cards, factors, generic eigenvalues."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

MatrixKind = Literal["stiffness", "mass", "viscous", "hysteretic"]


@dataclass(frozen=True, order=True)
class FieldRef:
    """A field of a card, for example ``PBAR 3 I1``; `region` is set if some of its users were split off.

    A PARAM has no number: ``PARAM G`` has id 0. A factor of matrices has neither number nor name: ``STIFFNESS``.
    """

    card: str
    id: int
    name: str
    region: str = ""

    def __str__(self) -> str:
        tail = f" [{self.region}]" if self.region else ""
        number = f" {self.id}" if self.id else ""
        name = f" {self.name}" if self.name else ""
        return f"{self.card}{number}{name}{tail}"


FACTORS: Mapping[str, MatrixKind] = {"STIFFNESS": "stiffness", "MASS": "mass", "VISCOUS": "viscous"}
"""Factors of whole element matrices, and the matrices that they multiply."""


def factor_ref(word: str) -> FieldRef:
    """Reference to the entry of the value table that holds a factor."""
    return FieldRef(word, 0, "")


AMPLITUDE = "DISTRIBUTION"
"""Card word of the amplitudes of functions of position: ``DISTRIBUTION THIN F2``."""


def amplitude_ref(name: str, number: int) -> FieldRef:
    """Reference to the amplitude of a function of a distribution; functions are numbered from 1."""
    return FieldRef(AMPLITUDE, 0, f"{name} F{number}")


def generic_ref(group: str, name: str) -> FieldRef:
    """Reference to an eigenvalue (K1) or a rotation (S1-3) of a generic element group."""
    return FieldRef("GENERIC", 0, f"{group} {name}")
