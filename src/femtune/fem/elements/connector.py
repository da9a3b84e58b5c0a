"""Connectors between two surfaces (CWELD, CFAST): six springs between two ends that follow other grid points.

The springs act at the middle between the ends, along and about the element's axes. Those of a weld are a straight bar
of round section with transverse shear, in terms of its six deformations (Przemieniecki, Theory of Matrix Structural
Analysis, 1968, section 5.6). Its moduli are multiplied by L/Le, with the distance L of the ends and the effective
length Le, so that the flexibility across is L²Le/12EI + Le/κGA, which has a limit for L = 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.contribution import Coefficient, Contribution, product
from femtune.fem.elements import placement
from femtune.fem.elements.kind import ElementKind
from femtune.fem.structure import ElementBatch, Structure
from femtune.parameters.jet import Jet

ROUND_SHEAR_FACTOR = 0.9
"""Shear factor κ of a solid round section: the value that Nastran uses for bars of the type ROD."""

Values = Mapping[str, Jet]
Facts = Mapping[str, NDArray]


def fastener(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffnesses K1 to K6 with the loss factor GE, and a mass M, half at each end."""
    at = np.arange(len(batch))
    out = [
        Contribution("stiffness", f"K{i + 1}", at, placement.outer(row), (f"K{i + 1}",), product(f"K{i + 1}"))
        for i, row in enumerate(np.moveaxis(_deformations(batch), 1, 0))
    ]
    return [*out, Contribution("mass", "mass", at, _shared_mass(batch, structure), ("M",), product("M"))]


def weld(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """A bar of diameter D; its effective length is "fixed" + "factor" · D, or the mean of the thicknesses tA and tB."""
    at, rows = np.arange(len(batch)), _deformations(batch)
    spot = "tA" in batch.roles
    shape = {name: batch.facts[name] for name in (("length",) if spot else ("length", "fixed", "factor"))}
    sizes = ("D", "tA", "tB") if spot else ("D",)
    out = [
        Contribution(
            "stiffness", label, at, placement.sum_of_squares(rows[:, springs]), (*moduli, *sizes), coefficient, shape
        )
        for label, springs, moduli, coefficient in _PARTS
    ]
    length = batch.facts["length"][:, None, None]
    mass = _shared_mass(batch, structure) * (0.25 * np.pi * length)
    return [*out, Contribution("mass", "mass", at, mass, ("rho", "D"), product("rho", "D", "D"))]


def _deformations(batch: ElementBatch) -> Reals:
    """(e, 6, d) motion of the second end relative to the first, both carried by rigid arms to the middle."""
    ends, arm = batch.facts["ends"], placement.cross_matrix(batch.facts["arm"])
    gap = ends[:, 6:] - ends[:, :6]
    gap[:, :3] += arm @ (ends[:, 3:6] + ends[:, 9:])
    return np.asarray(gap)


def _shared_mass(batch: ElementBatch, structure: Structure) -> Reals:
    """(e, d, d) matrices of a unit mass, half at each end."""
    ends = batch.facts["ends"]
    moved = np.concatenate([ends[:, :3], ends[:, 6:9]], axis=1)
    return placement.sum_of_squares(moved) * (0.5 * structure.mass_factor)


def _effective(values: Values, facts: Facts) -> Jet:
    """Effective length (m,)."""
    if "tA" in values:
        return (values["tA"] + values["tB"]) * 0.5
    return values["D"] * facts["factor"] + facts["fixed"]


def _over_length(modulus: str, factor: float, power: int) -> Coefficient:
    """factor · modulus · D^power / Le."""

    def stiffness(values: Values, facts: Facts) -> Jet:
        return _power(values["D"], power) * values[modulus] * factor / _effective(values, facts)

    return stiffness


def _across(values: Values, facts: Facts) -> Jet:
    """The inverse of L²Le/12EI + Le/κGA."""
    D, length = values["D"], facts["length"]
    bending = length**2 / 12.0 / (values["E"] * _power(D, 4) * (np.pi / 64.0))
    shear = 1.0 / (values["G"] * D * D * (ROUND_SHEAR_FACTOR * np.pi / 4.0))
    return 1.0 / ((bending + shear) * _effective(values, facts))


def _power(x: Jet, n: int) -> Jet:
    squared = x * x
    return squared if n == 2 else squared * squared


_Part = tuple[str, slice, tuple[str, ...], Callable[[Values, Facts], Jet]]
_PARTS: tuple[_Part, ...] = (
    ("axial", slice(0, 1), ("E",), _over_length("E", np.pi / 4.0, 2)),
    ("shear-bending", slice(1, 3), ("E", "G"), _across),
    ("torsion", slice(3, 4), ("G",), _over_length("G", np.pi / 32.0, 4)),
    ("bending", slice(4, 6), ("E",), _over_length("E", np.pi / 64.0, 4)),
)


WELD = ElementKind("weld", weld, line=True)
FASTENER = ElementKind("fastener", fastener, line=True)
