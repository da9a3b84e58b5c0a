"""Strain rows of a solid and their coefficients.

An isotropic solid has at most four: λ for the traces, μ for all the rest, λ' = 2λμ/(λ + 2μ) for the traces of plane
stress, E for uniaxial stress. All are functions of C12 = λ and C44 = μ, so that elements of one material share them.
Any other law has 21 entries for the strains along the material's axes. If stresses are assumed in a frame of the
element, the coefficients are the entries of the law in that frame after elimination of the zero stresses.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Flags, Reals
from femtune.fem.contribution import Coefficient, product
from femtune.fem.elements.placement import nominal
from femtune.fem.elements.solids.strains import KEPT, Rows, StrainGroup
from femtune.fem.structure import ElementBatch, Structure
from femtune.parameters import jet
from femtune.parameters.jet import Jet

# ----------------------------------------------------------------------------------------------------
# Coefficients of solids as exact functions of the entries of their law, and the turning of strains.
#
# Entries are in the order xx, yy, zz, xy, yz, zx with engineering shears; stress = C strain.


Values = Mapping[str, Jet]
Facts = Mapping[str, NDArray]

ENTRIES = tuple(f"C{i}{j}" for i in range(1, 7) for j in range(i, 7))
"""Roles of the 21 entries, the upper triangle row by row."""

_SHEARS = ((0, 1), (1, 2), (2, 0))


def plane_lame(values: Values, facts: Facts) -> Jet:
    """λ' = 2λμ/(λ + 2μ): in plane stress the stress is λ' tr ε + 2μ ε."""
    lam, mu = values["C12"], values["C44"]
    return 2.0 * lam * mu / (lam + 2.0 * mu)


def young(values: Values, facts: Facts) -> Jet:
    """E = μ(3λ + 2μ)/(λ + μ)."""
    lam, mu = values["C12"], values["C44"]
    return mu * (3.0 * lam + 2.0 * mu) / (lam + mu)


def condensed(kept: Sequence[int], a: int, b: int, eliminate: bool) -> Coefficient:
    """Entry (a, b) of the law between the `kept` stresses and strains along the axes of the fact "frame".

    The other stresses are zero if `eliminate` is true, otherwise the other strains. "frame" is (m, 9): the rows of the
    matrix whose columns are the axes, seen from the material's.

    With z the free strains and C t_a in equilibrium with them, zᵀC t_a = 0, the entry is t_aᵀC t_b. As t moves
    along z only, its derivatives are t_aᵀC_p t_b and t_aᵀC_pq t_b − r_apᵀS r_bq − r_aqᵀS r_bp, r_ap = zᵀC_p t_a,
    S = (zᵀC z)⁻¹.
    """
    free = [k for k in range(6) if k not in kept] if eliminate else []
    ends = [kept[a], kept[b]]

    def entry(values: Values, facts: Facts) -> Jet:
        strains = turn_strain(np.swapaxes(facts["frame"].reshape(-1, 3, 3), 1, 2))
        law = _symmetric(jet.stack([values[name] for name in ENTRIES]))
        z, t = strains[:, :, free], strains[:, :, ends]
        inner = np.swapaxes(z, 1, 2) @ law.value
        t = t - z @ np.linalg.solve(inner @ z, inner @ t)
        moved = np.einsum("mijp,mje->mepi", law.grad, t)
        grad = np.einsum("mi,mpi->mp", t[:, :, 0], moved[:, 1])
        r = moved[:, :, : law.n_curved] @ z[:, None]
        bent = np.swapaxes(r[:, 0] @ np.linalg.solve(inner @ z, np.swapaxes(r[:, 1], 1, 2)), 1, 2)
        hess = np.einsum("mi,mijpq,mj->mpq", t[:, :, 0], law.hess, t[:, :, 1], optimize=True)
        value = np.einsum("mi,mij,mj->m", t[:, :, 0], law.value, t[:, :, 1])
        return Jet(value, grad, hess - bent - np.swapaxes(bent, 1, 2))

    return entry


_PLACE = np.zeros((6, 6), np.int64)
_PLACE[np.triu_indices(6)] = np.arange(21)
_PLACE = np.maximum(_PLACE, _PLACE.T)


def _symmetric(entries: Jet) -> Jet:
    """(m, 6, 6) law from its entries (21, m)."""
    return Jet(*(np.moveaxis(part[_PLACE], 2, 0) for part in (entries.value, entries.grad, entries.hess)))


def turn_strain(axes: Reals) -> Reals:
    """(m, 6, 6) from strains along some axes to those along `axes` (m, 3, 3), columns seen from the former."""
    out = np.empty((len(axes), 6, 6))
    for row, (a, b) in enumerate(((0, 0), (1, 1), (2, 2), *_SHEARS)):
        x, y, factor = axes[:, :, a], axes[:, :, b], 1.0 if a == b else 2.0
        out[:, row, :3] = factor * x * y
        for k, (i, j) in enumerate(_SHEARS):
            out[:, row, 3 + k] = 0.5 * factor * (x[:, i] * y[:, j] + x[:, j] * y[:, i])
    return out


LEAST_SCALED_EIGENVALUE = 1e-9
"""Eigenvalue of a law, its diagonal scaled to one, up to which stresses are not eliminated; seven digits are left."""
LEAST_EIGENVALUE_RATIO = 1e-12
"""Ratio of the smallest to the largest eigenvalue of the unscaled law up to which stresses are not eliminated.

On axes rotated from the material's, a soft shear modulus is added to stiff entries, whose rounding errors of 1e-16
leave it fewer than four digits.
"""
COSINE_DIGITS = 12
"""Digits to which direction cosines in coefficients are rounded, so that elements equal but for rounding share one."""

PAIRS = tuple(combinations_with_replacement(range(6), 2))


@dataclass(frozen=True)
class SolidTerm:
    """A stiffness of some elements: LᵀL of the rows `left`, or LᵀR + RᵀL if there is a `right`.

    `group` is the number of the group of strains whose frame enters the coefficient, or None.
    """

    label: str
    at: NDArray[np.int64]
    roles: tuple[str, ...]
    coefficient: Coefficient
    left: str
    right: str = ""
    group: int | None = None
    facts: dict[str, NDArray] = field(default_factory=dict)


def stiffness_terms(batch: ElementBatch, structure: Structure, laws: Sequence[str]) -> list[SolidTerm]:
    """All stiffness terms of a batch of solids with the `laws` of their strain groups, if some element has them."""
    terms = [*_isotropic_terms(batch, structure, laws), *_entries(batch, structure, laws)]
    terms += _assumed_stresses(batch, structure, laws)
    return [term for term in terms if len(term.at)]


def _isotropic_terms(batch: ElementBatch, structure: Structure, laws: Sequence[str]) -> Iterator[SolidTerm]:
    isotropic = batch.facts["isotropic"]
    at, both = np.flatnonzero(isotropic), ("C12", "C44")
    lam, mu = (nominal(batch, structure, role) for role in both)
    yield SolidTerm("lambda", at, ("C12",), product("C12"), "trace")
    yield SolidTerm("shear", at, ("C44",), product("C44"), "shear")
    if "plane" in laws:
        yield SolidTerm("plane-stress", np.flatnonzero(isotropic & (lam + 2.0 * mu != 0.0)), both, plane_lame, "plane")
    if "uniaxial" in laws:
        yield SolidTerm("uniaxial", np.flatnonzero(isotropic & (lam + mu != 0.0)), both, young, "uniaxial")


def _entries(batch: ElementBatch, structure: Structure, laws: Sequence[str]) -> Iterator[SolidTerm]:
    """Terms of the 21 entries of a law that is not isotropic, except entries known to be zero."""
    other = ~batch.facts["isotropic"]
    if "full" not in laws or not other.any():
        return
    for role, (i, j) in zip(ENTRIES, PAIRS):
        at = np.flatnonzero(other & ~_shared_zero(batch, structure, role))
        yield SolidTerm(f"law-{role[1:]}", at, (role,), product(role), f"full-{i}", "" if i == j else f"full-{j}")


def _shared_zero(batch: ElementBatch, structure: Structure, role: str) -> Flags:
    """True if an entry is zero and shares its value with other entries, as in a law that cannot have this entry."""
    entry = batch.roles[role]
    shared = sum((batch.roles[other] == entry).astype(int) for other in ENTRIES)
    return np.asarray((shared > 1) & (nominal(batch, structure, role) == 0.0))


def _assumed_stresses(batch: ElementBatch, structure: Structure, laws: Sequence[str]) -> Iterator[SolidTerm]:
    """The law in the frame of each group; without strain in the other directions if it cannot be inverted."""
    other = ~batch.facts["isotropic"]
    if not other.any():
        return
    regular = _invertible(batch, structure, other)
    for g, law in enumerate(laws):
        if law == "full":
            continue
        for a, b in combinations_with_replacement(range(len(KEPT[law])), 2):
            right = "" if a == b else f"{g}-{b}"
            for mask, eliminate in ((other & regular, True), (other & ~regular, False)):
                coefficient, at = condensed(KEPT[law], a, b, eliminate), np.flatnonzero(mask)
                facts = {"frame": np.empty((len(at), 9))}
                yield SolidTerm(f"{law}-{g}-{a + 1}{b + 1}", at, ENTRIES, coefficient, f"{g}-{a}", right, g, facts)


def _invertible(batch: ElementBatch, structure: Structure, some: Flags) -> Flags:
    """(e,) True if the deck's law is positive definite on any axes; only `some` elements are tested."""
    out, law = np.zeros(len(batch), bool), nominal_law(batch, structure, some)
    size = np.sqrt(np.einsum("eii->ei", law))
    scale = np.where(size > 0.0, size, 1.0)
    scaled = np.linalg.eigvalsh(law / (scale[:, :, None] * scale[:, None, :]))
    plain = np.linalg.eigvalsh(law)
    out[some] = (scaled[:, 0] > LEAST_SCALED_EIGENVALUE) & (plain[:, 0] > LEAST_EIGENVALUE_RATIO * plain[:, -1])
    return out


def nominal_law(batch: ElementBatch, structure: Structure, part: slice | Flags) -> Reals:
    """(m, 6, 6) laws of a part of a batch at the deck's values."""
    first = batch.roles["C11"][part]
    out = np.empty((len(first), 6, 6))
    for role, (i, j) in zip(ENTRIES, PAIRS):
        out[:, i, j] = out[:, j, i] = structure.values.values[batch.roles[role][part]]
    return out


def nominal_poisson(batch: ElementBatch, structure: Structure, part: slice) -> Reals:
    """(m,) Poisson's ratio of the deck's law; of its isotropic mean (Voigt's) if it is not isotropic."""
    law = nominal_law(batch, structure, part)
    bulk = law[:, :3, :3].sum(axis=(1, 2)) / 9.0
    deviatoric = 1.5 * np.einsum("eii->e", law[:, :3, :3]) - 4.5 * bulk
    mu = (deviatoric + 3.0 * np.einsum("eii->e", law[:, 3:, 3:])) / 15.0
    whole = 2.0 * (3.0 * bulk + mu)
    return np.asarray((3.0 * bulk - 2.0 * mu) / np.where(whole == 0.0, 1.0, whole))


def law_rows(laws: Sequence[str], groups: Sequence[StrainGroup], isotropic: Flags, material: Reals) -> Rows:
    """Rows (m, r, 3n) by name: "trace", "shear", "plane", "uniaxial", and "full-i", "g-i" of other laws."""
    out: Rows = {}
    if isotropic.any():
        out |= _isotropic_rows(laws, groups)
    if not isotropic.all():
        full = [turn_strain(material)[:, None] @ _flat(g.rows) for law, g in zip(laws, groups) if law == "full"]
        out |= {f"full-{i}": np.concatenate([rows[:, :, i] for rows in full], axis=1) for i in range(6 if full else 0)}
        for g, (law, group) in enumerate(zip(laws, groups)):
            out |= {f"{g}-{i}": _flat(group.rows)[:, :, i] for i in range(len(KEPT[law]) if law != "full" else 0)}
    return out


def _isotropic_rows(laws: Sequence[str], groups: Sequence[StrainGroup]) -> Rows:
    parts: dict[str, list[Reals]] = {"trace": [], "shear": [], "plane": [], "uniaxial": []}
    for law, group in zip(laws, groups):
        rows = _flat(group.rows)
        if law == "uniaxial":
            parts["uniaxial"].append(rows[:, :, 0])
            continue
        normal = {"full": 3, "plane": 2, "transverse": 0}[law]
        parts["shear"] += [np.sqrt(2.0) * rows[:, :, i] for i in range(normal)]
        parts["shear"] += [rows[:, :, i] for i in range(normal, rows.shape[2])]
        if normal:
            parts["trace" if law == "full" else "plane"].append(rows[:, :, :normal].sum(axis=2))
    return {name: np.concatenate(rows, axis=1) for name, rows in parts.items() if rows}


def _flat(rows: Reals) -> Reals:
    return rows.reshape(*rows.shape[:3], -1)


def place_frame(term: SolidTerm, groups: Sequence[StrainGroup], some: NDArray, material: Reals, place: slice) -> None:
    """Put the axes of a term's group, as seen from the material's axes, among its facts."""
    frame = None if term.group is None else groups[term.group].frame
    if frame is not None:
        turned = np.swapaxes(material[some], 1, 2) @ frame[some]
        term.facts["frame"][place] = np.round(turned, COSINE_DIGITS).reshape(-1, 9)
