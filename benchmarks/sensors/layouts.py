"""Random sensor layouts on meshes, with what is right for them."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from femtune.correlation.guessed_sensors import GuessedSensors, guess_sensors
from femtune.fem import NodeTable

Reals = NDArray[np.float64]

MOVED = 0.3
"""Largest distance of a test point from its grid point, over the distance of the grid point from its neighbour."""
WITHOUT_PARTNER = 0.2
"""Largest part of the points without a grid point."""
UNITS = (1.0, 1000.0, 0.001, 25.4, 1.0 / 25.4, 0.0254, 1.0 / 0.0254, 100.0, 0.01)
"""Factors between the units of test and model; half of the tests have that of the model."""
CHANGES = ("none", "shifted", "rotated", "left-handed")


@dataclass(frozen=True, eq=False)
class Layout:
    """Test points on a mesh: `numbers` (n,), `points` (n, 3) and the rows of their grid points, −1 without one."""

    mesh: str
    change: str
    factor: float
    numbers: NDArray[np.int64]
    points: Reals
    grids: NDArray[np.int64]


def _block(nx: int, ny: int, nz: int, h: float) -> Reals:
    axes = [h * np.arange(n + 1.0) for n in (nx, ny, nz)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def _shell(nx: int, ny: int, nz: int, h: float) -> Reals:
    points = _block(nx, ny, nz, h)
    size = h * np.array([nx, ny, nz])
    return points[(np.minimum(points, size - points) < 1e-9).any(axis=1)]


def _frame() -> Reals:
    posts = [(x, 0.0, z) for x in (0.0, 1.2) for z in np.linspace(0.0, 2.4, 13)]
    beams = [(x, 0.0, z) for z in (0.8, 1.6, 2.4) for x in np.linspace(0.0, 1.2, 9)[1:-1]]
    arm = [(0.0, y, 2.4) for y in np.linspace(0.0, 0.9, 7)[1:]]
    return np.array([*posts, *beams, *arm])


def _stiffened() -> Reals:
    ribs = [(x, y, z) for y in (0.08, 0.28) for x in 0.04 * np.arange(17) for z in (0.03, 0.06)]
    return np.concatenate([_block(16, 10, 0, 0.04), np.array(ribs)])


MESHES = {
    "plate": _block(12, 8, 0, 0.05),
    "frame": _frame(),
    "shell box": _shell(8, 6, 5, 0.03),
    "solid": _block(10, 4, 2, 0.02),
    "stiffened plate": _stiffened(),
}


def layout(mesh: str, change: str, seed: int) -> Layout:
    """A layout of 15 to 40 points.

    Points are grid points drawn at random, each moved by at most 0.3 of the distance to the neighbour. Those without
    partner are at least 1.5 elements away from the mesh. Half of the layouts have numbers of other grid points.
    """
    random = np.random.default_rng(seed)
    xyz = MESHES[mesh]
    spacing = cKDTree(xyz).query(xyz, k=2)[0][:, 1]
    n = int(random.integers(15, 41))
    grids = random.choice(len(xyz), n, replace=False)
    steps = random.standard_normal((n, 3))
    steps *= (MOVED * spacing[grids] * random.uniform(0.0, 1.0, n) ** (1.0 / 3.0) / np.linalg.norm(steps, axis=1))[
        :, None
    ]
    points = xyz[grids] + steps
    lost = random.choice(n, int(random.integers(0, int(WITHOUT_PARTNER * n) + 1)), replace=False)
    for i in lost:
        points[i] = _away(random, xyz, spacing)
    size = float(np.linalg.norm(np.ptp(xyz, axis=0)))
    rotation, origin, factor = np.eye(3), np.zeros(3), 1.0
    if change != "none":
        origin = random.uniform(-2.0, 2.0, 3) * size
        factor = float(random.choice(UNITS)) if random.uniform() < 0.5 else 1.0
    if change in ("rotated", "left-handed"):
        rotation = Rotation.random(random_state=int(random.integers(2**31))).as_matrix()
    if change == "left-handed":
        rotation = rotation @ np.diag([1.0, 1.0, -1.0])
    numbers = random.permutation(len(xyz))[:n] + 1 if random.uniform() < 0.5 else np.arange(1001, 1001 + n)
    grids[lost] = -1
    return Layout(mesh, change, factor, numbers, (points @ rotation.T + origin) * factor, grids)


def _away(random: np.random.Generator, xyz: Reals, spacing: Reals) -> Reals:
    """A place at least 1.5 elements from the mesh."""
    low, high = xyz.min(axis=0), xyz.max(axis=0)
    room = 0.3 * np.linalg.norm(high - low)
    while True:
        place = random.uniform(low - room, high + room)
        if np.linalg.norm(xyz - place, axis=1).min() > 1.5 * np.median(spacing):
            return np.asarray(place)


def assigned(one: Layout, found: GuessedSensors) -> NDArray[np.int64]:
    """Row of the grid point that the study of `found` assigns to each point, −1 for those that it leaves out."""
    xyz = MESHES[one.mesh]
    keys: dict[str, Any] = found.test
    rotation, origin = np.array(keys.get("rotation", np.eye(3))), np.array(keys.get("origin", np.zeros(3)))
    moved = keys.get("coordinate_factor", 1.0) * one.points @ rotation.T + origin
    distance, at = cKDTree(xyz).query(moved)
    tolerance = found.sensors.get("tolerance", 1e-3 * np.linalg.norm(np.ptp(xyz, axis=0)))
    left = np.isin(one.numbers, found.sensors.get("leave_out", ()))
    return np.where(left | (distance > tolerance), -1, at)


def outcome(one: Layout) -> str:
    """ "right", "right, symmetry told", "several told", "refused" or "wrong".

    Right are assignments in which nine in ten of the points with a partner have it, none has another one, and no point
    without partner is assigned. A symmetry maps all grid points so that their distances stay.
    """
    xyz = MESHES[one.mesh]
    nodes = NodeTable(np.arange(1, len(xyz) + 1), xyz, np.tile(np.eye(3), (len(xyz), 1, 1)))
    structure: Any = SimpleNamespace(nodes=nodes)
    found = guess_sensors(structure, one.numbers, one.points)
    if not found.found:
        return "refused"
    got = assigned(one, found)
    used = got >= 0
    complete = used[one.grids >= 0].mean() >= 0.9 and not used[one.grids < 0].any()
    if complete and (got[used] == one.grids[used]).all():
        return "right"
    if complete and found.several:
        true, made = xyz[one.grids[used]], xyz[got[used]]
        before, after = (np.linalg.norm(x[:, None] - x[None], axis=2) for x in (true, made))
        if np.abs(before - after).max() <= 1e-6 * before.max():
            return "right, symmetry told"
    return "several told" if found.several else "wrong"


OUTCOMES = ("right", "right, symmetry told", "several told", "refused", "wrong")
