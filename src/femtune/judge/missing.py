"""What is missing in a model: a score test of properties that no parameter represents.

A fixed property with the column c = ∂r/∂q of the residuals r, q its relative change, is missing if the part of c that
the parameters cannot represent, c̃ = Pc with P = I − UUᵀ and U spanning the Jacobian, explains a part of Pr that noise
does not. To first order a change δ = −c̃ᵀr/c̃ᵀc̃ of the property lowers χ² by (c̃ᵀr)²/c̃ᵀc̃. Nothing is solved again:
the model stays where it is.

The standard deviations of the residuals need not be known. Each kind of residual has a scale of its own, which is
estimated beside δ (the variance of a kind is its sum of squares over its degrees of freedom), so that the square of
δ over its standard deviation has a distribution F(1, ν), with ν from the degrees of freedom of the kinds that
determine δ (Satterthwaite). The p value of a field is adjusted for the number of fields and for their collinearity:
the same statistics are computed of simulated noise, and the largest of all fields counts.

Sources: C. R. Rao, Large sample tests of statistical hypotheses concerning several parameters, Proc. Cambridge Phil.
Soc. 44, 1948 (score test); F. E. Satterthwaite, An approximate distribution of estimates of variance components,
Biometrics Bulletin 2, 1946; P. H. Westfall, S. S. Young, Resampling-Based Multiple Testing, 1993 (adjustment).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from femtune.arrays import Flags, Integers, Reals

PRIOR = "prior"
"""Kind of the rows of a prior, whose standard deviations are what they are: they are not estimated."""
INVISIBLE = 1e-4
"""|Pc|² relative to |c|² below which the parameters represent a field: the data cannot tell them apart."""
LOOKS_ALIKE = 0.95
"""|cos| of the columns Pc of two fields from which the data hardly tell them apart."""
DRAWS = 1_000
"""Draws of noise for the adjusted p values: the level of 1 % is then known to 0.3 %, that of 5 % to 0.7 %."""
SEED = 2026
"""Of these draws, so that a result can be repeated."""
_FEWEST_DEGREES = 3.0 - 1e-6
"""Degrees of freedom of a kind of residual below which its scale is not estimated: three, but for rounding."""
_NO_EFFECT = 1e-9
"""|c| relative to the largest below which a field has no effect but rounding."""
_DEPENDENT = 1e-10
"""Singular value of scaled columns relative to the largest, at or below which they are dependent."""
_ITERATIONS = 5
"""Of the scales of the kinds and of δ: enough for three digits of the p value."""
_AT_ONCE = 50_000
"""Numbers (draws × fields × kinds) that are computed together: arrays that stay in the cache of a processor."""


@dataclass(frozen=True, eq=False)
class ScoreTest:
    """The score test of m fields.

    Parameters
    ----------
    change : (m,) foretold relative change of each field; 0 for one that the data do not see
    sd : (m,) standard deviation of that change, by the estimated scales
    f : (m,) statistic, F(1, `degrees`) distributed if nothing is missing
    degrees : (m,) degrees of freedom of the denominator
    p_alone : (m,) p value of a field by itself
    p : (m,) p value adjusted for all fields
    within : (m,) part of `f` that is left if the change is limited to what is plausible of the field
    invisible : (m,) fields that the parameters represent, or without effect
    group : (m,) number of the group of fields that the data hardly tell apart, numbered from 0 in the order of `order`;
        −1 for invisible ones
    order : (v,) visible fields, that with the largest `within` first
    scales : by kind of residual, the standard deviation in units of the stated one
    """

    change: Reals
    sd: Reals
    f: Reals
    degrees: Reals
    p_alone: Reals
    p: Reals
    within: Reals
    invisible: Flags
    group: Integers
    order: Integers
    scales: dict[str, float]


def score_test(
    r: Reals,
    J: Reals,
    kinds: Sequence[str],
    columns: Reals,
    plausible: Reals,
    *,
    draws: int = DRAWS,
    seed: int = SEED,
) -> ScoreTest | None:
    """Test m fields at the end of an update.

    Parameters
    ----------
    r : (n,) residuals of independent values, each in units of its stated standard deviation, at the end of the update;
        rows of priors among them
    J : (n, k) their Jacobian by the parameters that are not at a bound; further columns span the directions in which r
        is zero whatever the noise, see `lost_directions`
    kinds : (n,) kind of each residual; `PRIOR` for rows whose scale is known
    columns : (n, m) ∂r/∂q of the fields, q the relative change of each
    plausible : (m,) largest relative change of each field that is plausible
    draws, seed : of the noise for the adjusted p values

    Returns
    -------
    None where no degrees of freedom are left for a test, or the parameters represent all fields

    Examples
    --------
    The second of two fields is missing, with a change of 0.1:

    >>> random = np.random.default_rng(0)
    >>> J, columns = random.normal(size=(40, 2)), 50.0 * random.normal(size=(40, 2))
    >>> r = random.normal(size=40) - 0.1 * columns[:, 1]
    >>> found = score_test(r, J, ["frequency"] * 40, columns, np.array([0.2, 0.2]))
    >>> int(found.order[0]), round(float(found.change[1]), 2), bool(found.p[1] < 0.01 < found.p[0])
    (1, 0.1, True)
    """
    names = tuple(dict.fromkeys(kinds))
    rows = np.array([[kind == name for kind in kinds] for name in names]).reshape(len(names), len(r))
    known = np.array([name == PRIOR for name in names])
    scales, P = _scales(r, J, rows, known)
    weighted = columns / (scales @ rows)[:, None]
    C = P @ weighted
    size, freedom = np.linalg.norm(weighted, axis=0), _degrees(P, rows)
    seen = np.linalg.norm(C, axis=0) ** 2 >= INVISIBLE * size**2
    seen &= size > _NO_EFFECT * size.max(initial=0.0)
    if freedom.sum() < _FEWEST_DEGREES or not seen.any():
        return None
    which = np.flatnonzero(seen)
    parts = _Parts(C[:, which], rows, freedom, known | (freedom < _FEWEST_DEGREES))
    change, sd, f, degrees = (values[0] for values in parts.statistics((P @ (r / (scales @ rows)))[:, None]))
    alone = fdtrc(1.0, degrees, f)
    largest = np.sort(_largest_of_noise(parts, P, draws, seed))
    adjusted = (1 + draws - np.searchsorted(largest, _normal_square(f, degrees))) / (draws + 1)
    bound = np.minimum(1.0, plausible[which] / np.maximum(np.abs(change), 1e-300))
    within = f * (2.0 * bound - bound**2)
    order = np.argsort(-within, kind="stable")

    def spread(values: Reals, other: float) -> Reals:
        out = np.full(columns.shape[1], other)
        out[which] = values
        return out

    return ScoreTest(
        spread(change, 0.0), spread(sd, np.inf), spread(f, 0.0), spread(degrees, np.nan), spread(alone, 1.0),
        spread(adjusted, 1.0), spread(within, 0.0), ~seen,
        spread(_groups(C[:, which], order), -1).astype(np.int64), which[order],
        {name: float(s) for name, s in zip(names, scales) if name != PRIOR},
    )  # fmt: skip


def lost_directions(jacobian: Reals, count: int) -> Reals:
    """(n, count) orthonormal directions in which a block of residuals is zero whatever the noise.

    Its Jacobian by all parameters and fields has no part in them. Where more directions have none, any of them serve:
    only the number of degrees of freedom depends on it.

    Parameters
    ----------
    jacobian : (n, k) of the block, by all parameters and fields
    count : how many combinations of its values are lost
    """
    size = np.linalg.norm(jacobian, axis=0)
    U, _, _ = np.linalg.svd(jacobian[:, size > 0.0] / size[size > 0.0])
    return np.asarray(U[:, len(jacobian) - count :])


def _scales(r: Reals, J: Reals, rows: Flags, known: Flags) -> tuple[Reals, Reals]:
    """(kinds,) scale of each kind by restricted maximum likelihood, and P of the residuals in these scales.

    s² = r⊥ᵀr⊥/tr P over the rows of a kind, until it settles. A kind with few degrees of freedom keeps its stated scale,
    or takes its root mean square if that is larger.
    """
    scales = np.ones(len(rows))
    P = _projector(J)
    for _ in range(_ITERATIONS):
        left, freedom = P @ (r / (scales @ rows)), _degrees(P, rows)
        square = np.array([float(left[mine] @ left[mine]) for mine in rows])
        enough = freedom >= _FEWEST_DEGREES
        own = scales * np.sqrt(square / np.where(enough, freedom, rows.sum(axis=1)))
        scales = np.where(known, 1.0, np.where(enough, own, np.maximum(1.0, own)))
        # residuals that are zero have no scale
        scales = np.where(scales > 0.0, scales, 1.0)
        P = _projector(J / (scales @ rows)[:, None])
    return scales, P


def _projector(J: Reals) -> Reals:
    """(n, n) P = I − UUᵀ with U spanning the columns."""
    size = np.linalg.norm(J, axis=0)
    scaled = J[:, size > 0.0] / size[size > 0.0]
    if not scaled.size:
        return np.eye(len(J))
    U, s, _ = np.linalg.svd(scaled, full_matrices=False)
    U = U[:, s > _DEPENDENT * s[0]]
    return np.asarray(np.eye(len(J)) - U @ U.T)


def _degrees(P: Reals, rows: Flags) -> Reals:
    """(kinds,) degrees of freedom of each kind: the trace of P over its rows."""
    return np.asarray(rows @ np.diag(P))


@dataclass(frozen=True, eq=False)
class _Parts:
    """The columns of m fields by kinds of residual.

    Parameters
    ----------
    C : (n, m) columns Pc
    rows : (kinds, n)
    freedom : (kinds,) degrees of freedom
    fixed : (kinds,) kinds whose scale is not estimated
    """

    C: Reals
    rows: Flags
    freedom: Reals
    fixed: Flags

    def statistics(self, left: Reals) -> tuple[Reals, ...]:
        """(d, m) each: change of every field, its standard deviation, F, and its degrees of freedom.

        Parameters
        ----------
        left : (n, d) d vectors Pr
        """
        a = np.array([left[mine].T @ self.C[mine] for mine in self.rows])
        b = np.array([np.sum(self.C[mine] ** 2, axis=0) for mine in self.rows])[:, None, :]
        q = np.array([np.sum(left[mine] ** 2, axis=0) for mine in self.rows])[:, :, None]
        freedom, fixed = self.freedom[:, None, None], self.fixed[:, None, None]
        share, change = np.zeros_like(a), np.zeros(a.shape[1:])
        for _ in range(_ITERATIONS):
            rest = np.maximum(q - 2.0 * change * a + change**2 * b, 1e-12 * q)
            spare = np.maximum(freedom - share, 0.5)
            weight = np.where(fixed, 1.0, spare / np.where(rest > 0.0, rest, 1.0))
            information = np.sum(weight * b, axis=0)
            change = np.sum(weight * a, axis=0) / information
            share = weight * b / information
        f = change**2 * information
        inverse = np.sum(np.where(fixed, 0.0, share**2 / spare), axis=0)
        degrees = 1.0 / np.maximum(inverse, 1e-9)
        # r + cδ is least at δ = −cᵀr/cᵀc
        return -change, 1.0 / np.sqrt(information), f, degrees


def _normal_square(f: Reals, degrees: Reals) -> Reals:
    """The square of a normal variable that is exceeded with nearly the same probability as F(1, ν).

    Source: D. L. Wallace, Bounds on normal approximations to Student's and the chi-square distributions, 1959.
    """
    return np.asarray(((8.0 * degrees + 1.0) / (8.0 * degrees + 3.0)) ** 2 * degrees * np.log1p(f / degrees))


def _largest_of_noise(parts: _Parts, P: Reals, draws: int, seed: int) -> Reals:
    """(draws,) the largest statistic of all fields in noise of unit variance, as `_normal_square`."""
    random = np.random.default_rng(seed)
    at_once = max(1, min(draws, _AT_ONCE // max(parts.C.shape[1] * len(parts.rows), len(P))))
    out = []
    for first in range(0, draws, at_once):
        left = P @ random.normal(size=(len(P), min(at_once, draws - first)))
        _, _, f, degrees = parts.statistics(left)
        out.append(_normal_square(f, degrees).max(axis=1))
    return np.concatenate(out)


def _groups(C: Reals, order: Integers) -> Reals:
    """(m,) number of the group of each field: the first of a group in the order, and all that look like it."""
    unit = C / np.linalg.norm(C, axis=0)
    group = np.full(C.shape[1], -1.0)
    count = 0
    for j in order:
        if group[j] < 0.0:
            alike = (np.abs(unit.T @ unit[:, j]) >= LOOKS_ALIKE) & (group < 0.0)
            group[alike] = count
            count += 1
    return group
