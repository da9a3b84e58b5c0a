"""Sensors whose channels were exchanged: a swap of two of them explains most of the misfit of the shapes."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.dofs import DofSet
from femtune.errors import Notice

_LEAST_PART = 0.08
"""Part of the misfit of all shapes that every swap must remove."""
_LEAST_LEAD = 2.5
"""Least decrease of the misfit by every swap over that by the best further swap. Errors of a model are spread over many
sensors, so that several swaps offer a little, and none stands out."""
_LEAST_RATIO = 12.0
"""Least decrease of the misfit over the mean misfit of an entry that is left. The best of all swaps that noise offers
decreases the misfit by less: its exchange adds (φa − φb)² wherever the model is right."""
_LEAST_MISFIT = 1e-4
"""Misfit 1 − MAC, mean over the modes, below which there is nothing to explain."""
_GOOD_MAC = 0.8
"""MAC after the swaps from which a test mode without a partner before counts as one that they explain."""
_MOST_SWAPS = 5
"""Exchanges that are looked for, one after the other."""
_ROW_LEFT = 0.8
"""Largest part of the misfit of each of its two rows that a swap may leave."""
_FEWEST_SENSORS = 4
"""Sensors from which an exchange can be recognised."""
_MOST_SENSORS = 1000
"""Sensors up to which all pairs of them are tried."""
_FEWEST_MODES = 2
"""Test modes with a good partner from which a swap means something."""


@dataclass(frozen=True, eq=False)
class Shapes:
    """Test shapes and what each may be compared with.

    Parameters
    ----------
    test : (n, t) test shapes, NaN where not measured
    model : (n, c) possible partners
    allowed : (t, c) which partner a test mode may have
    paired : (t,) True for test modes that have one
    """

    test: NDArray
    model: Reals
    allowed: NDArray[np.bool_]
    paired: NDArray[np.bool_]


def exchanged_sensors(shapes: Shapes, leave: Collection[int] = ()) -> list[tuple[int, int]]:
    """Pairs of rows of the test shapes whose exchange makes them agree with the model.

    A swap of rows a and b changes ψᵀφ by −(ψa − ψb)(φa − φb), and no norm. The swap with the largest sum of the best
    MACs of all test modes is made, and the next one looked for. As many swaps are believed as stand out from the next
    one, remove a part of the misfit each, and far more than is left.

    Parameters
    ----------
    leave : rows that are explained otherwise, such as inverted sensors
    """
    known = ~(np.isnan(shapes.test).any(axis=1) | np.isnan(shapes.model).any(axis=1))
    known[list(leave)] = False
    rows = np.flatnonzero(known)
    if not _FEWEST_SENSORS <= len(rows) <= _MOST_SENSORS or len(shapes.paired) < _FEWEST_MODES:
        return []
    test, model = _unit(shapes.test[rows]), _unit(shapes.model[rows])
    exchanges: list[tuple[int, int]] = []
    gains: list[float] = []
    proven = 0
    before = best = _best_macs(test.conj().T @ model, shapes.allowed)
    while len(exchanges) <= _MOST_SWAPS and np.mean(1.0 - best) >= _LEAST_MISFIT:
        a, b = _best_swap(test, model, shapes.allowed)
        test[[a, b]] = test[[b, a]]
        after = _best_macs(test.conj().T @ model, shapes.allowed)
        gain = float((after - best).sum())
        if gains and min(gains) >= _LEAST_LEAD * gain and _explained(before, best, shapes.paired, len(rows)):
            proven = len(exchanges)
        counted = shapes.paired | (after >= _GOOD_MAC)
        if gain < _LEAST_PART * (1.0 - best)[counted].sum() or not _both_fit(
            test, model, shapes.allowed, counted, (a, b)
        ):
            break
        exchanges.append((int(rows[a]), int(rows[b])))
        gains.append(gain)
        best = after
    else:
        if gains and _explained(before, best, shapes.paired, len(rows)):
            proven = len(exchanges)
    return exchanges[:proven]


def _explained(before: Reals, after: Reals, paired: NDArray[np.bool_], rows: int) -> bool:
    """Whether the swaps remove far more misfit of the modes that have a good partner than they leave."""
    counted = paired | (after >= _GOOD_MAC)
    first, left = (float((1.0 - macs)[counted].sum()) for macs in (before, after))
    return int(counted.sum()) >= _FEWEST_MODES and (first - left) * rows * int(counted.sum()) >= _LEAST_RATIO * left


def _both_fit(
    test: NDArray, model: Reals, allowed: NDArray[np.bool_], counted: NDArray[np.bool_], pair: tuple[int, int]
) -> bool:
    """Whether the swap that was made removes misfit from both rows: a channel that is dead, noisy or has a wrong factor
    is one bad row, and its swap makes the other row bad."""
    products = test.conj().T @ model
    partner = np.argmax(np.where(allowed, np.abs(products) ** 2, -1.0), axis=1)
    fit = model[:, partner] * products[np.arange(len(partner)), partner].conj()
    a, b = pair
    after = [float((np.abs(test[k] - fit[k]) ** 2)[counted].sum()) for k in (a, b)]
    before = [float((np.abs(test[other] - fit[k]) ** 2)[counted].sum()) for k, other in ((a, b), (b, a))]
    return all(now <= _ROW_LEFT * then for now, then in zip(after, before, strict=True))


def _unit(shapes: NDArray) -> NDArray:
    norm = np.linalg.norm(shapes, axis=0)
    return shapes / np.where(norm > 0.0, norm, 1.0)


def _best_macs(products: NDArray, allowed: NDArray[np.bool_]) -> Reals:
    """(…, t) largest MAC of each test mode with an allowed partner, from products of unit shapes (…, t, c)."""
    return np.asarray(np.where(allowed, np.abs(products) ** 2, 0.0).max(axis=-1))


def _best_swap(test: NDArray, model: Reals, allowed: NDArray[np.bool_]) -> tuple[int, int]:
    """The two rows whose swap gives the largest sum of the best MACs."""
    products, best = test.conj().T @ model, (-1.0, 0, 1)
    for a in range(len(test) - 1):
        steps = (test[a] - test[a + 1 :]).conj()[:, :, None] * (model[a] - model[a + 1 :])[:, None, :]
        sums = _best_macs(products - steps, allowed).sum(axis=1)
        b = int(np.argmax(sums))
        best = max(best, (float(sums[b]), a, a + 1 + b))
    return best[1], best[2]


def exchange_notices(dofs: DofSet, shapes: Shapes, leave: Collection[int]) -> tuple[Notice, ...]:
    """A notice that names exchanged sensors."""
    exchanges = exchanged_sensors(shapes, leave)
    if not exchanges:
        return ()
    named = " and ".join(f"{dofs[a]} with {dofs[b]}" for a, b in exchanges)
    return (Notice("correlate.sensors-exchanged", modes=int(shapes.paired.sum()), sensors=named),)
