"""Which parameters, and which combinations of them, the data determine.

Scaled Jacobian S = ∂r/∂x · diag(prior sd), with r in units of its own standard deviation: a singular value of one is
a combination that the data know as well as the prior does. Posterior covariance (Bayes, linear):
(SᵀS + I)⁻¹ in prior standard deviations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals

NO_EFFECT = 0.1
"""Change of all residuals together, in standard deviations, by one prior standard deviation along a combination, that
the data do not see."""
NO_SHARE = 1e-3
"""The same relative to that of the best determined combination."""
ROUNDING = 1e-9
"""Singular value, and part of a residual, that is rounding."""
_VARIMAX_STARTS = 8
"""Random rotations that a varimax rotation starts from: it has local maxima."""


def determined(singular_values: Reals) -> NDArray[np.bool_]:
    """Which combinations the data determine.

    One prior standard deviation along an undetermined combination changes all residuals together by less than
    NO_EFFECT of their standard deviation, and by less than NO_SHARE of what the best determined one does (so that
    residuals with unit weights, whose size has no meaning, are not called blind). Singular values below ROUNDING count
    as zero.
    """
    s = singular_values
    return np.asarray((s > NO_EFFECT) | (s > max(NO_SHARE * s.max(initial=0.0), ROUNDING)))


def determined_combinations(scaled: Reals) -> int:
    """How many combinations a Jacobian (n, k) by parameters in prior standard deviations determines."""
    return int(determined(np.asarray(np.linalg.svd(scaled, compute_uv=False), dtype=float)).sum())


WEAK = 0.5
"""A combination whose posterior is wider than this fraction of its prior is weakly determined."""


@dataclass(frozen=True)
class Combination:
    """A direction in parameter space, unit length in prior standard deviations.

    `reduction` is posterior sd / prior sd along it: 1 if the data contain no information.
    """

    coefficients: Reals
    singular_value: float
    reduction: float


@dataclass(frozen=True)
class Identifiability:
    """What the data determine about k parameters, from a Jacobian.

    Parameters
    ----------
    scaled_jacobian : (n, k) in prior standard deviations
    singular_values : (k,) descending, zeros appended where there are fewer residuals
    rank : number of combinations that the data determine, see `determined`
    undetermined : combinations that the data do not determine, as sparse as they can be made
    weak : further combinations that the data determine worse than WEAK
    reduction : (k,) posterior sd / prior sd of each parameter
    correlation : (k, k) of the posterior
    sensitivity : (k,) length of each parameter's column: its effect over one prior sd, in residual sds
    """

    names: tuple[str, ...]
    scaled_jacobian: Reals
    singular_values: Reals
    rank: int
    undetermined: tuple[Combination, ...]
    weak: tuple[Combination, ...]
    reduction: Reals
    correlation: Reals
    sensitivity: Reals


def identifiability(jacobian: Reals, prior_sd: Reals, names: tuple[str, ...], size: float = 1.0) -> Identifiability:
    """Singular values and vectors, posterior to prior ratios and correlations.

    Parameters
    ----------
    jacobian : (n, k) ∂r/∂x of residuals in units of their stated standard deviation
    prior_sd : (k,) of x
    names : of the k parameters
    size : actual over stated standard deviation of the residuals, see `estimated_size`
    """
    S = jacobian * prior_sd / size
    k = S.shape[1]
    _, s, vt = np.linalg.svd(np.vstack([S, np.zeros((max(0, k - len(S)), k))]), full_matrices=False)
    null = ~determined(s * size)
    covariance = (vt.T / (1.0 + s**2)) @ vt
    sd = np.sqrt(np.diag(covariance))
    undetermined = [_combination(S, v) for v in sparse_basis(vt[null])]
    ratio = 1.0 / np.sqrt(1.0 + s**2)
    weak = [
        Combination(_signed(vt[i]), float(s[i]), float(ratio[i])) for i in range(k) if ratio[i] > WEAK and not null[i]
    ]
    return Identifiability(
        names=names,
        scaled_jacobian=S,
        singular_values=s,
        rank=int((~null).sum()),
        undetermined=tuple(undetermined),
        weak=tuple(weak),
        reduction=sd,
        correlation=covariance / np.outer(sd, sd),
        sensitivity=np.linalg.norm(S, axis=0),
    )


def estimated_size(jacobian: Reals, r: Reals, lost: int) -> float:
    """Standard deviation of residuals in units of the stated one, from what no parameter can change of them.

    It is 1 where no degrees of freedom are left, and at least ROUNDING of the whole residual.

    Parameters
    ----------
    jacobian, r : (n, k), (n,)
    lost : combinations of residuals that are zero whatever the noise
    """
    length = np.linalg.norm(jacobian, axis=0)
    U, s, _ = np.linalg.svd(jacobian[:, length > 0.0] / length[length > 0.0], full_matrices=False)
    U = U[:, s > ROUNDING * s.max(initial=0.0)]
    freedom = len(r) - U.shape[1] - lost
    if freedom < 1 or not r.any():
        return 1.0
    left = np.linalg.norm(r - U @ (U.T @ r)) / np.sqrt(freedom)
    return float(max(left, ROUNDING * np.linalg.norm(r)))


def _combination(S: Reals, direction: Reals) -> Combination:
    effect = float(np.linalg.norm(S @ direction))
    return Combination(direction, effect, 1.0 / float(np.sqrt(1.0 + effect**2)))


def sparse_basis(vectors: Reals) -> Reals:
    """Rotate orthonormal rows (m, k) so that each touches as few parameters as it can (varimax).

    A null space is known only as a space; any basis is right, and the sparsest is the one that can be read.
    """
    m = len(vectors)
    if m < 2:
        return np.array([_signed(row) for row in vectors]).reshape(vectors.shape)
    # the criterion has saddles, (1, 1) and (1, −1) for one, so that it is climbed from several turned bases
    rng = np.random.default_rng(0)
    starts = [np.linalg.qr(rng.standard_normal((m, m)))[0] for _ in range(_VARIMAX_STARTS)]
    rotated = [_varimax(vectors, start) for start in starts]
    basis = max(rotated, key=lambda rows: float((rows**4).sum()))
    basis[np.abs(basis) < 1e-3] = 0.0
    return np.array([_signed(row) for row in basis])


def _varimax(vectors: Reals, turn: Reals) -> Reals:
    """Local optimum of the variance of squared coefficients, as (m, k) rows."""
    last = 0.0
    for _ in range(500):
        L = vectors.T @ turn
        u, s, vt = np.linalg.svd(vectors @ L**3)
        turn = u @ vt
        if s.sum() <= last * (1.0 + 1e-14):
            break
        last = float(s.sum())
    return np.asarray(turn.T @ vectors)


def _signed(v: Reals) -> Reals:
    """The sign that makes the largest coefficient positive."""
    return v * (np.sign(v[np.argmax(np.abs(v))]) or 1.0)


# ----------------------------------------------------------------------------------------------------
# Identifiability in sentences.


_WELL_DETERMINED = 1 / 3
"""Posterior to prior standard deviation below which the data determine a parameter."""
_PARTLY_DETERMINED = 2 / 3
"""The same, below which they determine it partly."""
_SMALL_COEFFICIENT = 0.1
"""Coefficient of a combination relative to the largest, below which its parameter is not named."""


def verdict(reduction: float) -> str:
    """Verdict on one parameter by its posterior to prior ratio."""
    if reduction < _WELL_DETERMINED:
        return "determined by the data"
    if reduction < _PARTLY_DETERMINED:
        return "partly determined: bounds or prior still affect it"
    return "weakly determined: mostly bounds or prior"


def combination_text(names: tuple[str, ...], combination: Combination) -> str:
    """Such as ``+0.71 Icx2 −0.50 Ibx1``, small coefficients left out, in prior standard deviations."""
    c: NDArray = combination.coefficients
    order = [i for i in np.argsort(-np.abs(c)) if abs(c[i]) >= _SMALL_COEFFICIENT * np.abs(c).max()]
    return " ".join(f"{'+' if c[i] > 0 else '−'}{abs(c[i]):.2f} {names[i]}" for i in order)


def sentences(result: Identifiability) -> list[str]:
    """Identifiability in sentences: undetermined combinations first, then weak ones; `verdict` is for parameters."""
    k, m = len(result.names), len(result.undetermined)
    if not k:
        return ["There is no free parameter."]
    out = [
        f"The data leave {_count(m)} of the {k} free parameters undetermined."
        if m
        else f"The data determine all {k} free parameters, some better than others."
    ]
    out += [undetermined_sentence(result, c) for c in result.undetermined]
    return out + [_weak(result, c) for c in result.weak]


def _count(m: int) -> str:
    return "one combination" if m == 1 else f"{m} combinations"


def undetermined_sentence(result: Identifiability, c: Combination) -> str:
    """What an undetermined combination means for its parameters, and what helps."""
    together = [
        result.names[i]
        for i in np.flatnonzero(np.abs(c.coefficients) >= _SMALL_COEFFICIENT * np.abs(c.coefficients).max())
    ]
    if len(together) == 1:
        return f"{together[0]} has no effect on the measured quantities: fix it, or measure a quantity that it affects."
    return (
        f"A joint change of {listed(together)} ({combination_text(result.names, c)}) changes no measured quantity by "
        f"more than {c.singular_value:.1g} of its standard deviation: fix one of them, tie two, or measure further "
        "quantities."
    )


def _weak(result: Identifiability, c: Combination) -> str:
    return (
        f"The combination {combination_text(result.names, c)} is weakly determined: "
        f"its standard deviation is still {100 * c.reduction:.0f} % of the prior's."
    )


def listed(names: Sequence[str]) -> str:
    """ "a, b and c"."""
    return " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else "".join(names)
