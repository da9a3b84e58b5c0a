"""Are the MACs of the pairs as low as noise of the shapes makes them?

1 − MAC is no normal variable, but with a model shape φ and a test shape ψ it is |ψ⊥|²/|ψ|², ψ⊥ the part of ψ across φ.
Where the model is right, ψ⊥ is noise of the test with the covariance A = P(Σ + G C Gᵀ)P, P taking φ away, Σ of the
stated standard deviations of the entries, and G C Gᵀ of φ, which the uncertain parameters move. |ψ⊥|² is then compared
with a chi-square as the parts of other residuals are (Satterthwaite). The fit to the noise, which makes ψ⊥ smaller, is
neglected: the derivative of a MAC vanishes where shapes agree.

Source: F. E. Satterthwaite, Biometrics Bulletin 2, 1946, 110-114.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammainc, gammaincc

from femtune.judge.parts import ResidualPart
from femtune.residuals.mac import MacResidual

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.residuals import CaseState
    from femtune.updating import UpdateResult

_DETERMINED = 1e-6
"""Singular value relative to the largest below which data leave a combination of parameters undetermined."""


def mac_parts(result: UpdateResult) -> tuple[ResidualPart, ...]:
    """The test of each MAC residual whose test shape has standard deviations."""
    after, covariance = result.after, _covariance(result)
    compared = {(b.configuration, b.mode) for b in after.blocks if b.kind == MacResidual.label}
    if not compared:
        return ()
    return tuple(
        p for state in after.states for p in _of_state(state, covariance) if (p.configuration, p.mode) in compared
    )


def _covariance(result: UpdateResult) -> Reals:
    """(k, k) of the parameters by the stated deviations, whatever the residuals show; zero where undetermined."""
    spread = result.parameters.prior[1]
    moving = np.isin([p.name for p in result.parameters.free], result.active)
    rows = np.vstack([result.after.jacobian, result.side.prior_rows]) * np.where(moving, spread, 0.0)
    inverse = np.linalg.pinv(rows, rcond=_DETERMINED) * spread[:, None]
    return np.asarray(inverse @ inverse.T)


def _of_state(state: CaseState, covariance: Reals) -> Iterator[ResidualPart]:
    sds = state.case.test.shapes_sd
    if sds is None or not state.groups:
        return
    for pair in state.pairs(derivatives=True):
        known, sd = ~np.isnan(pair.test_shape), sds[:, pair.position]
        if np.isnan(sd[known]).any() or not (sd[known] > 0.0).any():
            continue
        # an entry to which the test scales its shape has no error of its own: its error is in all others
        spread = np.where(sd[known] > 0.0, sd[known], np.sqrt(np.mean(sd[known][sd[known] > 0.0] ** 2)))
        tested = mac_test(
            pair.test_shape[known], pair.shape[known], np.diag(spread**2), pair.shape_gradient[known], covariance
        )
        if tested is not None:
            chi_square, degrees, large, small = tested
            yield ResidualPart(
                family="modes",
                kind=MacResidual.label,
                configuration=pair.case.name,
                mode=pair.label,
                sensor="",
                values=1,
                chi_square=chi_square,
                degrees=degrees,
                p_large=large,
                p_small=small,
            )


def mac_test(
    test: Reals, shape: Reals, noise: Reals, gradient: Reals, covariance: Reals
) -> tuple[float, float, float, float] | None:
    """Chi-square, degrees of freedom, and chance of a MAC as low or lower, and as high or higher.

    Parameters
    ----------
    test, shape : (s,) of test and model, each in any scale
    noise : (s, s) covariance of the errors of the test shape
    gradient, covariance : (s, k) of the model shape by the parameters, and (k, k) of the parameters

    Returns
    -------
    None for a single entry, whose MAC is one

    Examples
    --------
    >>> shape, noise = np.array([1.0, 2.0, 3.0]), 1e-4 * np.eye(3)
    >>> exact = mac_test(2.0 * shape, shape, noise, np.zeros((3, 0)), np.zeros((0, 0)))
    >>> other = mac_test(np.array([1.0, 2.0, 3.2]), shape, noise, np.zeros((3, 0)), np.zeros((0, 0)))
    >>> round(exact[1], 6), exact[2] > 0.99, other[2] < 1e-6
    (2.0, True, True)
    """
    unit = shape / np.linalg.norm(shape)
    scale = float(unit @ test) / float(np.linalg.norm(shape))
    moved = scale * gradient
    across = np.eye(len(unit)) - np.outer(unit, unit)
    A = across @ (noise + moved @ covariance @ moved.T) @ across
    first, second = float(np.trace(A)), float(np.sum(A**2))
    if not second > 0.0:
        return None
    degrees = first**2 / second
    chi_square = float(np.sum((across @ test) ** 2)) * first / second
    return (
        chi_square, degrees, float(gammaincc(0.5 * degrees, 0.5 * chi_square)),
        float(gammainc(0.5 * degrees, 0.5 * chi_square)),
    )  # fmt: skip
