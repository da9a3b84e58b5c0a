"""Structured meshes of solids, their materials, and structures made of them: for tests and examples.

A mesh is a mapping of the unit cube; a ``SolidPart`` gives its cells a material; ``solid_structure`` joins them.
Quick solutions are those of ``structures.shells`` (``static_displacements``, ``natural_frequencies`` …).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femtune.arrays import Integers, Reals
from femtune.fem.elements.solids.laws import ENTRIES
from femtune.fem.elements.solids.shape import (
    HEXA20_SHAPE as HEXA20,
)
from femtune.fem.elements.solids.shape import (
    PENTA15_SHAPE as PENTA15,
)
from femtune.fem.elements.solids.shape import (
    PYRAM13_SHAPE as PYRAM13,
)
from femtune.fem.elements.solids.shape import (
    TETRA10_SHAPE as TETRA10,
)
from femtune.fem.elements.solids.shape import (
    SolidShape,
)
from femtune.fem.fields import FieldRef
from femtune.fem.structure import ElementBatch, NodeTable, Structure
from femtune.fem.values import ValueTableBuilder
from structures.frames import Part, part_batch
from structures.shells import Isotropic

Mapped = Callable[[Reals, Reals, Reals], ArrayLike]

CARDS = {
    "hexa8": "CHEXA",
    "hexa20": "CHEXA",
    "penta6": "CPENTA",
    "penta15": "CPENTA",
    "tetra4": "CTETRA",
    "tetra10": "CTETRA",
    "pyram5": "CPYRAM",
    "pyram13": "CPYRAM",
}

# cells of one box of the grid by its corners, in the order of CHEXA; 8 is a node in its middle
_SPLITS = {
    "hexa8": [[0, 1, 2, 3, 4, 5, 6, 7]],
    "penta6": [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]],
    # all paths from corner 0 to corner 6 along the sides, so that neighbours share the diagonals of their faces
    "tetra4": [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]],
    "pyram5": [[0, 1, 2, 3, 8], [7, 6, 5, 4, 8], [0, 4, 5, 1, 8], [1, 5, 6, 2, 8], [2, 6, 7, 3, 8], [3, 7, 4, 0, 8]],
}
_QUADRATIC: dict[str, tuple[str, SolidShape]] = {
    "hexa20": ("hexa8", HEXA20),
    "penta15": ("penta6", PENTA15),
    "tetra10": ("tetra4", TETRA10),
    "pyram13": ("pyram5", PYRAM13),
}
_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])


@dataclass(frozen=True, eq=False)
class SolidMesh:
    """Nodes and cells of one kind.

    Parameters
    ----------
    kind : "hexa8", "penta6", "tetra4", "pyram5" …
    xyz : (n, 3) nodes
    cells : (e, k) rows of the nodes in the order of the card
    uvw : (n, 3) where the nodes are in the unit cube
    """

    kind: str
    xyz: Reals
    cells: Integers
    uvw: Reals

    def face(self, name: str) -> Integers:
        """Nodes on a face of the cube: "u0" (u = 0), "u1", "v0" … "w1"."""
        return np.flatnonzero(np.abs(self.uvw[:, "uvw".index(name[0])] - float(name[1])) < 1e-9)

    @property
    def rim(self) -> Integers:
        """Nodes on all six faces."""
        return np.flatnonzero((np.minimum(self.uvw, 1.0 - self.uvw) < 1e-9).any(axis=1))


def solid_mesh(
    mapping: Mapped, counts: tuple[int, int, int], kind: str = "hexa8", distort: float = 0.0, seed: int = 0
) -> SolidMesh:
    """A mesh of the mapping (u, v, w) in [0, 1]³ -> (x, y, z), of nu × nv × nw boxes.

    Parameters
    ----------
    kind : "hexa8" is one cell a box, "penta6" two with their triangles across w, "tetra4" six, "pyram5" six that meet
        in a node in the box's middle; "hexa20", "penta15", "tetra10", "pyram13" are these with mid-side nodes, which
        the mapping places too, so that sides are curved where it is
    distort : inner grid points are moved at random by up to this part of a box, in (u, v, w)
    """
    if kind in _QUADRATIC:
        first, shape = _QUADRATIC[kind]
        return _with_middles(solid_mesh(mapping, counts, first, distort, seed), kind, shape, mapping)
    grid = np.indices([c + 1 for c in counts]).reshape(3, -1).T
    uvw = grid / np.array(counts)
    inner = np.all((grid > 0) & (grid < np.array(counts)), axis=1, keepdims=True)
    move = np.random.default_rng(seed).uniform(-distort, distort, grid.shape) / np.array(counts)
    uvw = uvw + np.where(inner, move, 0.0)
    boxes = _boxes(counts)
    if kind == "pyram5":
        middles = len(uvw) + np.arange(len(boxes))
        uvw = np.concatenate([uvw, uvw[boxes].mean(axis=1)])
        boxes = np.concatenate([boxes, middles[:, None]], axis=1)
    cells = boxes[:, np.array(_SPLITS[kind])].reshape(-1, len(_SPLITS[kind][0]))
    return SolidMesh(kind, mapped(mapping, uvw), cells, uvw)


def _with_middles(mesh: SolidMesh, kind: str, shape: SolidShape, mapping: Mapped) -> SolidMesh:
    ends = np.sort(mesh.cells[:, np.array(shape.edges)], axis=2)
    pairs, own = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
    uvw = np.concatenate([mesh.uvw, mesh.uvw[pairs].mean(axis=1)])
    cells = np.concatenate([mesh.cells, len(mesh.uvw) + own.reshape(len(ends), -1)], axis=1)
    return SolidMesh(kind, mapped(mapping, uvw), cells, uvw)


def _boxes(counts: tuple[int, int, int]) -> Integers:
    """(b, 8) grid points of the boxes, in the order of CHEXA."""
    first = np.indices(counts).reshape(3, -1).T
    corners = first[:, None] + _CORNERS
    return np.ravel_multi_index(tuple(np.moveaxis(corners, 2, 0)), tuple(c + 1 for c in counts)).astype(np.int64)


def mapped(mapping: Mapped, uvw: Reals) -> Reals:
    """(n, 3) places of points (n, 3) of the unit cube."""
    u, v, w = uvw.T
    return np.stack([np.broadcast_to(x, u.shape) for x in mapping(u, v, w)], axis=-1).astype(float)  # type: ignore[union-attr]


def box(a: float, b: float, c: float) -> Mapped:
    """The box a × b × c with one corner at the origin."""
    return lambda u, v, w: (a * u, b * v, c * w)


@dataclass(frozen=True, eq=False)
class Law:
    """A MAT9: (6, 6) law of xx, yy, zz, xy, yz, zx with engineering shears, density, loss factor."""

    law: ArrayLike
    rho: float = 0.0
    GE: float = 0.0


@dataclass(frozen=True, eq=False)
class SolidPart:
    """Cells (e, k) of one kind with one material, whose axes are the columns of `frame`; −1 is no mid-side node."""

    kind: str
    cells: ArrayLike
    material: Isotropic | Law
    frame: ArrayLike = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def solid_structure(
    xyz: ArrayLike,
    solids: Iterable[SolidPart],
    others: Iterable[Part] = (),
    frames: NDArray | None = None,
    held: Iterable[int] = (),
    **settings: Any,
) -> Structure:
    """A structure of solids, elements 1, 2, …, with other elements after them.

    The i-th part has values of its own: ``MAT1 i E`` or ``MAT9 i G11``. `held` are DOFs 6·node + component (0 to 5);
    the turns of nodes that only solids have are held too. `settings` are further fields of Structure.
    """
    points = np.array(xyz, float)
    basic = np.tile(np.eye(3), (len(points), 1, 1))
    nodes = NodeTable(np.arange(1, len(points) + 1), points, basic if frames is None else frames)
    table, batches, first = ValueTableBuilder(), [], 1
    for i, part in enumerate(solids):
        batches.append(_solid_batch(i + 1, first, part, table))
        first += len(batches[-1])
    batches += [part_batch(first // 1000 + 1 + i, part, table) for i, part in enumerate(others)]
    fixed = {int(dof) for dof in held} | _turns(len(points), batches)
    return Structure(nodes, table.table(), tuple(batches), permanent=np.array(sorted(fixed), np.int64), **settings)


def solid_model(mesh: SolidMesh, material: Isotropic | Law, **settings: Any) -> Structure:
    """A structure of one mesh and one material; `settings` as of ``solid_structure``."""
    return solid_structure(mesh.xyz, [SolidPart(mesh.kind, mesh.cells, material)], **settings)


def _turns(count: int, batches: Iterable[ElementBatch]) -> set[int]:
    """DOFs of the turns of the nodes that no element but solids has."""
    used = [b.nodes.ravel() for b in batches if b.kind not in CARDS]
    alone = np.setdiff1d(np.arange(count), np.concatenate([np.zeros(0, np.int64), *used]))
    return set((6 * alone[:, None] + np.arange(3, 6)).ravel().tolist())


def _solid_batch(number: int, first: int, part: SolidPart, table: ValueTableBuilder) -> ElementBatch:
    cells = np.asarray(part.cells, np.int64)
    e = len(cells)
    roles = {name: np.full(e, at) for name, at in _law(number, part.material, table).items()}
    facts = {
        "isotropic": np.full(e, isinstance(part.material, Isotropic)),
        "material_frame": np.tile(np.asarray(part.frame, float), (e, 1, 1)),
    }
    dofs = np.where(cells[:, :, None] < 0, -1, 6 * cells[:, :, None] + np.arange(3)).reshape(e, -1)
    return ElementBatch(part.kind, CARDS[part.kind], first + np.arange(e), cells, dofs, roles, facts)


def _law(mid: int, material: Isotropic | Law, table: ValueTableBuilder) -> dict[str, int]:
    """Positions of the entries of a material's law; zeros are one position."""
    zero = table.add(FieldRef("", 0, "zero"), 0.0)
    card = "MAT1" if isinstance(material, Isotropic) else "MAT9"
    out = {name: table.add(FieldRef(card, mid, name.upper()), getattr(material, name)) for name in ("rho", "GE")}
    if isinstance(material, Isotropic):
        return out | _isotropic(mid, material, table, zero)
    law = np.asarray(material.law, float)
    for role in ENTRIES:
        value = law[int(role[1]) - 1, int(role[2]) - 1]
        out[role] = table.add(FieldRef(card, mid, f"G{role[1:]}"), value) if value else zero
    return out


def _isotropic(mid: int, material: Isotropic, table: ValueTableBuilder, zero: int) -> dict[str, int]:
    E, nu = (table.add(FieldRef("MAT1", mid, name.upper()), getattr(material, name)) for name in ("E", "nu"))
    lam = table.derive(FieldRef("MAT1", mid, "LAMBDA"), lambda E, nu: E * nu / ((1 + nu) * (1 - 2 * nu)), E, nu)
    mu = table.derive(FieldRef("MAT1", mid, "G"), lambda E, nu: E / (2.0 + 2.0 * nu), E, nu)
    both = table.derive(FieldRef("MAT1", mid, "C11"), lambda lam, mu: lam + 2.0 * mu, lam, mu)
    same = {"C11": both, "C22": both, "C33": both, "C44": mu, "C55": mu, "C66": mu}
    return dict.fromkeys(ENTRIES, zero) | same | dict.fromkeys(("C12", "C13", "C23"), lam)


def isotropic_law(E: float, nu: float) -> Reals:
    """(6, 6) law of an isotropic material."""
    lam, mu = E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), E / (2.0 + 2.0 * nu)
    out = np.diag([2.0 * mu] * 3 + [mu] * 3)
    out[:3, :3] += lam
    return out
