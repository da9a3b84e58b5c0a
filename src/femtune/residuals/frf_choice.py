"""An FRF residual from a test's functions: lines, scatter, and the functions that cannot be compared."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Notice
from femtune.modal import FrfSet
from femtune.model import EigenSolution, ModelPoint
from femtune.residuals.frf import FrfResidual
from femtune.residuals.frf_channels import silent_functions
from femtune.residuals.frf_forms import FrfForm
from femtune.residuals.frf_lines import Band, Lines, Region
from femtune.residuals.frf_places import Places, places_of
from femtune.residuals.frf_scatter import ABOVE_NOISE, FrfScatter
from femtune.residuals.model_way import ModelWay

Reals = NDArray[np.float64]

_SHOWN = 8


def frf_residual(
    model: ModelPoint | EigenSolution,
    measured: FrfSet,
    lines: Lines | None = None,
    form: FrfForm = "log-complex",
    scatter: FrfScatter | None = None,
    way: ModelWay | None = None,
    places: Places | None = None,
) -> tuple[FrfResidual, tuple[Notice, ...]]:
    """The residual of a configuration, and what was left out.

    Parameters
    ----------
    model : at the start, solved unless the way is "direct" without modal damping
    measured : NaN where a function or a line was not measured
    lines : which are compared; all above 0 Hz where nothing is said
    scatter, way : `FrfScatter()` and `ModelWay()` where nothing is said
    places : where the functions were driven and seen; the model's DOFs of their labels where nothing is said

    Raises
    ------
    FemtuneError : ``residual.no-frf-lines``, ``residual.no-coherence``, ``residual.no-frf-channels``,
        ``response.held-port``, ``model.unknown-node``, ``model.component``
    """
    scatter, way = scatter or FrfScatter(), way or ModelWay()
    measured, regions, sd, shift = _chosen(measured, lines or Band(), scatter, form)
    configured = _point(model).configured
    name = configured.configuration.name
    places = places or places_of(configured.model.structure.nodes, measured)
    residual = FrfResidual(name, measured, places, sd, regions, form, way, shift)
    notices = _lost_in_noise(residual) if scatter.floor and form != "linear" else []
    residual = _coupled(residual, silent_functions(residual, model), notices)
    if not np.isfinite(residual.sd).any():
        raise _nothing_left(name, notices)
    return residual, tuple(notices)


def _point(model: ModelPoint | EigenSolution) -> ModelPoint:
    return model.point if isinstance(model, EigenSolution) else model


def _chosen(
    measured: FrfSet, lines: Lines, scatter: FrfScatter, form: FrfForm
) -> tuple[FrfSet, tuple[Region, ...], Reals, Reals]:
    """Functions, regions, σ and shifts at the chosen lines; noise and neighbours are those of all lines."""
    found = lines.regions(measured.freq_hz)
    at = np.unique(np.concatenate([r.at for r in found]))
    none = np.zeros(measured.values.shape)
    sd, shift = (scatter.linear(measured), none) if form == "linear" else scatter.logarithmic(measured)
    coherence = None if measured.coherence is None else measured.coherence[:, :, at]
    some = replace(measured, freq_hz=measured.freq_hz[at], values=measured.values[:, :, at], coherence=coherence)
    return some, tuple(replace(r, at=np.searchsorted(at, r.at)) for r in found), sd[:, :, at], shift[:, :, at]


def _lost_in_noise(residual: FrfResidual) -> list[Notice]:
    """Values whose logarithm would be that of the noise."""
    measured = np.isfinite(residual.measured.values)
    lost = measured & ~np.isfinite(residual.sd)
    if not lost.any():
        return []
    what = (
        f"{residual.configuration}: {lost.sum()} of {measured.sum()} values of FRFs are left out: at antiresonances, "
        f"below {ABOVE_NOISE:g} standard deviations of the noise floor, a logarithm is that of the noise"
    )
    return [Notice("residual.frf-below-noise", what, level="info")]


def _coupled(residual: FrfResidual, silent: NDArray[np.bool_], notices: list[Notice]) -> FrfResidual:
    known = np.isfinite(residual.sd).any(axis=2)
    out = [_named(residual, i, j) for i, j in zip(*np.nonzero(silent & known))]
    if out:
        what = (
            f"{residual.configuration}: {len(out)} of {known.sum()} FRFs are zero in the model but for rounding, and "
            f"are left out: {_listed(out)}"
        )
        notices.append(Notice("residual.silent-frf", what))
    return replace(residual, sd=np.where(silent[:, :, None], np.nan, residual.sd))


def _named(residual: FrfResidual, i: int, j: int) -> str:
    return f"{residual.measured.responses[int(i)]} / {residual.measured.references[int(j)]}"


def _listed(labels: Iterable[str]) -> str:
    names = list(labels)
    return ", ".join(names[:_SHOWN]) + (f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else "")


def _nothing_left(name: str, notices: list[Notice]) -> FemtuneError:
    why = "; ".join(n.what for n in notices) or "none has a value at the chosen lines that is not zero"
    return FemtuneError(
        "residual.no-frf-channels",
        f"configuration {name}: no FRF is left to compare: {why}",
        hint="check outputs, inputs and directions of the test against the model",
    )
