"""The residuals that a page can compute from frequencies and shapes alone, and their values."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.residuals.frequency import FrequencyResidual
from femtune.residuals.mac import MacResidual
from femtune.residuals.pair import ByMode, OfModes
from femtune.residuals.shape import ShapeResidual, scaled_difference

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.residuals import CaseState, Evaluation
    from femtune.residuals.case import PairedMode, Residual
    from femtune.residuals.pair import PairResidual
    from femtune.steps.live.record import LiveQuantity

_MOST_ENTRIES = 120
"""Entries of a shape up to which a matrix of weights is found."""
_SAME = 1e-6
"""Relative difference of two sums of squares that are the same."""


@dataclass(frozen=True, eq=False)
class PagePart:
    """Residuals of one pair as functions of its frequency and shape.

    Parameters
    ----------
    kind, quantity, form, test : as in `LivePart`
    sd : standard deviation; 1 with `weights`
    sensors : (m,) rows of the sensors that are compared
    weights : (n, n) matrix that makes residuals of the differences of a shape, None where `sd` does
    common : change of the residual by the error that all frequencies share
    """

    kind: str
    quantity: LiveQuantity
    form: str
    test: int
    sd: float
    sensors: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    weights: Reals | None = None
    common: float = 0.0

    def values(self, eigenvalue: float, shape: Reals, test_hz: float, test_shape: Reals) -> Reals:
        """The residuals of a model mode (shape at all sensors) and a test mode."""
        if self.quantity == "frequency":
            ratio = eigenvalue / (2.0 * np.pi * test_hz) ** 2
            return np.array([((np.sqrt(max(ratio, 0.0)) if self.form == "frequency" else ratio) - 1.0) / self.sd])
        if self.quantity == "mac":
            known = ~np.isnan(test_shape)
            phi, psi = shape[known], test_shape[known]
            root = abs(float(phi @ psi)) / (np.linalg.norm(phi) * np.linalg.norm(psi))
            value = {"root": (1.0 - root) / root, "ratio": (1.0 - root**2) / root**2, "difference": 1.0 - root**2}
            return np.array([value[self.form] / self.sd])
        errors = _differences(shape[self.sensors], test_shape[self.sensors], self.form)
        return errors / self.sd if self.weights is None else self.weights @ errors


def _differences(shape: Reals, test: Reals, form: str) -> Reals:
    return scaled_difference(shape, np.zeros((len(shape), 0)), test, form)[0]  # type: ignore[arg-type]


def page_parts(at: Evaluation, position: int, residuals: Sequence[Residual], known: Collection[int]) -> list[PagePart]:
    """The residuals of one configuration that a page can compute, each checked against its own values.

    Parameters
    ----------
    at : the updated point
    position : of the configuration among the states
    residuals : of paired modes in all configurations
    known : positions of the test modes whose pairs the page follows
    """
    state = at.states[position]
    pairs = list(state.pairs(False))
    parts = [
        part
        for residual in (*residuals, *state.case.residuals)
        for one, labels in _single(residual, None)
        for pair in pairs
        if pair.position in known
        if labels is None or pair.label in labels
        if (part := _part(one, pair, at.common_sd)) is not None
    ]
    return _whole_kinds(parts, at, state)


def _whole_kinds(parts: list[PagePart], at: Evaluation, state: CaseState) -> list[PagePart]:
    """Those of kinds whose sum of squares in this configuration is that of the residuals."""
    wanted: dict[str, float] = {}
    for block in at.blocks:
        if block.configuration == state.case.name:
            wanted[block.kind] = wanted.get(block.kind, 0.0) + float(block.values @ block.values)
    found: dict[str, float] = {}
    by_test = {pair.position: pair for pair in state.pairs(False)}
    for part in parts:
        pair = by_test[part.test]
        values = part.values(pair.eigenvalue, pair.shape, pair.test_hz, pair.test_shape)
        found[part.kind] = found.get(part.kind, 0.0) + float(values @ values)
    same = {k for k, v in found.items() if abs(v - wanted.get(k, np.inf)) <= _SAME * max(abs(v), 1.0)}
    return [part for part in parts if part.kind in same]


def _single(
    residual: Residual, labels: tuple[str, ...] | None
) -> Iterator[tuple[PairResidual, tuple[str, ...] | None]]:
    """Residuals of single pairs, with the labels of the modes that they are limited to."""
    if isinstance(residual, ByMode):
        for part in residual.parts:
            yield from _single(part, labels)
    elif isinstance(residual, OfModes):
        yield from _single(residual.residual, residual.labels if labels is None else labels)
    elif type(residual) in (FrequencyResidual, MacResidual, ShapeResidual):
        yield residual, labels  # type: ignore[misc]


def _part(residual: PairResidual, pair: PairedMode, common_sd: float) -> PagePart | None:
    plain = replace(pair, shape_gradient=np.zeros((len(pair.shape), 0)), eigenvalue_gradient=np.zeros(0), state=None)
    block = residual.of_pair(plain)
    if isinstance(residual, FrequencyResidual):
        common = 0.0 if block.common is None else common_sd * float(block.common[0])
        return PagePart(block.kind, "frequency", residual.form, pair.position, block.sd, common=common)
    if isinstance(residual, MacResidual):
        return PagePart(block.kind, "mac", residual.form, pair.position, block.sd)
    assert isinstance(residual, ShapeResidual)
    return _of_shape(residual, plain)


def _of_shape(residual: ShapeResidual, pair: PairedMode) -> PagePart | None:
    """The weights of the differences of a shape, found from the residuals of other shapes."""
    dofs = pair.case.test.dofs
    wanted = dofs if residual.sensors is None else residual.sensors
    rows = np.array([i for i, dof in enumerate(dofs) if dof in set(wanted)], np.int64)
    if len(rows) > _MOST_ENTRIES:
        return None
    random = np.random.default_rng(1)
    size = np.nanmax(np.abs(pair.shape[rows])) or 1.0
    errors, values = [], []
    for _ in range(len(rows) + 8):
        shape = pair.shape.copy()
        shape[rows] += size * random.standard_normal(len(rows))
        errors.append(_differences(shape[rows], pair.test_shape[rows], residual.scaling))
        values.append(residual.of_pair(replace(pair, shape=shape)).values)
    E, R = np.array(errors), np.array(values)
    if E.shape != R.shape:
        return None
    W, *_ = np.linalg.lstsq(E, R, rcond=None)
    if np.abs(E @ W - R).max() > 1e-6 * np.abs(R).max():
        return None
    label = residual.label
    diagonal = float(np.mean(np.diag(W)))
    if np.abs(W - diagonal * np.eye(len(W))).max() <= 1e-6 * abs(diagonal):
        return PagePart(label, "shape", residual.scaling, pair.position, 1.0 / diagonal, rows)
    return PagePart(label, "shape", residual.scaling, pair.position, 1.0, rows, np.asarray(W.T, float))
