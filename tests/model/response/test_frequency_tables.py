"""Stiffness, loss factors and dashpots that depend on frequency: closed forms, dense solutions, derivatives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq
from tests.messages.shown import check_shown

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.fem import FieldRef
from femtune.modal import ModeSet
from femtune.model import (
    Assignment,
    Configuration,
    ConfiguredModel,
    FrequencyTable,
    ModelPoint,
    configure,
    frequency_table,
    matrices_digest,
    modes_at_own_frequency,
    parametric_model,
    solve_modes,
)
from femtune.model.damping import constant_damping
from femtune.model.full_model import direct
from femtune.model.response import (
    complex_modes_at_own_frequency,
    frf,
    frf_gradient,
    make_ports,
    static_response,
)
from femtune.parameters import Parameter, ParameterSet
from femtune.residuals import (
    ComparedCase,
    ComplexEigenvalueResidual,
    DampingResidual,
    FrequencyResidual,
    FrfResidual,
    ModelWay,
    ShapeResidual,
    UpdateProblem,
    case_without_modes,
    frf_residual,
)
from femtune.testing import check_matrix_derivatives, check_residual
from femtune.updating import update
from structures.springs import sensor_rows

from .models import CARDS, chain

SPRINGS = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0), (0, 2, 150.0)]
MASSES = [1.0, 2.0, 1.5, 1.0]
LOSS = [0.02, 0.1, 0.0, 0.05, 0.0]
DASHPOTS = [(-1, 1, 0.6), (2, 3, 0.9)]
FREQ = [0.0, 2.0, 4.0, 8.0]


def field(role: str, number: int) -> FieldRef:
    card, offset = CARDS[role]
    return FieldRef(card, offset + number, role)


MODULUS = frequency_table([field("K", 2)], FREQ, [0.8, 1.0, 1.3, 1.5])
LOSSES = frequency_table([field("GE", 2)], FREQ, [0.5, 1.0, 1.8, 1.5])
DAMPER = frequency_table([field("B", 1)], FREQ, [1.0, 0.9, 0.7, 0.6])


def model(
    tables: Sequence[FrequencyTable],
    factors: Mapping[str, tuple[str, int]] | None = None,
    springs: Sequence = SPRINGS,
    masses: Sequence[float] = MASSES,
    dashpots: Sequence = DASHPOTS,
    loss: object = LOSS,
) -> ConfiguredModel:
    given = factors or {}
    assignments = [Assignment(name, field(*at)) for name, at in given.items()]
    names = ParameterSet(tuple(Parameter(name, 1.0, 0.1, 5.0) for name in given))
    structure = chain(springs, masses, dashpots, loss)  # type: ignore[arg-type]
    return configure(parametric_model(structure, names, assignments, tables), Configuration())


ALL = {"k": ("K", 2), "eta": ("GE", 2), "m": ("M", 2), "c": ("B", 1), "other": ("K", 3)}
X = np.array([0.1, -0.2, 0.05, 0.3, -0.1])


def at_values(freq_hz: float, x: NDArray) -> ModelPoint:
    """The model without tables whose deck has the values at a frequency, factors of parameters included."""
    f = [t.at(freq_hz)[0] for t in (MODULUS, LOSSES, DAMPER)]
    springs = [list(s) for s in SPRINGS]
    springs[1][2] *= f[0] * (1 + x[0])
    springs[2][2] *= 1 + x[4]
    loss = np.array(LOSS)
    loss[1] *= f[1] * (1 + x[1])
    dashpots = [(-1, 1, 0.6 * f[2] * (1 + x[3])), DASHPOTS[1]]
    masses = [1.0, 2.0 * (1 + x[2]), 1.5, 1.0]
    return model((), None, springs, masses, dashpots, loss).at(np.zeros(0))


def test_factors_are_linear_between_and_constant_outside():
    for f, value, slope in ((1.0, 0.9, 0.1), (2.0, 1.0, 0.125), (3.0, 1.15, 0.15), (9.0, 1.5, 0.0), (8.0, 1.5, 0.025)):
        np.testing.assert_allclose(MODULUS.at(f), (value, slope))


@pytest.mark.quick(0)
@pytest.mark.parametrize("freq_hz", [0.0, 3.3, 20.0])
def test_matrices_are_those_of_the_values(freq_hz: float):
    found = model((MODULUS, LOSSES, DAMPER), ALL).at(X).at_frequency(freq_hz)
    expected = at_values(freq_hz, X)
    for name in ("stiffness", "mass", "viscous", "hysteretic"):
        np.testing.assert_allclose(getattr(found, name).toarray(), getattr(expected, name).toarray(), rtol=1e-13)
    check_matrix_derivatives(found)


def test_derivatives_by_frequency():
    point, h = model((MODULUS, LOSSES, DAMPER), ALL).at(X), 1e-6
    for kind in ("stiffness", "viscous", "hysteretic"):
        found = point.at_frequency(3.3).by_frequency(kind).toarray()
        sides = [getattr(point.at_frequency(3.3 + s * h), kind).toarray() for s in (1, -1)]
        np.testing.assert_allclose(found, (sides[0] - sides[1]) / (2 * h), atol=1e-6)
        assert np.abs(found).max() > 1e-3


@pytest.mark.slow
def test_frfs_of_each_line_are_those_of_its_values():
    configured = model((MODULUS, LOSSES, DAMPER), ALL)
    lines = np.linspace(0.0, 9.0, 19)
    ports = make_ports(configured, ["2X+"], ["1X+", "4X+"])
    found = frf_gradient(configured.at(X), ports, lines, "receptance", "direct")
    np.testing.assert_array_equal(found.frfs.values, frf(configured.at(X), ports, lines, "receptance", "direct").values)
    for i, line in enumerate(lines):
        at = at_values(line, X)
        w = 2 * np.pi * line
        K, M, C, H = (m.toarray() for m in (at.stiffness, at.mass, at.viscous, at.hysteretic))
        inverse = np.linalg.inv(K + 1j * H + 1j * w * C - w**2 * M)
        np.testing.assert_allclose(found.frfs.values[:, :, i], inverse[np.ix_([0, 3], [1])], rtol=1e-10)
    h = 1e-6
    for j in range(5):
        points = [configured.at(X + s * h * np.eye(5)[j]) for s in (1, -1)]
        sides = [frf(point, ports, lines, "receptance", "direct").values for point in points]
        difference = (sides[0] - sides[1]) / (2 * h)
        size = np.abs(found.gradient).max()
        np.testing.assert_allclose(found.gradient[..., j], difference, atol=1e-6 * size)


def test_one_mass_by_hand():
    """k(f) = k₀(1 + f/10 Hz) to 20 Hz, η(f) = η₀(1 + f/5 Hz): m(2πf)² = k(f) is a quadratic equation for f."""
    m, k, eta = 2.0, 800.0, 0.04
    tables = (
        frequency_table([field("K", 1)], [0.0, 20.0], [1.0, 3.0]),
        frequency_table([field("GE", 1)], [0.0, 20.0], [1.0, 5.0]),
    )
    factors = {"k": ("K", 1), "m": ("M", 1), "eta": ("GE", 1)}
    configured = model(tables, factors, [(-1, 0, k)], [m], [], [eta])
    (real,) = modes_at_own_frequency(configured.at(np.zeros(3)), 1)

    def natural(k: float, m: float) -> float:
        a = m * (2 * np.pi) ** 2
        return (k / 10 + np.sqrt((k / 10) ** 2 + 4 * a * k)) / (2 * a)

    assert real.freq_hz == pytest.approx(natural(k, m), rel=1e-12)
    h = 1e-6
    by_k = (natural(k * (1 + h), m) - natural(k * (1 - h), m)) / (2 * h)
    by_m = (natural(k, m * (1 + h)) - natural(k, m * (1 - h))) / (2 * h)
    in_hz = real.gradient / (8 * np.pi**2 * real.freq_hz)
    np.testing.assert_allclose(in_hz, [by_k, by_m, 0.0], rtol=1e-8)
    # the deck's stiffness at a fixed frequency would give half the derivative of the logarithm
    assert by_k / real.freq_hz > 0.55

    def pole(k: float, m: float, eta: float) -> complex:
        def at(f: float) -> complex:
            return complex(1j * np.sqrt(k * (1 + f / 10) * (1 + 1j * eta * (1 + f / 5)) / m))

        return at(brentq(lambda f: abs(at(f)) / (2 * np.pi) - f, 0.1, 20.0, xtol=1e-14, rtol=1e-14))

    (found,) = complex_modes_at_own_frequency(configured.at(np.zeros(3)), 1)
    assert found.eigenvalue == pytest.approx(pole(k, m, eta), rel=1e-10)
    sides = [[pole(*(np.array([k, m, eta]) * (1 + s * h * unit))) for s in (1, -1)] for unit in np.eye(3)]
    differences = [(up - down) / (2 * h) for up, down in sides]
    np.testing.assert_allclose(found.gradient, differences, rtol=1e-6, atol=1e-7)
    # the receptance is 1/(k(f)(1 + iη(f)) − mω²)
    lines = np.array([1.0, 3.5, 4.0, 30.0])
    ports = make_ports(configured, ["1X+"], ["1X+"])
    clipped = np.minimum(lines, 20.0)
    expected = 1 / (k * (1 + clipped / 10) * (1 + 1j * eta * (1 + clipped / 5)) - m * (2 * np.pi * lines) ** 2)
    found_frf = frf(configured.at(np.zeros(3)), ports, lines, "receptance", "direct").values[0, 0]
    np.testing.assert_allclose(found_frf, expected, rtol=1e-12)
    assert static_response(configured.at(np.zeros(3)), ports).values[0, 0] == pytest.approx(1 / k)


@pytest.mark.slow
@pytest.mark.parametrize("solve", [modes_at_own_frequency, complex_modes_at_own_frequency])
def test_modes_satisfy_their_own_matrices_and_derivatives_are_differences(solve):
    configured, h = model((MODULUS, LOSSES, DAMPER), ALL), 1e-5
    found = solve(configured.at(X), 4)
    sides = [[solve(configured.at(X + s * h * np.eye(5)[i]), 4) for s in (1, -1)] for i in range(5)]
    for j, mode in enumerate(found):
        at = at_values(mode.freq_hz, X)
        K, M, C, H = (m.toarray() for m in (at.stiffness, at.mass, at.viscous, at.hysteretic))
        damped = solve is complex_modes_at_own_frequency
        Z = K + 1j * H + mode.eigenvalue * C + mode.eigenvalue**2 * M if damped else K - mode.eigenvalue * M
        np.testing.assert_allclose(Z @ mode.shape, 0.0, atol=1e-8 * np.abs(K).max() * np.abs(mode.shape).max())
        for i in range(5):
            difference = (sides[i][0][j].eigenvalue - sides[i][1][j].eigenvalue) / (2 * h)
            assert abs(mode.gradient[i] - difference) <= 1e-6 * np.abs(mode.gradient).max()
        assert mode.iterations < 12


@pytest.mark.slow
def test_a_residual_of_frfs_finds_the_factors_of_the_tables():
    configured = model((MODULUS, LOSSES), {"k": ("K", 2), "eta": ("GE", 2)})
    truth = np.array([0.2, -0.3])
    ports = make_ports(configured, ["1X+", "4X+"], ["2X+"])
    measured = frf(configured.at(truth), ports, np.linspace(0.5, 9.0, 30), "accelerance", "direct")
    residual, _ = frf_residual(configured.at(np.zeros(2)), measured, way=ModelWay("direct"))
    case: ComparedCase = case_without_modes(configured, (residual,))
    problem = UpdateProblem((case,), configured.model.parameters)
    assert isinstance(residual, FrfResidual)
    check_residual(problem, np.array([0.05, 0.1]))
    assert problem.start(truth).objective < 1e-16
    assert problem.start(np.zeros(2)).objective > 1e-2


def test_what_needs_one_stiffness_is_refused():
    configured = model((MODULUS,))
    point = configured.at(np.zeros(0))
    ports = make_ports(configured, ["1X+"], ["1X+"])
    for act in (
        lambda: solve_modes(point, 2),
        lambda: point.stiffness,
        lambda: point.stiffness_derivatives or point.symmetric_stiffness,
    ):
        with pytest.raises(FemtuneError) as caught:
            act()
        assert caught.value.code == "table.no-frequency"
        check_shown("table.no-frequency", caught.value)
    assert point.mass.shape == (4, 4)
    assert point.viscous.nnz
    frozen = solve_modes(point.at_frequency(3.0), 4)
    assert frf(frozen, ports, [1.0, 2.0], "receptance").values.shape == (1, 1, 2)
    for options in ({"method": "real-modes"}, {"method": "direct", "damping": constant_damping(0.01)}):
        with pytest.raises(FemtuneError) as caught:
            frf(point, ports, [1.0], **options)  # type: ignore[arg-type]
        assert caught.value.code == "table.direct"
        if "damping" not in options:
            check_shown("table.direct", caught.value)


@pytest.mark.parametrize(
    ("code", "tables"),
    [
        ("table.values", lambda: [frequency_table([field("K", 2)], [2.0, 1.0], [1.0, 2.0])]),
        ("table.fields", lambda: [frequency_table([FieldRef("CELAS2", 77, "K")], [1.0], [1.0])]),
    ],
)
def test_messages(code: str, tables: Callable[[], list[FrequencyTable]]):
    with pytest.raises(FemtuneError) as caught:
        model(tables())
    check_shown(code, caught.value)


def test_close_modes_are_refused_as_a_cluster():
    configured = model((MODULUS,))
    modes = direct.modes(configured.at(np.zeros(0)), 3, None)
    with pytest.raises(FemtuneError) as caught:
        direct.derivative(modes, [0, 1], sensor_rows(configured, (0,)))
    check_shown("table.close-modes", caught.value)


def test_a_digest_contains_the_tables():
    points = [model(tables).at(np.zeros(0)) for tables in ((), (MODULUS,), (MODULUS, LOSSES))]
    digests = {matrices_digest(p, "stiffness", "hysteretic") for p in points}
    assert len(digests) == 3
    at = [matrices_digest(points[1].at_frequency(f), "stiffness") for f in (1.0, 3.0)]
    assert at[0] != at[1]


@pytest.mark.parametrize(
    ("fields", "freq", "factor", "code", "word"),
    [
        ([field("K", 2)], [1.0, 2.0], [1.0], "table.values", "2 frequencies and 1 factors"),
        ([field("K", 2)], [2.0, 1.0], [1.0, 2.0], "table.values", "ascending"),
        ([field("K", 2)], [-1.0, 1.0], [1.0, 2.0], "table.values", "ascending"),
        ([field("K", 2)], [1.0, 2.0], [1.0, 0.0], "table.values", "positive"),
        ([field("K", 2)], [1.0, np.nan], [1.0, 1.0], "table.values", "finite"),
        ([], [], [], "table.values", "0 frequencies"),
        ([FieldRef("CELAS2", 77, "K")], [1.0], [1.0], "table.fields", "does not have"),
        ([field("K", 2), field("K", 2)], [1.0], [1.0], "table.fields", "two tables"),
        ([field("M", 2)], [1.0], [1.0], "table.fields", "changes the mass"),
        ([field("GE", 3)], [1.0], [1.0], "table.fields", "no effect"),
    ],
)
def test_bad_tables(fields: list[FieldRef], freq: list[float], factor: list[float], code: str, word: str):
    with pytest.raises(FemtuneError) as caught:
        model((frequency_table(fields, freq, factor),))
    assert caught.value.code == code
    assert word in caught.value.what


@pytest.mark.slow
def test_a_modulus_that_rises_too_steeply_has_no_mode_of_its_own():
    """k(f) = k₀ f²/f₀² between the frequencies of the table: every frequency there is a natural one of its own."""
    f0 = np.sqrt(800.0 / 2.0) / (2 * np.pi)
    lines = np.linspace(0.2, 30.0, 3000)
    steep = frequency_table([field("K", 1)], lines, (lines / f0) ** 2 * (1.0 + 0.001 * lines))
    configured = model((steep,), None, [(-1, 0, 800.0)], [2.0], [], [0.0])
    with pytest.raises(FemtuneError) as caught:
        modes_at_own_frequency(configured.at(np.zeros(0)), 1)
    assert caught.value.code == "table.own-frequency"
    check_shown("table.own-frequency", caught.value)


@pytest.mark.long
def test_residuals_of_modes_at_their_own_frequency():
    """Frequencies and shapes: zero at the truth, and Jacobians that contain the change of stiffness with frequency."""
    configured = model((MODULUS, LOSSES), {"k": ("K", 2), "m": ("M", 3), "other": ("K", 3)})
    rows = sensor_rows(configured, (0, 1, 3))
    truth = np.array([0.2, -0.1, 0.1])
    there = direct.modes(configured.at(truth), 3, None)
    freq = [mode.freq_hz for mode in modes_at_own_frequency(configured.at(truth), 3)]
    np.testing.assert_allclose(there.freq_hz, freq, rtol=1e-10)
    dofs = DofSet(configured.free_dof(i) for i in (0, 1, 3))
    test = ModeSet(there.freq_hz, rows @ there.shapes, dofs)
    case = ComparedCase(configured, test, rows, count=4, residuals=(FrequencyResidual(0.01), ShapeResidual(0.1)))
    problem = UpdateProblem((case,), configured.model.parameters)
    check_residual(problem, np.array([0.05, 0.02, -0.05]))
    assert problem.start(truth).objective < 1e-16
    found = update(problem)
    np.testing.assert_allclose(found.x, truth, atol=1e-6)
    poles = [mode.eigenvalue for mode in complex_modes_at_own_frequency(configured.at(truth), 3)]
    damped = replace(test, freq_hz=np.abs(poles) / (2 * np.pi), damping_ratio=-np.real(poles) / np.abs(poles))
    both = (ComplexEigenvalueResidual(sd=0.01), DampingResidual(sd=0.01))
    problem = UpdateProblem((replace(case, test=damped, residuals=both),), configured.model.parameters)
    check_residual(problem, np.array([0.05, 0.02, -0.05]))
    assert problem.start(truth).objective < 1e-14
    up_to = direct.modes(configured.at(truth), None, freq[1] * 1.01)
    np.testing.assert_allclose(up_to.freq_hz, freq[:2], rtol=1e-10)
