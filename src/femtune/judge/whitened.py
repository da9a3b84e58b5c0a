"""The residuals at the end of an update as independent values of unit variance, with what the parameters can change.

All tests of the fit read this one record. To first order, and where the model and the stated standard deviations are
right, the residuals are r = e + J d with independent e of unit variance and some change d of the parameters. P = I −
U Uᵀ, with U spanning the range of J and the combinations that are lost, takes J d away: P r = P e, whatever
regularisation, bounds and iterations did to the parameters. Rows of a prior are values like those of the test.

Source: G. A. F. Seber, A. J. Lee, Linear Regression Analysis, 2003, sections 3.3 and 10.2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, TypeVar

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.parameters import ParameterSet
from femtune.residuals import ResidualBlock
from femtune.updating.result import UpdateResult
from femtune.validation.goodness import RANK

L = TypeVar("L", bound=str)
Role = Literal["data", "prior"]
PRIOR = "prior"
"""Kind of the rows of a prior, and their role."""


@dataclass(frozen=True, eq=False)
class Whitened:
    """Residuals r (n,) and Jacobian J (n, k) of the rows that have a known distribution, and a label of each row.

    Rows of side constraints that are no information (Tikhonov, minimum change) are not among them.

    Parameters
    ----------
    r : (n,) residuals
    J : (n, k) ∂r/∂(x/s), columns of the parameters that move and are not at a bound, in prior standard deviations s
    names : (k,) parameters of the columns
    bounded, fixed : (n, b) and (n, f) the same columns of the parameters at a bound, and of those that do not move
    kinds, configurations, modes, sensors, roles : (n,) what each row compares; "" where it has no sensor or, of a
        prior, no configuration. `modes` of a prior are the names of the parameters
    shares : (n,) share of each row that is independent: below one where it is known how many combinations of the rows
        of a block are lost, but not which
    lost : (n, m) orthonormal combinations of the rows that are zero whatever the noise
    of_modes : kinds that compare modes
    untested : by kind, why its rows are not in the record
    optimum : False if the update ended without an optimum; P r would be what a linear model promises for values that
        were not reached, and r itself is looked at

    Examples
    --------
    Three values of one parameter, which is their mean:

    >>> rows = Whitened(np.array([1.0, 2.0, 3.0]), np.ones((3, 1)), ("k",), np.zeros((3, 0)), *[("a", "b", "c")] * 4,
    ...                 ("data",) * 3, np.ones(3), np.zeros((3, 0)))
    >>> [round(float(r), 6) + 0.0 for r in rows.left], round(rows.degrees(np.arange(3))[0], 6)
    ([-1.0, 0.0, 1.0], 2.0)
    """

    r: Reals
    J: Reals
    names: tuple[str, ...]
    bounded: Reals
    kinds: tuple[str, ...]
    configurations: tuple[str, ...]
    modes: tuple[str, ...]
    sensors: tuple[str, ...]
    roles: tuple[Role, ...]
    shares: Reals
    lost: Reals
    of_modes: frozenset[str] = frozenset()
    untested: dict[str, str] = field(default_factory=dict)
    optimum: bool = True
    fixed: Reals = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        if not self.fixed.size:
            object.__setattr__(self, "fixed", np.zeros((len(self.r), 0)))

    @property
    def of_all_parameters(self) -> Whitened:
        """The record with the columns of all free parameters in J.

        The values of those that did not move are not known exactly: an earlier stage may have found them.
        """
        columns = np.hstack([self.J, self.bounded, self.fixed])
        return replace(self, J=columns, bounded=columns[:, :0], fixed=columns[:, :0])

    def without_kinds(self, why: Mapping[str, str]) -> Whitened:
        """The record without the rows of some kinds, with the reasons by kind."""
        return replace(self.of_rows(self.rows(lambda kind, *_: kind not in why)), untested={**self.untested, **why})

    def of_rows(self, at: NDArray[np.int64]) -> Whitened:
        """The record with some of its rows; a lost combination with other rows is none of them."""

        def chosen(labels: tuple[L, ...]) -> tuple[L, ...]:
            return tuple(labels[i] for i in at)

        lost = self.lost[:, ~np.any(np.delete(self.lost, at, axis=0), axis=0)][at]
        return replace(
            self, r=self.r[at], J=self.J[at], bounded=self.bounded[at], fixed=self.fixed[at], shares=self.shares[at],
            lost=lost, kinds=chosen(self.kinds), configurations=chosen(self.configurations),
            modes=chosen(self.modes), sensors=chosen(self.sensors), roles=chosen(self.roles),
        )  # fmt: skip

    def rows(self, chosen: Callable[[str, str, str, str], bool]) -> NDArray[np.int64]:
        """Positions of the rows for which a function of kind, configuration, mode and sensor is true."""
        labels = zip(self.kinds, self.configurations, self.modes, self.sensors)
        return np.flatnonzero([chosen(*of_row) for of_row in labels])

    def of_kind(self, kind: str) -> NDArray[np.int64]:
        """Positions of the rows of a kind."""
        return self.rows(lambda k, *_: k == kind)

    def across(self, columns: Reals) -> Reals:
        """P times vectors (n,) or (n, m)."""
        return np.asarray(columns - self.basis @ (self.basis.T @ columns))

    @cached_property
    def range(self) -> Reals:
        """U (n, rank): orthonormal basis of the range of J, across the combinations that are lost."""
        size = np.linalg.norm(self.J, axis=0)
        columns = self.J[:, size > 0.0] / size[size > 0.0]
        U, s, _ = np.linalg.svd(columns - self.lost @ (self.lost.T @ columns), full_matrices=False)
        return np.asarray(U[:, s > RANK * s.max(initial=0.0)])

    @cached_property
    def basis(self) -> Reals:
        """(n, m + rank): orthonormal basis of all that P takes away."""
        return np.hstack([self.lost, self.range])

    @cached_property
    def left(self) -> Reals:
        """(n,) P r; r without the combinations that are lost where the update ended without an optimum."""
        return self.across(self.r) if self.optimum else self.r - self.lost @ (self.lost.T @ self.r)

    def degrees(self, rows: NDArray[np.int64]) -> tuple[float, float]:
        """tr A and tr A² of the covariance A = S P Sᵀ of the residuals that are left in some rows."""
        part = self.basis[rows]
        gram, share = part.T @ part, float(self.shares[rows].sum())
        first = float(np.trace(gram))
        return share - first, share - 2.0 * first + float(np.sum(gram**2))


def whitened(result: UpdateResult, untested: str = "") -> Whitened | None:
    """The record at the end of an update; None without derivatives there.

    Parameters
    ----------
    untested : why no standard deviation of the data is known; "" where they are
    """
    if not result.after.has_derivatives:
        return None
    names = tuple(p.name for p in result.parameters.free)
    moving, bound = np.isin(names, result.active), np.isin(names, result.at_bound)
    return whitened_blocks(
        (*result.after.weighted, *prior_blocks(result)), result.parameters, moving & ~bound, moving & bound, untested,
        result.status.ok,
    )  # fmt: skip


def whitened_values(blocks: Sequence[ResidualBlock]) -> Reals:
    """(n,) the values alone, as in `whitened_blocks`: of blocks that need no derivatives."""
    kept = (b for b in blocks if not _why_not(b, ""))
    return np.concatenate([np.zeros(0), *(b.whitened().values for b in kept)])


def prior_blocks(result: UpdateResult, x: Reals | None = None) -> tuple[ResidualBlock, ...]:
    """The rows of a prior as blocks, one a parameter; none where the update has no prior.

    Parameters
    ----------
    x : the parameters, and others after them; those at the end of the update without it
    """
    side, parameters = result.side, result.parameters
    values, rows = side.rows(result.x if x is None else x[: len(result.x)])
    known = np.flatnonzero(np.broadcast_to(side.informative, len(values)))
    if not len(known):
        return ()
    # rows of correlated parameters are mixtures; each is named by the parameter that it moves with most
    names = [parameters.free[int(np.argmax(np.abs(rows[i] * parameters.prior[1])))].name for i in known]
    return tuple(
        ResidualBlock(PRIOR, "", name, values[[i]], rows[[i]], 1.0) for i, name in zip(known, names, strict=True)
    )


def whitened_blocks(
    blocks: Sequence[ResidualBlock],
    parameters: ParameterSet,
    free: NDArray[np.bool_],
    at_bound: NDArray[np.bool_],
    untested: str = "",
    optimum: bool = True,
) -> Whitened:
    """The record of blocks with derivatives.

    Parameters
    ----------
    free, at_bound : (k,) parameters that the update moves between their bounds, and at a bound
    """
    why = {b.kind: reason for b in blocks if (reason := _why_not(b, untested))}
    kept = [b.whitened() for b in blocks if b.kind not in why]
    spread = parameters.prior[1]
    J = np.vstack([np.zeros((0, len(spread))), *(b.jacobian for b in kept)]) * spread
    return Whitened(
        r=np.concatenate([np.zeros(0), *(b.values for b in kept)]),
        J=J[:, free],
        names=tuple(p.name for p, moves in zip(parameters.free, free) if moves),
        bounded=J[:, at_bound],
        kinds=tuple(b.kind for b in kept for _ in b.values),
        configurations=tuple(b.configuration for b in kept for _ in b.values),
        modes=tuple(mode for b in kept for mode in b.modes or (b.mode,) * len(b.values)),
        sensors=tuple(sensor for b in kept for sensor in b.sensors or ("",) * len(b.values)),
        roles=tuple("prior" if b.kind == PRIOR else "data" for b in kept for _ in b.values),
        shares=np.concatenate([np.zeros(0), *(_shares(b) for b in kept)]),
        lost=la.block_diag(np.zeros((0, 0)), *(b.directions for b in kept)),
        of_modes=frozenset(b.kind for b in kept if b.of_mode),
        untested=why,
        optimum=optimum,
        fixed=J[:, ~(free | at_bound)],
    )


def _why_not(block: ResidualBlock, untested: str) -> str:
    return "" if block.kind == PRIOR else untested or block.without_distribution


def _shares(block: ResidualBlock) -> Reals:
    """Share of each row, for the combinations that are lost and of which only the number is known."""
    n, unknown = len(block.values), block.lost - block.directions.shape[1]
    return np.full(n, 1.0 - unknown / n if n else 1.0)
