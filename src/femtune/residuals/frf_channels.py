"""Functions that are zero in the model whatever drives it: motions that do not couple."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.modal import FrfSet
from femtune.model import EigenSolution, ModelPoint
from femtune.model.response import Ports, frf_gradient
from femtune.residuals.frf import FrfResidual

_ZERO = 1e-8
_LOOKED_AT = 12


def silent_functions(residual: FrfResidual, model: ModelPoint | EigenSolution) -> NDArray[np.bool_]:
    """(outputs, inputs) True for functions H_ij that are zero but for rounding beside √(H_ii H_jj).

    In the linear form those that a parameter moves are not: they are zero at this point only.
    """
    lines = _some(residual.measured)
    point = model.point if isinstance(model, EigenSolution) else model
    ports = residual.places.ports(point.configured, residual.measured)
    cross, slope = _peaks(residual, ports, model, lines, residual.form == "linear")
    at_inputs = Ports(ports.inputs, sp.csr_array(ports.inputs.T), ports.input_labels, ports.input_labels, (), ())
    at_outputs = Ports(sp.csc_array(ports.outputs.T), ports.outputs, ports.output_labels, ports.output_labels, (), ())
    driven = np.diag(_peaks(residual, at_inputs, model, lines)[0])
    seen = np.diag(_peaks(residual, at_outputs, model, lines)[0])
    scale = _ZERO * np.sqrt(np.outer(seen, driven))
    return np.asarray((cross <= scale) & (slope <= scale))


def _some(measured: FrfSet) -> NDArray[np.float64]:
    """A dozen of the lines."""
    lines = measured.freq_hz
    at = np.unique(np.linspace(0, len(lines) - 1, min(_LOOKED_AT, len(lines))).round().astype(int))
    return np.asarray(lines[at])


def _peaks(
    residual: FrfResidual,
    ports: Ports,
    model: ModelPoint | EigenSolution,
    lines: NDArray[np.float64],
    derivatives: bool = False,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(outputs, inputs) largest magnitudes of functions and of their derivatives over the lines."""
    found = frf_gradient(
        model, ports, lines, "receptance", residual.way.method,
        damping=residual.way.damping, residual_vectors=residual.way.residual_vectors, derivatives=derivatives,
    )  # fmt: skip
    return np.abs(found.frfs.values).max(axis=2), np.abs(found.gradient).max(axis=(2, 3), initial=0.0)
