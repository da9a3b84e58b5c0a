"""The three ways agree where they should, and differ by what truncation costs where they may."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from femtune.dofs import parse_dof
from femtune.errors import FemtuneError
from femtune.fem import Structure
from femtune.model import ModelPoint, solve_modes
from femtune.model.damping import as_hysteretic, constant_damping, damping_table
from femtune.model.response import METHODS, DampingRatios, Signal, frf, make_ports
from femtune.model.response.basis import damping_forces
from femtune.model.response.dynamic_stiffness import DynamicStiffness, sparse_solver
from femtune.model.response.modal_damping import modal_damper

from .models import beam, chain, dense_receptance, point, rising

SPRINGS = [(-1, 0, 900.0), (0, 1, 700.0), (1, 2, 800.0), (2, 3, 500.0), (0, 2, 150.0)]
MASSES = [1.0, 2.0, 1.5, 1.0]
LOSS = [0.02, 0.1, 0.0, 0.3, 0.0]
CASES: dict[str, tuple[Callable[[], Structure], DampingRatios | None]] = {
    "dashpots": (lambda: chain(SPRINGS, MASSES, [(-1, 1, 3.0), (2, 3, 5.0)]), None),
    "loss factors": (lambda: chain(SPRINGS, MASSES, loss=LOSS), None),
    "one loss factor": (lambda: chain(SPRINGS, MASSES, loss=0.03), None),
    "modal": (lambda: chain(SPRINGS, MASSES), rising(0.02, 4.0)),
    "hysteretic modal": (lambda: chain(SPRINGS, MASSES, [(-1, 1, 3.0)]), as_hysteretic(rising(0.02, 4.0))),
    "free, hysteretic modal": (lambda: chain(SPRINGS[1:], MASSES), as_hysteretic(damping_table([1, 9], [20, 30], "Q"))),
    "all together": (lambda: chain(SPRINGS, MASSES, [(-1, 1, 3.0), (2, 3, 5.0)], LOSS), constant_damping(0.02)),
    "overdamped": (lambda: chain(SPRINGS, MASSES, [(-1, 1, 3.0), (2, 3, 500.0)]), None),
    "free, relative dashpot": (lambda: chain(SPRINGS[1:], MASSES, [(2, 3, 5.0)]), None),
    "free, grounded dashpot": (lambda: chain(SPRINGS[1:], MASSES, [(-1, 3, 5.0)]), None),
    "free, loss factor": (lambda: chain(SPRINGS[1:], MASSES, loss=0.1), None),
    "free, modal": (lambda: chain(SPRINGS[1:], MASSES), constant_damping(0.1)),
    "repeated modes": (lambda: chain([(-1, i, 100.0) for i in range(4)], [1.0] * 4, [(0, 1, 1.0), (-1, 3, 2.0)]), None),
    "massless point with a dashpot": (
        lambda: chain([(-1, 0, 900.0), (0, 1, 300.0), (1, 2, 400.0)], [1.0, 0.0, 2.0], [(-1, 1, 30.0)]),
        None,
    ),
    "massless point": (lambda: chain([(-1, 0, 900.0), (0, 1, 300.0), (1, 2, 400.0)], [1.0, 0.0, 2.0], loss=0.1), None),
}


def _modal_matrix(at: ModelPoint, damping: DampingRatios | None, freq_hz: NDArray) -> NDArray:
    """C of modal damping at each line (n, n, k): MΦ diag(2ζω) ΦᵀM, or 2ζω²/Ω in place of 2ζω where it is hysteretic."""
    n = at.configured.n_free
    if damping is None:
        return np.zeros((n, n, len(freq_hz)))
    modes, M = solve_modes(at, 10), at.mass.toarray()
    elastic = modes.freq_hz > 1e-4
    half, w = (M @ modes.shapes[:, : len(elastic)])[:, elastic], 2 * np.pi * modes.freq_hz[elastic]
    rate = 2 * damping.ratio(modes.freq_hz[elastic]) * w
    over = w[:, None] / (2 * np.pi * freq_hz) if damping.hysteretic else np.ones((len(w), len(freq_hz)))
    return np.einsum("ir,rk,jr->ijk", half, rate[:, None] * over, half)


@pytest.mark.quick(0, gate=16)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("method", METHODS)
def test_all_modes_give_the_inverse_of_the_dynamic_stiffness(case: str, method: str) -> None:
    make, damping = CASES[case]
    at = point(make())
    f = np.linspace(0.1, 9.0, 90)
    n = at.configured.n_free
    pair = Signal(parse_dof("99X+"), {parse_dof("1X+"): 1.0, parse_dof(f"{n}X+"): -1.0}, "pair")
    ports = make_ports(at.configured, ["2X+", pair], ["1X+", "3X-"])
    found = frf(solve_modes(at, 10), ports, f, "receptance", method, damping=damping)  # type: ignore[arg-type]
    inverse = dense_receptance(at, f, _modal_matrix(at, damping, f))
    exact = np.einsum("oi,ijk,jb->obk", ports.outputs.toarray(), inverse, ports.inputs.toarray())
    assert np.abs(found.values - exact).max() <= 1e-9 * np.abs(exact).max()
    np.testing.assert_allclose(found.values, exact, rtol=1e-8, atol=1e-9 * np.abs(exact).max())
    assert found.reference_names == ("2X+", "pair")


def test_modal_damping_carries_the_direct_way_at_a_natural_frequency() -> None:
    """There the sparse part of Z is singular, and only the low rank makes it regular; repeated modes too."""
    for springs, masses in ((SPRINGS, MASSES), ([(-1, i, 100.0) for i in range(4)], [1.0] * 4)):
        modes = solve_modes(point(chain(springs, masses)), 4)
        ports = make_ports(modes.point.configured, ["1X+"], ["1X+", "4X+"])
        lines = np.unique(np.round(modes.freq_hz, 12))
        direct, modal = (frf(modes, ports, lines, method=m, damping=constant_damping(0.01)).values for m in METHODS[:2])
        np.testing.assert_allclose(direct, modal, rtol=1e-8, atol=1e-10 * np.abs(modal).max())


@pytest.mark.parametrize("factor", [1.0, 1e12, 1e-12])
def test_the_sparse_part_is_propped_near_natural_frequencies_only(factor: float) -> None:
    """One spring to ground for each mode within half a per cent, whatever the unit of time."""
    springs = [(-1, i, factor * k) for i, k in enumerate([100.0, 100.0, 400.0])]
    modes = solve_modes(point(chain(springs, [1.0] * 3)), 3)
    stiffness = DynamicStiffness(modes.point, modal_damper(modes, constant_damping(0.01)))
    for omega, count in ((10.01, 2), (9.0, 0), (20.02, 1), (15.0, 0)):
        found, weights = stiffness.grounded_dofs(1j * omega * np.sqrt(factor))
        assert len(found) == len(weights) == count
        assert set(found) <= ({0, 1} if omega < 12.0 else {2})


def test_no_force_has_no_response() -> None:
    """Of a dynamic stiffness, and of a sparse matrix; also beside forces that have one."""
    stiffness, s = DynamicStiffness(point(chain(SPRINGS, MASSES, loss=LOSS))), 3j
    forces = np.eye(4)[:, :2] * [1.0, 0.0]
    for solve in (stiffness.solver(s), sparse_solver(stiffness.sparse(s))):
        assert not solve(np.zeros((4, 1))).any()
        found = solve(forces)
        np.testing.assert_allclose(stiffness.sparse(s) @ found, forces, atol=1e-12)
        assert not found[:, 1].any()


@pytest.mark.parametrize(("dashpots", "count"), [(1, 1), (2, 2), (3, 0)])
def test_forces_of_dashpots_on_up_to_a_quarter_of_the_degrees_of_freedom(dashpots: int, count: int) -> None:
    springs = [(i - 1, i, 100.0) for i in range(8)]
    at = point(chain(springs, [1.0] * 8, [(-1, i, 3.0) for i in range(dashpots)]))
    forces = damping_forces(at)
    assert forces.shape == (8, count)
    assert not forces[dashpots:].any()


LINES = np.linspace(1.0, 200.0, 25)


def _errors(
    at: ModelPoint, count: int, method: str, residual_vectors: bool, lines: NDArray = LINES, kind: str = "accelerance"
) -> float:
    ports = make_ports(at.configured, ["11Y+", "6RZ+"], ["11Y+", "4Y+"])
    exact = frf(at, ports, lines, kind, "direct").values  # type: ignore[arg-type]
    found = frf(solve_modes(at, count), ports, lines, kind, method, residual_vectors=residual_vectors)  # type: ignore[arg-type]
    return float((np.linalg.norm(found.values - exact, axis=-1) / np.linalg.norm(exact, axis=-1)).max())


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS[1:])
@pytest.mark.parametrize("consistent", [True, False])
def test_residual_vectors_make_the_static_response_exact(method: str, consistent: bool) -> None:
    """With lumped mass the turning of a node moves no mass: its residual vector is a pseudo-mode without mass."""
    at = beam(10, clamped=True, consistent=consistent)
    assert _errors(at, 2, method, True, np.zeros(1), "receptance") < 1e-8
    assert _errors(at, 2, method, False, np.zeros(1), "receptance") > 1e-4


@pytest.mark.quick(1)
@pytest.mark.parametrize("method", METHODS[1:])
@pytest.mark.parametrize("clamped", [True, False])
def test_residual_vectors_shrink_the_truncation_error(method: str, clamped: bool) -> None:
    """Up to 200 Hz, with the modes up to some 400 Hz: the error falls by more than a factor of thirty."""
    at = beam(10, clamped=clamped, GE=0.02)
    count = 4 if clamped else 5
    without, with_vectors = (_errors(at, count, method, flag) for flag in (False, True))
    assert without > 1e-3
    assert with_vectors < without / 30.0


def test_accelerance_tends_to_the_direct_term_of_the_modes() -> None:
    """−ω²/(λ − ω²) → 1: far above the modes a truncated superposition leaves CΦΦᵀB."""
    modes = solve_modes(beam(10), 5)
    ports = make_ports(modes.point.configured, ["1Y+"], ["1Y+", "4Y+"])
    high = frf(modes, ports, [1e5 * modes.freq_hz[-1]], method="real-modes", residual_vectors=False).values[:, 0, 0]
    phi = modes.shapes[:, :5]
    np.testing.assert_allclose(high, (ports.outputs @ phi) @ (ports.inputs.T @ phi).T[:, 0], rtol=1e-8)


@pytest.mark.parametrize("method", METHODS)
def test_a_line_on_an_undamped_resonance_is_refused(method: str) -> None:
    at = point(chain([(-1, 0, 4.0 * np.pi**2)], [1.0]))
    ports = make_ports(at.configured, ["1X+"], ["1X+"])
    with pytest.raises(FemtuneError) as caught:
        frf(solve_modes(at, 1), ports, [0.5, 1.0, 2.0], method=method)  # type: ignore[arg-type]
    assert caught.value.code == "response.resonance"
    assert caught.value.values == {"frequency (Hz)": "1"}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("dashpots", [[], [(0, 1, 2.0)]])
def test_a_free_structure_has_no_response_at_zero(method: str, dashpots: list[tuple[int, int, float]]) -> None:
    at = point(chain([(0, 1, 50.0)], [1.0, 2.0], dashpots))
    ports = make_ports(at.configured, ["1X+"], ["1X+"])
    with pytest.raises(FemtuneError) as caught:
        frf(solve_modes(at, 2), ports, [0.0, 1.0], method=method)  # type: ignore[arg-type]
    assert caught.value.code == "response.free-at-zero"


def test_progress_counts_the_lines() -> None:
    at = point(chain(SPRINGS, MASSES))
    seen: list[tuple[int, int]] = []
    ports = make_ports(at.configured, ["1X+"], ["1X+"])
    frf(at, ports, [1.0, 2.0], method="direct", progress=lambda done, all_: seen.append((done, all_)))
    assert seen == [(1, 2), (2, 2)]
