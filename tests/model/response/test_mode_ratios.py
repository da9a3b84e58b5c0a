"""Damping ratios of modes as parameters: by three ways, beside tables of damping, in complex modes."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem import ALL_MODES, FieldRef, mode_ratio_field, with_mode_ratios
from femtune.model import Assignment, Configuration, ConfiguredModel, configure, parametric_model, solve_modes
from femtune.model.damping import as_hysteretic, constant_damping, damping_by_mode
from femtune.model.kinds import FrfMethod
from femtune.model.response import (
    METHODS,
    complex_mode_derivative,
    complex_modes,
    frf,
    frf_gradient,
    make_ports,
)
from femtune.parameters import Parameter, ParameterSet

from .models import chain

SPRINGS = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0), (0, 2, 150.0)]
LINES = np.linspace(0.5, 9.0, 12)
every_way = pytest.mark.parametrize("method", METHODS)
AT = np.array([0.1, -0.2, 0.3])


def model(ratios: dict[int, float]) -> ConfiguredModel:
    """Parameters: a stiffness, the ratio of mode 2, the ratio of all others."""
    structure = with_mode_ratios(chain(SPRINGS, [1.0, 2.0, 1.5, 1.0], [(-1, 1, 3.0)]), ratios)
    fields = {"k": FieldRef("CELAS2", 2, "K"), "second": mode_ratio_field(2), "others": mode_ratio_field(ALL_MODES)}
    names = ParameterSet(tuple(Parameter(name, 1.0, 0.1, 5.0) for name in fields))
    placed = [Assignment(name, ref) for name, ref in fields.items()]
    return configure(parametric_model(structure, names, placed), Configuration())


ZETA = Parameter("z", 1.0, 0.1, 5.0)
RATIOS = {2: 0.03, ALL_MODES: 0.01}


@pytest.mark.slow
@every_way
@pytest.mark.parametrize("damping", [None, constant_damping(0.5), as_hysteretic(constant_damping(0.2))])
def test_derivatives_by_four_point_differences(method: FrfMethod, damping: object) -> None:
    configured = model(RATIOS)
    ports = make_ports(configured, ["1X+", "3X+"], ["1X+", "4X+"])
    found = frf_gradient(solve_modes(configured.at(AT), 4), ports, LINES, "mobility", method, damping=damping)  # type: ignore[arg-type]
    h = 1e-4

    def at(x: np.ndarray) -> np.ndarray:
        modes = solve_modes(configured.at(x), 4)
        return frf(modes, ports, LINES, "mobility", "direct", damping=damping).values  # type: ignore[arg-type]

    for i, e in enumerate(np.eye(3)):
        a, b, c, d = (at(AT + s * h * e) for s in (1, -1, 2, -2))
        exact = (8 * (a - b) - (c - d)) / (12 * h)
        assert np.abs(exact).max() > 0.0
        assert np.abs(found.gradient[..., i] - exact).max() <= 1e-7 * np.abs(exact).max()


@pytest.mark.slow
@every_way
def test_they_are_the_ratios_of_a_list(method: FrfMethod) -> None:
    configured = model(RATIOS)
    ports = make_ports(configured, ["1X+"], ["4X+"])
    modes = solve_modes(configured.at(np.zeros(3)), 4)
    bare = configure(
        parametric_model(chain(SPRINGS, [1.0, 2.0, 1.5, 1.0], [(-1, 1, 3.0)]), ParameterSet(()), []), Configuration()
    )
    same = frf(
        solve_modes(bare.at(np.zeros(0)), 4), make_ports(bare, ["1X+"], ["4X+"]), LINES, "receptance", method,
        damping=damping_by_mode([0.01, 0.03, 0.01, 0.01]),
    )  # fmt: skip
    np.testing.assert_allclose(frf(modes, ports, LINES, "receptance", method).values, same.values, rtol=1e-9)


def test_they_take_the_place_of_other_damping_of_their_mode_only() -> None:
    structure = with_mode_ratios(chain(SPRINGS, [1.0, 2.0, 1.5, 1.0]), {2: 0.03})
    configured = configure(
        parametric_model(
            structure, ParameterSet((Parameter("z", 1.0, 0.1, 5.0),)), [Assignment("z", mode_ratio_field(2))]
        ),
        Configuration(),
    )
    modes = solve_modes(configured.at(np.array([1.0])), 4)
    found = complex_modes(modes, 4, constant_damping(0.02))
    np.testing.assert_allclose(found.damping_ratio, [0.02, 0.06, 0.02, 0.02], rtol=1e-9)


def test_the_pole_of_a_mode_moves_with_its_ratio_by_the_closed_form() -> None:
    """λ = ω(−ζ + i√(1 − ζ²)): dλ/dζ = ω(−1 − iζ/√(1 − ζ²))."""
    structure = with_mode_ratios(chain(SPRINGS, [1.0, 2.0, 1.5, 1.0]), {2: 0.03})
    configured = configure(
        parametric_model(
            structure, ParameterSet((Parameter("z", 1.0, 0.1, 5.0),)), [Assignment("z", mode_ratio_field(2))]
        ),
        Configuration(),
    )
    modes = solve_modes(configured.at(np.zeros(1)), 4)
    slope = complex_mode_derivative(complex_modes(modes, 4), 1).pole[0]
    omega, zeta = np.sqrt(modes.eigenvalues[1]), 0.03
    assert slope == pytest.approx(omega * zeta * (-1 - 1j * zeta / np.sqrt(1 - zeta**2)), rel=1e-9)


def test_modes_are_needed() -> None:
    configured = model(RATIOS)
    with pytest.raises(FemtuneError, match="needs the modes") as error:
        frf(configured.at(np.zeros(3)), make_ports(configured, ["1X+"], ["1X+"]), LINES, "receptance", "direct")
    assert error.value.code == "response.modes-needed"


def test_a_negative_ratio_is_refused() -> None:
    configured = model(RATIOS)
    modes = solve_modes(configured.at(np.array([0.0, -1.1, 0.0])), 4)
    with pytest.raises(FemtuneError) as error:
        frf(modes, make_ports(configured, ["1X+"], ["1X+"]), LINES)
    assert error.value.code == "response.damping-ratio"


def test_a_ratio_belongs_to_the_whole_model() -> None:
    structure = with_mode_ratios(chain(SPRINGS, [1.0] * 4), {1: 0.01})
    part = [Assignment("z", mode_ratio_field(1), elements=frozenset([1]))]
    with pytest.raises(FemtuneError) as error:
        parametric_model(structure, ParameterSet((Parameter("z"),)), part)
    assert error.value.code == "parameter.whole-model"
