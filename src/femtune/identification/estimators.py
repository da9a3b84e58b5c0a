"""H1, H2 and Hv of averaged spectra, with coherences and standard deviations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.arrays import Complexes, Reals
from femtune.errors import FemtuneError
from femtune.identification.averaging import InputOutputSpectra
from femtune.identification.kinds import FRF_ESTIMATORS
from femtune.modal import FrfSet

KIND_OF = {"displacement": "receptance", "velocity": "mobility", "acceleration": "accelerance"}
SAME_INPUT = 1e10
"""Condition of the inputs' spectra, each scaled to one, above which two of them are one and the same."""


@dataclass(frozen=True, eq=False)
class FrfEstimate:
    """Functions with what is known of their errors.

    Parameters
    ----------
    frfs : with the ordinary coherence of each pair
    sd : (n, u, k) standard deviations √E|error|²; NaN where too few averages tell
    multiple_coherence : (n, k) part of each response's power that all inputs together explain
    averages : independent ones
    """

    frfs: FrfSet
    sd: Reals
    multiple_coherence: Reals
    averages: float


def estimate_frfs(spectra: InputOutputSpectra, estimator: str = "H1") -> FrfEstimate:
    """Functions of a set of averaged spectra.

    H1 = G_yx G_xx⁻¹ is free of bias from noise of the responses, H2 = G_yy/G_xy (one input) from noise of the input, Hv
    takes both alike: the smallest principal component of inputs and a response, each scaled to one, is noise. For one
    input |Hv|² = |H1||H2|. The variance is (1 − γ²) G_yy [G_xx⁻¹]_jj/(averages − inputs), γ² the multiple coherence.

    Parameters
    ----------
    estimator : "H1", "H2" or "Hv"

    Raises
    ------
    FemtuneError : ``identify.estimator``, ``identify.same-inputs`` where inputs are not independent or fewer segments
        than inputs were averaged, ``identify.response-quantity`` for responses that are no motion

    Sources: J. Bendat, A. Piersol, Random Data, 4th edition (2010), chapters 7 and 9; G. Rocklin, J. Crowley, H. Vold
    (1985), A comparison of the H1, H2 and Hv frequency response functions, Proc. IMAC 3.
    """
    _check_estimator(estimator, len(spectra.references))
    kind = KIND_OF.get(spectra.quantity)
    if kind is None:
        raise FemtuneError("identify.response-quantity", quantity=spectra.quantity)
    inverse = _inverse(spectra)
    values = FRF_ESTIMATORS[estimator].load()(spectra, inverse)
    together = _multiple_coherence(spectra, inverse)
    pairs = _coherence(spectra)
    source = f"{estimator} of {spectra.averages:.1f} averages"
    frfs = FrfSet(
        spectra.freq_hz, values.transpose(1, 2, 0), spectra.responses, spectra.references, kind, pairs, source=source
    )
    return FrfEstimate(frfs, _sd(spectra, inverse, together), together.T, spectra.averages)


def _check_estimator(estimator: str, references: int) -> None:
    if estimator not in FRF_ESTIMATORS:
        raise FemtuneError("identify.estimator", estimator=estimator)
    if estimator == "H2" and references > 1:
        raise FemtuneError("identify.estimator/several-inputs", n_inputs=references)


def _inverse(spectra: InputOutputSpectra) -> Complexes:
    """(k, u, u) inverses of G_xx."""
    size = np.sqrt(np.einsum("kjj->kj", spectra.inputs).real)
    silent = spectra.freq_hz[(size <= 1e-12 * size.max(axis=0, initial=0.0)).any(axis=1)]
    size = np.where(size > 0.0, size, 1.0)
    scaled = spectra.inputs / (size[:, :, None] * size[:, None, :])
    usable = np.isin(spectra.freq_hz, silent, invert=True)
    if len(spectra.references) > 1 and (
        spectra.averages < len(spectra.references) or np.median(np.linalg.cond(scaled[usable])) > SAME_INPUT
    ):
        raise FemtuneError(
            "identify.same-inputs", values={"inputs": len(spectra.references), "averages": f"{spectra.averages:.1f}"}
        )
    inverse = np.full(scaled.shape, np.nan, dtype=complex)
    inverse[usable] = np.linalg.pinv(scaled[usable], hermitian=True)
    return inverse / (size[:, :, None] * size[:, None, :])


def h1(spectra: InputOutputSpectra, inverse: Complexes) -> Complexes:
    return spectra.cross @ inverse


def h2(spectra: InputOutputSpectra, inverse: Complexes) -> Complexes:
    with np.errstate(divide="ignore", invalid="ignore"):
        values = spectra.outputs[:, :, None] / spectra.cross.conj()
    return np.where(np.isfinite(values) & np.isfinite(inverse[:, :1, :1]), values, np.nan)


def hv(spectra: InputOutputSpectra, inverse: Complexes) -> Complexes:
    """[H, −1] is the left singular direction of least power of the scaled inputs and the response."""
    u = len(spectra.references)
    x = np.sqrt(np.einsum("kjj->kj", spectra.inputs).real)
    values = np.full(spectra.cross.shape, np.nan, dtype=complex)
    usable = np.isfinite(inverse).all(axis=(1, 2))
    for i in range(spectra.cross.shape[1]):
        y = np.sqrt(spectra.outputs[:, i])
        lines = np.flatnonzero(usable & (y > 0.0))
        size = np.column_stack([x, y])[lines]
        whole = np.empty((len(lines), u + 1, u + 1), dtype=complex)
        whole[:, :u, :u], whole[:, u, u] = spectra.inputs[lines], spectra.outputs[lines, i]
        whole[:, u, :u], whole[:, :u, u] = spectra.cross[lines, i], spectra.cross[lines, i].conj()
        least = np.linalg.eigh(whole / (size[:, :, None] * size[:, None, :]))[1][:, :, 0].conj() / size
        values[lines, i] = -least[:, :u] / least[:, u:]
    return values


def _multiple_coherence(spectra: InputOutputSpectra, inverse: Complexes) -> Reals:
    explained = np.einsum("knu,kuv,knv->kn", spectra.cross, inverse, spectra.cross.conj(), optimize=True).real
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.clip(explained / spectra.outputs, 0.0, 1.0)


def _coherence(spectra: InputOutputSpectra) -> Reals:
    """(n, u, k) |G_yx|²/(G_xx G_yy) of each pair."""
    power = np.einsum("kjj->kj", spectra.inputs).real[:, None, :] * spectra.outputs[:, :, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.clip(np.abs(spectra.cross) ** 2 / power, 0.0, 1.0).transpose(1, 2, 0)


def _sd(spectra: InputOutputSpectra, inverse: Complexes, together: Reals) -> Reals:
    freedom = spectra.averages - len(spectra.references)
    if freedom <= 0.0:
        return np.full(spectra.cross.transpose(1, 2, 0).shape, np.nan)
    noise = (1.0 - together) * spectra.outputs / freedom
    gain = np.einsum("kjj->kj", inverse).real
    return np.sqrt(noise[:, :, None] * np.clip(gain, 0.0, None)[:, None, :]).transpose(1, 2, 0)
