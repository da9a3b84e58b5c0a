"""Single distorted solids and their laws: what several tests of solids share."""

from __future__ import annotations

import numpy as np

from femtune.fem.assemble import assemble
from femtune.fem.elements.solids.hexa8 import CORNERS as HEXA
from femtune.fem.elements.solids.penta6 import CORNERS as PENTA
from femtune.fem.elements.solids.tetra4 import CORNERS as TETRA
from structures.shells import Isotropic, dofs_of, natural_frequencies
from structures.solids import Law, SolidPart, solid_mesh, solid_model, solid_structure

PYRAMID = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, 0, 1.5]])
CORNERS = {"hexa8": HEXA, "penta6": PENTA, "tetra4": TETRA, "pyram5": PYRAMID}
KINDS = list(CORNERS)
ISO = Isotropic(200.0, 0.3, 2.0, 0.02)
LAW = np.array(
    [
        [210.0, 61.0, 55.0, 7.0, -4.0, 3.0],
        [61.0, 143.0, 47.0, -5.0, 6.0, 2.0],
        [55.0, 47.0, 99.0, 4.0, 1.0, -8.0],
        [7.0, -5.0, 4.0, 50.0, 3.0, -2.0],
        [-4.0, 6.0, 1.0, 3.0, 38.0, 5.0],
        [3.0, 2.0, -8.0, -2.0, 5.0, 29.0],
    ]
)
ANISO = Law(LAW, 2.0, 0.02)


def turned(n: int, seed: int = 5) -> np.ndarray:
    rng = np.random.default_rng(seed)
    q = np.array([np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(n)])
    return q * np.linalg.det(q)[:, None, None]


def distorted(kind: str, size: float = 0.2, seed: int = 1) -> np.ndarray:
    xyz = CORNERS[kind]
    return xyz + np.random.default_rng(seed).uniform(-size, size, xyz.shape)


def one(kind: str, xyz, material=ISO, frame=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), **settings):
    cell = [list(range(len(CORNERS[kind])))]
    return solid_structure(xyz, [SolidPart(kind, cell, material, frame)], **settings)


def translations(n: int) -> np.ndarray:
    return (6 * np.arange(n)[:, None] + np.arange(3)).ravel()


def dense(structure, kind: str = "stiffness") -> np.ndarray:
    at = translations(len(structure.nodes.ids))
    return assemble(structure, kind).toarray()[np.ix_(at, at)]


def lean(u, v, w):
    return 2.0 * u + 0.4 * v, 1.5 * v + 0.2 * w, w + 0.3 * u


def translations_of(order) -> np.ndarray:
    return (3 * np.array(order)[:, None] + np.arange(3)).ravel()


GRADIENT = np.array([[0.3, 0.1, -0.2], [0.4, -0.2, 0.5], [0.1, 0.25, 0.15]])


def solved_patch(structure, rim) -> tuple[np.ndarray, np.ndarray, float]:
    """Displacements inside when the rim follows a linear field, that field, and the energy of the field."""
    K = dense(structure)
    u = (structure.nodes.xyz @ GRADIENT.T).ravel()
    outer = translations_of(rim)
    inner = np.setdiff1d(np.arange(len(u)), outer)
    found = np.linalg.solve(K[np.ix_(inner, inner)], -K[np.ix_(inner, outer)] @ u[outer])
    return found, u[inner], float(u @ K @ u)


def sliding_box(kind: str, n: int, nu: float = 0.3, squeeze: float = 0.06) -> float:
    """Relative error of the lowest eigenvalue of a box that slides on its six faces, on a curved mesh.

    Its mode is a shear wave, (sin πx/a cos πy/b, …, 0): λ = (G/ρ) π² (1/a² + 1/b²).
    """
    a, b, c = 1.0, 0.9, 0.8

    def place(u, v, w):
        x = u + squeeze * np.sin(np.pi * u) * np.sin(2 * np.pi * v + 0.5) * np.cos(np.pi * w)
        y = v + squeeze * np.sin(np.pi * v) * np.sin(2 * np.pi * w)
        return a * x, b * y, c * (w + squeeze * np.sin(np.pi * w) * np.sin(2 * np.pi * u))

    mesh = solid_mesh(place, (n, n, n), kind)
    held = set().union(
        *(dofs_of(np.concatenate([mesh.face(f"{k}0"), mesh.face(f"{k}1")]), str(i + 1)) for i, k in enumerate("uvw"))
    )
    structure = solid_model(mesh, Isotropic(1.0, nu, 1.0), held=held, consistent_mass=True)
    exact = np.sqrt((1.0 / (2 + 2 * nu)) * (1 / a**2 + 1 / b**2)) / 2.0
    return float((natural_frequencies(structure, 1)[0] / exact) ** 2 - 1.0)
