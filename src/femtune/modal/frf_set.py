"""FrfSet: frequency response functions between references and responses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import DofSet
from femtune.errors import FemtuneError

KINDS = ("receptance", "mobility", "accelerance")


@dataclass(frozen=True)
class FrfSet:
    """Frequency response functions, convention e^{iωt}.

    Parameters
    ----------
    freq_hz : (k,) frequency lines
    values : (responses, references, k) complex; NaN where a pair was not measured
    responses, references : the DOFs of the first two axes
    kind : one of KINDS
    coherence : (responses, references, k) or None
    """

    freq_hz: NDArray[np.float64]
    values: NDArray[np.complex128]
    responses: DofSet
    references: DofSet
    kind: str
    coherence: NDArray[np.float64] | None = None
    source: str = ""

    def __post_init__(self) -> None:
        wanted = (len(self.responses), len(self.references), len(self.freq_hz))
        if self.values.shape != wanted:
            raise FemtuneError("frf.shape", f"values have shape {self.values.shape}, wanted {wanted}")
        if self.kind not in KINDS:
            raise FemtuneError("frf.kind", f"'{self.kind}' is not a kind of FRF", hint="one of " + ", ".join(KINDS))
