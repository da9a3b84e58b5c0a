"""Noise of a recorded force: all responses share its error, so that many channels do not average it.

With the measured force U + ν the functions of a whole record leave N − H ν: noise of each response, and a part that
follows the functions, largest at the resonances, with the same ν in all of them. A fit that knows N alone gives these
lines too much weight and too small errors. ν is eliminated line by line, which leaves the noise I + s² a aᴴ of the
responses together, a = H/σ.

Source: R. Pintelon, J. Schoukens (2012), System Identification: A Frequency Domain Approach, 2nd edition, chapters 9
and 12 (errors in variables).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve, qr, solve_triangular
from scipy.optimize import minimize_scalar
from scipy.special import chdtri

from femtune.arrays import Complexes, Reals
from femtune.identification.modal_fit import ModalFit
from femtune.identification.modal_solve import OUT_OF_BAND, OutsideTerms, PartialFractions, modal_basis, real_rows
from femtune.identification.whole_record import WholeRecord

CHANCE = 1e-4
"""The force is noisy where chance would explain what the responses share with a smaller probability."""
MOST_UNKNOWNS = 2500
"""Numbers of all functions up to which the poles are fitted again; with more, only their errors are raised."""
MOST_NUMBERS = 20_000_000
"""Slopes of all functions with the poles up to which all lines are used, 320 MB; else errors are from some lines."""
MOST_STEPS = 8
"""Steps of this fit at most."""
SMALL = 0.02
"""Steps of all poles below this part of their errors end it."""
_LEAST_PART = 0.01
"""Part of the noise of a line that is that of the force, below which the line is taken to have none."""
_TURNS = 20
"""Turns in which noise of the force and of the responses are found from each other."""


@dataclass(frozen=True, eq=False)
class _ErrorsOfFit:
    """Of the poles, and of the coordinates z of Q in the functions over the noise of each.

    Parameters
    ----------
    poles : (2m, 2m) covariance of Re λ of every mode, then Im λ
    own : (n, q, q) covariance of the z of a function for given poles
    moved : (n, q, 2m) change of the z with the poles
    """

    poles: Reals
    own: Reals
    moved: Reals


@dataclass(frozen=True, eq=False)
class LinesOfRecord:
    """The lines of a record at given poles, all for noise of size 1 at a mean line.

    Parameters
    ----------
    Q : (k, q) complex, the columns of every function made orthogonal in their real rows
    back : (q, q) coefficients of the columns by those of Q
    across, shadow : (k, 2, p, m), (q, 2, p, m) the slopes outside of Q and inside
    coefficients : (n, q) of the columns
    left : (n, k) what the fit leaves
    loaded : (n, k) the functions
    free : (k,) part of the noise of a line that the fit leaves
    """

    Q: Complexes
    back: Reals
    across: Complexes
    shadow: Reals
    coefficients: Reals
    left: Complexes
    loaded: Complexes
    free: Reals


def with_force_noise(fit: ModalFit, whole: WholeRecord, terms: OutsideTerms = OUT_OF_BAND) -> ModalFit:
    """The fit of a whole record with the noise of its force, where there is any; else as it is.

    Poles, residues and their covariances are those of the likelihood with the noise of the force. With many functions
    or lines only the covariances contain it; poles and residues are those of the given fit.
    """
    n, _, k = whole.frfs.values.shape
    most = MOST_NUMBERS // (2 * n * len(fit.poles))
    # part of the lines has that part of the information
    thin = k > most
    now = lines_at(fit.poles, whole.thinned(most) if thin else whole, terms)
    noise = noise_of(now)
    if noise is None:
        return fit
    variance, force = noise
    if thin or now.coefficients.size > MOST_UNKNOWNS:
        errors = _raised(now, variance, force)
        errors = replace(errors, poles=errors.poles * len(now.free) / k, own=errors.own * len(now.free) / k)
        return _with_errors(fit, now, variance, errors)
    poles, errors, now = _refitted(fit.poles, now, variance, force, whole, terms)
    m = len(poles)
    basis = modal_basis(whole.frfs.freq_hz, poles, whole.frfs.kind, terms)
    inside = whole.of_functions(now.coefficients, m, len(terms))
    values = inside @ basis.columns.T
    fit = replace(
        fit,
        poles=poles,
        residues=(inside[:, :m] + 1j * inside[:, m : 2 * m])[:, None],
        terms=inside[:, None, 2 * m :],
        synthesised=replace(fit.synthesised, values=values.reshape(-1, 1, k)),
        ends=now.coefficients @ whole.basis(poles, terms).columns.T - values,
    )
    return _with_errors(fit, now, variance, errors)


def lines_at(poles: Complexes, whole: WholeRecord, terms: OutsideTerms, given: Reals | None = None) -> LinesOfRecord:
    """With the coefficients of least squares, or those that are given."""
    freq, line, m = whole.frfs.freq_hz, whole.line / np.sqrt(np.mean(whole.line**2)), len(poles)
    inside = modal_basis(freq, poles, whole.frfs.kind, terms)
    basis = whole.basis(poles, terms)
    weighted = PartialFractions(basis.columns * line[:, None], basis.by_decay * line[:, None], m)
    scale = np.linalg.norm(weighted.columns, axis=0)
    rows, R = qr(real_rows(weighted.columns / scale), mode="economic", check_finite=False)
    slopes, values = real_rows(weighted.slopes), whole.frfs.values[:, 0] * line
    shadow = rows.T @ slopes
    back = solve_triangular(R, np.eye(len(R))) / scale[:, None]
    coefficients = (back @ (rows.T @ real_rows(values.T))).T if given is None else given
    k, q = weighted.columns.shape
    Q = rows[:k] + 1j * rows[k:]
    across = slopes - rows @ shadow
    modal = whole.of_functions(coefficients, m, len(terms))
    return LinesOfRecord(
        Q, back, (across[:k] + 1j * across[k:]).reshape(k, 2, -1, m), shadow.reshape(q, 2, -1, m), coefficients,
        values - coefficients @ weighted.columns.T, (modal @ inside.columns.T) * line / np.abs(whole.force),
        np.clip(1.0 - 0.5 * np.sum(np.abs(Q) ** 2, axis=1), 0.05, 1.0),
    )  # fmt: skip


def noise_of(now: LinesOfRecord) -> tuple[Reals, float] | None:
    """(n,) variances of one real part of the responses and that of the force, of most likelihood; None without any."""
    size, loaded, free = np.abs(now.left) ** 2, np.abs(now.loaded) ** 2, 2.0 * now.free
    variance = start = np.maximum(size.sum(axis=1) / free.sum(), np.finfo(float).tiny)
    force = 0.0
    for _ in range(_TURNS):
        before, g = force, np.sum(loaded / variance[:, None], axis=0)
        least = -np.log(np.median(g)) - 12.0
        found = minimize_scalar(
            lambda log, v=variance: _deviance(now, v, float(np.exp(log))),
            bounds=(least, least + 24.0),
            method="bounded",
        )
        force = float(np.exp(found.x))
        times = 1.0 + force * loaded / variance[:, None]
        variance = np.sum(size / times**2, axis=1) / np.sum(free / times, axis=1)
        if abs(force - before) < 1e-3 * force:
            break
    gain = _deviance(now, start, 0.0) - _deviance(now, variance, force)
    return (variance, force) if gain > float(chdtri(1, CHANCE)) else None


def _deviance(now: LinesOfRecord, variance: Reals, force: float) -> float:
    """−2 log likelihood, but for a constant; lines count as far as the fit leaves them free."""
    white = now.left / np.sqrt(variance)[:, None]
    loaded = now.loaded / np.sqrt(variance)[:, None]
    g = np.sum(np.abs(loaded) ** 2, axis=0)
    shared = np.abs(np.sum(loaded.conj() * white, axis=0)) ** 2 * force / (1.0 + force * g)
    levels = np.log1p(force * g) + np.sum(np.log(variance))
    return float(np.sum(np.abs(white) ** 2) - shared.sum() + np.sum(2.0 * now.free * levels))


def _slopes(now: LinesOfRecord, variance: Reals) -> Complexes:
    """(n, k, 2m) of the functions with the poles, outside of their columns, for noise of size 1."""
    m = now.across.shape[3]
    c = now.coefficients[:, : now.across.shape[2] * m].reshape(len(now.coefficients), -1, m)
    every = np.einsum("kapr,fpr->fkar", now.across, c, optimize=True)
    return np.asarray(every.reshape(len(c), len(now.Q), 2 * m) / np.sqrt(variance)[:, None, None])


def slopes_of_function(now: LinesOfRecord, f: int, variance: Reals) -> Complexes:
    """(k, 2m) of one function with the poles, outside of the columns, for noise of size 1."""
    _, _, p, m = now.across.shape
    one = np.einsum("kapr,pr->kar", now.across, now.coefficients[f, : p * m].reshape(p, m))
    return np.asarray(one.reshape(len(one), 2 * m) / np.sqrt(variance[f]))


def _refitted(
    poles: Complexes,
    now: LinesOfRecord,
    variance: Reals,
    force: float,
    whole: WholeRecord,
    terms: OutsideTerms,
) -> tuple[Complexes, _ErrorsOfFit, LinesOfRecord]:
    """Poles, their errors and coefficients of most likelihood; those before, if the steps do not end."""
    begin, lines, m = poles, now, len(poles)
    for _ in range(MOST_STEPS):
        step = _step(lines, variance, force)
        poles = poles + step.poles[:m] + 1j * step.poles[m:]
        if not ((poles.real < 0.0).all() and (poles.imag > 0.0).all() and np.isfinite(poles).all()):
            break
        lines = lines_at(poles, whole, terms, lines.coefficients + step.coefficients)
        if (np.abs(step.poles) < SMALL * np.sqrt(np.diag(step.covariance))).all():
            return poles, step.errors(), lines
    return begin, _raised(now, variance, force), now


@dataclass(frozen=True, eq=False)
class _GaussNewtonStep:
    """A Gauss-Newton step.

    Parameters
    ----------
    poles, coefficients : (2m,), (n, q) changes
    covariance : (2m, 2m) of the poles
    factor : of the normal matrix of all z for given poles
    moved : (n, q, 2m) change of the z with the poles, in which the noise of the force ties the functions together
    """

    poles: Reals
    coefficients: Reals
    covariance: Reals
    factor: tuple[Reals, bool]
    moved: Reals

    def errors(self) -> _ErrorsOfFit:
        n, q, _ = self.moved.shape
        every = cho_solve(self.factor, np.eye(n * q), check_finite=False).reshape(n, q, n, q)
        return _ErrorsOfFit(self.covariance, np.einsum("fpfq->fpq", every), self.moved)


def _step(now: LinesOfRecord, variance: Reals, force: float) -> _GaussNewtonStep:
    slopes, (n, q) = _slopes(now, variance), now.coefficients.shape
    white, loaded = (values / np.sqrt(variance)[:, None] for values in (now.left, now.loaded))
    g = np.sum(np.abs(loaded) ** 2, axis=0)
    kept = np.flatnonzero(force * g > _LEAST_PART)
    root = np.sqrt(force / (1.0 + force * g[kept]))
    to_poles = np.einsum("fk,fka->ka", loaded[:, kept].conj(), slopes[:, kept])
    to_columns = loaded[:, kept].conj().T[:, :, None] * now.Q[kept, None, :]
    shared = real_rows(np.hstack([to_poles, to_columns.reshape(len(kept), n * q)]) * root[:, None])
    common = real_rows(np.sum(loaded[:, kept].conj() * white[:, kept], axis=0) * root)
    a = slopes.shape[2]
    normal = -(shared.T @ shared)
    normal[:a, :a] += np.einsum("fka,fkb->ab", slopes.conj(), slopes, optimize=True).real
    normal[np.arange(a, a + n * q), np.arange(a, a + n * q)] += 1.0
    gradient = -(shared.T @ common)
    gradient[:a] += np.einsum("fka,fk->a", slopes.conj(), white).real
    gradient[a:] += (white @ now.Q.conj()).real.ravel()
    factor = cho_factor(normal[a:, a:], lower=True, check_finite=False)
    across = cho_solve(factor, np.column_stack([normal[a:, :a], gradient[a:]]))
    covariance = np.linalg.pinv(normal[:a, :a] - normal[:a, a:] @ across[:, :a], hermitian=True)
    step = covariance @ (gradient[:a] - normal[:a, a:] @ across[:, a])
    coordinates = (across[:, a] - across[:, :a] @ step).reshape(n, q) * np.sqrt(variance)[:, None]
    change = (coordinates - _moved(now, step)) @ now.back.T
    return _GaussNewtonStep(step, change, covariance, factor, -across[:, :a].reshape(n, q, a))


def _moved(now: LinesOfRecord, step: Reals) -> Reals:
    """(n, q) what a step of the poles does to the coordinates of Q."""
    _, _, p, m = now.shadow.shape
    c = now.coefficients[:, : p * m].reshape(-1, p, m)
    return np.asarray(np.einsum("qapr,ar,fpr->fq", now.shadow, step.reshape(2, m), c, optimize=True))


def _raised(now: LinesOfRecord, variance: Reals, force: float) -> _ErrorsOfFit:
    """Of poles and residues that were fitted as if the force had no noise."""
    slopes, a = _slopes(now, variance), now.loaded / np.sqrt(variance)[:, None]
    inverse = np.linalg.pinv(np.einsum("fka,fkb->ab", slopes.conj(), slopes, optimize=True).real, hermitian=True)
    shared = real_rows(np.einsum("fk,fka->ka", a.conj(), slopes) * np.sqrt(force)) @ inverse
    poles = inverse + shared.T @ shared
    back, q = np.linalg.pinv(poles, hermitian=True), now.Q.shape[1]
    own, moved = np.empty((len(a), q, q)), np.empty((len(a), q, len(poles)))
    for f, loaded in enumerate(a):
        # the same error of the force moves the poles and the z
        rows = real_rows(now.Q * loaded.conj()[:, None] * np.sqrt(force))
        both = rows.T @ shared
        moved[f] = both @ back
        own[f] = np.eye(q) + rows.T @ rows - moved[f] @ both.T
    return _ErrorsOfFit(poles, own, moved)


def _with_errors(fit: ModalFit, now: LinesOfRecord, variance: Reals, errors: _ErrorsOfFit) -> ModalFit:
    """With the covariances of poles and residues; that of a pole on which the functions disagree is larger."""
    factor = np.sqrt(np.tile(fit.spread, 2))
    q, _, p, m = now.shadow.shape
    half, level = now.back[: 2 * m], np.sqrt(variance)[:, None, None]
    own = np.einsum("farbr->frab", (level**2 * (half @ errors.own @ half.T)).reshape(-1, 2, m, 2, m))
    c = now.coefficients[:, : p * m].reshape(-1, p, m)
    by_poles = np.einsum("qapr,fpr->fqar", now.shadow, c, optimize=True).reshape(len(c), q, 2 * m)
    effect = (half @ (level * errors.moved - by_poles)).reshape(-1, 2, m, 2 * m)
    return replace(
        fit,
        pole_covariance=errors.poles * np.outer(factor, factor),
        own_covariance=np.ascontiguousarray(own)[:, None],
        pole_effect=np.ascontiguousarray(effect.transpose(0, 2, 1, 3))[:, None],
    )
