"""Units of a deck, guessed from common values of its materials and from the positions of the test sensors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from femtune.arrays import Reals
from femtune.study.plausible_units import SYSTEMS, materials_of
from femtune.units import UnitSystem, unit_system

if TYPE_CHECKING:
    from collections.abc import Sequence

    from femtune.fem import Structure
    from femtune.study.plausible_units import Material

_TEST_UNITS = ("m-kg-s", "mm-t-s", "cm-kg-s", "in-slinch-s", "ft-slug-s")
"""Units that are tried for a test whose file states none: one for each unit of length."""
_SAME_PLACE = 1e-3
"""Distance of a sensor from its grid point, relative to the diagonal of the model.

It covers coordinates that are written with few digits, not sensors between grid points.
"""
_USUAL_EXTENT = (0.4, 1.3)
"""Usual extent of the sensors relative to that of the model, lower and upper limit.

The factors between units of length are at least 2.54, so that wrong units lead out of these limits if the sensors
cover most of the structure.
"""
_MATERIAL_SCORE = 4.0
"""Score of units in which a material of the deck is a common one; half of it if its density is a weight density.

It is the strongest evidence, because modulus and density rarely agree by chance.
"""
_POSSIBLE_SCORE = 1.0
"""Score of units in which all materials are physically possible: weak evidence, because most systems of units pass."""
_PLACE_SCORE = 3.0
"""Score of units in which all grid points of the sensors are found: less than that of a common material."""
_EXTENT_SCORE = 1.5
"""Score of units in which the sensors extend over the structure.

It is weaker evidence than sensors that coincide with grid points.
"""
_USUAL_SCORE = 0.1
"""Score of the most common system of units, less for others.

It decides only between systems that are otherwise equal.
"""
_MASSES = {"kg": "kg", "t": "t", "slinch": "lbf·s²/in", "lbm": "lbm", "slug": "slug"}


@dataclass(frozen=True)
class GuessedUnits:
    """Units of a deck and, where its file states none, of a test.

    Parameters
    ----------
    units : of the deck
    of_test : of the test; None where the file states them
    reasons : sentences with the reasons
    doubts : contradictions, each with what to write
    """

    units: UnitSystem
    of_test: UnitSystem | None
    reasons: tuple[str, ...]
    doubts: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Try:
    """One system for the deck, and one for the test where its file states none."""

    units: UnitSystem
    of_test: UnitSystem
    common: tuple[tuple[Material, str], ...]
    weight: tuple[tuple[Material, str], ...]
    possible: float
    share: float
    extent: float

    @property
    def score(self) -> float:
        covers = _USUAL_EXTENT[0] <= self.extent <= _USUAL_EXTENT[1]
        usual = _USUAL_SCORE * (1.0 - SYSTEMS.index(self.units.name) / len(SYSTEMS))
        known = _MATERIAL_SCORE * bool(self.common) + 0.5 * _MATERIAL_SCORE * bool(self.weight)
        return known + _POSSIBLE_SCORE * self.possible + _PLACE_SCORE * self.share + _EXTENT_SCORE * covers + usual


def guess_units(structure: Structure, points: Reals, of_test: UnitSystem | None) -> GuessedUnits:
    """The units of a deck.

    Parameters
    ----------
    structure : of the deck
    points : (n, 3) places of the sensors in the unit of the test
    of_test : units of the test; None where its file states none
    """
    materials = tuple(materials_of(structure))
    places = _Places(structure, points)
    tests = [of_test] if of_test is not None else [unit_system(name) for name in _TEST_UNITS]
    tries = [_tried(unit_system(name), test, materials, places) for name in SYSTEMS for test in tests]
    best = max(tries, key=lambda one: one.score)
    return GuessedUnits(
        best.units,
        best.of_test if of_test is None else None,
        tuple(_reasons(best, places)),
        tuple(_doubts(best, places)),
    )


class _Places:
    """Grid points of the model and sensors of the test, in their own units."""

    def __init__(self, structure: Structure, points: Reals) -> None:
        from scipy.spatial import cKDTree  # noqa: PLC0415  slow to import

        nodes = structure.nodes
        self.grids = nodes.xyz if nodes.has_coordinates else nodes.xyz[:0]
        self.points = np.unique(points[np.isfinite(points).all(axis=1)], axis=0)
        self.diagonal, self.of_test = (float(np.linalg.norm(np.ptp(x, axis=0))) if len(x) else 0.0
                                       for x in (self.grids, self.points))  # fmt: skip
        self._tree = cKDTree(self.grids) if len(self.grids) else None

    def share(self, factor: float) -> float:
        """Part of the sensors that lie at grid points of their own if their coordinates are taken times a factor."""
        if self._tree is None or not self.diagonal or len(self.points) < 2:
            return 0.0
        distance, at = self._tree.query(factor * self.points)
        near = distance <= _SAME_PLACE * self.diagonal
        return len(set(at[near].tolist())) / len(self.points)

    def extent(self, factor: float) -> float:
        """Extent of the sensors over that of the model; 0 where one has none."""
        return factor * self.of_test / self.diagonal if self.diagonal else 0.0


def _tried(units: UnitSystem, of_test: UnitSystem, materials: Sequence[Material], places: _Places) -> _Try:
    factor = units.length_from(of_test)
    possible = sum(m.is_possible(units) for m in materials) / len(materials) if materials else 0.0
    return _Try(
        units,
        of_test,
        tuple((m, name) for m in materials if (name := m.common(units))),
        tuple((m, name) for m in materials if (name := m.common_weight(units))),
        possible,
        places.share(factor),
        places.extent(factor),
    )


def _reasons(best: _Try, places: _Places) -> list[str]:
    units, reasons = best.units, []
    for material, name in best.common[:3]:
        reasons.append(
            f"{material.name} is {name}: E = {material.modulus:.4g} is {material.modulus_si(units) / 1e9:.4g} GPa, "
            f"density {material.density:.4g} is {material.density_si(units):.4g} kg/m³"
        )
    if places.diagonal:
        length = units.name.partition("-")[0]
        reasons.append(
            f"the grid points extend over {places.diagonal:.4g} {length} ({places.diagonal * units.length:.4g} m)"
        )
    if best.share:
        reasons.append(f"{100.0 * best.share:.0f} % of the test points lie at grid points")
    elif places.of_test and places.diagonal:
        reasons.append(f"the test points extend over {100.0 * best.extent:.0f} % of that")
    if not best.common and not best.weight:
        reasons.append("no material of the deck is a common one in any system: check the units yourself")
    return reasons


def _doubts(best: _Try, places: _Places) -> list[str]:
    units, doubts = best.units, []
    if best.weight and not best.common:
        material, name = best.weight[0]
        factor = units.length / 9.80665
        doubts.append(
            f"the density {material.density:.4g} of {material.name} is that of {name} as a weight per volume, too "
            f"large by the factor {1.0 / factor:.5g}: add PARAM,WTMASS,{factor:.5g} to the deck, or masses and "
            "frequencies are wrong"
        )
    if (
        places.of_test
        and places.diagonal
        and not best.share
        and not _USUAL_EXTENT[0] <= best.extent <= _USUAL_EXTENT[1]
    ):
        doubts.append(
            f"the test points extend over {100.0 * best.extent:.3g} % of the model: the unit of length of the deck or "
            "of the test may be wrong; state them with the keys units of [study] and of [test]"
        )
    return doubts


def unit_words(units: UnitSystem) -> str:
    """A system in words: ``mm-t-s``, forces in N."""
    length, mass, _ = units.name.split("-")
    force = {"m-kg-s": "N", "mm-t-s": "N", "mm-kg-s": "mN", "cm-kg-s": "cN", "in-slinch-s": "lbf", "ft-slug-s": "lbf"}
    force |= {"in-kip-s": "kip", "ft-kip-s": "kip"}
    of_mass = f"kip·s²/{length}" if mass == "kip" else _MASSES.get(mass, mass)
    of_force = force.get(units.name, f"{mass}·{length}/s²")
    return f"length in {length}, mass in {of_mass}, force in {of_force}"
