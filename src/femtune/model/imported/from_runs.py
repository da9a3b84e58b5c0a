"""A model of the runs of another solver: modal matrices of every run, and polynomials or surrogates of them.

With the shapes Φ(p) of m modes, of unit modal mass, in coordinates Ψ(p) of a basis B that spans the shapes of all runs,

    K(p) = Ψ⁻ᵀ Λ Ψ⁻¹,   M(p) = Ψ⁻ᵀ Ψ⁻¹,   u = B q

have exactly the eigenvalues and shapes of the run. They do not depend on the order, the signs, or the choice among
repeated modes, so that they are smooth in p where modes change places: nothing is tracked. Where the basis has more
vectors than modes, those that are no mode get eigenvalues above the modes. Without shapes K is the diagonal of ω².

Polynomials are fitted to the entries. Surrogates are fitted to principal components of the entries over the runs, or to
each ω² without shapes.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from femtune.arrays import Flags, Integers, Reals
from femtune.errors import FemtuneError
from femtune.fem import AssembledMatrix, NodeTable, Structure, ValueTableBuilder
from femtune.fem.constraints import follow_rows
from femtune.model.imported.coverage import RunsCoverage
from femtune.model.imported.fitted_matrices import FittedMatrices, SurrogateCoefficient, fit_matrices
from femtune.model.imported.model import (
    ImportedMatrix,
    factor_of_matrix,
    field_of_matrix,
    field_of_variable,
    polynomial_terms,
)
from femtune.model.imported.polynomial import Polynomial, Powers, Variable
from femtune.surrogates import SurrogateRules

_NEW_DIRECTION = 1e-4
"""Part of the shapes outside the modes of the central run, relative to their size, above which it is a further
direction of the basis: smaller parts are the rounding of listed shapes."""
_MOST_DIRECTIONS = 40
"""Further directions at most; each adds a row to every modal matrix."""
_EIGENVALUE_OF_NO_MODE = 4.0
"""Eigenvalues of directions that are no modes, relative to the largest one of the central run: twice its frequency."""
_LEAST_OVERLAP = 0.05
"""Least singular value of the modes of a run in those of the central one; below, the run has other modes."""
_RANK = 1e-9
"""Singular value relative to the largest below which the runs do not determine a coefficient."""
_UNSEEN = 1e-6
"""Size of a shape relative to the largest one of its run below which it is rounding: lists have six to seven digits."""
_ALIKE = 1e-6
"""Least singular value of the shapes of the central run, each of length one, that distinguishes them."""
_FULL_LEVERAGE = 1.0 - 1e-9
"""Leverage of a run from which on the others do not determine the polynomial without it."""
_RIGID = 1e-4
"""Frequency relative to the highest one of a run below which it is that of a rigid-body mode."""
_RAISED_TO = 1e-6
"""Frequency over the highest one of a run, below which it is raised to this where the rigid-body modes of the runs
differ."""


@dataclass(frozen=True, eq=False)
class Runs:
    """Runs that are used.

    Parameters
    ----------
    names : of the parameters
    points : (n, k)
    freq_hz : (n, m)
    shapes : (n, s, m) of unit modal mass at `dofs`, or None
    dofs : (s,) g-set DOFs of `nodes`
    """

    names: tuple[str, ...]
    points: Reals
    freq_hz: Reals
    shapes: Reals | None = None
    dofs: Integers | None = None

    def select(self, keep: Flags) -> Runs:
        """Some of the runs."""
        shapes = None if self.shapes is None else self.shapes[keep]
        return replace(self, points=self.points[keep], freq_hz=self.freq_hz[keep], shapes=shapes)

    @property
    def scales(self) -> tuple[Reals, Reals]:
        """Centre and half range of every parameter."""
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        return 0.5 * (low + high), 0.5 * (high - low)


@dataclass(frozen=True, eq=False)
class FittedRuns:
    """The model, and how well it meets its runs.

    Parameters
    ----------
    structure : with fields ``VARIABLE <name>``
    used : (n,) runs that are fitted
    error : (n_used, m) relative error of each frequency if its run is left out; NaN where that cannot be told
    coefficients : number of coefficients of a polynomial, or of surrogates
    nominal : (k,) the centre of the runs
    coverage : ranges of the runs that are fitted, with the surrogates
    """

    structure: Structure
    used: Flags
    error: Reals
    coefficients: int
    nominal: Reals
    coverage: RunsCoverage


def fit_runs(
    runs: Runs, nodes: NodeTable, degree: int, crossed: bool, centre: int | None = None,
    rules: SurrogateRules | None = None,
) -> FittedRuns:  # fmt: skip
    """Fit the model to runs; arguments and errors as of `fit_configurations`."""
    return fit_configurations([runs], nodes, degree, crossed, centre, rules)[0]


def fit_configurations(
    parts: Sequence[Runs], nodes: NodeTable, degree: int, crossed: bool, centre: int | None = None,
    rules: SurrogateRules | None = None,
) -> tuple[FittedRuns, ...]:  # fmt: skip
    """Fit one model to the runs of one or several configurations.

    Every configuration has coordinates of its own. With several of them, support set i of the structure, from 1, holds
    the coordinates of all but configuration i. All results have the same structure.

    Parameters
    ----------
    nodes : grid points of the shapes; without shapes, or beside them, its scalar points are those of the model
    degree : of the polynomials in each parameter, and of products in total; 0 for the model of the first run alone,
        which no parameter changes
    crossed : True with products of parameters
    centre : the run that the basis is taken from; None for the one nearest the middle
    rules : of surrogates, without logarithms; None for polynomials

    Raises
    ------
    FemtuneError : ``runs.one-value``, ``runs.too-few``, ``runs.not-determined``, ``runs.few-dofs/alike``,
        ``surrogate.*``
    """
    fits = [_fit(runs, degree, crossed, centre, rules) for runs in parts]
    structure = _structure(parts, nodes, fits, degree or 1)
    return tuple(
        FittedRuns(structure, f.used, f.error, f.coefficients, f.middle, _coverage(runs, f))
        for runs, f in zip(parts, fits, strict=True)
    )


def _coverage(runs: Runs, fit: _Fit) -> RunsCoverage:
    points = runs.points[fit.used]
    return RunsCoverage(runs.names, points.min(axis=0), points.max(axis=0), *fit.by_surrogates)


@dataclass(frozen=True, eq=False)
class _Fit:
    """Polynomials of one configuration: powers, and coefficients (p, r, r) of stiffness and mass; or surrogates.

    Parameters
    ----------
    coefficients : number of coefficients of a polynomial, or of surrogates
    by_surrogates : surrogates of stiffness and mass in place of the polynomials
    """

    basis: Reals | None
    stiffness: Reals
    mass: Reals
    powers: list[Powers]
    middle: Reals
    half: Reals
    used: Flags
    error: Reals
    coefficients: int
    by_surrogates: tuple[FittedMatrices, ...] = ()


def _fit(runs: Runs, degree: int, crossed: bool, centre: int | None, rules: SurrogateRules | None) -> _Fit:
    if centre is None:
        centre = _central(runs)
    runs = _rigid_exact(runs, centre)
    basis, modal, used = _modal(runs, centre)
    chosen = runs.select(used)
    modal = modal[:, used]
    middle, half = _scales(chosen)
    if rules is not None:
        return _by_surrogates(chosen, basis, modal, used, rules)
    powers = _powers(len(runs.names), degree, crossed)
    if not degree:
        # every parameter has its term, which is zero
        nothing = np.zeros((len(runs.names), *modal.shape[2:]))
        K, M = (np.concatenate([part[:1], nothing]) for part in modal)
        linear, unknown = _powers(len(runs.names), 1, False), np.full(runs.freq_hz.shape, np.nan)
        return _Fit(
            basis=basis,
            stiffness=K,
            mass=M,
            powers=linear,
            middle=middle,
            half=half,
            used=used,
            error=unknown,
            coefficients=1,
        )
    if len(chosen.points) < len(powers):
        raise FemtuneError(
            "runs.too-few", n_runs=len(chosen.points), n_coefficients=len(powers), degree=degree,
            products=" with products" if crossed else "",
        )  # fmt: skip
    V = np.prod(((chosen.points - middle) / half)[:, None, :] ** np.array(powers)[None], axis=2)
    singular = la.svdvals(V)
    if singular[-1] < _RANK * singular[0]:
        raise FemtuneError("runs.not-determined", n_runs=len(V), n_coefficients=len(powers))
    K, M = (np.einsum("pn,nij->pij", np.linalg.pinv(V), part) for part in modal)
    return _Fit(
        basis=basis,
        stiffness=K,
        mass=M,
        powers=powers,
        middle=middle,
        half=half,
        used=used,
        error=_left_out(V, modal, chosen.freq_hz),
        coefficients=len(powers),
    )


def _by_surrogates(chosen: Runs, basis: Reals | None, modal: Reals, used: Flags, rules: SurrogateRules) -> _Fit:
    """Surrogates of the modal matrices."""
    middle, half = _scales(chosen)
    K, M = (fit_matrices(chosen.names, chosen.points, part, rules, basis is None) for part in modal)
    error = np.full(chosen.freq_hz.shape, np.nan)
    for i, (one, other) in enumerate(zip(K.left_out, M.left_out)):
        error[i] = _errors(one, other, chosen.freq_hz[i])
    count = len(K.parts) + len(M.parts)
    return _Fit(
        basis=basis,
        stiffness=K.mean[None],
        mass=M.mean[None],
        powers=[],
        middle=middle,
        half=half,
        used=used,
        error=error,
        coefficients=count,
        by_surrogates=(K, M),
    )


def seen_modes(freq_hz: Reals, shapes: Reals, part: float = 1.0) -> tuple[Reals, Reals, int]:
    """Frequencies (n, m) and shapes (n, s, m) without modes that do not move at the DOFs, and how many these are.

    The torsion of a straight beam moves none of its nodes: what its shape is made of there is rounding. All runs keep
    the same number of modes, which at least a part of the runs has.

    Raises
    ------
    FemtuneError : ``runs.few-dofs/none``
    """
    if not shapes.size:
        return freq_hz, shapes, 0
    size = np.linalg.norm(shapes, axis=1)
    seen = size > _UNSEEN * size.max(axis=1, keepdims=True)
    counts = np.sort(seen.sum(axis=1))
    count = int(counts[int((1.0 - part) * len(counts) + 1e-9)])
    if not count:
        raise FemtuneError("runs.few-dofs/none")
    # those that are seen, in their order
    order = np.argsort(~seen, axis=1, kind="stable")[:, :count]
    hz = np.take_along_axis(freq_hz, order, axis=1)
    return hz, np.take_along_axis(shapes, order[:, None, :], axis=2), freq_hz.shape[1] - count


def _central(runs: Runs) -> int:
    """The run nearest the middle of the ranges."""
    middle, half = _scales(runs)
    return int(np.argmin((((runs.points - middle) / half) ** 2).sum(axis=1)))


def _scales(runs: Runs) -> tuple[Reals, Reals]:
    if not len(runs.points):
        raise FemtuneError("runs.too-few/none")
    middle, half = runs.scales
    if len(runs.points) == 1:
        return middle, np.ones_like(half)
    for name, width, at in zip(runs.names, half, middle):
        if not width > 1e-12 * abs(at):
            raise FemtuneError("runs.one-value", parameter=name, value=at)
    return middle, half


def _powers(count: int, degree: int, crossed: bool) -> list[Powers]:
    """Powers with a sum up to the degree, constant first; products only where they are wanted."""
    every = itertools.product(range(degree + 1), repeat=count)
    powers = [p for p in every if sum(p) <= degree and (crossed or sum(e > 0 for e in p) <= 1)]
    return sorted(powers, key=sum)


def _modal(runs: Runs, centre: int) -> tuple[Reals | None, Reals, Flags]:
    """Basis (s, r), (2, n, r, r) stiffness and mass of every run, and which runs have the modes of the central one."""
    values = (2.0 * np.pi * runs.freq_hz) ** 2
    n, m = values.shape
    if runs.shapes is None:
        K = np.zeros((n, m, m))
        K[:, np.arange(m), np.arange(m)] = values
        return None, np.stack([K, np.broadcast_to(np.eye(m), K.shape)]), np.ones(n, bool)
    phi = runs.shapes[centre]
    _check_told_apart(phi)
    A = np.linalg.pinv(phi) @ runs.shapes
    # stiffness in the directions of rigid-body modes is exactly zero
    rigid = int((values[centre] == 0.0).sum())
    A[:, rigid:, :rigid] = 0.0
    used = np.linalg.svd(A, compute_uv=False)[:, -1] > _LEAST_OVERLAP
    extra = _directions(phi, runs.shapes[used] - phi @ A[used])
    D = np.linalg.pinv(extra) @ (runs.shapes - phi @ A)
    D[:, :, :rigid] = 0.0
    r = m + extra.shape[1]
    inverse = np.tile(np.eye(r), (n, 1, 1))
    inverse[used, :m, :m] = np.linalg.inv(A[used])
    inverse[:, m:, :m] = -D @ inverse[:, :m, :m]
    above = np.full((n, r - m), _EIGENVALUE_OF_NO_MODE * values[centre].max())
    weights = np.concatenate([values, above], axis=1)
    M = np.einsum("nai,naj->nij", inverse, inverse)
    K = np.einsum("nai,na,naj->nij", inverse, weights, inverse)
    return np.hstack([phi, extra]), np.stack([K, M]), used


def _rigid_exact(runs: Runs, centre: int) -> Runs:
    """The runs with rigid-body modes that have no stiffness, in the space of those of the central run.

    The frequencies that a solver lists for them are rounding, and so is the part of elastic modes in their shapes. A
    difference of two neighbouring runs divides this rounding by their distance; away from the runs the free structure
    would have a stiffness against ground, or a negative one. The space of the rigid-body modes depends on the geometry
    alone. Where the runs have different numbers of such modes, or other spaces, their frequencies are only raised, so
    that eigenvalues of different rounding do not hide all others.
    """
    highest = runs.freq_hz.max(axis=1, keepdims=True)
    rigid = runs.freq_hz < _RIGID * highest
    count, hz, shapes = int(rigid[centre].sum()), np.where(rigid, 0.0, runs.freq_hz), runs.shapes
    raised = replace(runs, freq_hz=np.maximum(runs.freq_hz, _RAISED_TO * highest))
    if shapes is None:
        return replace(runs, freq_hz=hz) if (rigid == rigid[centre]).all() else raised
    if (rigid.sum(axis=1) != count).any():
        return raised
    # rigid-body modes first
    order = np.argsort(~rigid, axis=1, kind="stable")
    shapes = np.take_along_axis(shapes, order[:, None, :], axis=2)
    known, moving = shapes[centre, :, :count], shapes[:, :, :count]
    inside = known @ (np.linalg.pinv(known) @ moving)
    outside = np.linalg.norm(moving - inside, axis=1).max(initial=0.0)
    if outside > _NEW_DIRECTION * np.linalg.norm(known, axis=0).max(initial=0.0):
        return raised
    return replace(runs, freq_hz=np.take_along_axis(hz, order, axis=1), shapes=shapes)


def _check_told_apart(phi: Reals) -> None:
    """Refuse modes that look alike at the DOFs (error ``runs.few-dofs/alike``)."""
    unit = phi / np.linalg.norm(phi, axis=0)
    _, size, rows = la.svd(unit, full_matrices=False)
    if size[-1] < _ALIKE:
        modes = ", ".join(str(j + 1) for j in np.flatnonzero(np.abs(rows[-1]) > 0.1 * np.abs(rows[-1]).max()))
        raise FemtuneError("runs.few-dofs/alike", modes=modes)


def _directions(phi: Reals, rest: Reals) -> Reals:
    """(s, e) directions of shapes outside the modes of the central run, of the size of these."""
    s, m = phi.shape
    U, size, _ = la.svd(np.concatenate([np.zeros((s, 1)), *rest], axis=1), full_matrices=False)
    typical = float(np.sqrt((phi**2).sum() / m))
    count = min(int((size > _NEW_DIRECTION * typical).sum()), _MOST_DIRECTIONS, s - m)
    return np.asarray(typical * U[:, : max(count, 0)])


def _structure(parts: Sequence[Runs], nodes: NodeTable, fits: Sequence[_Fit], degree: int) -> Structure:
    basis = [fit.basis for fit in fits]
    sizes = [fit.stiffness.shape[1] for fit in fits]
    shaped = all(b is not None for b in basis)
    first = int(max([0, *nodes.ids, *nodes.scalar_points])) + 1 if shaped else 1
    nodes = replace(nodes, scalar_points=np.arange(first, first + sum(sizes)))
    scalars = 6 * len(nodes.ids) + np.arange(sum(sizes))
    own = np.split(scalars, np.cumsum(sizes)[:-1])
    values = ValueTableBuilder()
    nominal: dict[str, float] = {}
    places: dict[str, int] = {}
    for runs, fit in zip(parts, fits):
        for name, value in zip(runs.names, fit.middle):
            if name not in nominal:
                nominal[name] = float(value)
                places[name] = values.add(field_of_variable(name), float(value))
    assembled: list[AssembledMatrix] = []
    for i, (runs, fit, at) in enumerate(zip(parts, fits, own), start=1):
        variables = tuple(Variable(name, nominal[name], degree) for name in runs.names)
        scales = tuple((float(c), float(h)) for c, h in zip(fit.middle, fit.half))
        for j, (kind, coefficients) in enumerate((("stiffness", fit.stiffness), ("mass", fit.mass))):
            name = kind.upper() if len(parts) == 1 else f"{kind.upper()}{i}"
            factor = values.add(field_of_matrix(name), 1.0)
            if fit.by_surrogates:
                used = {own_name: places[own_name] for own_name in runs.names}
                assembled += _matrices_of_surrogates(kind, name, fit.by_surrogates[j], at, nodes.n_dofs, factor, used)
                continue
            some = [(p, c) for p, c in zip(fit.powers, coefficients) if c.any() or kind == "stiffness"]
            terms = tuple((p, _on_g_set(c, at, nodes.n_dofs)) for p, c in some)
            polynomial = Polynomial(name, variables, scales, terms, 0.0, 0)
            assembled += polynomial_terms(ImportedMatrix(name, kind, ()), polynomial, factor, values)  # type: ignore[arg-type]
    dofs = parts[0].dofs
    moving = np.zeros(0, np.int64) if not shaped or dofs is None else dofs
    permanent = np.setdiff1d(np.arange(6 * len(nodes.ids)), moving)
    sets = {i: np.setdiff1d(scalars, at) for i, at in enumerate(own, start=1)} if len(parts) > 1 else {}
    structure = Structure(
        nodes, values.table(), (), permanent=permanent, hold_singular=False, assembled=tuple(assembled),
        support_sets=sets,
    )  # fmt: skip
    if not shaped:
        return structure
    shapes = np.hstack([b for b in basis if b is not None])
    return replace(structure, rigid=follow_rows(moving, np.tile(scalars, (len(moving), 1)), shapes, 0))


def _matrices_of_surrogates(
    kind: str, name: str, fitted: FittedMatrices, at: Integers, size: int, factor: int, places: dict[str, int]
) -> Iterator[AssembledMatrix]:
    """The mean of the modal matrices, and the parts that surrogates multiply."""
    label, roles = f"{kind} {name}", {"FACTOR": factor}
    yield AssembledMatrix(kind, label, _on_g_set(fitted.mean, at, size), roles, factor_of_matrix)  # type: ignore[arg-type]
    for j, matrix in enumerate(fitted.parts):
        assert fitted.surrogate is not None
        moving = SurrogateCoefficient(fitted.surrogate, j)
        upper = _on_g_set(matrix, at, size)
        yield AssembledMatrix(kind, label, upper, {**roles, **places}, moving)  # type: ignore[arg-type]


def _on_g_set(matrix: Reals, at: Integers, size: int) -> sp.csr_array:
    row, col = np.triu_indices(len(at))
    out = sp.csr_array((matrix[row, col], (at[row], at[col])), shape=(size, size))
    out.eliminate_zeros()
    return out


def _left_out(V: Reals, modal: Reals, freq_hz: Reals) -> Reals:
    """(n, m) relative errors of the frequencies of each run, predicted from the others."""
    hat = V @ np.linalg.pinv(V)
    leverage = np.diag(hat)
    fitted = np.einsum("ij,mjab->miab", hat, modal)
    error = np.full(freq_hz.shape, np.nan)
    for i in np.flatnonzero(leverage < _FULL_LEVERAGE):
        K, M = modal[:, i] - (modal[:, i] - fitted[:, i]) / (1.0 - leverage[i])
        error[i] = _errors(K, M, freq_hz[i])
    return error


def _errors(K: Reals, M: Reals, freq_hz: Reals) -> Reals:
    """(m,) relative errors of the frequencies of two matrices; infinite where M is not positive definite."""
    try:
        values = la.eigvalsh(K, M)[: len(freq_hz)]
    except la.LinAlgError:
        return np.full(len(freq_hz), np.inf)
    hz = np.sqrt(np.maximum(values, 0.0)) / (2.0 * np.pi)
    known = np.sort(freq_hz)
    return np.asarray((hz - known) / np.maximum(known, 1e-3 * known.max()))
