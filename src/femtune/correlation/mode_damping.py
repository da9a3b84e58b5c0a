"""Measured damping ratios for the modes of a model that are paired with those of a test."""

from __future__ import annotations

import numpy as np

from femtune.arrays import Reals
from femtune.correlation.pairing import Pairing
from femtune.errors import FemtuneError
from femtune.modal import ModeSet


def paired_damping(test: ModeSet, pairing: Pairing, count: int, others: float | None = None) -> Reals:
    """(count,) damping ratios of the modes of a model: the measured one where a mode is paired.

    An update with equalised damping gives no damping of single modes. For FRFs to be compared with measured
    ones afterwards, each paired mode gets that of its partner. Give the result to `damping_by_mode`.

    Parameters
    ----------
    test : with damping ratios; NaN where a mode has none
    pairing : of the calibrated model, from `pair_modes`
    count : number of modes of the model, rigid-body modes included
    others : for modes without partner; None for the median of the paired ones

    Raises
    ------
    FemtuneError : ``correlate.no-damping`` where no paired mode has a damping ratio

    Examples
    --------
    >>> from femtune.correlation import pair_modes
    >>> from femtune.dofs import DofSet, parse_dof
    >>> dofs = DofSet([parse_dof("1X+"), parse_dof("2X+")])
    >>> test = ModeSet([10.0, 21.0], np.array([[1.0, 1.0], [0.5, -0.6]]), dofs, damping_ratio=[0.01, 0.03])
    >>> model = ModeSet([10.2, 20.4], np.array([[1.0, 1.0], [0.55, -0.5]]), dofs)
    >>> paired_damping(test, pair_modes(test, model), 3).tolist()
    [0.01, 0.03, 0.02]
    """
    given = np.full(len(test), np.nan) if test.damping_ratio is None else np.asarray(test.damping_ratio, float)
    out = np.full(count, np.nan)
    for pair in pairing.pairs:
        if pair.model < count:
            out[pair.model] = given[pair.test]
    known = np.isfinite(out)
    if not known.any():
        raise FemtuneError("correlate.no-damping", test=test.source or "the test")
    out[~known] = float(np.median(out[known])) if others is None else others
    return out
