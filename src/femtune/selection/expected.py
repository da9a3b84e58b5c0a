"""Expected standard deviations of the parameters from the data alone: what can be known, and what only together.

The covariance is F⁻¹ with the Fisher information F = JᵀJ of residuals in units of their standard deviations. Where
residuals compare FRFs of an identified test, whose errors all lines share, it is F⁻¹Jᵀ Cov(Δr) J F⁻¹: the covariance of
the estimate with the weights of the residuals, the changes Δr being those that noise as large as the errors of the
identification makes through identification and equalisation. After an update the residuals r that are left tell whether
these changes are all: if |r|² is larger than 99 % of the values of |Δr|², both without what the parameters can do, the
standard deviations are multiplied by |r| over the root mean square of |Δr|. Modes that the identification missed and
errors of the model make r larger.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from zlib import crc32

import numpy as np

from femtune.arrays import Flags, Reals
from femtune.residuals import Evaluation, ResidualBlock
from femtune.residuals.identified import drawn_changes
from femtune.selection.combinations import determined, listed, sparse_basis
from femtune.selection.information import KNOWN

TOGETHER = 0.9
"""Absolute correlation from which a combination of parameters is known much better than each."""
_NOISE_DRAWS = 200
"""Draws of the noise of an identified test: variances are known to 10 %."""
_BY_CHANCE = 0.01
"""Significance level above which the residuals are larger than the noise of an identified test makes them."""
_SMALL_COEFFICIENT = 0.1
"""Coefficient of an undetermined combination, relative to the largest one, below which its parameter is not named."""
_NO_PART = 1e-6
"""Coefficient of orthonormal directions that is rounding."""


@dataclass(frozen=True, eq=False)
class ExpectedKnowledge:
    """Expected standard deviations of k parameters, in normalised units.

    Parameters
    ----------
    names : of the parameters
    prior_sd : (k,)
    together : (k,) standard deviation with all unknown, from the data alone; inf where undetermined
    alone : (k,) were all others known; inf without effect
    correlation : (k, k) of the estimate in what the data determine
    null : (m, k) combinations in prior standard deviations that the data leave open, as sparse as they can be made
    measured : whether the noise is that of measured FRFs that were identified
    misfit : residuals of these FRFs after an update over those that the noise makes; 1 where the noise explains
        them, before an update, and for other data. The standard deviations contain it
    noise : (k, k) covariance of Jᵀe, with the Jacobian J of all parameters in prior standard deviations, where errors e
        of such FRFs, the misfit included, are among the data; None for other data, and of a selection
    """

    names: tuple[str, ...]
    prior_sd: Reals
    together: Reals
    alone: Reals
    correlation: Reals
    null: Reals
    measured: bool
    misfit: float = 1.0
    noise: Reals | None = None

    @property
    def known(self) -> Flags:
        """(k,) parameters whose standard deviation is below a third of the prior's."""
        return np.asarray(self.together <= KNOWN * self.prior_sd)

    @property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """Parameters that are correlated by more than TOGETHER with another one of their group."""
        near = np.abs(self.correlation) >= TOGETHER
        left, grouped = list(range(len(self.names))), []
        while left:
            group, ahead = {left[0]}, [left[0]]
            while ahead:
                new = {int(j) for j in np.flatnonzero(near[ahead.pop()])} - group
                group |= new
                ahead += sorted(new)
            left = [j for j in left if j not in group]
            if len(group) > 1:
                grouped.append(tuple(self.names[j] for j in sorted(group)))
        return tuple(grouped)

    @property
    def open(self) -> tuple[tuple[str, ...], ...]:
        """Parameters of each combination that the data leave open."""
        return tuple(
            tuple(n for n, c in zip(self.names, row) if abs(c) >= _SMALL_COEFFICIENT * np.abs(row).max())
            for row in self.null
        )

    def select(self, which: Flags) -> ExpectedKnowledge:
        """Some of the parameters, where the others are known."""
        if which.all():
            return self
        names = tuple(n for n, w in zip(self.names, which) if w)
        null = self.null[(np.abs(self.null[:, ~which]) < _SMALL_COEFFICIENT).all(axis=1)][:, which]
        return replace(
            self, names=names, prior_sd=self.prior_sd[which], together=self.together[which], alone=self.alone[which],
            correlation=self.correlation[np.ix_(which, which)], null=null, noise=None,
        )  # fmt: skip

    def sentences(self, percent: Reals) -> list[str]:
        """Sentences; `percent` (k,) are the standard deviations in % of the values."""
        if not self.names:
            return []
        known = [f"{n} (±{p:.2g} %)" for n, p, k in zip(self.names, percent, self.known) if k]
        open_ = [n for n, k in zip(self.names, self.known) if not k]
        first = f"The data alone determine {listed(known)}." if known else "The data alone determine no parameter."
        out = [first]
        if open_:
            out.append(
                f"They do not determine {listed(open_)}: the standard deviation is more than a third of the prior's."
            )
        out += [
            f"{listed(group)} are correlated by more than {TOGETHER:g}: a combination of them is known much better "
            "than each of them."
            for group in self.groups
        ]
        for parts in self.open:
            joint = f"A joint change of {listed(parts)}" if len(parts) > 1 else f"A change of {parts[0]}"
            out.append(f"{joint} has no effect on the data.")
        if self.misfit > 1.0:
            out.append(
                f"The residuals are {self.misfit:.2g} times as large as the noise of the identified test makes them: "
                "the identification misses modes, or the model is wrong. The standard deviations are increased by this "
                "factor."
            )
        return out


def expected_knowledge(
    at: Evaluation, prior_sd: Reals, names: tuple[str, ...], size: float = 1.0, *, updated: bool = False
) -> ExpectedKnowledge:
    """Information in the data of an evaluation about its parameters.

    Parameters
    ----------
    at : with derivatives by the k parameters
    prior_sd : (k,)
    names : of the parameters
    size : actual over stated standard deviation of the residuals; not used for identified tests
    updated : whether the parameters are those of an update, so that the residuals are errors of the data and the model
    """
    S = at.jacobian * prior_sd
    k = S.shape[1]
    _, s, vt = np.linalg.svd(np.vstack([S, np.zeros((max(0, k - len(S)), k))]), full_matrices=False)
    kept = determined(s)
    inverse = (vt[kept].T / s[kept] ** 2) @ vt[kept]
    measured = any(_noise_is_known(b) for b in at.weighted)
    noise, misfit = _noise(at, S, vt[kept]) if measured else (size**2 * (S.T @ S), 1.0)
    misfit = misfit if updated else 1.0
    noise = misfit**2 * noise
    covariance = inverse @ noise @ inverse
    null = sparse_basis(vt[~kept])
    open_ = (np.abs(vt[~kept]) > _NO_PART).any(axis=0)
    sd = np.sqrt(np.diag(covariance))
    safe = np.where(sd > 0.0, sd, 1.0)
    lengths = np.sum(S**2, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        alone = np.where(lengths > 0.0, np.sqrt(np.diag(noise)) / lengths, np.inf)
    # what does not move has no spread, whatever the data are
    together, alone = (np.where(prior_sd > 0.0, x, 0.0) * prior_sd for x in (np.where(open_, np.inf, sd), alone))
    correlation = covariance / np.outer(safe, safe)
    stated_noise = noise if measured else None
    return ExpectedKnowledge(
        names=names,
        prior_sd=prior_sd,
        together=together,
        alone=alone,
        correlation=correlation,
        null=null,
        measured=measured,
        misfit=misfit,
        noise=stated_noise,
    )


def _noise(at: Evaluation, S: Reals, directions: Reals) -> tuple[Reals, float]:
    """(k, k) covariance of Sᵀ Δr, and how much larger the residuals of identified tests are than Δr.

    Blocks of other data have independent errors of the stated size.

    Parameters
    ----------
    directions : (q, k) combinations that the data determine
    """
    ends = np.cumsum([0, *(len(b.values) for b in at.weighted)])
    rows, left = np.split(S, ends[1:-1]), np.split(at.residuals, ends[1:-1])
    identified = [_noise_is_known(b) for b in at.weighted]
    mine = [i for i, is_so in enumerate(identified) if is_so]
    jacobian_rows = np.concatenate([rows[i] for i in mine])
    # an orthonormal basis of what the parameters can do to these residuals
    basis = np.linalg.qr(jacobian_rows @ directions.T)[0]
    sums, squares = np.zeros((_NOISE_DRAWS, S.shape[1])), np.zeros(_NOISE_DRAWS)
    for i in range(_NOISE_DRAWS):
        rng = np.random.default_rng(i)
        drawn = drawn_changes(at.weighted, "noise", rng)
        changes = [_own_noise(b, rng, i) if c is None else c for b, c in zip(at.weighted, drawn)]
        noise = np.concatenate([change for change in changes if change is not None])
        sums[i] = noise @ jacobian_rows
        squares[i] = _square_outside(noise, basis)
    others = sum((rows[i].T @ rows[i] for i, is_so in enumerate(identified) if not is_so), np.zeros((S.shape[1],) * 2))
    square = _square_outside(np.concatenate([left[i] for i in mine]), basis)
    large = square > np.quantile(squares, 1.0 - _BY_CHANCE)
    misfit = float(np.sqrt(square / squares.mean())) if large else 1.0
    return np.asarray(np.atleast_2d(np.cov(sums.T)) + others), misfit


def _noise_is_known(block: ResidualBlock) -> bool:
    """Whether an identification has found the noise of a block."""
    return block.samples is not None and (block.samples.identified is not None or block.samples.noise is not None)


def _own_noise(block: ResidualBlock, rng: np.random.Generator, draw: int) -> Reals | None:
    """(n,) errors of the measured values of a block, if their noise is known.

    Errors that all values of a configuration share are the same in all its blocks of a draw.
    """
    noise = None if block.samples is None else block.samples.noise
    if block.samples is None or noise is None:
        return None
    own, common = noise * rng.standard_normal(len(noise)), block.samples.common
    if common is None:
        return np.asarray(own)
    shared = np.random.default_rng([draw, crc32(block.configuration.encode())])
    return np.asarray(own + common @ shared.standard_normal(common.shape[1]))


def _square_outside(values: Reals, basis: Reals) -> float:
    inside = basis.T @ values
    return float(values @ values - inside @ inside)
