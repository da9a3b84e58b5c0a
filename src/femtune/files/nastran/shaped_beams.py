"""PBARL and PBEAML: section values that follow from the dimensions of a shape."""

from __future__ import annotations

import math
from collections.abc import Sequence

from femtune.fem.values import FieldRef
from femtune.files.nastran.beam_stations import STATION_FLAGS, BeamSection, beam_section, sort_stations, station_values
from femtune.files.nastran.building import Building
from femtune.files.nastran.record import Record
from femtune.files.nastran.sections import SECTION_ROLES, SHAPES, Shape

# fourth powers of dimensions, and of their inverses, stay within the sizes that other values may have
_LARGEST = 1e12
# the product of inertia and the offset of a symmetric section are rounding
_ROUNDING = 1e-10


def read_pbarl(b: Building, record: Record, pid: int) -> BeamSection:
    """The section of a PBARL; the offset between shear centre and neutral axis is left out, as Nastran does.

    Raises
    ------
    FemtuneError : ``deck.section``
    """
    shape = _shape(record)
    own = Record(record.card, (*shape.dimensions, "NSM"), 8)
    _check_dimensions(own, shape, [own.real(name) for name in shape.dimensions])
    at = [b.value(own, pid, name) for name in shape.dimensions]
    roles = _derived(b, FieldRef(record.name, pid, ""), shape, at)
    return BeamSection({**{n: roles[n] for n in SECTION_ROLES[:7]}, "NSM": b.value(own, pid, "NSM")})


def read_pbeaml(b: Building, record: Record, pid: int) -> BeamSection:
    """The section of a PBEAML, at one or more stations; the element's axis goes through the shear centres.

    Raises
    ------
    FemtuneError : ``deck.section``
    """
    shape = _shape(record)
    own = Record(record.card, (*shape.dimensions, "NSM"), 8)
    stations = sort_stations(record.card, 8, _starts(own, shape))
    _check_dimensions(own, shape, [own.real(name) for name in shape.dimensions])
    dims = [station_values(b, own, pid, name, stations) for name in shape.dimensions]
    table = {"NSM": station_values(b, own, pid, "NSM", stations)}
    sections: list[dict[str, int]] = []
    for k, x in enumerate(stations.x):
        at = [positions[k] for positions in dims]
        _check_dimensions(own, shape, [b.values.values[i] for i in at])
        same = next((j for j in range(k) if all(p[j] == p[k] for p in dims)), None)
        name = f" at {x:g}" if k else ""
        made = _derived(b, FieldRef(record.name, pid, name), shape, at) if same is None else sections[same]
        sections.append(made)
    table |= {role: [section[role] for section in sections] for role in SECTION_ROLES}
    none = b.values.add(FieldRef(record.name, pid, "zero"), 0.0)
    table |= {name: [none] * len(stations.x) for name in ("M1", "M2", "NSI")}
    return beam_section(b, record, table, stations.x)


def _derived(b: Building, ref: FieldRef, shape: Shape, at: Sequence[int]) -> dict[str, int]:
    """Positions of the properties that follow from the dimensions at some positions; `ref` names the station."""
    nominal = shape.properties(*(b.values.values[i] for i in at))
    sizes = {"I12": math.sqrt(nominal["I1"] * nominal["I2"]), "N1": math.sqrt(nominal["A"])}
    sizes["N2"] = sizes["N1"]
    roles, formulas = {}, shape.formulas
    for role in SECTION_ROLES:
        own = FieldRef(ref.card, ref.id, f"{role}{ref.name}")
        if abs(nominal[role]) <= _ROUNDING * sizes.get(role, 0.0):
            roles[role] = b.values.add(own, 0.0)
        else:
            roles[role] = b.values.derive(own, formulas[role], *at)
    return roles


def _shape(record: Record) -> Shape:
    name = record.text("TYPE")
    if name not in SHAPES:
        raise record.error(
            "deck.section",
            f"section '{name}' of {record.name} is not known",
            at="TYPE",
            hint=f"known sections: {', '.join(SHAPES)}; for another give a PBAR or PBEAM with its A, I1, I2 and J",
        )
    return SHAPES[name]


def _starts(own: Record, shape: Shape) -> list[int]:
    """Positions of the dimensions of further stations: SO, X/XB, DIM1 … NSM after each other."""
    card, at, starts = own.card, 8 + shape.n + 1, []
    while at < len(card.fields):
        if card.text(at, "YES") not in STATION_FLAGS:
            what = f"{card.name} has no YES or NO where the next station should start"
            hint = f"after {shape.n} dimensions and NSM a station has SO, X/XB and dimensions"
            raise card.error("deck.section", what, index=at, hint=hint)
        starts.append(at + 2)
        at += 2 + shape.n + 1
    return starts


def _check_dimensions(own: Record, shape: Shape, dims: Sequence[float]) -> None:
    if not shape.valid(*dims):
        raise own.error("deck.section", shape.rule, at="DIM1", hint="correct the dimensions")
    if max(dims) > _LARGEST or min(d for d in dims if d) < 1 / _LARGEST:
        raise own.error("deck.section", "the section's moments of inertia are beyond all numbers", at="DIM1",
                        hint="correct the dimensions")  # fmt: skip
