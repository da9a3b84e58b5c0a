"""Modes of the model that are left out of the FRFs that a residual compares, followed through the update.

A test may not show a mode of the model: its shaker or its sensors hardly move in it, or the identification missed it.
Such a mode is named by its frequency at the initial values. At any other values it is the mode that has most of the
momentum of the named one, so that it does not depend on the way there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.modal.assignment import linear_sum_assignment
from femtune.model import EigenSolution

NEAR = 0.02
"""A mode is named by a frequency that differs from its own by this at most, relative."""
_NEAREST_SHOWN = 2
"""Nearest modes that a message names."""


@dataclass(frozen=True, eq=False)
class LeftOutModes:
    """Modes at the initial values.

    Parameters
    ----------
    numbers : (m,) positions in the solution at the initial values
    freq_hz : (m,) natural frequencies there
    momentum : φᵀM there (m, n_free)
    """

    numbers: tuple[int, ...]
    freq_hz: Reals
    momentum: Reals = field(repr=False)

    def found(self, seen: Reals) -> tuple[tuple[int, ...], Reals]:
        """Positions of the modes among others, and the squares of their correlations φ₀ᵀM₀φ (m,).

        Parameters
        ----------
        seen : (m, n) `momentum` times the shapes of n modes of unit modal mass
        """
        likeness = np.minimum(np.asarray(seen) ** 2, 1.0)
        rows, columns = linear_sum_assignment(-likeness)
        at = tuple(int(j) for _, j in sorted(zip(rows, columns)))
        return at, likeness[np.arange(len(at)), list(at)]

    def of(self, modes: EigenSolution) -> tuple[tuple[int, ...], Reals]:
        """The same among the wanted modes of the full model."""
        return self.found(self.momentum @ modes.shapes[:, : modes.wanted])


def left_out_modes(modes: EigenSolution, asked_hz: Sequence[float], configuration: str) -> LeftOutModes:
    """The modes nearest to some frequencies, each once.

    Parameters
    ----------
    modes : at the initial values

    Raises
    ------
    FemtuneError : ``residual.left-out-mode`` where no mode is near a frequency, or fewer than frequencies
    """
    hertz = modes.freq_hz
    far = np.abs(hertz[None, :] / np.asarray(asked_hz)[:, None] - 1.0)
    # forbidden pairs cost more than all others together
    _, at = linear_sum_assignment(np.where(far <= NEAR, far, 1.0 + len(asked_hz)))
    for i, j in enumerate(at):
        if far[i, j] > NEAR:
            raise _not_near(hertz, asked_hz[i], configuration)
    numbers = tuple(sorted(int(j) for j in at))
    some = list(numbers)
    momentum = np.ascontiguousarray((modes.point.mass @ modes.shapes[:, some]).T)
    return LeftOutModes(numbers, hertz[some], momentum)


def _not_near(hertz: Reals, asked_hz: float, configuration: str) -> FemtuneError:
    nearest = np.sort(hertz[np.argsort(np.abs(hertz - asked_hz))[:_NEAREST_SHOWN]])
    return FemtuneError(
        "residual.left-out-mode", values={"nearest (Hz)": ", ".join(f"{hz:.5g}" for hz in nearest)},
        configuration=configuration, asked=asked_hz, near=100.0 * NEAR,
    )  # fmt: skip
