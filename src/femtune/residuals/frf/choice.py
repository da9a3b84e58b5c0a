"""An FRF residual from a test's functions: lines, standard deviations, and functions that cannot be compared."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.dofs import DofSet
from femtune.errors import FemtuneError, Notice
from femtune.modal import FrfSet
from femtune.model import EigenSolution, ModelPoint
from femtune.model.response import Ports, frf_gradient, survey_functions
from femtune.residuals.frf.lines import Band, Lines, Region
from femtune.residuals.frf.model_way import ModelWay
from femtune.residuals.frf.residual import FrfForm, FrfResidual, Places, places_of
from femtune.residuals.frf.scatter import ABOVE_NOISE, FrfScatter

# ----------------------------------------------------------------------------------------------------
# Functions that are zero in the model under any force: motions that do not couple.


_SILENT = 1e-8
"""Size of a function relative to those of its driving points, at or below which it is rounding of zero."""
_SURVEY_LINES = 12
"""Evenly spaced lines at which functions are surveyed; each costs a solution."""


def silent_functions(residual: FrfResidual, model: ModelPoint | EigenSolution) -> NDArray[np.bool_]:
    """(outputs, inputs) True for functions H_ij that are zero but for rounding beside √(H_ii H_jj).

    In the linear form those that a parameter moves are not: they are zero at this point only.
    """
    lines = _some(residual.measured)
    point = model.point if isinstance(model, EigenSolution) else model
    ports = residual.places.ports(point.configured, residual.measured)
    # one basis serves all: unit forces at inputs and outputs, motions at outputs and inputs
    rows, columns = sp.vstack([ports.outputs, ports.inputs.T]), sp.hstack([ports.inputs, ports.outputs.T])
    seen_labels = (*ports.output_labels, *ports.input_labels)
    driven_labels = (*ports.input_labels, *ports.output_labels)
    every = Ports(sp.csc_array(columns), sp.csr_array(rows), DofSet(()), DofSet(()), seen_labels, driven_labels)
    size = np.abs(
        survey_functions(
            model, every, lines, "receptance", residual.way.method,
            damping=residual.way.damping, residual_vectors=residual.way.residual_vectors,
        )
    ).max(axis=2)  # fmt: skip
    a, b = len(ports.output_labels), len(ports.input_labels)
    seen, driven = np.diag(size[:a, b:]), np.diag(size[a:, :b])
    scale = _SILENT * np.sqrt(np.outer(seen, driven))
    silent = size[:a, :b] <= scale
    if residual.form == "linear" and silent.any():
        silent &= _slopes(residual, ports, model, lines) <= scale
    return np.asarray(silent)


def _some(measured: FrfSet) -> NDArray[np.float64]:
    """A dozen of the lines."""
    lines = measured.freq_hz
    at = np.unique(np.linspace(0, len(lines) - 1, min(_SURVEY_LINES, len(lines))).round().astype(int))
    return np.asarray(lines[at])


def _slopes(
    residual: FrfResidual, ports: Ports, model: ModelPoint | EigenSolution, lines: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(outputs, inputs) largest magnitudes of the derivatives of functions over the lines."""
    functions = frf_gradient(
        model, ports, lines, "receptance", residual.way.method,
        damping=residual.way.damping, residual_vectors=residual.way.residual_vectors,
    )  # fmt: skip
    return np.asarray(np.abs(functions.gradient).max(axis=(2, 3), initial=0.0))


_LISTED = 8
"""Names in a message; it stays one line or two."""


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
    model : at the start, solved unless the way is "direct" without modal damping; a way without a number of modes
        keeps the number of this solution, so that the functions are smooth in the parameters
    measured : NaN where a function or a line was not measured
    lines : which are compared; all above 0 Hz where nothing is said
    scatter, way : default: `FrfScatter()` and `ModelWay()`
    places : where the functions were driven and seen; the model's DOFs of their labels where nothing is said

    Raises
    ------
    FemtuneError : ``residual.no-frf-lines``, ``residual.no-coherence``, ``residual.no-frf-channels``,
        ``response.held-port``, ``model.unknown-node``, ``model.component``
    """
    scatter, way = scatter or FrfScatter(), (way or ModelWay()).of(model)
    configured = _point(model).configured
    name = configured.configuration.name
    places = places or places_of(configured.model.structure.nodes, measured)
    residual = weighted_residual(name, measured, places, lines or Band(), form, scatter, way)
    notices = (
        lost_in_noise(residual, np.isfinite(residual.measured.values)) if scatter.floor and form != "linear" else []
    )
    residual = _coupled(residual, silent_functions(residual, model), notices)
    if not np.isfinite(residual.sd).any():
        raise _nothing_left(name, notices)
    return residual, tuple(notices)


def weighted_residual(
    configuration: str,
    measured: FrfSet,
    places: Places,
    lines: Lines,
    form: FrfForm,
    scatter: FrfScatter,
    way: ModelWay,
) -> FrfResidual:
    """The residual of all functions at the chosen lines, with the standard deviations of their values.

    Functions that are zero in the model are part of it. Arguments and errors as of `frf_residual`.
    """
    some, regions, sd, shift = _chosen(measured, lines, scatter, form)
    return FrfResidual(configuration, some, places, sd, regions, form, way, shift)


def _point(model: ModelPoint | EigenSolution) -> ModelPoint:
    return model.point if isinstance(model, EigenSolution) else model


def _chosen(
    measured: FrfSet, lines: Lines, scatter: FrfScatter, form: FrfForm
) -> tuple[FrfSet, tuple[Region, ...], Reals, Reals]:
    """Functions, regions, σ and shifts at the chosen lines; noise and neighbours are those of all lines."""
    regions = lines.regions(measured.freq_hz)
    at = np.unique(np.concatenate([r.at for r in regions]))
    none = np.zeros(measured.values.shape)
    sd, shift = (scatter.linear(measured), none) if form == "linear" else scatter.logarithmic(measured)
    coherence = None if measured.coherence is None else measured.coherence[:, :, at]
    some = replace(measured, freq_hz=measured.freq_hz[at], values=measured.values[:, :, at], coherence=coherence)
    return some, tuple(replace(r, at=np.searchsorted(at, r.at)) for r in regions), sd[:, :, at], shift[:, :, at]


def lost_in_noise(residual: FrfResidual, measured: NDArray[np.bool_]) -> list[Notice]:
    """Of the values that were measured, those whose logarithm would be that of the noise."""
    lost = measured & ~np.isfinite(residual.sd)
    if not lost.any():
        return []
    return [
        Notice(
            "residual.frf-below-noise",
            level="info",
            configuration=residual.configuration,
            left_out=lost.sum(),
            measured=measured.sum(),
            threshold=ABOVE_NOISE,
        )
    ]


def _coupled(residual: FrfResidual, silent: NDArray[np.bool_], notices: list[Notice]) -> FrfResidual:
    known = np.isfinite(residual.sd).any(axis=2)
    out = [_named(residual, i, j) for i, j in zip(*np.nonzero(silent & known))]
    if out:
        notices.append(
            Notice(
                "residual.silent-frf",
                configuration=residual.configuration,
                silent=len(out),
                known=known.sum(),
                functions=_listed(out),
            )
        )
    return replace(residual, sd=np.where(silent[:, :, None], np.nan, residual.sd))


def _named(residual: FrfResidual, i: int, j: int) -> str:
    return f"{residual.measured.responses[int(i)]} / {residual.measured.references[int(j)]}"


def _listed(labels: Iterable[str]) -> str:
    names = list(labels)
    return ", ".join(names[:_LISTED]) + (f" and {len(names) - _LISTED} more" if len(names) > _LISTED else "")


def _nothing_left(name: str, notices: list[Notice]) -> FemtuneError:
    why = "; ".join(n.what for n in notices) or "none has a nonzero value at the chosen frequency lines"
    return FemtuneError("residual.no-frf-channels/nothing-left", configuration=name, reason=why)
