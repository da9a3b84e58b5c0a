"""Which strain rows of a shell meet which coefficient: membrane M·t, bending B·t³·RI, both together C·t², shear S·t·TS.

An offset z0 multiplies the membrane's terms by z0 and z0², and those of membrane and bending together by z0.

Every coefficient is a product of values, so that elements of one property share it; only in-plane bending of a law that
is not isotropic depends on the element, by the angle between its sides and the material's axes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Flags
from femtune.fem.contribution import Coefficient, product
from femtune.fem.elements.placement import nominal
from femtune.fem.elements.shells.strains import OFFSET
from femtune.fem.elements.shells.tri import SOFTENERS, bends, softened_shear
from femtune.fem.structure import ElementBatch, Structure
from femtune.parameters.jet import Jet

Names = tuple[str, ...]

# determinant of a membrane law over the product of its diagonal, below which no stress can be uniaxial
SINGULAR = 1e-9


@dataclass(frozen=True)
class ShellTerm:
    """A stiffness of some elements: LᵀL of the rows `left`, or LᵀR + RᵀL where there is a `right`.

    `direction` is the number of the uniaxial row whose angle to the material's x axis enters the coefficient, else 0;
    `point` is the only place of the rows that counts, None where all do.
    """

    label: str
    at: NDArray[np.int64]
    roles: Names
    coefficient: Coefficient
    left: Names
    right: Names = ()
    loss: str = "GE"
    direction: int = 0
    point: int | None = None
    facts: dict[str, NDArray] = field(default_factory=dict)


@dataclass(frozen=True)
class _Law:
    """The entries of a law of a batch: letter of its roles and rows, further factors, and who has it."""

    law: str
    rows: str
    label: str
    factors: Names
    loss: str
    has: Flags


def stiffness_terms(
    batch: ElementBatch, structure: Structure, uniaxial: int, residual: NDArray | None = None
) -> list[ShellTerm]:
    """All stiffness terms of a batch of shells; those that no element has are left out.

    `residual` (e,) is what the formulation gives for the shear's residual bending flexibility, None without one.
    """
    membrane = _Law("M", "m", "membrane", ("t",), "GE", batch.facts["has_membrane"])
    bending = _Law("B", "b", "bending", ("t", "t", "t", "RI"), "GEB", batch.facts["has_bending"])
    shear = _Law("S", "s", "shear", ("t", "TS"), "GES", batch.facts["has_bending"])
    offset = batch.facts["offset_given"]
    flat = [*_plane_law(batch, structure, membrane), *_in_plane_bending(batch, structure, uniaxial)]
    lifted = [lifted for term in flat for lifted in _offset_terms(term, offset)]
    both = list(_coupling_law(batch, structure, _Law("C", "", "coupling", ("t", "t"), "GEC", couples(batch))))
    lifted += [_lifted_coupling(term, offset) for term in both]
    sheared = list(_shear_law(batch, structure, shear))
    if residual is not None:
        sheared = [part for term in sheared for part in _softened(term, residual, bends(batch, structure))]
    terms = [*flat, *both, *lifted, *_plane_law(batch, structure, bending), *sheared]
    return [term for term in terms if len(term.at)]


def _plane_law(batch: ElementBatch, structure: Structure, law: _Law) -> Iterator[ShellTerm]:
    """Entries 11 to 33; the two moduli of a law that has one are one term, and entries known to be zero are none."""
    one, two, both = (f"{law.rows}{k}" for k in ("1", "2", "12"))
    alike = law.has & (batch.roles[f"{law.law}11"] == batch.roles[f"{law.law}22"])
    coupled = law.has & ~_shared_zero(batch, structure, f"{law.law}13", f"{law.law}23")
    drilling = ("drill",) if law.rows == "m" else ()
    yield _term(law, "11", alike, (one, two))
    yield _term(law, "11", law.has & ~alike, (one,))
    yield _term(law, "22", law.has & ~alike, (two,))
    yield _term(law, "12", law.has, (one,), (two,))
    yield _term(law, "33", law.has, (both, *drilling))
    yield _term(law, "13", coupled, (one,), (both,))
    yield _term(law, "23", coupled, (two,), (both,))


def couples(batch: ElementBatch) -> Flags:
    """(e,) True where membrane and bending have a common law."""
    return np.asarray(batch.facts.get("has_coupling", np.zeros(len(batch), bool)))


def _coupling_law(batch: ElementBatch, structure: Structure, law: _Law) -> Iterator[ShellTerm]:
    """Entries 11 to 33: strain i meets curvature j, and j meets i."""
    if not law.has.any():
        return
    alike = law.has & (batch.roles["C11"] == batch.roles["C22"])
    sheared = law.has & ~_shared_zero(batch, structure, "C13", "C23")
    yield _term(law, "11", alike, ("m1", "m2"), ("c1", "c2"))
    yield _term(law, "11", law.has & ~alike, ("m1",), ("c1",))
    yield _term(law, "22", law.has & ~alike, ("m2",), ("c2",))
    yield _term(law, "12", law.has, ("m1", "m2"), ("c2", "c1"))
    yield _term(law, "33", law.has, ("m12",), ("c12",))
    yield _term(law, "13", sheared, ("m1", "m12"), ("c12", "c1"))
    yield _term(law, "23", sheared, ("m2", "m12"), ("c12", "c2"))


def _shear_law(batch: ElementBatch, structure: Structure, law: _Law) -> Iterator[ShellTerm]:
    alike = law.has & (batch.roles["S11"] == batch.roles["S22"])
    coupled = law.has & ~(alike & (nominal(batch, structure, "S12") == 0.0))
    yield _term(law, "11", alike, ("s1", "s2"))
    yield _term(law, "11", law.has & ~alike, ("s1",))
    yield _term(law, "22", law.has & ~alike, ("s2",))
    yield _term(law, "12", coupled, ("s1",), ("s2",))


def _softened(term: ShellTerm, residual: NDArray, soft: Flags) -> list[ShellTerm]:
    """A term of shear, with residual bending flexibility where there is bending."""
    at, rest = term.at[soft[term.at]], term.at[~soft[term.at]]
    roles = tuple(dict.fromkeys((*term.roles, *SOFTENERS)))
    facts = {"residual": residual[at]}
    series = replace(term, at=at, roles=roles, coefficient=softened_shear(term.roles[0]), facts=facts)
    return [series, replace(term, at=rest)]


def _shared_zero(batch: ElementBatch, structure: Structure, a: str, b: str) -> Flags:
    """True where two entries are one value and it is zero: the mark of a law without coupling to shear."""
    return np.asarray((batch.roles[a] == batch.roles[b]) & (nominal(batch, structure, a) == 0.0))


def _term(law: _Law, entry: str, has: Flags, left: Names, right: Names = ()) -> ShellTerm:
    roles = (f"{law.law}{entry}", *law.factors)
    unique = tuple(dict.fromkeys(roles))
    return ShellTerm(f"{law.label}-{entry}", np.flatnonzero(has), unique, product(*roles), left, right, law.loss)


def _in_plane_bending(batch: ElementBatch, structure: Structure, count: int) -> Iterator[ShellTerm]:
    """Uniaxial rows with the modulus of their direction; with the full entry where a law cannot be inverted."""
    has, isotropic = batch.facts["has_membrane"], batch.facts["isotropic"]
    stiff = nominal(batch, structure, "M11") != 0.0
    names = tuple(f"a{i + 1}" for i in range(count))
    if not count:
        return
    at = np.flatnonzero(has & isotropic & stiff)
    yield ShellTerm("in-plane-bending", at, ("M11", "M12", "t"), isotropic_modulus, names)
    other, regular = has & ~isotropic, _invertible(batch, structure)
    for i, name in enumerate(names):
        for mask, coefficient in ((other & regular, directional_modulus), (other & ~regular, constrained_modulus)):
            label = f"in-plane-bending-{i + 1}"
            yield ShellTerm(label, np.flatnonzero(mask), (*ENTRIES, "t"), coefficient, (name,), direction=i + 1)


ENTRIES = ("M11", "M12", "M13", "M22", "M23", "M33")


def _invertible(batch: ElementBatch, structure: Structure) -> Flags:
    a, b, c, d, e, f = (nominal(batch, structure, name) for name in ENTRIES)
    determinant = a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d)
    return np.asarray(determinant > SINGULAR * np.abs(a * d * f))


def isotropic_modulus(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
    """E·t from the plane-stress law: M11 − M12²/M11."""
    return (values["M11"] - values["M12"] * values["M12"] / values["M11"]) * values["t"]


def directional_modulus(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
    """t times the uniaxial modulus along (cos, sin) in material axes, 1/(aᵀM⁻¹a) with a = (c², s², cs)."""
    a, b, c, d, e, f = (values[name] for name in ENTRIES)
    cofactors = (d * f - e * e, c * e - b * f, b * e - c * d, a * f - c * c, b * c - a * e, a * d - b * b)
    determinant = a * cofactors[0] + b * cofactors[1] + c * cofactors[2]
    return determinant / _quadratic(cofactors, facts, 1.0) * values["t"]


def constrained_modulus(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
    """t times the modulus for strain along (cos, sin) and none across, aᵀMa with a = (c², s², 2cs)."""
    return _quadratic(tuple(values[name] for name in ENTRIES), facts, 2.0) * values["t"]


def _quadratic(entries: tuple[Jet, ...], facts: Mapping[str, NDArray], shear: float) -> Jet:
    """aᵀXa of a symmetric X given by its six entries, a = (c², s², shear·cs)."""
    x, y, z = facts["cos"] ** 2, facts["sin"] ** 2, shear * facts["cos"] * facts["sin"]
    weights = (x * x, 2.0 * x * y, 2.0 * x * z, y * y, 2.0 * y * z, z * z)
    total = entries[0] * weights[0]
    for entry, weight in zip(entries[1:], weights[1:]):
        total = total + entry * weight
    return total


def _offset_terms(term: ShellTerm, offset: Flags) -> list[ShellTerm]:
    """The terms in z0 and z0² that go with a membrane term."""
    at = term.at[offset[term.at]]
    left, right = (tuple(name + OFFSET for name in names) for names in (term.left, term.right))
    crossed = (term.left, left) if not right else ((*term.left, *term.right), (*right, *left))
    return [
        _times_offset(term, at, f"{term.label}-offset", crossed, 1),
        _times_offset(term, at, f"{term.label}-offset²", (left, right), 2),
    ]


def _lifted_coupling(term: ShellTerm, offset: Flags) -> ShellTerm:
    """The term in z0 that goes with one of membrane and bending together."""
    left = tuple(name + OFFSET for name in term.left)
    return _times_offset(term, term.at[offset[term.at]], f"{term.label}-offset", (left, term.right), 1)


def _times_offset(
    term: ShellTerm, at: NDArray[np.int64], label: str, rows: tuple[Names, Names], power: int
) -> ShellTerm:
    def coefficient(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        return term.coefficient(values, facts) * values["z0"] ** power

    roles = (*term.roles, "z0")
    return ShellTerm(label, at, roles, coefficient, *rows, loss=term.loss, direction=term.direction)
