"""A model of matrices that another solver wrote: nodes without elements, and sums of matrices with coefficients."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Flags
from femtune.errors import FemtuneError, Notice, Where
from femtune.fem import AssembledMatrix, FieldRef, NodeTable, Structure, ValueTableBuilder
from femtune.fem.contribution import Coefficient
from femtune.fem.fields import MatrixKind
from femtune.fem.values import TableJet
from femtune.model.imported.polynomial import MatrixSet, Polynomial, Variable, fit_polynomial
from femtune.model.terms import CompiledTerms, MatrixTerm
from femtune.parameters import jet
from femtune.parameters.jet import Jet

# ----------------------------------------------------------------------------------------------------
# Which DOFs imported matrices have entries for: signs of a file that was cut, or of another run.


_ROUNDING = 1e-9
"""Entries in the row of a zero diagonal that are rounding, relative to the largest diagonal."""
_SHOWN = 6
"""DOFs that a message names."""


def touched(upper: sp.csr_array, least: float = 0.0) -> Flags:
    """(n,) whether a DOF has an entry above `least`, in its row or column."""
    coo = sp.coo_array(upper)
    some = np.abs(coo.data) > least
    seen = np.zeros(upper.shape[0], bool)
    seen[coo.row[some]] = seen[coo.col[some]] = True
    return seen


def check_occupied(nodes: NodeTable, assembled: Sequence[AssembledMatrix]) -> list[Notice]:
    """Stiffness and mass lie on the same DOFs, and no row has entries but no diagonal.

    Raises
    ------
    FemtuneError : ``matrices.disjoint``, ``matrices.no-diagonal``
    """
    stiffness, mass = (_of_kind(nodes, assembled, kind) for kind in ("stiffness", "mass"))
    if not (stiffness & mass).any():
        raise FemtuneError(
            "matrices.disjoint", values={"stiffness at": _names(nodes, stiffness), "mass at": _names(nodes, mass)}
        )
    return [*_loose(nodes, mass & ~stiffness), *_massless(nodes, stiffness & ~mass)]


def _massless(nodes: NodeTable, flags: Flags) -> list[Notice]:
    """Translations only: a lumped mass has no rotations."""
    at = np.arange(len(flags))
    bare = flags & (at < 6 * len(nodes.ids)) & (at % 6 < 3)
    if not bare.any():
        return []
    facts: dict[str, Any] = {"count": int(bare.sum()), "dofs": _names(nodes, bare)}
    return [Notice("matrices.stiffness-without-mass", level="info", **facts)]


def _loose(nodes: NodeTable, loose: Flags) -> list[Notice]:
    if not loose.any():
        return []
    return [Notice("matrices.mass-without-stiffness", count=int(loose.sum()), dofs=_names(nodes, loose))]


def _of_kind(nodes: NodeTable, assembled: Sequence[AssembledMatrix], kind: MatrixKind) -> Flags:
    """DOFs with entries of a kind; each has a diagonal, since x·K x < 0 for some x otherwise."""
    mine = [m.upper for m in assembled if m.kind == kind]
    diagonals = np.max([np.abs(m.diagonal()) for m in mine], axis=0)
    least = _ROUNDING * diagonals.max(initial=0.0)
    bare = np.any([touched(m, least) for m in mine], axis=0) & (diagonals == 0.0)
    if bare.any():
        raise FemtuneError("matrices.no-diagonal", values={"DOFs": _names(nodes, bare)}, count=bare.sum(), kind=kind)
    return np.asarray(np.any([touched(m) for m in mine], axis=0))


def _names(nodes: NodeTable, flags: Flags) -> str:
    at = np.flatnonzero(flags)
    return ", ".join(str(nodes.describe(int(i)))[:-1] for i in at[:_SHOWN]) + (" …" if at.size > _SHOWN else "")


_LARGEST = 1e100
"""Entries above this are no stiffness or mass in any units, and their products overflow."""
MATRIX = "MATRIX"
"""Card of the factor of a matrix: ``MATRIX FRAME``."""
VARIABLE = "VARIABLE"
"""Card of the value of a variable: ``VARIABLE T``."""


@dataclass(frozen=True, eq=False)
class ImportedMatrix:
    """One matrix of a model, or the sets of one that depends on variables.

    Parameters
    ----------
    name : of its factor
    kind : "stiffness", "mass", "viscous" or "hysteretic"
    sets : the matrix at points of the variables, on the g-set; one set without a point is a constant matrix
    where : place in the study
    """

    name: str
    kind: MatrixKind
    sets: tuple[MatrixSet, ...]
    where: Where = field(default_factory=Where)


@dataclass(frozen=True, eq=False)
class ImportedStructure:
    """A structure of assembled matrices, and what was found."""

    structure: Structure
    notices: tuple[Notice, ...]


def field_of_matrix(name: str) -> FieldRef:
    """The factor of a matrix: 1 as it was imported."""
    return FieldRef(MATRIX, 0, name)


def field_of_variable(name: str) -> FieldRef:
    """The value of a variable."""
    return FieldRef(VARIABLE, 0, name)


def imported_structure(
    nodes: NodeTable,
    listed: NDArray[np.int64],
    matrices: Sequence[ImportedMatrix],
    variables: Sequence[Variable] = (),
    *,
    held: NDArray[np.int64] | None = None,
    hold_singular: bool = False,
    tolerance: float = 1e-4,
) -> ImportedStructure:
    """A structure without elements.

    Parameters
    ----------
    nodes : grid and scalar points
    listed : g-set DOFs that the matrices have; the others do not move
    matrices : on the g-set
    variables : what sets of matrices depend on
    held : g-set DOFs that the file marks as held
    hold_singular : hold what has no stiffness, as AUTOSPC does
    tolerance : largest error of a polynomial at a set that it was not made of, over the change between the sets

    Raises
    ------
    FemtuneError : ``matrices.sets``, ``matrices.not-polynomial``, ``matrices.no-mass``, ``matrices.no-stiffness``,
        ``matrices.disjoint``, ``matrices.no-diagonal``, ``matrices.unused-variable``, ``matrices.huge``
    """
    _check_used(matrices, variables)
    values = ValueTableBuilder()
    for variable in variables:
        values.add(field_of_variable(variable.name), variable.nominal)
    assembled: list[AssembledMatrix] = []
    notices: list[Notice] = []
    for matrix in matrices:
        _check_magnitude(matrix)
        factor = values.add(field_of_matrix(matrix.name), 1.0)
        terms, remarks = _assembled(matrix, factor, variables, values, tolerance)
        assembled += terms
        notices += remarks
    check_kinds(assembled)
    notices += check_occupied(nodes, assembled)
    empty = _empty(assembled, listed)
    still = np.setdiff1d(np.arange(nodes.n_dofs), listed)
    permanent = np.unique(np.concatenate([still, empty, np.zeros(0, np.int64) if held is None else held]))
    structure = Structure(
        nodes, values.table(), (), permanent=permanent, hold_singular=hold_singular, assembled=tuple(assembled)
    )
    return ImportedStructure(structure, (*notices, *_of_empty(nodes, empty)))


def _check_used(matrices: Sequence[ImportedMatrix], variables: Sequence[Variable]) -> None:
    """Every variable moves some matrix (error ``matrices.unused-variable``)."""
    used = {name for matrix in matrices for part in matrix.sets for name in part.at}
    for variable in variables:
        if variable.name not in used:
            raise FemtuneError(
                "matrices.unused-variable",
                values={"variables of the matrices": ", ".join(sorted(used)) or "none"},
                variable_name=variable.name,
            )


def _check_magnitude(matrix: ImportedMatrix) -> None:
    """Entries times the factor of the study must stay numbers (error ``matrices.huge``)."""
    for part in matrix.sets:
        data = part.upper.data
        if not (np.abs(data) <= _LARGEST).all():
            raise FemtuneError(
                "matrices.huge",
                where=matrix.where if str(matrix.where) else part.where,
                values={"largest": np.abs(data).max()},
                matrix_name=matrix.name,
                largest=_LARGEST,
            )


def check_kinds(assembled: Sequence[AssembledMatrix]) -> None:
    """A model has stiffness and mass (errors ``matrices.no-stiffness``, ``matrices.no-mass``)."""
    _check_kind(assembled, "stiffness", "matrices.no-stiffness", "matrices.no-stiffness/zero")
    _check_kind(assembled, "mass", "matrices.no-mass", "matrices.no-mass/zero")


def _check_kind(assembled: Sequence[AssembledMatrix], kind: MatrixKind, code: str, zero: str) -> None:
    mine = [m for m in assembled if m.kind == kind]
    if not any(m.upper.count_nonzero() for m in mine):
        raise FemtuneError(zero if mine else code)


def _empty(assembled: Sequence[AssembledMatrix], listed: NDArray[np.int64]) -> NDArray[np.int64]:
    """Listed DOFs that no matrix of any kind has an entry for: held ones whose rows were wiped."""
    n = assembled[0].upper.shape[0]
    seen = np.zeros(n, bool)
    for matrix in assembled:
        if matrix.kind in ("stiffness", "mass"):
            seen |= touched(matrix.upper)
    return listed[~seen[listed]]


def _of_empty(nodes: NodeTable, empty: NDArray[np.int64]) -> list[Notice]:
    if not empty.size:
        return []
    shown = ", ".join(str(nodes.describe(int(i)))[:-1] for i in empty[:_SHOWN]) + (" …" if empty.size > _SHOWN else "")
    return [Notice("matrices.empty-rows", level="info", n_empty=empty.size, dofs=shown)]


def _assembled(
    matrix: ImportedMatrix, factor: int, variables: Sequence[Variable], values: ValueTableBuilder, tolerance: float
) -> tuple[list[AssembledMatrix], list[Notice]]:
    if len(matrix.sets) == 1 and not matrix.sets[0].at:
        return _parts(matrix, matrix.sets[0].upper, {"FACTOR": factor}, factor_of_matrix), []
    polynomial = fit_polynomial(matrix.name, matrix.sets, variables, tolerance, matrix.where)
    return polynomial_terms(matrix, polynomial, factor, values), [polynomial.notice(matrix.where)]


def polynomial_terms(
    matrix: ImportedMatrix, polynomial: Polynomial, factor: int, values: ValueTableBuilder
) -> list[AssembledMatrix]:
    """The coefficient matrices of a polynomial and the monomials that multiply them; `factor` is that of the matrix."""
    places = {v.name: values.add(field_of_variable(v.name), v.nominal) for v in polynomial.variables}
    terms: list[AssembledMatrix] = []
    for powers, upper in polynomial.terms:
        roles = {"FACTOR": factor, **{name: at for (name, at), power in zip(places.items(), powers) if power}}
        terms += _parts(matrix, upper, roles, _monomial(polynomial, powers))
    return terms


def _parts(
    matrix: ImportedMatrix, upper: sp.csr_array, roles: Mapping[str, int], coefficient: Coefficient
) -> list[AssembledMatrix]:
    """A complex stiffness is K + iH."""
    label = f"{matrix.kind} {matrix.name}"
    if not np.iscomplexobj(upper):
        return [AssembledMatrix(matrix.kind, label, upper, roles, coefficient)]
    if matrix.kind != "stiffness" and upper.imag.count_nonzero():
        raise FemtuneError("matrices.complex", where=matrix.where, matrix_kind=matrix.kind, matrix_name=matrix.name)
    imaginary = sp.csr_array(upper.imag)
    imaginary.eliminate_zeros()
    real = AssembledMatrix(matrix.kind, label, sp.csr_array(upper.real), roles, coefficient)
    loss = AssembledMatrix("hysteretic", label, imaginary, roles, coefficient)
    return [real, loss] if imaginary.nnz else [real]


def factor_of_matrix(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
    """The coefficient of a constant matrix."""
    return values["FACTOR"]


@dataclass(frozen=True, eq=False)
class _Monomial:
    """factor · Π ξ^power of the scaled variables; a class, so that other processes can load it.

    Parameters
    ----------
    factors : of each variable its name, its power, and the centre and half width by which it is scaled
    """

    factors: tuple[tuple[str, int, float, float], ...]

    def __call__(self, values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        out = values["FACTOR"]
        for name, power, centre, half in self.factors:
            for _ in range(power):
                out = out * ((values[name] - centre) * (1.0 / half))
        return out


def _monomial(polynomial: Polynomial, powers: tuple[int, ...]) -> Coefficient:
    scaled = zip(polynomial.variables, powers, polynomial.scales)
    return _Monomial(tuple((v.name, power, float(centre), float(half)) for v, power, (centre, half) in scaled))


# ----------------------------------------------------------------------------------------------------
# Terms of assembled matrices: one coefficient each, as sparse matrices on the g-set.


def with_assembled(compiled: CompiledTerms, structure: Structure, touched: set[int]) -> CompiledTerms:
    """The terms of the elements with one term for each assembled matrix.

    `touched` are positions of the value table that parameters move, dependents included.
    """
    if not structure.assembled:
        return compiled
    used = {kind: flags.copy() for kind, flags in compiled.used.items()}
    for matrix in structure.assembled:
        used[matrix.kind][list(matrix.roles.values())] = True
    terms = [_term(matrix, structure, matrix.depends_on(touched)) for matrix in structure.assembled]
    return CompiledTerms((*compiled.terms, *terms), used)


def _term(matrix: AssembledMatrix, structure: Structure, moves: bool) -> MatrixTerm:
    coefficient = matrix.coefficient
    if coefficient is None or not moves:
        scale = factor_at(matrix, structure.values.values)
        return MatrixTerm(matrix.kind, matrix.label, 1, None, sp.csr_array(scale * matrix.upper))

    def moving_one(table: TableJet) -> Jet:
        return coefficient({name: table[np.array([i])] for name, i in matrix.roles.items()}, {})

    return MatrixTerm(matrix.kind, matrix.label, 1, moving_one, matrix.upper)


def factor_at(matrix: AssembledMatrix, table: NDArray) -> float | complex:
    """Coefficient of an assembled matrix at a value table (n,)."""
    if matrix.coefficient is None:
        return 1.0
    values = {name: jet.constant(table[[i]], 0) for name, i in matrix.roles.items()}
    coefficient: float | complex = matrix.coefficient(values, {}).value[0].item()
    return coefficient
