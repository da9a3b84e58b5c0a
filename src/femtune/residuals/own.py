"""Residuals of a user's own: any object with a method ``blocks``, whose answers are checked."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any

import numpy as np

from femtune.errors import FemtuneError
from femtune.residuals.case import CaseState, Residual
from femtune.residuals.weights import ResidualBlock


def own_residual(given: Any) -> Residual:
    """A residual of this package as it is; any other object with its answers checked."""
    return given if type(given).__module__.partition(".")[0] == "femtune" else OwnResidual(given)


@dataclass(frozen=True, eq=False)
class OwnResidual(Residual):
    """A residual of a user's own class, which need not be a subclass of `Residual`.

    Parameters
    ----------
    own : has a method ``blocks(state, derivatives)``; its attributes `key`, `label`, `of_modes`, `on_modes`,
        `not_normal` and `of_ratio` are used where it has them
    """

    own: Any

    def __post_init__(self) -> None:
        for name in ("key", "label", "of_modes", "on_modes", "not_normal"):
            object.__setattr__(self, name, getattr(self.own, name, getattr(Residual, name)))

    @property
    def of_ratio(self) -> bool:
        """See `Residual`."""
        return bool(getattr(self.own, "of_ratio", False))

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        """See `Residual`; error ``residual.own`` for an answer that cannot be used."""
        # a deck with the updated values has no parameters
        wanted = derivatives and bool(len(state.point.x))
        blocks = checked_blocks(self.own.blocks(state, wanted), self.own, len(state.point.x) if wanted else None)
        return blocks if wanted else [replace(b, jacobian=np.zeros((len(b.values), 0))) for b in blocks]

    def of_kinds(self, keys: Collection[str]) -> Residual | None:
        """See `Residual`."""
        return self if self.key in keys else None

    def in_band(self, low_hz: float, high_hz: float) -> Residual:
        """See `Residual`."""
        return OwnResidual(self.own.in_band(low_hz, high_hz)) if hasattr(self.own, "in_band") else self


def checked_blocks(blocks: Any, residual: object, parameters: int | None) -> Sequence[ResidualBlock]:
    """What ``blocks`` of a residual returned: a residual of a user's own may return anything.

    Parameters
    ----------
    parameters : k, the number of columns of each Jacobian; None where derivatives were not wanted

    Raises
    ------
    FemtuneError : ``residual.own`` with the class of the residual, what was found and what is expected
    """
    name = type(residual).__name__
    if not isinstance(blocks, Sequence):
        type_name = type(blocks).__name__
        raise FemtuneError(
            "residual.own", values={"found": type_name, "expected": "a list of ResidualBlock"}, residual=name
        )
    for i, block in enumerate(blocks):
        if not isinstance(block, ResidualBlock):
            values = {f"found at {i}": type(block).__name__, "expected": "ResidualBlock"}
            raise FemtuneError("residual.own", values=values, residual=name)
        _check_shapes(block, i, name, parameters)
    return blocks


def _check_shapes(block: ResidualBlock, i: int, residual: str, parameters: int | None) -> None:
    """Refuse a block whose arrays do not belong together (error ``residual.own``)."""
    n = np.size(block.values)
    expected: dict[str, tuple[int, ...]] = {"values": (n,)}
    if parameters is not None:
        expected["jacobian"] = (n, parameters)
    if block.covariance is not None:
        expected["covariance"] = (n, n)
    for argument, shape in expected.items():
        array = getattr(block, argument)
        if np.shape(array) != shape or not isinstance(array, np.ndarray) or array.dtype.kind not in "fiu":
            kind = f" of {array.dtype}" if isinstance(array, np.ndarray) else f" ({type(array).__name__})"
            values = {f"{argument} of block {i}": f"{np.shape(array)}{kind}", "expected": f"{shape} of real numbers"}
            raise FemtuneError("residual.own/shape", values=values, residual=residual, argument=argument)
    if not isinstance(block.sd, Real) or not block.sd > 0.0:
        raise FemtuneError("residual.own/sd", values={f"sd of block {i}": block.sd}, residual=residual)
    if not np.isfinite(block.values).all():
        raise FemtuneError("residual.own/not-finite", values={f"values of block {i}": block.values}, residual=residual)
