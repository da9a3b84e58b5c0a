"""Errors of sensor placement: gradients against closed forms, covariance against displaced sensors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.deck_models import model_of

from femtune.correlation import map_sensors, sensor_placement
from femtune.correlation.placement import SensorPlacement
from femtune.dofs import DofSet
from femtune.modal import ModeSet
from femtune.model import ConfiguredModel
from femtune.testdata import ModalTest, WireFrame, sensors_at
from femtune.units import SI

HEAD = "SOL 103\nCEND\nSPC = 1\nBEGIN BULK\nMAT1    1       2.1+11          0.3     7850.\n"
TAIL = "SPC1    1       123456  1\nENDDATA\n"


def _configured(folder: Path, cards: list[str]) -> ConfiguredModel:
    path = folder / "model.bdf"
    path.write_text(HEAD + "\n".join(cards) + "\n" + TAIL)
    return model_of(path)


def _grids(points: np.ndarray) -> list[str]:
    return [f"GRID    {i + 1:<8d}        {x:<8.5f}{y:<8.5f}{z:<8.5f}" for i, (x, y, z) in enumerate(points)]


def _beam(folder: Path, n: int = 11, skew: bool = False) -> ConfiguredModel:
    direction = np.array([0.6, 0.8, 0.0]) if skew else np.array([1.0, 0.0, 0.0])
    bars = [f"CBAR    {i:<8d}1       {i:<8d}{i + 1:<8d}0.0     0.0     1.0" for i in range(1, n)]
    section = "PBAR    1       1       1.0-3   2.0-7   5.0-7   4.0-7"
    return _configured(folder, [*_grids(np.outer(np.linspace(0.0, 1.0, n), direction)), section, *bars])


def _placement(
    configured: ConfiguredModel, labels: list[str], position: float | dict[int, float], angle: float = 0.0
) -> SensorPlacement:
    dofs = DofSet.parse(labels)
    nodes = configured.model.structure.nodes
    ids = sorted({d.node for d in dofs})
    frame = WireFrame(np.array(ids), np.array([nodes.xyz[nodes.position(n)] for n in ids]))
    modes = ModeSet(np.array([1.0]), np.ones((len(dofs), 1)), dofs)
    test = ModalTest("t", SI, frame, sensors_at(frame, dofs), modes=modes)
    found = map_sensors(test, configured.model.structure, tolerance=1e-3)
    return sensor_placement(configured, found, position, angle)


def _field(configured: ConfiguredModel, motion, rotation) -> np.ndarray:
    """g-set displacements of functions of the position, both (3,)."""
    return np.concatenate([np.concatenate([motion(x), rotation(x)]) for x in configured.model.structure.nodes.xyz])


def test_a_beam_s_transverse_sensor_has_the_slope_of_its_rotation(tmp_path: Path) -> None:
    """w = sin kx along Z, rotation RY = −w′: standard deviation |w′|σ, whatever the mesh."""
    configured, k, sigma = _beam(tmp_path), 5.0, 0.01
    found = _placement(configured, ["4Z+", "11Z-", "4Y+", "4X+"], sigma)
    u = _field(
        configured, lambda x: np.array([0, 0, np.sin(k * x[0])]), lambda x: np.array([0, -k * np.cos(k * x[0]), 0])
    )
    P = found.covariance(u)
    slope = k * np.cos(k * np.array([0.3, 1.0]))
    np.testing.assert_allclose(np.sqrt(np.diag(P))[:2], np.abs(slope) * sigma, rtol=1e-9)
    np.testing.assert_allclose(P[2:], 0.0, atol=1e-15)
    # other test nodes are independent
    assert P[0, 1] == 0.0


def test_axial_motion_takes_its_gradient_from_the_neighbours(tmp_path: Path) -> None:
    """Linear u along a skew beam is exact; sensors in X and Y of one node move together."""
    configured = _beam(tmp_path, skew=True)
    e, strain = np.array([0.6, 0.8, 0.0]), 0.2
    u = _field(configured, lambda x: strain * (e @ x) * e, lambda x: np.zeros(3))
    P = _placement(configured, ["6X+", "6Y+", "6Z+", "11X+"], 0.01).covariance(u)
    wanted = (0.01 * strain) ** 2 * np.outer(e, e)
    np.testing.assert_allclose(P[:3, :3], wanted, atol=1e-18)
    assert P[3, 3] == pytest.approx(wanted[0, 0])


def test_a_tilted_sensor_reads_the_transverse_motion(tmp_path: Path) -> None:
    """Var = σ²|d × u|²; X and Z sensors of a node, tilted together, are correlated by −u_x u_z σ²."""
    configured, angle = _beam(tmp_path), np.radians(2.0)
    motion = np.array([0.3, -0.2, 0.9])
    u = _field(configured, lambda x: motion, lambda x: np.zeros(3))
    P = _placement(configured, ["6X+", "6Z+", "8X+"], 0.0, angle).covariance(u)
    x, z = (np.cross(d, motion) for d in (np.eye(3)[0], np.eye(3)[2]))
    assert P[0, 0] == pytest.approx(angle**2 * (x @ x))
    assert P[0, 1] == pytest.approx(angle**2 * (x @ z))
    assert P[0, 2] == 0.0
    # the exact reading of a sensor turned by a small rotation
    alpha = 1e-3 * np.array([0.4, -0.7, 0.2])
    turned = np.eye(3)[0] + np.cross(alpha, np.eye(3)[0])
    assert turned @ motion - motion[0] == pytest.approx(alpha @ x, rel=1e-6)


def _plate(folder: Path, card: str, section: str) -> ConfiguredModel:
    n = 9
    x, y = np.meshgrid(np.linspace(0.0, 0.4, n), np.linspace(0.0, 1.2, n))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(n * n)])
    first = [i * n + j + 1 for i in range(n - 1) for j in range(n - 1)]
    quads = [f"{card:<8s}{a:<8d}1       {a:<8d}{a + 1:<8d}{a + n + 1:<8d}{a + n:<8d}" for a in first]
    return _configured(folder, [*_grids(points), section, *quads])


def test_a_plate_s_normal_sensor_has_the_slopes_of_both_directions(tmp_path: Path) -> None:
    configured = _plate(tmp_path, "CQUAD4", "PSHELL  1       1       .01     1               1")
    a, b = 4.0, 2.0

    def rotation(x: np.ndarray) -> np.ndarray:
        # θx = ∂w/∂y, θy = −∂w/∂x
        return np.array([b * np.sin(a * x[0]) * np.cos(b * x[1]), -a * np.cos(a * x[0]) * np.sin(b * x[1]), 0.0])

    u = _field(configured, lambda x: np.array([0.0, 0.0, np.sin(a * x[0]) * np.sin(b * x[1])]), rotation)
    label = 3 * 9 + 5
    P = _placement(configured, [f"{label}Z+", f"{label}X+"], 0.01).covariance(u)
    x, y = configured.model.structure.nodes.xyz[label - 1][:2]
    slopes = np.array([a * np.cos(a * x) * np.sin(b * y), b * np.sin(a * x) * np.cos(b * y)])
    assert np.sqrt(P[0, 0]) == pytest.approx(0.01 * np.linalg.norm(slopes), rel=1e-9)
    # in its plane: du_x = 3x − 2y + 0.5
    plane = _field(configured, lambda x: np.array([3 * x[0] - 2 * x[1] + 0.5, 0.0, 0.0]), lambda x: np.zeros(3))
    found = _placement(configured, [f"{label}Z+", f"{label}X+", "1X+"], 0.01).covariance(plane)
    assert np.sqrt(found[1, 1]) == pytest.approx(0.01 * np.sqrt(13.0))
    assert found[0, 0] == pytest.approx(0.0, abs=1e-15)
    assert np.sqrt(found[2, 2]) == pytest.approx(0.01 * np.sqrt(13.0))


def test_a_solid_takes_the_whole_gradient_from_its_neighbours(tmp_path: Path) -> None:
    n = 3
    axes = np.linspace(0.0, 0.2, n)
    points = np.array([[x, y, z] for z in axes for y in axes for x in axes])
    at = lambda i, j, k: k * n * n + j * n + i + 1  # noqa: E731
    cards = []
    for k in range(n - 1):
        for j in range(n - 1):
            for i in range(n - 1):
                c = [at(i, j, k), at(i + 1, j, k), at(i + 1, j + 1, k), at(i, j + 1, k)]
                c += [at(i, j, k + 1), at(i + 1, j, k + 1), at(i + 1, j + 1, k + 1), at(i, j + 1, k + 1)]
                number = len(cards) // 2 + 1
                cards.append(f"CHEXA   {number:<8d}1       " + "".join(f"{v:<8d}" for v in c[:6]) + "+")
                cards.append("+       " + "".join(f"{v:<8d}" for v in c[6:]))
    configured = _configured(tmp_path, [*_grids(points), "PSOLID  1       1", *cards])
    G = np.array([[0.1, -0.2, 0.3], [0.5, 0.4, -0.6], [-0.7, 0.8, 0.2]])
    u = _field(configured, lambda x: G @ x, lambda x: np.zeros(3))
    P = _placement(configured, ["14X+", "14Y+", "27Z+"], 0.01).covariance(u)
    assert P[0, 0] == pytest.approx(1e-4 * (G[0] @ G[0]))
    assert P[0, 1] == pytest.approx(1e-4 * (G[0] @ G[1]))
    assert P[2, 2] == pytest.approx(1e-4 * (G[2] @ G[2]))


def test_the_covariance_is_that_of_displaced_sensors(tmp_path: Path) -> None:
    """Monte Carlo on a cantilever shape whose value is known everywhere."""
    configured, sigma, k = _beam(tmp_path), 0.004, 3.0
    u = _field(
        configured, lambda x: np.array([0, 0, 1 - np.cos(k * x[0])]), lambda x: np.array([0, -k * np.sin(k * x[0]), 0])
    )
    P = _placement(configured, ["3Z+", "7Z+", "10Z+"], sigma).covariance(u)
    at = np.array([0.2, 0.6, 0.9])
    readings = 1 - np.cos(k * (at + sigma * np.random.default_rng(0).standard_normal((20000, 3))))
    np.testing.assert_allclose(np.diag(np.cov(readings.T)), np.diag(P), rtol=0.04)


def test_each_test_node_may_have_its_own_deviation(tmp_path: Path) -> None:
    configured = _beam(tmp_path)
    u = _field(configured, lambda x: np.array([0, 0, x[0]]), lambda x: np.array([0, -1.0, 0]))
    found = _placement(configured, ["4Z+", "6Z+"], {6: 0.02})
    np.testing.assert_allclose(np.diag(found.covariance(u)), [0.0, 4e-4])
