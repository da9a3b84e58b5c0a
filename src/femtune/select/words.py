"""Identifiability in sentences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from femtune.select.identifiability import Combination, Identifiability

_WELL, _PARTLY, _SMALL = 1 / 3, 2 / 3, 0.1


def verdict(reduction: float) -> str:
    """What a posterior to prior ratio means for one parameter."""
    if reduction < _WELL:
        return "determined by the data"
    if reduction < _PARTLY:
        return "partly determined: the bounds or the prior still matter"
    return "not determined by these data"


def combination_text(names: tuple[str, ...], combination: Combination) -> str:
    """Such as ``+0.71 Icx2 −0.50 Ibx1``, small coefficients left out, in prior standard deviations."""
    c: NDArray = combination.coefficients
    order = [i for i in np.argsort(-np.abs(c)) if abs(c[i]) >= _SMALL * np.abs(c).max()]
    return " ".join(f"{'+' if c[i] > 0 else '−'}{abs(c[i]):.2f} {names[i]}" for i in order)


def sentences(result: Identifiability) -> list[str]:
    """What the data determine: undetermined combinations first, then weak ones; `verdict` speaks of parameters."""
    k, m = len(result.names), len(result.undetermined)
    if not k:
        return ["There is no free parameter."]
    out = [
        f"The data leave {_count(m)} of the {k} free parameters undetermined."
        if m
        else f"The data determine all {k} free parameters, some better than others."
    ]
    out += [_undetermined(result, c) for c in result.undetermined]
    return out + [_weak(result, c) for c in result.weak]


def _count(m: int) -> str:
    return "one combination" if m == 1 else f"{m} combinations"


def _undetermined(result: Identifiability, c: Combination) -> str:
    together = [
        result.names[i] for i in np.flatnonzero(np.abs(c.coefficients) >= _SMALL * np.abs(c.coefficients).max())
    ]
    if len(together) == 1:
        return f"{together[0]} changes nothing that was measured: fix it, or measure where it acts."
    return (
        f"Moving {listed(together)} together ({combination_text(result.names, c)}) changes nothing that was measured "
        f"by more than {c.singular_value:.1g} of its uncertainty: fix one of them, tie two, or measure something else."
    )


def _weak(result: Identifiability, c: Combination) -> str:
    return (
        f"The combination {combination_text(result.names, c)} is weakly determined: "
        f"its spread only falls to {100 * c.reduction:.0f} % of the prior's."
    )


def listed(names: Sequence[str]) -> str:
    """ "a, b and c"."""
    return " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else "".join(names)
