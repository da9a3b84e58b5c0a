"""PBCOMP: a constant beam section, given as a whole or as lumped areas of several materials.

With fractions C_i of the area A at (Y_i, Z_i): the neutral axis is the centre of the C_i E_i, A_eff = A Σ C_i E_i/E,
I1 = A Σ C_i (Y_i − ȳ)² E_i/E, I2 and I12 likewise, J_eff = J Σ C_i G_i/G, and the mass per length is A Σ C_i ρ_i.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from femtune.fem.fields import FieldRef
from femtune.fem.rules import makes_rules
from femtune.files.nastran.beam_sections import BeamSection, beam_section
from femtune.files.nastran.building import Building
from femtune.files.nastran.card import CardEntry
from femtune.files.nastran.materials import Materials

# images of a lump by SYMOPT: none, in both axes, in the y axis, in the z axis, in the origin, none
_IMAGES: tuple[tuple[tuple[int, int], ...], ...] = (
    ((1, 1),),
    ((1, 1), (-1, 1), (1, -1), (-1, -1)),
    ((1, 1), (1, -1)),
    ((1, 1), (-1, 1)),
    ((1, 1), (-1, -1)),
    ((1, 1),),
)
_LUMP_FIELDS = ("Y", "Z", "C", "MID")
_MOST_LUMPS = 20
"""Largest number of lumped areas after reflection by SYMOPT; all of their moduli enter each derived value."""
_END_STATIONS = (0.0, 1.0)
"""Stations of a constant section: both ends of the beam."""
_ACROSS = {"I1": ("y", "y"), "I2": ("z", "z"), "I12": ("y", "z")}


@dataclass(frozen=True)
class Lump:
    """Position and fraction of a lumped area, and the positions of its material's values."""

    y: float
    z: float
    fraction: float
    material: Mapping[str, int]


def read_pbcomp(
    b: Building, record: CardEntry, pid: int, material: Mapping[str, int], materials: Materials
) -> BeamSection:  # fmt: skip
    """The section of a PBCOMP and its density "rho".

    Raises
    ------
    FemtuneError : ``deck.section`` (SYMOPT, lumps on a line, too many of them, no area)
    """
    lumps = _lumps(record, material, materials)
    given = {n: b.value(record, pid, n) for n in ("A", "J", "NSM", "M1", "M2")}
    given |= {n: b.value(record, pid, n, 1.0) for n in ("K1", "K2")}
    given["NSI"] = b.values.add(FieldRef(record.name, pid, "NSI"), 0.0)
    if lumps:
        with np.errstate(all="ignore"):
            made = _composed(b, FieldRef(record.name, pid, ""), lumps, given, material)
        _check_finite(b, record, made)
    else:
        made = {n: b.value(record, pid, n) for n in ("I1", "I2", "I12", "N1", "N2")}
    section = beam_section(
        b, record, {name: [at, at] for name, at in {**given, **made}.items() if name != "rho"}, _END_STATIONS
    )
    density = {"rho": made["rho"]} if lumps else {}
    return BeamSection({**section.roles, **density}, section.stations)


def _lumps(record: CardEntry, material: Mapping[str, int], materials: Materials) -> list[Lump]:
    images = _images(record)
    lumps = []
    for start in range(16, len(record.card.fields), 8):
        line = CardEntry(record.card, _LUMP_FIELDS, start)
        fraction = line.real("C", 0.0)
        if fraction < 0.0:
            raise line.error("deck.section/lump-fraction", at="C")
        lump_material = material if line.blank("MID") else materials.get(line.integer("MID"), line)
        y, z = line.reals("Y", "Z")
        lumps += [Lump(s * y, t * z, fraction, lump_material) for s, t in images if fraction]
    if len(lumps) > _MOST_LUMPS:
        raise record.error("deck.section/too-many-lumps", n_lumps=len(lumps), most=_MOST_LUMPS)
    return lumps


def _check_finite(b: Building, record: CardEntry, made: Mapping[str, int]) -> None:
    if not all(math.isfinite(b.values.values[at]) for at in made.values()):
        raise record.error("deck.section/lumps-not-finite")


def _images(record: CardEntry) -> tuple[tuple[int, int], ...]:
    option = record.integer("SYMOPT", 0)
    if not 0 <= option < len(_IMAGES):
        raise record.error("deck.section/symmetry-option", at="SYMOPT", option=option)
    return _IMAGES[option]


def _composed(
    b: Building, ref: FieldRef, lumps: list[Lump], given: Mapping[str, int], material: Mapping[str, int]
) -> dict[str, int]:  # fmt: skip
    """Positions of the values derived from the lumps; A and J become the effective ones."""
    moduli, shear = [lump.material["E"] for lump in lumps], [lump.material["G"] for lump in lumps]
    density = [lump.material["rho"] for lump in lumps]

    def derive(name: str, function: Callable[..., Any], *sources: int) -> int:
        return b.values.derive(FieldRef(ref.card, ref.id, name), function, *sources)

    out = {
        "A": derive("effective A", _weighted(lumps), given["A"], material["E"], *moduli),
        "N1": derive("neutral axis y", _centre(lumps, "y"), *moduli),
        "N2": derive("neutral axis z", _centre(lumps, "z"), *moduli),
    }
    for name, (f, g) in _ACROSS.items():
        out[name] = derive(f"effective {name}", _second_moment(lumps, f, g), given["A"], material["E"], *moduli)
    if b.values.values[material["G"]]:
        out["J"] = derive("effective J", _weighted(lumps), given["J"], material["G"], *shear)
    # mass is density times effective area
    out["rho"] = derive("effective density", _weighted(lumps), given["A"], out["A"], *density)
    return out


@makes_rules
def _weighted(lumps: list[Lump]) -> Callable[..., Any]:
    """amount · Σ C_i value_i / reference."""
    return lambda amount, reference, *values: amount * _sum(lumps, values, lambda lump: 1.0) / reference


@makes_rules
def _centre(lumps: list[Lump], axis: str) -> Callable[..., Any]:
    return lambda *moduli: _sum(lumps, moduli, lambda p: getattr(p, axis)) / _sum(lumps, moduli, lambda p: 1.0)


@makes_rules
def _second_moment(lumps: list[Lump], f: str, g: str) -> Callable[..., Any]:
    """A Σ C_i f_i g_i E_i/E about the neutral axis."""

    def moment(area: Any, modulus: Any, *moduli: Any) -> Any:
        whole = _sum(lumps, moduli, lambda p: 1.0)
        first, second = (_sum(lumps, moduli, lambda p, a=a: getattr(p, a)) for a in (f, g))
        about_origin = _sum(lumps, moduli, lambda p: getattr(p, f) * getattr(p, g))
        return area * (about_origin - first * second / whole) / modulus

    return moment


def _sum(lumps: list[Lump], values: Any, factor: Callable[..., float]) -> Any:
    out = values[0] * (lumps[0].fraction * factor(lumps[0]))
    for lump, value in zip(lumps[1:], values[1:]):
        out = out + value * (lump.fraction * factor(lump))
    return out
