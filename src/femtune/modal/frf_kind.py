"""FRFs of another kind, and how two of them compare."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.modal.frf_set import KINDS, FrfSet


def as_kind(frfs: FrfSet, kind: str) -> FrfSet:
    """The same functions as receptance, mobility or accelerance: each is iω times the one before.

    At 0 Hz mobility and accelerance do not tell the receptance, which becomes NaN there; the other way they are 0.

    Raises
    ------
    FemtuneError : ``frf.kind``
    """
    if kind not in KINDS:
        raise FemtuneError("frf.kind", f"'{kind}' is not a kind of FRF", hint="one of " + ", ".join(KINDS))
    power = KINDS.index(kind) - KINDS.index(frfs.kind)
    i_omega = 2j * np.pi * frfs.freq_hz
    still = i_omega == 0.0
    factor = np.where(still, 1.0, i_omega) ** power
    if power:
        factor[still] = 0.0 if power > 0 else np.nan
    return replace(frfs, values=frfs.values * factor, kind=kind)


def frac(a: NDArray, b: NDArray) -> float | None:
    """Frequency response assurance criterion |aᴴb|²/(aᴴa · bᴴb) of two functions (k,) at the same lines.

    Lines where one of them is not known (NaN) do not count; None where nothing is left, or one is zero.

    Source: W. Heylen, S. Lammens, FRAC: a consistent way of comparing frequency response functions, 1996.
    """
    known = np.isfinite(a) & np.isfinite(b)
    a, b = a[known], b[known]
    a, b = (v / np.abs(v).max(initial=np.finfo(float).tiny) for v in (a, b))
    size = float(np.vdot(a, a).real * np.vdot(b, b).real)
    return float(abs(np.vdot(a, b)) ** 2 / size) if size > 0.0 else None
