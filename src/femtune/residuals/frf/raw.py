"""Measured FRFs in place of those of an identified test: the comparison that follows one with equal damping.

Source: the calibration of subframes, where the optimum with equal damping is the start of a calibration with the
measured FRFs, the measured damping ratios being those of the paired modes of the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from femtune.arrays import Reals
from femtune.identification.redrawn import RedrawnTest
from femtune.modal import FrfSet
from femtune.modal.equalise import Band
from femtune.model import ModalDamping
from femtune.residuals.frf.choice import weighted_residual
from femtune.residuals.frf.lines import Lines
from femtune.residuals.frf.residual import FrfResidual
from femtune.residuals.frf.scatter import ABOVE_NOISE, FrfScatter


def raw_residual(
    equalised: FrfResidual,
    test: RedrawnTest,
    measured: FrfSet,
    lines: Lines,
    scatter: FrfScatter,
    damping: ModalDamping,
    left_out_hz: Sequence[Band] = (),
) -> FrfResidual:
    """The comparison of the measured FRFs at the lines that were identified.

    Weights are smooth over the lines, so that they do not follow the noise of single values: magnitudes are those of
    the identified system. A value has the stated standard deviation, or that of the noise that the identification has
    found if this is larger. Logarithms of values below three standard deviations of the noise are not compared.

    Parameters
    ----------
    equalised : the comparison of the equalised test, at the result of the update with it
    test : the identified test behind it, with modes that were found since
    measured : the measured FRFs of its channels, NaN where they are held out
    lines, scatter : what is compared, and how exactly, by the study
    damping : of the modes of the model
    left_out_hz : bands that are not compared
    """
    rows, columns = (
        equalised.measured.responses.align(test.measured.responses)[0],
        equalised.measured.references.align(test.measured.references)[0],
    )
    at = np.isin(measured.freq_hz, test.measured.freq_hz)
    values = measured.values[:, :, at].copy()
    hertz = measured.freq_hz[at]
    for low, high in left_out_hz:
        values[:, :, (hertz >= low) & (hertz <= high)] = np.nan
    coherence = None if measured.coherence is None else measured.coherence[:, :, at]
    used = replace(measured, freq_hz=hertz, values=values, coherence=coherence)
    smooth = test.functions_at(hertz)[np.ix_(rows, columns)]
    smooth = np.where(np.isfinite(values), smooth, np.nan)
    noise = test.noise_sd[np.ix_(rows, columns)]
    residual = weighted_residual(
        equalised.configuration, replace(used, values=smooth), equalised.places, lines, equalised.form, scatter,
        replace(equalised.way, damping=damping, decay=test.decay),
    )  # fmt: skip
    chosen = np.isin(hertz, residual.measured.freq_hz)
    noise, values = noise[:, :, chosen], values[:, :, chosen]
    if equalised.form != "linear":
        noise = _relative(noise, np.abs(residual.measured.values))
        noise[noise >= 1.0 / ABOVE_NOISE] = np.nan
    silent = ~np.isfinite(equalised.sd).any(axis=2)
    sd = np.fmax(residual.sd, noise)
    known = np.isfinite(residual.sd) & np.isfinite(noise) & np.isfinite(values) & (values != 0.0)
    sd = np.where(known & ~np.asarray(silent)[:, :, None], sd, np.nan)
    return replace(
        residual, measured=replace(residual.measured, values=values), sd=sd, shift=None, left_out=equalised.left_out,
        damped_by=equalised.identified, noise=noise / sd,
    )  # fmt: skip


def _relative(noise: Reals, size: Reals) -> Reals:
    return np.divide(noise, size, out=np.full(size.shape, np.nan), where=size > 0.0)
