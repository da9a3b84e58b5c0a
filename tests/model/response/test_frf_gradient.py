"""Derivatives of FRFs by each of the three ways."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.model import ConfiguredModel, solve_modes
from femtune.model.damping import as_hysteretic, constant_damping
from femtune.model.kinds import FrfMethod
from femtune.model.response import METHODS, DampingRatios, FrfGradient, Ports, frf, frf_gradient, make_ports

from .models import chain, configured, rising

SPRINGS = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0), (0, 2, 150.0)]
FACTORS = {"k": ("K", 2), "m": ("M", 3), "c": ("B", 1), "g": ("GE", 2)}
LINES = np.linspace(0.5, 9.0, 12)
AT = np.array([0.1, -0.1, 0.2, 0.1])
every_way = pytest.mark.parametrize("method", METHODS)


def _model(n: int = 4) -> tuple[ConfiguredModel, Ports]:
    springs = SPRINGS if n == 4 else [(i - 1, i, 900.0 + 10 * i) for i in range(n)]
    model = configured(chain(springs, [1.0, 2.0, 1.5, 1.0] * (n // 4), [(-1, 1, 3.0), (2, 3, 5.0)], 0.02), FACTORS)
    return model, make_ports(model, ["1X+", "3X+"], ["1X+", "2X-", "4X+"])


@pytest.mark.slow
@every_way
def test_by_complex_difference(method: FrfMethod) -> None:
    model, ports = _model()
    found = frf_gradient(solve_modes(model.at(np.zeros(4)), 4), ports, LINES, "mobility", method)
    h = 1e-6
    for i in range(4):
        step = 1j * h * np.eye(4)[i]
        ends = [frf(model.at(x), ports, LINES, "mobility", "direct").values for x in (step, -step)]
        exact = (ends[0] - ends[1]) / (2j * h)
        assert np.abs(found.gradient[..., i] - exact).max() <= 3e-8 * np.abs(exact).max()
    assert found.parameters == ("k", "m", "c", "g")
    np.testing.assert_allclose(
        found.frfs.values, frf(model.at(np.zeros(4)), ports, LINES, "mobility", "direct").values, rtol=1e-9
    )


@pytest.mark.slow
@pytest.mark.quick(5, rest="long")
@every_way
@pytest.mark.parametrize("damping", [constant_damping(0.03), rising(0.03, 5.0), as_hysteretic(rising(0.03, 5.0))])
def test_with_modal_damping(method: FrfMethod, damping: DampingRatios) -> None:
    model, ports = _model()
    found = frf_gradient(solve_modes(model.at(np.zeros(4)), 4), ports, LINES, "receptance", method, damping=damping)
    h = 1e-4
    for i in range(4):
        ends = [
            frf(solve_modes(model.at(s * h * np.eye(4)[i]), 4), ports, LINES, "receptance", "direct", damping=damping)
            for s in (1, -1, 2, -2)
        ]
        a, b, c, d = (one.values for one in ends)
        exact = (8 * (a - b) - (c - d)) / (12 * h)
        assert np.abs(found.gradient[..., i] - exact).max() <= 1e-7 * np.abs(exact).max()


@pytest.mark.slow
@pytest.mark.parametrize("damping", [constant_damping(0.03), rising(0.03, 5.0), as_hysteretic(rising(0.03, 5.0))])
def test_with_modal_damping_of_some_modes_repeated_ones_among_them(damping: DampingRatios) -> None:
    """Three equal oscillators side by side and a chain: a cluster is split by the parameter, P′ still exists."""
    springs = [(-1, 0, 400.0), (-1, 1, 400.0), (-1, 2, 400.0), (2, 3, 30.0), (1, 3, 20.0)]
    model = configured(chain(springs, [1.0, 1.0, 1.0, 40.0]), {"k": ("K", 1), "m": ("M", 2), "l": ("K", 4)})
    ports = make_ports(model, ["1X+", "4X+"], ["2X+", "3X+", "1X+"])
    found = frf_gradient(solve_modes(model.at(np.zeros(3)), 4), ports, LINES, "receptance", "direct", damping=damping)
    h = 1e-4
    for i in range(3):
        ends = [
            frf(solve_modes(model.at(s * h * np.eye(3)[i]), 4), ports, LINES, "receptance", "direct", damping=damping)
            for s in (1, -1, 2, -2)
        ]
        a, b, c, d = (one.values for one in ends)
        exact = (8 * (a - b) - (c - d)) / (12 * h)
        assert np.abs(found.gradient[..., i] - exact).max() <= 1e-7 * np.abs(exact).max()


@pytest.mark.quick(1)
@pytest.mark.parametrize("method", METHODS[1:])
def test_modal_derivatives_converge_with_the_modes(method: FrfMethod) -> None:
    model, ports = _model(40)
    point, lines = model.at(np.zeros(4)), np.linspace(0.1, 1.5, 15)
    exact = frf_gradient(point, ports, lines, "receptance", "direct").gradient
    errors = [
        np.abs(frf_gradient(solve_modes(point, k), ports, lines, "receptance", method).gradient - exact).max()
        for k in (8, 16)
    ]
    # as the functions, by the square of what a fixed basis would leave
    assert errors[0] < 1e-4 * np.abs(exact).max()
    assert errors[1] < max(0.1 * errors[0], 1e-10 * np.abs(exact).max())


TRUNCATED: list[tuple[FrfMethod, int, bool]] = [
    ("real-modes", 3, True), ("real-modes", 3, False), ("real-modes", 8, True), ("complex-modes", 8, True),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("damping", [None, rising(0.03, 5.0), as_hysteretic(rising(0.03, 5.0))])
@pytest.mark.parametrize(("method", "count", "residual_vectors"), TRUNCATED)
def test_the_gradient_is_that_of_the_truncated_functions(
    method: FrfMethod, count: int, residual_vectors: bool, damping: DampingRatios | None, free: bool
) -> None:
    """Modes and residual vectors change too: differences of the superposed values themselves, four points a column."""
    springs = [(i - 1, i, 900.0 + 10 * i) for i in range(1 if free else 0, 40)]
    dashpots = [(0, 1, 3.0), (2, 3, 5.0)]
    model = configured(chain(springs, [1.0, 2.0, 1.5, 1.0] * 10, dashpots, 0.02), FACTORS)
    ports, lines, at, h = make_ports(model, ["1X+", "3X+"], ["1X+", "2X-", "4X+"]), np.linspace(0.1, 1.5, 9), AT, 2e-3

    def found(x: np.ndarray, derivatives: bool) -> FrfGradient:
        modes = solve_modes(model.at(x), count + 2 * free)
        return frf_gradient(
            modes, ports, lines, "receptance", method,
            damping=damping, residual_vectors=residual_vectors, derivatives=derivatives,
        )  # fmt: skip

    gradient = found(at, True).gradient
    for i, e in enumerate(np.eye(4)):
        a, b, c, d = (found(at + s * h * e, False).frfs.values for s in (1, -1, 2, -2))
        exact = (8 * (a - b) - (c - d)) / (12 * h)
        assert np.abs(gradient[..., i] - exact).max() <= 1e-6 * np.abs(gradient).max()


def test_taylor_slope() -> None:
    model, ports = _model()
    direction = np.array([0.3, -0.5, 0.4, 0.8])
    found = frf_gradient(model.at(np.zeros(4)), ports, LINES, method="direct")
    left = [
        np.linalg.norm(
            frf(model.at(t * direction), ports, LINES, method="direct").values
            - found.frfs.values - t * found.gradient @ direction
        )
        for t in 0.02 * 0.5 ** np.arange(6)
    ]  # fmt: skip
    np.testing.assert_allclose(np.log2(np.array(left[:-1]) / left[1:])[-3:], 2.0, atol=0.1)


def test_a_model_without_parameters_has_an_empty_gradient() -> None:
    model = configured(chain(SPRINGS, [1.0] * 4))
    ports = make_ports(model, ["1X+"], ["1X+"])
    for method in METHODS:
        found = frf_gradient(solve_modes(model.at(np.zeros(0)), 4), ports, LINES, method=method)
        assert found.gradient.shape == (1, 1, len(LINES), 0)
