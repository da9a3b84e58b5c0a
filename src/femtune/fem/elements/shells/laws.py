"""Strain rows of a shell and their coefficients: membrane M·t, bending B·t³·RI, both together C·t², shear S·t·TS.

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
from femtune.fem.elements.shells.residual import MEAN_TO_VARYING, SOFTENERS, ResidualFlexibility, bends, softened_shear
from femtune.fem.elements.shells.strains import OFFSET
from femtune.fem.structure import ElementBatch, Structure
from femtune.parameters.jet import Jet

Names = tuple[str, ...]

LEAST_DETERMINANT = 1e-9
"""Determinant of a membrane law, relative to the product of its diagonal, up to which it is not inverted.

Above it the uniaxial modulus keeps seven digits; laws of real materials are far above.
"""


@dataclass(frozen=True)
class ShellTerm:
    """A stiffness of some elements: LᵀL of the rows `left`, or LᵀR + RᵀL if there is a `right`.

    `direction` is the number of the uniaxial row whose angle to the material's x axis enters the coefficient, else 0;
    `point` is the only integration point that is used, None for all. `weights` (m, 2) are factors of the first and of
    the second half of the right rows, None if they are one.
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
    weights: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class _Law:
    """The entries of a law of a batch: letter of its roles and rows, other factors, and the elements that have it."""

    law: str
    rows: str
    label: str
    factors: Names
    loss: str
    has: Flags


def stiffness_terms(
    batch: ElementBatch, structure: Structure, uniaxial: int, residual: ResidualFlexibility | None = None
) -> list[ShellTerm]:
    """All stiffness terms of a batch of shells; those that no element has are left out.

    `residual` has the sizes of the shear's residual bending flexibility, None without one.
    """
    membrane = _Law("M", "m", "membrane", ("t",), "GE", batch.facts["has_membrane"])
    bending = _Law("B", "b", "bending", ("t", "t", "t", "RI"), "GEB", batch.facts["has_bending"])
    shear = _Law("S", "s", "shear", ("t", "TS"), "GES", batch.facts["has_bending"])
    offset = batch.facts["offset_given"]
    flat = [
        *_plane_law(batch, structure, membrane),
        *_uniaxial(batch, structure, membrane, "in-plane-bending", "a", uniaxial),
    ]
    lifted = [lifted for term in flat for lifted in _offset_terms(term, offset)]
    both = list(_coupling_law(batch, structure, _Law("C", "", "coupling", ("t", "t"), "GEC", couples(batch))))
    lifted += [_lifted_coupling(term, offset) for term in both]
    bent = [
        *_plane_law(batch, structure, bending),
        *_uniaxial(batch, structure, bending, "varying-bending", "k", uniaxial),
    ]
    sheared = list(_shear_law(batch, structure, shear))
    if residual is not None:
        soft, varying = bends(batch, structure), residual.times(1.0 / MEAN_TO_VARYING)
        rest = [replace(_with_rows(t, "v"), label=f"varying-{t.label}") for t in sheared] if uniaxial else []
        sheared = [part for term in sheared for part in _softened(term, residual, soft, "n")]
        sheared += [part for term in rest for part in _softened(term, varying, soft, "w")]
    terms = [*flat, *both, *lifted, *bent, *sheared]
    return [term for term in terms if len(term.at)]


def _plane_law(batch: ElementBatch, structure: Structure, law: _Law) -> Iterator[ShellTerm]:
    """Terms of the entries 11 to 33; equal moduli make one term, and entries known to be zero make none."""
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
    """(e,) True if membrane and bending are coupled by a law."""
    return np.asarray(batch.facts.get("has_coupling", np.zeros(len(batch), bool)))


def _coupling_law(batch: ElementBatch, structure: Structure, law: _Law) -> Iterator[ShellTerm]:
    """Terms of the entries 11 to 33: strain i with curvature j, and strain j with curvature i."""
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


def _softened(term: ShellTerm, residual: ResidualFlexibility, soft: Flags, less: str) -> Iterator[ShellTerm]:
    """A term of shear, with residual bending flexibility if there is bending.

    With the factors φ1 and φ2 of an element in its wide and its narrow direction, the law is φ1 S + (φ2 − φ1) (nᵀS n) n
    nᵀ: S itself for φ1 = φ2 = 1, and positive definite for φ1 ≤ φ2. `less` is the letter of the rows in the direction
    n: the narrow one for mean shear, the wide one for varying shear, which alternates across the narrow direction.
    """
    yield replace(term, at=term.at[~soft[term.at]])
    roles = tuple(dict.fromkeys((*term.roles, *SOFTENERS)))
    term = replace(term, at=term.at[soft[term.at]], roles=roles, coefficient=softened_shear(term.roles[0]))
    along = _with_rows(term, less)
    left, right = term.left + along.left, (term.right or term.left) + (along.right or along.left)
    for k, (sizes, wide, other) in enumerate(zip(residual.sizes.T, residual.wide.T, residual.narrow.T)):
        alike, label = (wide == 1.0) & (other == 1.0), f"{term.label}-{k + 1}" if k else term.label
        at = term.at[alike[term.at]]
        yield replace(term, label=label, at=at, facts={"residual": sizes[at]})
        at = term.at[(~alike & (wide + other > 0.0))[term.at]]
        weights, facts = np.stack([wide, other - wide], axis=1)[at], {"residual": sizes[at]}
        if not term.right:
            weights *= 0.5
        yield replace(term, label=label, at=at, facts=facts, left=left, right=right, weights=weights)


def _with_rows(term: ShellTerm, letter: str) -> ShellTerm:
    """The term with other rows, which differ in their first letter."""
    left, right = (tuple(letter + name[1:] for name in names) for names in (term.left, term.right))
    return replace(term, left=left, right=right)


def _shared_zero(batch: ElementBatch, structure: Structure, a: str, b: str) -> Flags:
    """True if two entries are the same value and it is zero, as in a law without coupling to shear."""
    return np.asarray((batch.roles[a] == batch.roles[b]) & (nominal(batch, structure, a) == 0.0))


def _term(law: _Law, entry: str, has: Flags, left: Names, right: Names = ()) -> ShellTerm:
    roles = (f"{law.law}{entry}", *law.factors)
    unique = tuple(dict.fromkeys(roles))
    return ShellTerm(f"{law.label}-{entry}", np.flatnonzero(has), unique, product(*roles), left, right, law.loss)


def _uniaxial(
    batch: ElementBatch, structure: Structure, law: _Law, label: str, rows: str, count: int
) -> Iterator[ShellTerm]:
    """Uniaxial rows with the modulus of their direction, or with the full entry if a law cannot be inverted."""
    entries = tuple(f"{law.law}{entry}" for entry in ENTRIES)
    stiff, isotropic = nominal(batch, structure, entries[0]) != 0.0, _isotropic(batch, structure, law)
    regular, names = _invertible(batch, structure, entries), tuple(f"{rows}{i + 1}" for i in range(count))
    at, both = np.flatnonzero(law.has & isotropic & stiff), entries[:2]
    if count:
        coefficient = _times(law.factors, isotropic_modulus(*both))
        yield ShellTerm(label, at, _roles(law, both), coefficient, names, loss=law.loss)
    for mask, modulus in ((regular, directional_modulus(entries)), (~regular, constrained_modulus(entries))):
        at, coefficient = np.flatnonzero(law.has & ~isotropic & mask), _times(law.factors, modulus)
        for i, name in enumerate(names):
            numbered, roles = f"{label}-{i + 1}", _roles(law, entries)
            yield ShellTerm(numbered, at, roles, coefficient, (name,), loss=law.loss, direction=i + 1)


ENTRIES = ("11", "12", "13", "22", "23", "33")


def _isotropic(batch: ElementBatch, structure: Structure, law: _Law) -> Flags:
    """True if the two moduli of a law are the same value and it has no coupling to shear."""
    alike = batch.roles[f"{law.law}11"] == batch.roles[f"{law.law}22"]
    return np.asarray(alike & _shared_zero(batch, structure, f"{law.law}13", f"{law.law}23"))


def _roles(law: _Law, entries: Names) -> Names:
    return tuple(dict.fromkeys((*entries, *law.factors)))


def _times(factors: Names, modulus: Coefficient) -> Coefficient:
    def stiffness(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        out = modulus(values, facts)
        for name in factors:
            out = out * values[name]
        return out

    return stiffness


def _invertible(batch: ElementBatch, structure: Structure, entries: Names) -> Flags:
    a, b, c, d, e, f = (nominal(batch, structure, name) for name in entries)
    determinant = a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d)
    return np.asarray(determinant > LEAST_DETERMINANT * np.abs(a * d * f))


def isotropic_modulus(a: str, b: str) -> Coefficient:
    """E from the entries 11 and 12 of the plane-stress law: a − b²/a."""

    def modulus(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        return values[a] - values[b] * values[b] / values[a]

    return modulus


def directional_modulus(entries: Names) -> Coefficient:
    """The uniaxial modulus along (cos, sin) in material axes, 1/(aᵀM⁻¹a) with a = (c², s², cs)."""

    def modulus(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        a, b, c, d, e, f = (values[name] for name in entries)
        cofactors = (d * f - e * e, c * e - b * f, b * e - c * d, a * f - c * c, b * c - a * e, a * d - b * b)
        determinant = a * cofactors[0] + b * cofactors[1] + c * cofactors[2]
        return determinant / _quadratic(cofactors, facts, 1.0)

    return modulus


def constrained_modulus(entries: Names) -> Coefficient:
    """The modulus for strain along (cos, sin) without transverse strain, aᵀMa with a = (c², s², 2cs)."""

    def modulus(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        return _quadratic(tuple(values[name] for name in entries), facts, 2.0)

    return modulus


def _quadratic(entries: tuple[Jet, ...], facts: Mapping[str, NDArray], shear: float) -> Jet:
    """aᵀXa of a symmetric X given by its six entries, a = (c², s², shear·cs)."""
    x, y, z = facts["cos"] ** 2, facts["sin"] ** 2, shear * facts["cos"] * facts["sin"]
    weights = (x * x, 2.0 * x * y, 2.0 * x * z, y * y, 2.0 * y * z, z * z)
    total = entries[0] * weights[0]
    for entry, weight in zip(entries[1:], weights[1:]):
        total = total + entry * weight
    return total


def _offset_terms(term: ShellTerm, offset: Flags) -> list[ShellTerm]:
    """The terms in z0 and z0² that belong to a membrane term."""
    at = term.at[offset[term.at]]
    left, right = (tuple(name + OFFSET for name in names) for names in (term.left, term.right))
    crossed = (term.left, left) if not right else ((*term.left, *term.right), (*right, *left))
    return [
        _times_offset(term, at, f"{term.label}-offset", crossed, 1),
        _times_offset(term, at, f"{term.label}-offset²", (left, right), 2),
    ]


def _lifted_coupling(term: ShellTerm, offset: Flags) -> ShellTerm:
    """The term in z0 that belongs to a term of membrane-bending coupling."""
    left = tuple(name + OFFSET for name in term.left)
    return _times_offset(term, term.at[offset[term.at]], f"{term.label}-offset", (left, term.right), 1)


def _times_offset(
    term: ShellTerm, at: NDArray[np.int64], label: str, rows: tuple[Names, Names], power: int
) -> ShellTerm:
    def coefficient(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        return term.coefficient(values, facts) * values["z0"] ** power

    roles = (*term.roles, "z0")
    return ShellTerm(label, at, roles, coefficient, *rows, loss=term.loss, direction=term.direction)
