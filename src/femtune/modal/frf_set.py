"""FrfSet: frequency response functions between references and responses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.modal.mode_set import read_only

KINDS = ("receptance", "mobility", "accelerance")


@dataclass(frozen=True, eq=False)
class FrfSet:
    """Frequency response functions, convention e^{iωt}; its arrays are read-only.

    Parameters
    ----------
    freq_hz : (k,) frequency lines
    values : (responses, references, k) complex; NaN where a pair was not measured
    responses, references : the DOFs of the first two axes
    kind : one of KINDS
    coherence : (responses, references, k) or None
    source : where they come from, in words
    response_names, reference_names : names of the axes where some of them are combinations of DOFs, which bear the
        label of the one DOF that they stand for; empty where the labels say all

    Raises
    ------
    FemtuneError : ``frf.shape`` where the sizes disagree, ``frf.kind``, ``frf.values`` for frequency lines that are
        not finite, negative or do not increase, or infinite values
    """

    freq_hz: NDArray[np.float64]
    values: NDArray[np.complex128]
    responses: DofSet
    references: DofSet
    kind: str
    coherence: NDArray[np.float64] | None = None
    source: str = ""
    response_names: tuple[str, ...] = ()
    reference_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "freq_hz", read_only(self.freq_hz, float))
        object.__setattr__(self, "values", read_only(self.values, complex))
        object.__setattr__(self, "coherence", read_only(self.coherence, float))
        if self.kind not in KINDS:
            raise FemtuneError("frf.kind", f"'{self.kind}' is not a kind of FRF", hint="one of " + ", ".join(KINDS))
        self._check_sizes()
        self._check_values()

    def _check_sizes(self) -> None:
        wanted = (len(self.responses), len(self.references), np.size(self.freq_hz))
        for name, array in (("values", self.values), ("coherence", self.coherence)):
            if array is not None and array.shape != wanted:
                raise FemtuneError("frf.shape", f"{name} has shape {array.shape}, wanted {wanted}")
        for names, wanted_names in ((self.response_names, wanted[0]), (self.reference_names, wanted[1])):
            if names and len(names) != wanted_names:
                raise FemtuneError("frf.shape", f"{len(names)} names for {wanted_names} rows or columns")

    def _check_values(self) -> None:
        lines = self.freq_hz
        if not np.isfinite(lines).all() or (lines < 0).any() or (np.diff(lines) <= 0).any():
            raise FemtuneError("frf.values", "frequency lines must be finite, not negative, and increase")
        if np.isinf(self.values).any():
            raise FemtuneError("frf.values", "a frequency response function has an infinite value")
