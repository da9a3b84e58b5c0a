"""FRFs at σ + iω, as an exponential window makes them: against a windowed impulse response and dense algebra."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from femtune.model import ConfiguredModel, solve_modes
from femtune.model.damping import constant_damping
from femtune.model.kinds import FrfMethod
from femtune.model.response import METHODS, Ports, frf, frf_gradient, frf_with_error, make_ports, survey_functions

from .models import chain, configured

SPRINGS = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0)]
LINES = np.linspace(0.5, 9.0, 12)
SIGMA = 3.0


def _model() -> tuple[ConfiguredModel, Ports]:
    structure = chain(SPRINGS, [1.0, 2.0, 1.5, 1.0], [(-1, 1, 3.0), (2, 3, 5.0)])
    model = configured(structure, {"k": ("K", 2), "m": ("M", 3), "c": ("B", 1)})
    return model, make_ports(model, ["1X+", "3X+"], ["1X+", "2X-", "4X+"])


def _dense(model: ConfiguredModel, x: NDArray, ports: Ports) -> NDArray:
    point = model.at(x)
    K, M, C = (matrix.toarray() for matrix in (point.stiffness, point.mass, point.viscous))
    s = SIGMA + 2j * np.pi * LINES
    Z = [one**2 * M + one * C + K for one in s]
    values = [
        one**2 * (ports.outputs @ np.linalg.solve(z, ports.inputs.toarray().astype(complex))) for one, z in zip(s, Z)
    ]
    return np.moveaxis(np.array(values), 0, -1)


@pytest.mark.parametrize("method", METHODS)
def test_functions_and_derivatives_by_dense_algebra(method: FrfMethod) -> None:
    model, ports = _model()
    x = np.array([0.1, -0.1, 0.2])
    found = frf_gradient(solve_modes(model.at(x), 4), ports, LINES, "accelerance", method, decay=SIGMA)
    exact = _dense(model, x, ports)
    np.testing.assert_allclose(found.frfs.values, exact, atol=1e-9 * np.abs(exact).max())
    h = 1e-5
    for i, e in enumerate(np.eye(3)):
        slope = (_dense(model, x + h * e, ports) - _dense(model, x - h * e, ports)) / (2.0 * h)
        np.testing.assert_allclose(found.gradient[..., i], slope, atol=1e-7 * np.abs(slope).max())
    modes = solve_modes(model.at(x), 4)
    surveyed = survey_functions(modes, ports, LINES, "accelerance", method, decay=SIGMA)
    np.testing.assert_allclose(surveyed, exact, atol=1e-6 * np.abs(exact).max())
    known = frf_with_error(modes, ports, LINES, "accelerance", method, decay=SIGMA)
    np.testing.assert_allclose(known.frfs.values, exact, atol=1e-9 * np.abs(exact).max())


def test_they_are_those_of_a_record_with_an_exponential_window() -> None:
    """Impulse response of one mass, times the window, by a discrete Fourier transform of the record."""
    mass, zeta, hertz = 2.0, 0.01, 7.0
    omega = 2.0 * np.pi * hertz
    model = configured(chain([(-1, 0, mass * omega**2)], [mass]))
    ports = make_ports(model, ["1X+"], ["1X+"])
    rate, seconds = 8192, 8
    t = np.arange(rate * seconds) / rate
    free = omega * np.sqrt(1.0 - zeta**2)
    record = np.exp(-zeta * omega * t) * np.sin(free * t) / (mass * free) * np.exp(-SIGMA * t)
    lines, values = np.fft.rfftfreq(len(t), 1.0 / rate), np.fft.rfft(record) / rate
    at = (lines > 1.0) & (lines < 20.0)
    modes = solve_modes(model.at(np.zeros(0)), 1)
    found = frf(modes, ports, lines[at], "receptance", damping=constant_damping(zeta), decay=SIGMA).values[0, 0]
    np.testing.assert_allclose(found, values[at], atol=1e-5 * np.abs(values).max())
