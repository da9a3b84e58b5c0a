"""Does the shape of a test mode contain other modes of the model? An F-test that needs no standard deviation.

The difference of a test shape and the model shape that is paired with it is split into its part in the span of the
shapes of the four model modes next in frequency, and the rest. Where the model is right and the entries of the shape
have errors of one size, both parts are noise: with q₁ on ν₁ and q₂ on ν₂ degrees of freedom, F = (q₁/ν₁)/(q₂/ν₂). A
wrong stiffness or mass mixes neighbouring modes first, since the mixture is proportional to 1/(λ − λ_h); so does
a test that does not separate two modes. The test therefore says "model or test".

Source: R. L. Fox, M. P. Kapoor, AIAA Journal 6, 1968, 2426-2429 (shapes change by neighbouring modes); G. A. F. Seber,
A. J. Lee, Linear Regression Analysis, 2003, section 4.3 (F-test).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtrc

from femtune.arrays import Reals
from femtune.judge.parts import holm
from femtune.residuals import CaseState, Evaluation

NEIGHBOURS = 4
"""Model modes next in frequency whose shapes are looked for."""
FEWEST_LEFT = 3
"""Degrees of freedom of the rest below which fewer neighbours are taken: F with fewer has hardly any power."""
_INDEPENDENT = 1e-3
"""Singular value of shapes of unit norm at the sensors, relative to the largest, below which one repeats the others."""


@dataclass(frozen=True)
class NeighbourTest:
    """The test of one mode.

    Parameters
    ----------
    configuration, mode : label of the test mode
    model_mode : position of the model mode that is paired with it
    neighbours : positions of the model modes that were looked for
    other : position of the neighbour of which the shape contains most
    share : its size relative to that of the mode itself, at the sensors
    F, degrees : the ratio, and its degrees of freedom ν₁ and ν₂
    p_value, p_family_wise : chance of a ratio as large, by itself and corrected for the number of modes
    scatter : root mean square of the rest relative to the largest entry of the shape: an estimate of its noise
    """

    configuration: str
    mode: str
    model_mode: int
    neighbours: tuple[int, ...]
    other: int
    share: float
    F: float
    degrees: tuple[int, int]
    p_value: float
    p_family_wise: float
    scatter: float


def neighbour_tests(at: Evaluation) -> tuple[NeighbourTest, ...]:
    """The tests of all paired modes of all configurations; modes with too few sensors for one are left out."""
    tests = [test for state in at.states for test in _of_state(state)]
    wise = holm([t.p_value for t in tests])
    return tuple(replace(t, p_family_wise=p) for t, p in zip(tests, wise))


def _of_state(state: CaseState) -> Iterator[NeighbourTest]:
    test = state.case.test
    if not state.groups:
        return
    shapes, values = np.asarray(state.case.sensors @ state.solution.shapes), state.solution.eigenvalues
    for pair in state.pairs(derivatives=False):
        weights = np.ones(len(test.dofs))
        if test.shapes_sd is not None:
            sd = test.shapes_sd[:, pair.position]
            # entries of one scatter count alike; that to which a shape is scaled has none of its own
            weights = 1.0 / np.where(sd > 0.0, sd, np.sqrt(np.mean(sd[sd > 0.0] ** 2))) if (sd > 0.0).any() else weights
        known = ~(np.isnan(pair.test_shape) | np.isnan(weights))
        w = weights[known] / np.max(weights[known], initial=0.0)
        others = [i for i in range(len(values)) if i not in pair.members]
        nearest = sorted(others, key=lambda i: abs(np.log(_positive(float(values[i])) / _positive(pair.eigenvalue))))
        projected = project(w * pair.test_shape[known], w * pair.shape[known], w[:, None] * shapes[known][:, nearest],
                        pair.turned)  # fmt: skip
        if projected is not None:
            of_largest = projected.scatter / float(np.abs(w * pair.test_shape[known]).max())
            member = min(pair.members, key=lambda i: abs(values[i] - pair.eigenvalue))
            yield NeighbourTest(
                configuration=pair.case.name,
                mode=pair.label,
                model_mode=member,
                neighbours=tuple(nearest[i] for i in range(projected.tried)),
                other=nearest[projected.other],
                share=projected.share,
                F=projected.F,
                degrees=projected.degrees,
                p_value=float(fdtrc(*projected.degrees, projected.F)),
                p_family_wise=1.0,
                scatter=of_largest,
            )


def _positive(eigenvalue: float) -> float:
    """Rigid-body motions have eigenvalues about zero: they are the farthest neighbours."""
    return max(float(eigenvalue), 1e-12)


@dataclass(frozen=True)
class ShapeProjection:
    """A shape beside its neighbours: see `NeighbourTest`; `tried` of the neighbours were looked for."""

    tried: int
    other: int
    share: float
    F: float
    degrees: tuple[int, int]
    scatter: float


def project(test: Reals, own: Reals, others: Reals, turned: int = 0) -> ShapeProjection | None:
    """A test shape (s,) beside that of its model mode (s,) and those of other model modes (s, m), nearest first.

    None where there are too few sensors for the test, or no other modes.

    Parameters
    ----------
    turned : rotations by which the model shape was fitted to the test shape besides its scale

    Examples
    --------
    A shape that contains 10 % of the next one, measured with little noise:

    >>> modes = np.sin(np.outer(np.arange(1, 11), np.arange(1, 6)) * np.pi / 11)
    >>> noise = 1e-3 * np.cos(7.0 * np.arange(10.0) ** 2)
    >>> found = project(modes[:, 0] + 0.1 * modes[:, 1] + noise, modes[:, 0], modes[:, 1:])
    >>> found.other, round(found.share, 2), found.F > 1000
    (0, 0.1, True)
    """
    spare = len(test) - 1 - turned
    count = min(NEIGHBOURS, others.shape[1], spare - FEWEST_LEFT)
    if count < 1 or not np.linalg.norm(own) > 0.0:
        return None
    unit = own / np.linalg.norm(own)
    near = others[:, :count]
    across = near - np.outer(unit, unit @ near)
    size = np.linalg.norm(near, axis=0)
    seen = np.linalg.norm(across, axis=0) > _INDEPENDENT * size
    if not seen.any():
        return None
    U, s, _ = np.linalg.svd(across[:, seen] / size[seen], full_matrices=False)
    U = U[:, s > _INDEPENDENT * s[0]]
    rest = test - unit * (unit @ test)
    inside = U.T @ rest
    outside = rest - U @ inside
    first, second = U.shape[1], spare - U.shape[1]
    noise = float(np.sqrt(outside @ outside / second))
    F = float(inside @ inside / first) / max(noise**2, np.finfo(float).tiny)
    mixture = np.linalg.lstsq(np.column_stack([own, near]), test, rcond=_INDEPENDENT)[0]
    shares = np.abs(mixture[1:]) * size / (abs(mixture[0]) * np.linalg.norm(own))
    other = int(np.argmax(np.where(seen, shares, 0.0)))
    return ShapeProjection(count, other, float(shares[other]), F, (first, second), noise)
