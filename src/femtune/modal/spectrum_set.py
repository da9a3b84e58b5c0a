"""Measured auto and cross spectra of responses."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError

Pair = tuple[Dof, Dof]
"""Response and reference of a spectrum."""
_MOST_TOLD = 5
"""Pairs that a message lists."""

_NEGATIVE = 0.01
"""Negative values of an auto spectrum over its largest one, that rounding and transforms of correlations have."""


@dataclass(frozen=True, eq=False)
class SpectrumSet:
    """Auto and cross spectra E[Y_i Y_j*] of responses i with the references j, which are some of the responses.

    Parameters
    ----------
    freq_hz : (k,) frequency lines
    values : (responses, references, k) complex; of the Fourier transform of the reference the conjugate is taken
    responses, references : the DOFs of the first two axes
    quantities : (responses,) what each response is
    source : origin of the spectra, a text
    """

    freq_hz: NDArray[np.float64]
    values: NDArray[np.complex128]
    responses: DofSet
    references: DofSet
    quantities: tuple[str, ...]
    source: str = ""

    @property
    def reference_rows(self) -> list[int]:
        """Positions of the references among the responses."""
        return [list(self.responses).index(dof) for dof in self.references]


def spectrum_set(
    freq_hz: NDArray[np.float64],
    pairs: Mapping[Pair, NDArray],
    quantities: Mapping[Dof, str] | None = None,
    source: str = "",
) -> SpectrumSet:
    """The spectra of all responses with each reference that has them; S_ji is the conjugate of S_ij.

    Parameters
    ----------
    freq_hz : (k,) frequency lines of all spectra
    pairs : (k,) each; of S_ij and S_ji one suffices
    quantities : of the responses; "unknown" where it is not stated

    Raises
    ------
    FemtuneError : ``identify.spectra`` if no response has cross spectra with all others; ``identify.spectra/autos`` if
        there are auto spectra only; ``identify.spectra/values`` for values that are not finite, and negative autos

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.dofs import parse_dof
    >>> a, b = parse_dof("1Z+"), parse_dof("2Z+")
    >>> spectra = spectrum_set(np.array([1.0, 2.0]), {(a, a): np.ones(2), (b, a): np.array([0.5j, 0.2])})
    >>> spectra.values[:, 0, 0], spectra.references.labels()
    (array([1. +0.j , 0. +0.5j]), ['1Z+'])
    """
    whole = {**{(j, i): np.conj(values) for (i, j), values in pairs.items()}, **pairs}
    responses = list(dict.fromkeys(dof for pair in pairs for dof in pair))
    for (i, j), values in whole.items():
        if not np.isfinite(values).all() or (i == j and values.real.min() < -_NEGATIVE * values.real.max()):
            raise FemtuneError("identify.spectra/values", response=i, reference=j)
    if all(i == j for i, j in pairs):
        raise FemtuneError("identify.spectra/autos", values={"auto spectra": _listed(responses)})
    references = [j for j in responses if all((i, j) in whole for i in responses)]
    if not references:
        missing = [f"{i}/{j}" for j in responses for i in responses if (i, j) not in whole]
        raise FemtuneError("identify.spectra", values={"responses": len(responses), "missing": _listed(missing)})
    values = np.array([[whole[i, j] for j in references] for i in responses], dtype=complex)
    stated = quantities or {}
    kinds = tuple(stated.get(dof, "unknown") for dof in responses)
    return SpectrumSet(freq_hz, values, DofSet(responses), DofSet(references), kinds, source)


def _listed(words: Iterable[object]) -> str:
    every = list(map(str, words))
    return ", ".join(every[:_MOST_TOLD]) + (f" and {len(every) - _MOST_TOLD} more" if len(every) > _MOST_TOLD else "")
