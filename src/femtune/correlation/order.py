"""Pairing of frequencies that were measured without shapes: by their order, and doubts about this order.

A test that misses one mode shifts the partners of all higher ones. No MAC tells, but the frequency ratios do: under the
right order they scatter about a common factor by the error of single modes, under a shifted one by the distances
between neighbouring modes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals

_FLOOR = 2e-3
"""Scatter of ln(model/test) below which orders are alike: errors of measured frequencies and of meshes are as large."""
_LEAST_MODES = 4
"""Test modes from which an order is doubted: two of three ratios agree by chance too often."""
_LEAST_SHIFTED = 2
"""Modes that another order has to shift: a single one may be better by chance anywhere."""
_EVIDENCE = 2.0
"""Gain in log likelihood of the scatter, beyond the logarithm of the number of orders tried, from which the order is
doubted. Of simulated lists of 5 to 12 modes at most 1.5 % are doubted wrongly; of those that miss a mode 91 to 100 %
are found where single modes of the model are 2 % off, 73 to 100 % where they are 4 % off."""


@dataclass(frozen=True)
class OtherOrder:
    """Another pairing in ascending order: one mode is left out on one side.

    Parameters
    ----------
    partners : model position of each test position
    skipped : positions of the modes without partner
    of_model : True if they are modes of the model, which the test misses; else of the test, which the model does not
        have
    scatter : root mean square of ln(model/test) about its mean
    """

    partners: dict[int, int]
    skipped: tuple[int, ...]
    of_model: bool
    scatter: float


def in_ascending_order(
    test_hz: Reals, modes: int, fixed: Sequence[tuple[int, int]] = (), rigid: int = 0
) -> dict[int, int]:
    """Model position of each test position, both in ascending order of frequency.

    Parameters
    ----------
    test_hz : (t,)
    modes : number of model modes, in ascending order
    fixed : pairs made by hand; test modes above one of them continue from there
    rigid : the first modes of the model, which are rigid-body modes; only `fixed` pairs them

    Examples
    --------
    >>> import numpy as np
    >>> in_ascending_order(np.array([10.0, 30.0, 20.0]), 5)
    {0: 0, 2: 1, 1: 2}
    >>> in_ascending_order(np.array([10.0, 30.0, 20.0]), 5, fixed=[(2, 2)])
    {0: 0, 2: 2, 1: 3}
    """
    by_hand = dict(fixed)
    ascending = np.argsort(test_hz, kind="stable").tolist()
    partners: dict[int, int] = {}
    following = rigid
    for k, i in enumerate(ascending):
        # a test mode below one that is paired by hand stays below its partner
        end = min((by_hand[later] for later in ascending[k + 1 :] if later in by_hand), default=modes)
        if i in by_hand:
            partners[i] = by_hand[i]
        elif following < end:
            partners[i] = following
        following = max(following, partners.get(i, -1) + 1)
    return partners


def other_orders(test_hz: Reals, model_hz: Reals, partners: Mapping[int, int], rigid: int = 0) -> list[OtherOrder]:
    """Orders in which a mode of the model, or of the test, has no partner; the modes above it move by one."""
    ascending = sorted(partners, key=lambda i: (partners[i], i))
    models = [partners[i] for i in ascending]
    orders = []
    for k, j in enumerate(models):
        free = np.setdiff1d(np.arange(rigid, len(model_hz)), models[: k + 1])
        above = free[free > j][: len(models) - k]
        if len(above) == len(models) - k >= _LEAST_SHIFTED:
            new = dict(zip(ascending, [*models[:k], *above.tolist()]))
            orders.append(OtherOrder(new, (j,), True, scatter(test_hz, model_hz, new)))
    # of a free structure several of the first test modes may be those of the suspension
    for first, end in [*((k, k + 1) for k in range(len(ascending))), *((0, n) for n in range(2, rigid + 1))]:
        if len(models) - end >= _LEAST_SHIFTED:
            new = dict(zip([*ascending[:first], *ascending[end:]], models))
            orders.append(OtherOrder(new, tuple(ascending[first:end]), False, scatter(test_hz, model_hz, new)))
    return sorted(orders, key=lambda one: one.scatter)


def scatter(test_hz: Reals, model_hz: Reals, partners: Mapping[int, int]) -> float:
    """Root mean square of ln(model/test) of the pairs about its mean, with one degree of freedom less."""
    ratios = np.array([np.log(model_hz[j] / test_hz[i]) for i, j in partners.items()])
    return float(np.sqrt(np.sum((ratios - ratios.mean()) ** 2) / max(len(ratios) - 1, 1)))


def better_order(test_hz: Reals, model_hz: Reals, partners: Mapping[int, int], rigid: int = 0) -> OtherOrder | None:
    """The other order that explains the frequencies much better; None if none does, or with few modes."""
    kept = {i: j for i, j in partners.items() if model_hz[j] > 0.0 and test_hz[i] > 0.0}
    if len(kept) < _LEAST_MODES:
        return None
    others = other_orders(test_hz, model_hz, kept, rigid)
    if not others:
        return None
    gain = np.log((scatter(test_hz, model_hz, kept) + _FLOOR) / (others[0].scatter + _FLOOR))
    worth = (len(kept) - 1) * float(gain) - np.log(len(others))
    return others[0] if worth > _EVIDENCE else None
