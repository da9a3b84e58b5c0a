"""Antiresonances: found in measured functions, paired, compared, with exact derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.dofs import DofSet
from femtune.errors import FemtuneError, Notice
from femtune.modal import FrfSet, as_kind
from femtune.model import solve_modes
from femtune.model.response import frf, make_ports, zero_finder
from femtune.residuals import (
    AntiresonanceResidual,
    UpdateProblem,
    ZeroGates,
    ZeroSearch,
    antiresonance_residual,
    case_without_modes,
    measured_antiresonances,
)
from femtune.residuals.frf.measured_zeros import Antiresonance, found_antiresonances
from femtune.testing import check_residual
from femtune.updating import SensitivityMethod, update

from .damped import chain, circular

LINES = np.linspace(0.5, 9.0, 600)
PORTS = ["1X+", "3X+"], ["1X+", "2X-", "3X+", "4X+"]
LIGHT, LOSS = np.array([0.15, -0.2, -0.9, 0.0]), 0.005
FREE = np.array([0.02, 0.05, 0.0, 0.0])


def functions(noise: float = 0.0, at: np.ndarray = LIGHT, seed: int = 0) -> FrfSet:
    model = chain(LOSS)
    exact = frf(solve_modes(model.at(at), 5), make_ports(model, *PORTS), LINES, "accelerance", "real-modes")
    scatter = noise * np.abs(exact.values).max(axis=2, keepdims=True)
    return replace(exact, values=exact.values + scatter * circular(exact.values.shape, seed))


def residual_of(frfs: FrfSet, **more: object) -> AntiresonanceResidual:
    modes = solve_modes(chain(LOSS).at(np.zeros(4)), 5)
    return antiresonance_residual(modes, frfs, measured_antiresonances(frfs), **more)[0]  # type: ignore[arg-type]


def exact_zeros(at: np.ndarray = LIGHT) -> dict[tuple[str, str], list[float]]:
    model = chain(LOSS)
    ports = make_ports(model, *PORTS)
    finder = zero_finder(solve_modes(model.at(at), 5), ports)
    return {
        (str(o), str(i)): [np.sqrt(m) / (2 * np.pi) for m in finder.candidates(a, b, 9.0)]
        for a, o in enumerate(ports.output_labels)
        for b, i in enumerate(ports.input_labels)
    }


@pytest.mark.slow
def test_they_are_found_where_the_undamped_model_has_them() -> None:
    """To a few thousandths where what damps them is a loss factor below 0.05."""
    found = measured_antiresonances(functions())
    exact = exact_zeros()
    assert len(found) == 11
    for zero in found:
        near = min(exact[str(zero.response), str(zero.reference)], key=lambda f: abs(f - zero.freq_hz))
        assert zero.freq_hz == pytest.approx(near, rel=5e-3)
        assert 0.0 < zero.damping < 0.05
    point = [z.freq_hz for z in found if str(z.response) == str(z.reference) == "1X+"]
    np.testing.assert_allclose(point, exact["1X+", "1X+"][:2], rtol=2e-3)


@pytest.mark.slow
def test_their_scatter_is_that_of_the_noise() -> None:
    noisy = [measured_antiresonances(functions(2e-5, seed=seed)) for seed in range(40)]
    exact = measured_antiresonances(functions())
    wanted = exact[0]
    same = [
        [
            z
            for z in zs
            if abs(z.freq_hz / wanted.freq_hz - 1) < 0.05
            and z.response == wanted.response
            and z.reference == wanted.reference
        ]
        for zs in noisy
    ]
    values = np.array([z[0].freq_hz for z in same if z])
    sds = np.array([z[0].sd_hz for z in same if z])
    assert len(values) == 40
    assert 0.6 < values.std(ddof=1) / np.sqrt(np.mean(sds**2)) < 1.5
    assert abs(values.mean() - wanted.freq_hz) < 4.0 * values.std() / np.sqrt(40)


def test_a_shallow_minimum_between_two_poles_is_none() -> None:
    """Transfer function of two masses: no zero, but a minimum of the magnitude."""
    lines = np.linspace(0.5, 9.0, 600)
    s = 2j * np.pi * lines
    value = 1.0 / (s**2 + 0.5 * s + (2 * np.pi * 2) ** 2) - 1.0 / (s**2 + 0.5 * s + (2 * np.pi * 5) ** 2)
    one = DofSet.parse(["1X+"])
    frfs = FrfSet(lines, value[None, None], one, DofSet.parse(["2X+"]), "receptance")
    with pytest.raises(FemtuneError, match=r"from 0\.5 to 9 Hz") as error:
        measured_antiresonances(frfs)
    assert error.value.code == "residual.no-antiresonances"


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["receptance", "mobility"])
def test_the_kind_of_function_does_not_matter(kind: str) -> None:
    frfs = functions()
    for a, b in zip(measured_antiresonances(frfs), measured_antiresonances(as_kind(frfs, kind))):
        assert a.freq_hz == pytest.approx(b.freq_hz, rel=1e-9)


@pytest.mark.slow
def test_an_exponential_window_moves_none() -> None:
    """ω of a zero, b + ia, gets i/τ: if the window is not known, √(b² − a²) falls."""
    model, decay = chain(LOSS), 0.3
    ports, modes = make_ports(model, *PORTS), solve_modes(model.at(LIGHT), 5)
    windowed = frf(modes, ports, LINES, "accelerance", "real-modes", decay=decay)

    def apart(some: tuple[Antiresonance, ...]) -> dict[tuple[str, float], Antiresonance]:
        """Without those where the window makes one peak of two that are near."""
        return {
            (f"{a.response} {a.reference}", round(a.freq_hz)): a for a in some if a.freq_hz < 3.0 or a.freq_hz > 7.5
        }

    plain, found, unknown = (
        apart(measured_antiresonances(functions_of, search))
        for functions_of, search in (
            (functions(), ZeroSearch()), (windowed, ZeroSearch(decay=decay)), (windowed, ZeroSearch(most_damping=0.5))
        )
    )  # fmt: skip
    assert set(found) == set(plain)
    assert len(found) >= 5
    for key, a in found.items():
        assert a.freq_hz == pytest.approx(plain[key].freq_hz, rel=1e-6)
        assert a.damping == pytest.approx(plain[key].damping, abs=1e-5)
    lowered = [b.freq_hz / a.freq_hz - 1.0 for a, b in zip(found.values(), unknown.values(), strict=True)]
    omega = np.array([2.0 * np.pi * a.freq_hz for a in found.values()])
    own = 0.5 * omega * [a.damping for a in found.values()]
    np.testing.assert_allclose(lowered, -0.5 * ((own + decay) ** 2 - own**2) / omega**2, rtol=0.01)


def test_jacobian() -> None:
    case = case_without_modes(chain(LOSS), (residual_of(functions()),), count=5)
    check_residual(UpdateProblem((case,), case.configured.model.parameters), FREE, 1e-6)


@pytest.mark.slow
def test_stiffness_and_mass_follow_from_antiresonances_alone() -> None:
    case = case_without_modes(chain(LOSS), (residual_of(functions(), sd=1e-3),), count=5)
    found = update(UpdateProblem((case,), case.configured.model.parameters), SensitivityMethod(), active=["k", "m"])
    np.testing.assert_allclose(found.x[:2], LIGHT[:2], atol=3e-3)


@pytest.mark.slow
def test_unpaired_ones_are_left_out_with_their_reason() -> None:
    frfs = functions()
    modes = solve_modes(chain(LOSS).at(np.zeros(4)), 5)
    zeros = measured_antiresonances(frfs)
    residual, notices = antiresonance_residual(modes, frfs, zeros, gates=ZeroGates(0.02, 0.0))
    assert len(residual.zeros) + len(notices) == len(zeros)
    assert 0 < len(notices) < len(zeros)
    assert all(n.code == "residual.antiresonance-unpaired" for n in notices)
    assert "; the gate is 2 %" in notices[0].what
    _, notices = antiresonance_residual(modes, frfs, zeros, gates=ZeroGates(0.5, 0.9999))
    assert "MAC" in notices[0].what
    with pytest.raises(FemtuneError, match="no antiresonance of the test could be paired"):
        antiresonance_residual(modes, frfs, zeros, gates=ZeroGates(1e-9))


@pytest.mark.slow
def test_motion_tells_near_ones_apart() -> None:
    """A zero of the test at which another motion is measured is not paired with the model's beside it."""
    frfs = functions()
    zeros = measured_antiresonances(frfs)
    wrong = replace(zeros[0], motion=zeros[0].motion * np.array([1, -1, 1, -1]))
    modes = solve_modes(chain(LOSS).at(np.zeros(4)), 5)
    residual, notices = antiresonance_residual(modes, frfs, (wrong, zeros[-1]))
    assert [z.label for z in residual.zeros] == [zeros[-1].label]
    assert "deflection shapes" in notices[0].what


@pytest.mark.quick(0)
@pytest.mark.parametrize("sd", [0.0, -1.0, float("nan")])
def test_no_scatter_is_refused(sd: float) -> None:
    with pytest.raises(FemtuneError) as error:
        residual_of(functions(), sd=sd)
    assert error.value.code == "residual.antiresonance-sd"


@pytest.mark.slow
def test_gaps_and_bands() -> None:
    frfs = functions()
    values = frfs.values.copy()
    values[0] = np.nan
    found = measured_antiresonances(replace(frfs, values=values))
    assert not [z for z in found if str(z.response) == "1X+"]
    band = measured_antiresonances(frfs, ZeroSearch(3.0, 5.0))
    assert {round(z.freq_hz, 6) for z in band} == {
        round(z.freq_hz, 6) for z in measured_antiresonances(frfs) if 3.0 <= z.freq_hz <= 5.0
    }


@pytest.mark.slow
@pytest.mark.quick(1, rest="long")
@pytest.mark.parametrize("noise", [2e-5, 2e-4])
def test_stated_standard_deviations_are_those_of_repeats(noise: float) -> None:
    """Pulls of 40 repeats of four zeros whose FRFs show the poles beside them; some are lost in the larger noise."""
    exact = [z for z in measured_antiresonances(functions()) if not 3.6 < z.freq_hz < 3.9 and z.freq_hz < 7.2]
    pulls = []
    for seed in range(40):
        found = measured_antiresonances(functions(noise, seed=100 + seed))
        for z in exact:
            own = [f for f in found if (f.response, f.reference) == (z.response, z.reference)]
            near = [f for f in own if abs(f.freq_hz / z.freq_hz - 1.0) < 0.05]
            pulls += [(f.freq_hz - z.freq_hz) / f.sd_hz for f in near]
    assert 155 <= len(pulls) <= 160
    assert 0.9 < np.std(pulls) < 1.1
    assert abs(np.mean(pulls)) < 0.3


@pytest.mark.slow
def test_minima_of_noise_are_no_antiresonances() -> None:
    """Two modes with equal residues have one zero, at the mean of the poles; noise of 1e-3 of the largest magnitude."""
    freq = np.arange(1.0, 60.0, 0.1)
    w2 = (2.0 * np.pi * freq) ** 2
    poles = (2.0 * np.pi * np.array([12.0, 33.0])) ** 2
    clean = -w2 * sum(1.0 / (p * (1.0 + 0.01j) - w2) for p in poles)
    noise = 1e-3 * np.abs(clean).max() * circular(freq.shape, 2)
    dof = DofSet.parse(["1X+"])
    found = found_antiresonances(FrfSet(freq, (clean + noise)[None, None], dof, dof, "accelerance"))
    (zero,) = found.zeros
    assert abs(zero.freq_hz - np.sqrt(poles.mean()) / (2.0 * np.pi)) < 3.0 * zero.sd_hz < 1.0
    only = FrfSet(freq, noise[None, None], dof, dof, "accelerance")
    assert len(measured_antiresonances(only, ZeroSearch(above_noise=0.0))) > 3
    with pytest.raises(FemtuneError, match="minima in the noise"):
        measured_antiresonances(only)
    left_out = Notice("residual.antiresonances-in-noise", configuration="beam", count=found.in_noise, ratio=8.0)
    check_shown("residual.antiresonances-in-noise", left_out)
