"""FRFs of an identified test with one damping ratio beside those of a model: its damping, and their weights.

Near an antiresonance the identified FRF is a small difference of large terms. Its logarithm is far less certain there
than the stated standard deviation says, and not even normal; with the stated weights such lines decide the parameters.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from femtune.errors import Notice
from femtune.model import ModalDamping, damping_table
from femtune.residuals.frf.choice import lost_in_noise
from femtune.residuals.frf.residual import FrfResidual
from femtune.residuals.frf.scatter import ABOVE_NOISE


def equal_damping(ratio: float, band_hz: tuple[float, float], outside: float) -> ModalDamping:
    """One damping ratio for the modes of a model inside a band, and another for those outside it.

    Outside the band the poles of the test keep their damping, small as it is: a model with the ratio of the band there
    would have another phase, most of all at antiresonances.
    """
    low, high = band_hz
    ratios = (outside, outside, ratio, ratio, outside, outside)
    return damping_table((0.0, low, low, high, high, 2.0 * high), ratios, flat=True)


def weighted_by_identification(residual: FrfResidual) -> tuple[FrfResidual, tuple[Notice, ...]]:
    """The residual with the noise of its identified test in its standard deviations, and what is left out.

    Logarithms of values below three standard deviations of this noise are not compared. A function of which nothing
    would be left stays as it is.
    """
    test = residual.identified
    if test is None:
        return residual, ()
    rows, columns = (
        residual.measured.responses.align(test.measured.responses)[0],
        residual.measured.references.align(test.measured.references)[0],
    )
    lines = np.searchsorted(test.freq_hz, residual.measured.freq_hz)
    noise = test.equalised_sd[np.ix_(rows, columns, lines)]
    if residual.form != "linear":
        size = np.abs(residual.measured.values)
        noise = np.divide(noise, size, out=np.full(size.shape, np.inf), where=size > 0.0)
        noise = np.where(noise < 1.0 / ABOVE_NOISE, noise, np.nan)
    sd = np.hypot(residual.sd, noise)
    empty = ~np.isfinite(sd).any(axis=2, keepdims=True)
    weighted = replace(residual, sd=np.where(empty, residual.sd, sd))
    return weighted, tuple(lost_in_noise(weighted, np.isfinite(residual.sd)))
