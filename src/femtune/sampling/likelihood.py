"""Likelihood of all residuals, with unknown sizes of the errors of the data and of the model.

The residuals of kind k have the variance σ_k² in units of their stated variances: σ_k is one, or is sampled with the
prior 1/σ_k (Jeffreys). Where the model has errors of its own, the residuals are r(x) + B q with nuisance factors q on
what no parameter represents, B = ∂r/∂q, and q normal with an unknown standard deviation s_c in each class c. Its
logarithm is as likely anywhere between two limits, with the soft ends 1/((1 + s²/s₂²)(1 + s₁²/s²)): a model may be
right but for what nobody would see, or wrong by tens of per cent. The factors q are integrated out:

    H = Σ_k B_kᵀB_k/σ_k² + diag(s⁻²),  g = Σ_k B_kᵀr_k/σ_k²,
    log p(r) = −½ (Σ_k (n_k log σ_k² + r_kᵀr_k/σ_k²) + Σ log s² + log|H| − gᵀH⁻¹g) + constant.

Sources: H. Jeffreys, An invariant form for the prior probability in estimation problems, Proc. Royal Soc. A 186, 1946
(sizes); M. C. Kennedy, A. O'Hagan, Bayesian calibration of computer models, J. Royal Stat. Soc. B 63, 2001 (errors of
the model as part of it).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from femtune.arrays import Flags, Integers, Reals

_LOG_2PI = float(np.log(2.0 * np.pi))


@dataclass(frozen=True, eq=False)
class NoiseGroup:
    """Residuals whose errors have one factor.

    Parameters
    ----------
    name : kind of residual, or "all"
    rows : their positions
    count : number of independent ones
    estimated : whether the factor is sampled; otherwise it is one
    """

    name: str
    rows: Integers
    count: float
    estimated: bool


@dataclass(frozen=True, eq=False)
class NuisanceClass:
    """Nuisance factors with one unknown standard deviation.

    Parameters
    ----------
    name : what they are on
    columns : their positions in B
    limits : s₁ and s₂ between which the logarithm of the standard deviation is uniform, relative changes
    """

    name: str
    columns: Integers
    limits: tuple[float, float]


@dataclass(frozen=True, eq=False)
class _Factors:
    """The factors q of residuals of c chains.

    Parameters
    ----------
    b : (c, m) the most probable ones
    variance : (c, m) their variances
    seen : (c, groups) trace of their covariance times BᵀB of each group; zero where the group is not estimated
    half_log_det : (c,) ½ log|I + SBᵀBS|
    s : (c, m) standard deviations before the data
    """

    b: Reals
    variance: Reals
    seen: Reals
    half_log_det: Reals
    s: Reals


@dataclass(frozen=True, eq=False)
class Likelihood:
    """The density of residuals (n,) with sampled sizes θ = (log σ_k of estimated groups, log s_c of the classes).

    Parameters
    ----------
    groups : of the rows; each row is in one of them
    classes : of the columns of B
    B : (n, m) ∂r/∂q of the nuisance factors
    """

    groups: tuple[NoiseGroup, ...]
    classes: tuple[NuisanceClass, ...]
    B: Reals

    @property
    def estimated(self) -> tuple[int, ...]:
        """Positions of the groups whose factor is sampled."""
        return tuple(i for i, group in enumerate(self.groups) if group.estimated)

    @property
    def names(self) -> tuple[str, ...]:
        """Of θ."""
        return (*(self.groups[i].name for i in self.estimated), *(c.name for c in self.classes))

    @property
    def size(self) -> int:
        """Number of θ."""
        return len(self.estimated) + len(self.classes)

    def reduced(self, r: Reals) -> tuple[Reals, ...]:
        """By group, rows (m, q) with the Gram matrix of residuals (n, q) and of B together; see `Reduced`."""
        return tuple(r[group.rows] for group in self.groups)

    def prior(self, theta: Reals) -> tuple[Reals, Reals]:
        """(c,) log density of θ (c, t), and its gradient (c, t): both flat in log σ and, within limits, log s."""
        log, slope, first = np.zeros(len(theta)), np.zeros_like(theta), len(self.estimated)
        for j, one in enumerate(self.classes, start=first):
            lower, upper = np.log(one.limits)
            above, below = np.exp(2.0 * (theta[:, j] - upper)), np.exp(2.0 * (lower - theta[:, j]))
            width = (upper - lower) / -np.expm1(2.0 * (lower - upper))
            log -= np.log1p(above) + np.log1p(below) + np.log(width)
            slope[:, j] = 2.0 * below / (1.0 + below) - 2.0 * above / (1.0 + above)
        return log, slope

    def of(
        self, parts: tuple[Reals, ...], B: tuple[Reals, ...], theta: Reals
    ) -> tuple[Reals, tuple[Reals, ...], Reals]:
        """Log likelihood (c,), its gradients by the residuals of each group (c, m_g), and by θ (c, t).

        Parameters
        ----------
        parts : by group, (c, m_g) residuals, or rows with the same Gram matrices
        B : by group, (m_g, m) in the same rows
        theta : (c, t)
        """
        log_sigma = np.zeros((len(theta), len(self.groups)))
        log_sigma[:, list(self.estimated)] = theta[:, : len(self.estimated)]
        weight = np.exp(-2.0 * log_sigma)
        counts = np.array([group.count for group in self.groups])
        log = -(log_sigma @ counts) - 0.5 * float(counts.sum()) * _LOG_2PI
        found = self._factors(parts, B, weight, theta)
        slope = np.zeros_like(theta)
        by_parts, squares = [], np.zeros_like(log_sigma)
        for g, (r, of_b) in enumerate(zip(parts, B)):
            left = r if found is None else r - found.b @ of_b.T
            squares[:, g] = np.sum(left**2, axis=1)
            log -= 0.5 * weight[:, g] * squares[:, g]
            by_parts.append(-weight[:, g, None] * left)
            if g in self.estimated:
                j = self.estimated.index(g)
                slope[:, j] = weight[:, g] * squares[:, g] - counts[g]
                if found is not None:
                    slope[:, j] += weight[:, g] * found.seen[:, g]
        if found is None:
            return log, tuple(by_parts), slope
        log -= found.half_log_det + 0.5 * np.sum((found.b / found.s) ** 2, axis=1)
        own = found.b**2 + found.variance
        for j, one in enumerate(self.classes, start=len(self.estimated)):
            inverse = np.exp(-2.0 * theta[:, j])
            slope[:, j] = inverse * own[:, one.columns].sum(axis=1) - len(one.columns)
        return log, tuple(by_parts), slope

    def _factors(self, parts: tuple[Reals, ...], B: tuple[Reals, ...], weight: Reals, theta: Reals) -> _Factors | None:
        """The factors q of residuals; None without errors of the model."""
        m = self.B.shape[1]
        if not m:
            return None
        s = np.empty((len(theta), m))
        for j, one in enumerate(self.classes, start=len(self.estimated)):
            s[:, one.columns] = np.exp(theta[:, j, None])
        grams = np.array([of_b.T @ of_b for of_b in B])
        g = sum((weight[:, i, None] * (r @ of_b) for i, (r, of_b) in enumerate(zip(parts, B))), np.zeros_like(s))
        out = _Factors(
            np.zeros_like(s), np.ones_like(s), np.zeros((len(s), len(B))), np.full(len(s), np.inf), s
        )  # fmt: skip
        # chain by chain with LAPACK itself: the matrices stay in the cache
        for c, s_c in enumerate(s):
            root = _inverse_root(np.tensordot(weight[c], grams, 1), s_c)
            if root is None:
                # sizes so far apart that the matrix is singular in floating point: no chain goes there
                continue
            T, out.half_log_det[c] = root
            out.b[c] = (T @ g[c]) @ T
            out.variance[c] = np.einsum("ij,ij->j", T, T)
            for i in self.estimated:
                out.seen[c, i] = np.einsum("ij,ij->", T @ grams[i], T)
        return out

    def factors(self, r: Reals, theta: Reals) -> Reals:
        """(c, m) most probable nuisance factors of residuals r (c, n) with θ (c, t)."""
        weight = np.ones((len(theta), len(self.groups)))
        weight[:, list(self.estimated)] = np.exp(-2.0 * theta[:, : len(self.estimated)])
        parts = tuple(r[:, group.rows] for group in self.groups)
        found = self._factors(parts, tuple(self.B[group.rows] for group in self.groups), weight, theta)
        # r + B q is the error of the data, so that the factors are those of −r
        return np.zeros((len(theta), 0)) if found is None else -found.b

    def drawn_factors(self, r: Reals, theta: Reals, rng: np.random.Generator) -> Reals:
        """(m,) nuisance factors of residuals r (n,) with θ (t,), drawn from their distribution."""
        mean = self.factors(r[None], theta[None])[0]
        sigma, s = self.sizes(theta)
        root = _inverse_root(self.B.T @ (self.B / sigma[:, None] ** 2), s) if len(s) else None
        return mean if root is None else np.asarray(mean + rng.standard_normal(len(s)) @ root[0])

    def sizes(self, theta: Reals) -> tuple[Reals, Reals]:
        """(n,) factors on the errors of the data, and (m,) standard deviations of the nuisance factors, at θ (t,)."""
        sigma, s = np.ones(len(self.B)), np.zeros(self.B.shape[1])
        for j, i in enumerate(self.estimated):
            sigma[self.groups[i].rows] = np.exp(theta[j])
        for j, one in enumerate(self.classes, start=len(self.estimated)):
            s[one.columns] = np.exp(theta[j])
        return sigma, s

    def without_classes(self) -> Likelihood:
        """The same without errors of the model."""
        return Likelihood(self.groups, (), np.zeros((len(self.B), 0)))

    def at(self, r: Reals, theta: Reals) -> Reals:
        """(c,) log likelihood of residuals (c, n) with θ (c, t)."""
        parts = tuple(r[:, group.rows] for group in self.groups)
        return self.of(parts, tuple(self.B[group.rows] for group in self.groups), theta)[0]


def _inverse_root(gram: Reals, s: Reals) -> tuple[Reals, float] | None:
    """T (m, m) with TᵀT = (G + diag(s⁻²))⁻¹, and ½ log|I + SGS|; None if that is not positive definite.

    In units of s, so that neither a tiny s nor a large one costs digits.
    """
    H = gram * s[:, None] * s
    H.flat[:: len(s) + 1] += 1.0
    L, failed = lapack.dpotrf(H.T, lower=1, overwrite_a=1)
    if failed:
        return None
    inverse = lapack.dtrtri(L, lower=1)[0]
    return np.asarray(inverse * s), float(np.log(L.diagonal()).sum())


def noise_groups(
    kinds: np.ndarray, fixed: Flags, lost: dict[str, int], rule: str, freedom: dict[str, float], least: float
) -> tuple[NoiseGroup, ...]:
    """Groups of rows by the rule, those of a prior with the factor one.

    Parameters
    ----------
    kinds : (n,) kind of each residual
    fixed : (n,) rows of a prior
    lost : by kind, combinations that vanish whatever the noise
    rule : "stated", "common" or "by-kind"
    freedom : by kind, degrees of freedom that the parameters leave
    least : degrees of freedom below which the errors of a kind cannot be estimated, and are as stated
    """
    names = list(dict.fromkeys(kinds[~fixed].tolist()))
    count = {name: float(np.sum(kinds[~fixed] == name)) - lost.get(name, 0) for name in names}
    free = [n for n in names if rule == "by-kind" and freedom.get(n, 0.0) >= least]
    if rule == "common" and sum(freedom.values()) >= least:
        rows = np.flatnonzero(~fixed)
        groups = [NoiseGroup("all residuals", rows, sum(count.values()), True)]
    else:
        groups = [NoiseGroup(n, np.flatnonzero((kinds == n) & ~fixed), count[n], n in free) for n in names]
    if fixed.any():
        groups.append(NoiseGroup("prior", np.flatnonzero(fixed), float(fixed.sum()), False))
    return tuple(groups)
