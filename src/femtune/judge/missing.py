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

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtrc

from femtune.arrays import Flags, Integers, Reals
from femtune.judge.scales import FEWEST_DEGREES, scales
from femtune.judge.whitened import PRIOR, Whitened

INVISIBLE = 1e-4
"""|Pc|² relative to |c|² below which the parameters represent a field: the data cannot tell them apart."""
LOOKS_ALIKE = 0.95
"""|cos| of the columns Pc of two fields from which the data hardly tell them apart."""
DRAWS = 1_000
"""Draws of noise for the adjusted p values: a level of 1 % is then known to 0.3 %, one of 5 % to 0.7 %."""
SEED = 2026
"""Of these draws, so that a result can be repeated."""
LEAST_SIZE = 0.01
"""Errors relative to the stated standard deviations below which residuals say nothing of the model. They are then the
digits of the data, or of the iterations, which no noise resembles: a value that is compared to three digits is written
with five or six. Nobody acts on a field that explains a hundredth of a standard deviation."""
MOST_OF_ONE = 0.5
"""Part of the decrease of χ² by a refit from which it is said to be that of one mode."""
SAYS_NOTHING = 0.05
"""p value of a field in the test without that mode from which the other modes do not ask for the field."""
_FEWEST_MODES = 3
"""Modes that are compared: of two, one has more than half of the decrease anyway."""
_ROUNDING = 1e-6
"""Of degrees of freedom."""
_NO_EFFECT = 1e-9
"""|c| relative to the largest below which a field has no effect but rounding."""
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
    gain : (m,) twice the gain of log likelihood by the change: the sum over the kinds of ν ln(q/q'), q and q' their
        sums of squares without and with it
    within : (m,) the same, the change limited to the usual range of the field
    invisible : (m,) fields that the parameters represent, or without effect
    group : (m,) number of the group of fields that the data hardly tell apart, numbered from 0 in the order of `order`;
        −1 for invisible ones
    order : (v,) visible fields, that with the largest `within` first
    """

    change: Reals
    sd: Reals
    f: Reals
    degrees: Reals
    p_alone: Reals
    p: Reals
    gain: Reals
    within: Reals
    invisible: Flags
    group: Integers
    order: Integers


def score_test(
    record: Whitened, columns: Reals, plausible: Reals, *, draws: int = DRAWS, seed: int = SEED
) -> ScoreTest | None:
    """Test m fields at the end of an update.

    Parameters
    ----------
    record : the residuals at the end of the update, and their Jacobian by the parameters that are not at a bound
    columns : (n, m) ∂r/∂q of the fields, in the rows of the record, q the relative change of each
    plausible : (m, 2) usual range of each field: largest relative decrease and increase
    draws, seed : of the noise for the adjusted p values

    Returns
    -------
    None where too few degrees of freedom are left for a test, or the parameters represent all fields

    Examples
    --------
    The second of two fields is missing, with a change of 0.1:

    >>> random, n = np.random.default_rng(0), 40
    >>> J, columns = random.normal(size=(n, 2)), 50.0 * random.normal(size=(n, 2))
    >>> r = random.normal(size=n) - 0.1 * columns[:, 1]
    >>> labels = [("frequency",) * n, *[("",) * n] * 3]
    >>> rows = Whitened(r, J, ("k", "m"), np.zeros((n, 0)), *labels, ("data",) * n, np.ones(n), np.zeros((n, 0)))
    >>> found = score_test(rows, columns, np.full((2, 2), 0.2))
    >>> int(found.order[0]), round(float(found.change[1]), 2), bool(found.p[1] < 0.01 < found.p[0])
    (1, 0.1, True)
    """
    names = tuple(dict.fromkeys(record.kinds))
    size, smallest = _sizes(record)
    weighted = _divided(record, size)
    places = [weighted.of_kind(name) for name in names]
    freedom = np.array([weighted.degrees(at)[0] for at in places])
    unit_columns = columns / size[:, None]
    C = weighted.across(unit_columns)
    length = np.linalg.norm(unit_columns, axis=0)
    seen = np.linalg.norm(C, axis=0) ** 2 >= INVISIBLE * length**2
    seen &= length > _NO_EFFECT * length.max(initial=0.0)
    if freedom.sum() < FEWEST_DEGREES - _ROUNDING or not seen.any():
        return None
    which = np.flatnonzero(seen)
    fixed = np.array([name == PRIOR or name in smallest for name in names]) | (freedom < FEWEST_DEGREES - _ROUNDING)
    parts = _Parts(C[:, which], tuple(places), freedom, fixed)
    left = weighted.across(weighted.r)
    change, sd, f, degrees = (values[0] for values in parts.statistics(left[:, None]))
    largest = np.sort(_largest_of_noise(parts, weighted, draws, seed))
    adjusted = (1 + draws - np.searchsorted(largest, _normal_square(f, degrees))) / (draws + 1)
    usual = np.clip(change, -plausible[which, 0], plausible[which, 1])
    gain, within = (parts.gain(left, some) for some in (change, usual))
    order = np.argsort(-within, kind="stable")

    def spread(values: Reals, other: float) -> Reals:
        out = np.full(columns.shape[1], other)
        out[which] = values
        return out

    return ScoreTest(
        change=spread(change, 0.0),
        sd=spread(sd, np.inf),
        f=spread(f, 0.0),
        degrees=spread(degrees, np.nan),
        p_alone=spread(fdtrc(1.0, degrees, f), 1.0),
        p=spread(adjusted, 1.0),
        gain=spread(gain, 0.0),
        within=spread(within, 0.0),
        invisible=~seen,
        group=spread(_groups(C[:, which], order), -1).astype(np.int64),
        order=which[order],
    )


def p_of_refit(before: Whitened, after: Whitened) -> float | None:
    """Probability that noise lowers the misfit as much as an update with one further parameter did.

    Both are weighted by the scales of the kinds after it, and the F test is that of one parameter. None if other values
    are compared, or no degrees of freedom are left.
    """
    labels = (before.kinds, before.configurations, before.modes), (after.kinds, after.configurations, after.modes)
    size, smallest = _sizes(after)
    weighted = _divided(after, size)
    degrees = weighted.degrees(np.arange(len(size)))[0]
    if labels[0] != labels[1] or degrees < FEWEST_DEGREES - _ROUNDING:
        return None
    least, first = (float(np.sum(record.across(record.r) ** 2)) for record in (weighted, _divided(before, size)))
    variance = max(least / degrees, 1.0) if smallest else least / degrees
    return float(fdtrc(1.0, degrees, max(first - least, 0.0) / variance))


@dataclass(frozen=True)
class OneMode:
    """The one test mode that a field explains.

    Parameters
    ----------
    configuration, mode : its labels
    before, after : its part of χ² before and after the refit of the field
    p_without : p value of the field in the test without the rows of this mode; 1 where they do not see it
    """

    configuration: str
    mode: str
    before: float
    after: float
    p_without: float


def mode_that_asks(record: Whitened, column: Reals, after: Reals) -> OneMode | None:
    """The mode whose residuals alone ask for a field.

    Either the field or that one mode is wrong: a mode that was identified badly has residuals that some field explains
    in part. The mode has most of what the refit lowers χ² by, and the test of the field without its rows finds nothing.

    Parameters
    ----------
    column : (n,) ∂r/∂q of the field, in the rows of the record
    after : (n,) residuals of the refit

    Returns
    -------
    None where several modes ask for the field, or too few are compared
    """
    rows: dict[tuple[str, str], list[int]] = {}
    for i, (name, mode, role) in enumerate(zip(record.configurations, record.modes, record.roles)):
        if mode and role != PRIOR:
            rows.setdefault((name, mode), []).append(i)
    decrease = record.r**2 - after**2
    if len(rows) < _FEWEST_MODES or not decrease.sum() > 0.0:
        return None
    (name, mode), at = max(rows.items(), key=lambda item: float(decrease[item[1]].sum()))
    if decrease[at].sum() < MOST_OF_ONE * decrease.sum():
        return None
    others = np.delete(np.arange(len(record.r)), at)
    found = score_test(record.of_rows(others), column[others, None], np.full((1, 2), np.inf), draws=1)
    p = float(found.p_alone[0]) if found else 1.0
    own, left = (float(np.sum(values[at] ** 2)) for values in (record.r, after))
    return OneMode(name, mode, own, left, p) if p >= SAYS_NOTHING else None


def _sizes(record: Whitened) -> tuple[Reals, frozenset[str]]:
    """(n,) size of the errors of each row in units of the stated standard deviations; kinds that have the least size.

    A kind with too few degrees of freedom to tell has the stated size, or that of its residuals if they are larger.
    """
    factors = scales(record)
    size, left = factors.rows.copy(), factors.weighted.across(factors.weighted.r)
    for kind in factors.kinds:
        at = record.of_kind(kind.kind)
        if not kind.estimated:
            size[at] *= max(1.0, float(np.sqrt(np.mean(left[at] ** 2))))
    smallest = frozenset(kind.kind for kind in factors.kinds if kind.estimated and kind.factor < LEAST_SIZE)
    return np.maximum(size, LEAST_SIZE), smallest


def _divided(record: Whitened, size: Reals) -> Whitened:
    return replace(record, r=record.r / size, J=record.J / size[:, None])


@dataclass(frozen=True, eq=False)
class _Parts:
    """The columns of m fields by kinds of residual.

    Parameters
    ----------
    C : (n, m) columns Pc
    places : (kinds,) rows of each kind
    freedom : (kinds,) degrees of freedom
    fixed : (kinds,) kinds whose scale is not estimated
    """

    C: Reals
    places: tuple[Integers, ...]
    freedom: Reals
    fixed: Flags

    def statistics(self, left: Reals) -> tuple[Reals, ...]:
        """(d, m) each: change of every field, its standard deviation, F, and its degrees of freedom.

        Parameters
        ----------
        left : (n, d) d vectors Pr
        """
        a = np.array([left[mine].T @ self.C[mine] for mine in self.places])
        b = np.array([np.sum(self.C[mine] ** 2, axis=0) for mine in self.places])[:, None, :]
        q = np.array([np.sum(left[mine] ** 2, axis=0) for mine in self.places])[:, :, None]
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

    def gain(self, left: Reals, change: Reals) -> Reals:
        """(m,) twice the gain of log likelihood by a change (m,) of each field by itself; `left` (n,) is Pr."""
        out = np.zeros(len(change))
        for at, freedom, fixed in zip(self.places, self.freedom, self.fixed):
            before = float(left[at] @ left[at])
            after = np.sum((left[at, None] + change * self.C[at]) ** 2, axis=0)
            out += before - after if fixed else freedom * np.log(before / np.maximum(after, _NO_EFFECT * before))
        return out


def _normal_square(f: Reals, degrees: Reals) -> Reals:
    """The square of a normal variable that is exceeded with nearly the same probability as F(1, ν).

    Source: D. L. Wallace, Bounds on normal approximations to Student's and the chi-square distributions, 1959.
    """
    return np.asarray(((8.0 * degrees + 1.0) / (8.0 * degrees + 3.0)) ** 2 * degrees * np.log1p(f / degrees))


def _largest_of_noise(parts: _Parts, record: Whitened, draws: int, seed: int) -> Reals:
    """(draws,) the largest statistic of all fields in noise of unit variance, as `_normal_square`."""
    random = np.random.default_rng(seed)
    n, root = len(record.r), np.sqrt(record.shares)[:, None]
    at_once = max(1, min(draws, _AT_ONCE // max(parts.C.shape[1] * len(parts.places), n)))
    out = []
    for first in range(0, draws, at_once):
        left = record.across(root * random.normal(size=(n, min(at_once, draws - first))))
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
