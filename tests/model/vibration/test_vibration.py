"""Sweeps, random vibration and transients: Miles' equation, quadrature, Lyapunov's equation, integration in time."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.linalg import solve_continuous_lyapunov
from scipy.signal import lsim
from tests.messages.shown import check_shown
from tests.model.response.models import SECTION, chain, configured, matrices, point

from femtune.errors import FemtuneError
from femtune.model import EigenSolution, grid_matrix, solve_modes
from femtune.model.damping import ModalDamping, damping_table
from femtune.model.response import frf, make_ports
from femtune.model.vibration import (
    ModalTransfer,
    Spectrum,
    Sweep,
    base_transfer,
    force_transfer,
    response_density,
    response_rms,
    swept_response,
    transient_response,
)
from structures.frames import bars, make_structure

CLOSE = chain([(-1, 0, 4e4), (0, 1, 3e3), (1, -1, 4.2e4), (1, 2, 8e4)], [1.0, 1.05, 0.3])
"""Three masses between walls, whose first modes are close."""
HUNG = chain([(-1, 0, 4e4), (0, 1, 3e4), (1, 2, 5e4)], [1.0, 1.5, 0.7])
"""Three masses on one base."""


def constant(ratio: float) -> ModalDamping:
    return damping_table([0.0, 1e5], [ratio, ratio])


def solved(structure: object, count: int = 3) -> EigenSolution:
    return solve_modes(point(structure), count)  # type: ignore[arg-type]


def driven(structure: object, ratio: float = 0.02, motion: str = "acceleration") -> ModalTransfer:
    modes = solved(structure)
    ports = make_ports(modes.point.configured, ["1X+"], ["1X+", "3X+"])
    return force_transfer(modes, ports, constant(ratio), motion)  # type: ignore[arg-type]


def shaken(structure: object, ratio: float = 0.02, count: int = 3, relative: bool = False) -> ModalTransfer:
    modes = solved(structure, count)
    ports = make_ports(modes.point.configured, ["1X+"], ["1X+", "3X+"])
    return base_transfer(modes, ports, "X", constant(ratio), relative=relative)


def damping_matrix(modes: EigenSolution, ratio: float) -> np.ndarray:
    """C of modal damping with all modes."""
    momentum = modes.point.mass.toarray() @ modes.shapes
    return momentum @ np.diag(2.0 * ratio * np.sqrt(modes.eigenvalues)) @ momentum.T


@pytest.mark.parametrize(
    ("motion", "kind"), [("acceleration", "accelerance"), ("velocity", "mobility"), ("displacement", "receptance")]
)
def test_transfer_functions_of_forces_are_the_frfs(motion: str, kind: str) -> None:
    modes = solved(CLOSE)
    hz = np.linspace(1.0, 120.0, 301)
    ports = make_ports(modes.point.configured, ["1X+"], ["1X+", "3X+"])
    expected = frf(modes, ports, hz, kind, damping=constant(0.02)).values  # type: ignore[arg-type]
    found = driven(CLOSE, motion=motion).at(hz)
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


def test_rigid_body_modes_of_forces() -> None:
    """A free mass pair: its mean acceleration is force over mass."""
    modes = solve_modes(point(chain([(0, 1, 1e4)], [2.0, 3.0])), 2)
    ports = make_ports(modes.point.configured, ["1X+"], ["1X+", "2X+"])
    found = force_transfer(modes, ports, constant(0.01))
    hz = np.linspace(1.0, 50.0, 40)
    np.testing.assert_allclose(np.array([2.0, 3.0]) @ found.at(hz)[:, 0], 1.0, rtol=1e-9)
    assert len(found.poles) == 1


@pytest.mark.parametrize("relative", [False, True])
def test_base_excitation_is_that_of_the_equations_of_motion(relative: bool) -> None:
    """M ü + C u̇ + K u = −M r a of the motion relative to the base, by dense linear algebra."""
    modes = solved(HUNG)
    K, M, *_ = matrices(modes.point)
    C = damping_matrix(modes, 0.02)
    found = shaken(HUNG, relative=relative)
    assert found.inputs == ("base X",)
    for hz in (0.5, 17.0, 33.0, 90.0):
        w = 2.0 * np.pi * hz
        u = np.linalg.solve(K + 1j * w * C - w * w * M, -M @ np.ones(3))
        expected = -w * w * u + (0.0 if relative else 1.0)
        np.testing.assert_allclose(found.at(np.array([hz]))[:, 0, 0], expected[[0, 2]], rtol=1e-9)


def test_the_base_of_a_clamped_beam_in_every_direction() -> None:
    """With consistent mass, in which supports are coupled to what is free; dense matrices of the whole beam."""
    n = 4
    xyz = np.column_stack([np.linspace(0.0, 1.0, n + 1), np.zeros((n + 1, 2))])
    links = bars(np.stack([np.arange(n), np.arange(1, n + 1)], axis=1), SECTION)
    held = make_structure(xyz, [links], consistent_mass=True, permanent=np.arange(6))
    modes = solve_modes(configured(held).at(np.zeros(0)), 6 * n)
    K, M = (m.toarray() for m in (modes.point.stiffness, modes.point.mass))
    whole = grid_matrix(modes.point.configured.model, modes.point.configured.configuration, "mass").toarray()
    ports = make_ports(modes.point.configured, ["5Y+"], ["5Y+", "3Z+"])
    r = np.zeros((6 * (n + 1), 6))
    for i, x in enumerate(xyz[:, 0]):
        r[6 * i : 6 * i + 6] = np.eye(6)
        r[6 * i + 1, 5], r[6 * i + 2, 4] = x, -x
    C = ports.outputs.toarray()
    for axis, name in enumerate(("X", "Y", "Z", "RX", "RY", "RZ")):
        if axis == 3:
            continue
        found = base_transfer(modes, ports, name, constant(0.03))
        w = 2.0 * np.pi * 21.0
        Z = K + 1j * w * damping_matrix(modes, 0.03) - w * w * M
        u = np.linalg.solve(Z, -(whole @ r[:, axis])[6:])
        expected = C @ (r[6:, axis] - w * w * u)
        np.testing.assert_allclose(found.at(np.array([21.0]))[:, 0, 0], expected, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("ratio", [0.005, 0.02, 0.1])
def test_one_degree_of_freedom_is_miles_equation(ratio: float) -> None:
    """White noise: G πf/(4ζ)·(1 + 4ζ²), which for small damping is Miles' (π/2)·f·Q·G."""
    modes = solve_modes(point(chain([(-1, 0, 4e4)], [1.0])), 1)
    f = float(modes.freq_hz[0])
    ports = make_ports(modes.point.configured, ["1X+"], ["1X+"])
    found = response_rms(
        base_transfer(modes, ports, "X", constant(ratio)), [Spectrum([f / 1e4, f * 1e6], [0.04, 0.04])]
    )  # type: ignore[arg-type]
    exact = np.sqrt(0.04 * np.pi * f / (4.0 * ratio) * (1.0 + 4.0 * ratio**2))
    assert found[0] == pytest.approx(exact, rel=1e-5)
    miles = np.sqrt(0.5 * np.pi * f * 0.5 / ratio * 0.04)
    assert found[0] == pytest.approx(miles, rel=2.1 * ratio**2 + 1e-5)


LEVEL = Spectrum([10.0, 20.0, 40.0, 60.0, 200.0], [0.01, 0.04, 0.04, 0.2, 0.003])  # type: ignore[arg-type]


@pytest.mark.quick(0)
@pytest.mark.parametrize("transfer", [driven(CLOSE, 0.03), shaken(HUNG, 0.01), driven(CLOSE, 0.03, "displacement")])
def test_the_root_mean_square_is_that_of_quadrature(transfer: ModalTransfer) -> None:
    found = response_rms(transfer, [LEVEL])
    peaks = np.abs(transfer.poles) / (2.0 * np.pi)
    edges = np.unique(np.concatenate([LEVEL.freq_hz, peaks[(peaks > 10.0) & (peaks < 200.0)]]))
    for o in range(2):

        def integrand(hz: float, o: int = o) -> float:
            return float(response_density(transfer, [LEVEL], np.array([hz]))[o, 0])

        area = sum(quad(integrand, a, b, epsrel=1e-9, epsabs=0.0, limit=500)[0] for a, b in pairwise(edges))
        assert found[o] == pytest.approx(np.sqrt(area), rel=2e-5)


def test_products_of_different_modes_count() -> None:
    """Close modes: squares added mode by mode are wrong by more than ten per cent."""
    whole = driven(CLOSE, 0.08, "displacement")
    rms = response_rms(whole, [LEVEL])
    single = [
        response_rms(
            ModalTransfer(
                whole.poles[m : m + 1], whole.residues[:, :, m : m + 1], whole.direct, whole.outputs, whole.inputs
            ),
            [LEVEL],
        )
        for m in range(3)
    ]
    added = np.sqrt(np.sum(np.square(single), axis=0))
    assert np.max(np.abs(added / rms - 1.0)) > 0.1


def test_white_noise_is_lyapunovs_equation() -> None:
    """A Q + Q Aᵀ + B S Bᵀ = 0 for the covariance of displacements and velocities, S of both signs of ω."""
    modes = solved(CLOSE)
    K, M, *_ = matrices(modes.point)
    C, one = damping_matrix(modes, 0.03), np.array([1.0, 0.0, 0.0])
    inverse = np.linalg.inv(M)
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [-inverse @ K, -inverse @ C]])
    B = np.concatenate([np.zeros(3), inverse @ one])
    covariance = solve_continuous_lyapunov(A, -0.5 * 0.02 * np.outer(B, B))
    white = Spectrum([1e-3, 1e7], [0.02, 0.02])  # type: ignore[arg-type]
    for motion, at in (("displacement", [0, 2]), ("velocity", [3, 5])):
        found = response_rms(driven(CLOSE, 0.03, motion), [white])
        np.testing.assert_allclose(found, np.sqrt(np.diag(covariance)[at]), rtol=1e-4)


def test_inputs_that_are_not_correlated_add_their_squares() -> None:
    modes = solved(CLOSE)
    both = force_transfer(modes, make_ports(modes.point.configured, ["1X+", "2X+"], ["3X+"]), constant(0.02))
    other = Spectrum([5.0, 300.0], [0.5, 0.001])  # type: ignore[arg-type]
    each = []
    for label, spectrum in (("1X+", LEVEL), ("2X+", other)):
        one = force_transfer(modes, make_ports(modes.point.configured, [label], ["3X+"]), constant(0.02))
        each.append(response_rms(one, [spectrum])[0])
    assert response_rms(both, [LEVEL, other])[0] == pytest.approx(np.hypot(*each))


def test_a_spectrum_between_its_points() -> None:
    """6 dB per octave up, flat, 6 dB down: areas of power laws."""
    level = Spectrum([10.0, 20.0, 40.0, 80.0], [1.0, 4.0, 4.0, 1.0])  # type: ignore[arg-type]
    np.testing.assert_allclose(
        level.at(np.array([5.0, 15.0, 30.0, 60.0, 90.0])), [0.0, 2.25, 4.0, 4.0 * (40 / 60) ** 2, 0.0]
    )
    area = (20.0**3 - 10.0**3) / 300.0 + 80.0 + 4.0 * 1600.0 * (1 / 40 - 1 / 80)
    assert level.root_mean_square == pytest.approx(np.sqrt(area))
    hz, g = level.pieces
    assert np.sum(0.5 * (g[1:] + g[:-1]) * np.diff(hz)) == pytest.approx(area, rel=1e-5)
    falling = Spectrum([10.0, 100.0], [1.0, 0.1])  # type: ignore[arg-type]
    assert falling.root_mean_square == pytest.approx(np.sqrt(10.0 * np.log(10.0)))


def _integrated(sweep: Sweep, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequency, and size of the absolute acceleration of the last mass, of the equations of motion in time."""
    modes = solved(HUNG)
    K, M, *_ = matrices(modes.point)
    C = damping_matrix(modes, ratio)
    inverse, T = np.linalg.inv(M), sweep.duration_s
    if sweep.law == "linear":
        signed = sweep.rate * np.sign(sweep.to_hz - sweep.from_hz)
        frequency = lambda t: sweep.from_hz + signed * t  # noqa: E731
        phase = lambda t: 2 * np.pi * (sweep.from_hz * t + 0.5 * signed * t**2)  # noqa: E731
    else:
        r = np.log(sweep.to_hz / sweep.from_hz) / T
        frequency = lambda t: sweep.from_hz * np.exp(r * t)  # noqa: E731
        phase = lambda t: 2 * np.pi * sweep.from_hz * np.expm1(r * t) / r  # noqa: E731

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        a = -inverse @ (K @ y[:3] + C @ y[3:]) - sweep.amplitude * np.exp(1j * phase(t))
        return np.concatenate([y[3:], a])

    times = np.minimum(np.concatenate([[0.0], np.cumsum(sweep.steps()[1])]), T)
    y = solve_ivp(slope, (0.0, T), np.zeros(6, complex), t_eval=times, rtol=1e-9, atol=1e-12, method="DOP853").y
    return frequency(times), np.abs(inverse @ (K @ y[:3] + C @ y[3:]))[2]


@pytest.mark.slow
@pytest.mark.parametrize(
    "sweep",
    [
        Sweep(10.0, 45.0, 6.0, "linear", 2.0),
        Sweep(45.0, 10.0, 6.0, "linear"),
        Sweep(12.0, 48.0, 20.0, "logarithmic", 0.5),
    ],
)
def test_a_sweep_is_that_of_integration_in_time(sweep: Sweep) -> None:
    """The excitation is a cosine and a sine at once; the size of the complex response is the envelope."""
    hz, envelope = swept_response(shaken(HUNG, 0.01), sweep)
    at, expected = _integrated(sweep, 0.01)
    np.testing.assert_allclose(at, hz, rtol=1e-9)
    assert np.max(np.abs(envelope[1] - expected)) < 5e-3 * expected.max()


def test_a_slow_sweep_has_the_transfer_function_as_its_envelope_and_a_fast_one_less() -> None:
    transfer = shaken(HUNG, 0.05)
    hz, envelope = swept_response(transfer, Sweep(10.0, 40.0, 0.005, "linear", 3.0))
    steady = 3.0 * np.abs(transfer.at(hz))[:, 0]
    away = hz > 10.5
    np.testing.assert_allclose(envelope[:, away], steady[:, away], rtol=0.02)
    up_hz, up = swept_response(transfer, Sweep(10.0, 40.0, 30.0, "linear", 3.0))
    down_hz, down = swept_response(transfer, Sweep(40.0, 10.0, 30.0, "linear", 3.0))
    assert up[1].max() < 0.9 * steady[1].max()
    assert up_hz[up[1].argmax()] > hz[steady[1].argmax()] > down_hz[down[1].argmax()]


def test_the_duration_of_a_sweep() -> None:
    for sweep, seconds in ((Sweep(5.0, 2000.0, 2.0), 30.0 * np.log2(400.0)), (Sweep(50.0, 10.0, 4.0, "linear"), 10.0)):
        assert sweep.duration_s == pytest.approx(seconds)
        assert sweep.steps()[1].sum() == pytest.approx(seconds)


@pytest.mark.parametrize("motion", ["displacement", "acceleration"])
def test_a_transient_is_exact_between_samples(motion: str) -> None:
    """SciPy's simulation of the matrices; the input is linear between its samples, and begins with a step."""
    modes = solved(CLOSE)
    K, M, *_ = matrices(modes.point)
    inverse = np.linalg.inv(M)
    C = damping_matrix(modes, 0.03)
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [-inverse @ K, -inverse @ C]])
    B = np.concatenate([np.zeros(3), inverse[:, 0]])[:, None]
    rows = np.eye(6)[[0, 2]] if motion == "displacement" else A[[3, 5]]
    D = np.zeros((2, 1)) if motion == "displacement" else B[[3, 5]]
    signal = np.random.default_rng(1).standard_normal(400)
    times = np.arange(400) * 0.004
    _, expected, _ = lsim((A, B, rows, D), signal, times)
    found = transient_response(driven(CLOSE, 0.03, motion), signal, 0.004)
    np.testing.assert_allclose(found, expected.T, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("vibration.damping", lambda: driven(CLOSE, 0.0)),
        ("vibration.spectrum", lambda: Spectrum([1.0, 2.0], [1.0, 0.0])),
        ("vibration.spectrum, steep", lambda: Spectrum([1.0, 2.0], [1.0, 1e-300]).pieces),
        ("vibration.sweep", lambda: Sweep(10.0, 10.0, 1.0)),
        ("vibration.sweep, slow", lambda: Sweep(1.0, 2000.0, 1e-9, "linear").steps()),
        ("vibration.inputs", lambda: response_rms(driven(CLOSE), [LEVEL, LEVEL])),
    ],
)
def test_errors(name: str, call: object) -> None:
    with pytest.raises(FemtuneError) as caught:
        call()  # type: ignore[operator]
    check_shown(name, caught.value)


def test_errors_of_free_structures_and_directions() -> None:
    modes = solve_modes(point(chain([(0, 1, 1e4)], [2.0, 3.0])), 2)
    ports = make_ports(modes.point.configured, ["1X+"], ["1X+"])
    with pytest.raises(FemtuneError) as caught:
        force_transfer(modes, ports, constant(0.01), "velocity")
    check_shown("vibration.free", caught.value)
    with pytest.raises(FemtuneError) as caught:
        base_transfer(modes, ports, "X", constant(0.01))
    check_shown("vibration.no-base", caught.value)
    held = solved(HUNG)
    with pytest.raises(FemtuneError) as caught:
        base_transfer(held, make_ports(held.point.configured, ["1X+"], ["1X+"]), "101Z", constant(0.01))
    check_shown("vibration.direction", caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2])
def test_accelerations_without_the_upper_modes_are_those_of_the_lower_ones(count: int) -> None:
    def all_and_few(make: Callable[[EigenSolution], ModalTransfer]) -> None:
        every, few = make(solved(HUNG)), make(solved(HUNG, count))
        hz = np.array([0.7, 20.0, 55.0])
        between = 0.5 * (solved(HUNG).freq_hz[count - 1] + solved(HUNG).freq_hz[count])
        np.testing.assert_allclose(every.accelerations_below(between).at(hz), few.at(hz), rtol=1e-10)
        assert every.highest_hz == pytest.approx(solved(HUNG).freq_hz[-1])

    ports = make_ports(solved(HUNG).point.configured, ["1X+"], ["1X+", "3X+"])
    all_and_few(lambda modes: base_transfer(modes, ports, "X", constant(0.02)))
    all_and_few(lambda modes: force_transfer(modes, ports, constant(0.02)))
