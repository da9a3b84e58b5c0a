"""Structured meshes of shells, their laws and sections, and quick solutions: for tests and examples.

A mesh is a mapping of the unit square; a ``ShellPart`` gives its cells a section; ``shell_structure`` joins them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femtune.arrays import Integers, Reals
from femtune.fem.assemble import assemble
from femtune.fem.fields import FieldRef
from femtune.fem.structure import ElementBatch, NodeTable, Structure
from femtune.fem.values import ValueTableBuilder
from femtune.model import Configuration, ModelPoint, configure, parametric_model, solve_modes
from femtune.model.solvers.factorise import factorise
from femtune.parameters import ParameterSet
from structures.frames import Part, part_batch

Mapped = Callable[[Reals, Reals], ArrayLike]

MEMBRANE = ("11", "12", "13", "22", "23", "33")
SHEAR = ("11", "12", "22")
CARDS = {
    4: ("shell-quad", "CQUAD4"),
    3: ("shell-tri", "CTRIA3"),
    8: ("shell-quad8", "CQUAD8"),
    6: ("shell-tri6", "CTRIA6"),
}
"""Kind of batch and card by the number of nodes."""


@dataclass(frozen=True, eq=False)
class ShellMesh:
    """Nodes (n, 3) of a grid of nu × nv cells, and the cells (e, 4), (e, 3), (e, 8) or (e, 6) as rows of the nodes.

    `rows` (nu + 1, nv + 1) holds the node of each grid point; in a closed mesh the last row is the first. With mid-side
    nodes it is (2 nu + 1, 2 nv + 1), −1 where no node is.
    """

    xyz: Reals
    cells: Integers
    rows: Integers

    def edge(self, name: str) -> Integers:
        """Nodes along an edge: "u0" (u = 0), "u1", "v0" or "v1"."""
        return np.asarray(
            {"u0": self.rows[0], "u1": self.rows[-1], "v0": self.rows[:, 0], "v1": self.rows[:, -1]}[name]
        )

    @property
    def rim(self) -> Integers:
        """Nodes on all four edges."""
        return np.unique(np.concatenate([self.edge(name) for name in ("u0", "u1", "v0", "v1")]))


def shell_mesh(
    mapping: Mapped, nu: int, nv: int, cells: str = "quad", closed: bool = False, distort: float = 0.0, seed: int = 0
) -> ShellMesh:
    """A mesh of the mapping (u, v) in [0, 1]² -> (x, y, z), arrays of the shape of u on axis 0 of three.

    Parameters
    ----------
    cells : "quad"; or two triangles a cell: "right" and "left" by the slope of the diagonal, "union" alternating;
        each with mid-side nodes as "quad8", "right6", "left6", "union6", these at the mapping of the sides' middles
    closed : True joins u = 1 to u = 0
    distort : inner grid points are moved at random by up to this part of a cell, in (u, v)
    """
    place = np.stack(np.meshgrid(np.linspace(0.0, 1.0, nu + 1), np.linspace(0.0, 1.0, nv + 1), indexing="ij"))
    move = np.random.default_rng(seed).uniform(-distort, distort, (2, nu - 1, nv - 1))
    place[:, 1:-1, 1:-1] += move / np.array([nu, nv])[:, None, None]
    corners, curved = cells.rstrip("68"), cells[-1] in "68"
    if curved:
        place = _with_middles(place, corners)
    u, v = place
    rows = np.arange(u.size).reshape(u.shape)
    xyz = np.stack([np.broadcast_to(x, u.shape) for x in mapping(u, v)], axis=-1).reshape(-1, 3)  # type: ignore[union-attr]
    if closed:
        rows[-1] = rows[0]
    found = _curved_cells(rows, corners) if curved else _cells(rows, corners)
    used, at = np.unique(found, return_inverse=True)
    new = np.full(len(xyz), -1)
    new[used] = np.arange(len(used))
    return ShellMesh(np.asarray(xyz[used], float), at.reshape(found.shape), new[rows])


def _with_middles(place: Reals, cells: str) -> Reals:
    """(2, 2 nu + 1, 2 nv + 1) parameters of grid points and of the middles of the lines between them."""
    out = np.zeros((2, *(2 * n - 1 for n in place.shape[1:])))
    out[:, ::2, ::2] = place
    out[:, 1::2, ::2] = 0.5 * (place[:, 1:] + place[:, :-1])
    out[:, ::2, 1::2] = 0.5 * (place[:, :, 1:] + place[:, :, :-1])
    nu, nv = (n - 1 for n in place.shape[1:])
    ends = place[:, :-1, :-1] + place[:, 1:, 1:], place[:, 1:, :-1] + place[:, :-1, 1:]
    out[:, 1::2, 1::2] = 0.5 * np.where(_right(nu, nv, cells), *ends)
    return out


def _right(nu: int, nv: int, cells: str) -> NDArray[np.bool_]:
    """(nu, nv) True where the diagonal runs from the first corner."""
    i, j = np.indices((nu, nv))
    return np.asarray({"right": i >= 0, "left": i < 0, "union": (i + j) % 2 == 0, "quad": i >= 0}[cells])


def _cells(rows: Integers, cells: str) -> Integers:
    a, b, c, d = rows[:-1, :-1], rows[1:, :-1], rows[1:, 1:], rows[:-1, 1:]
    quads = np.stack([a, b, c, d], axis=-1).reshape(-1, 4)
    if cells == "quad":
        return quads
    nu, nv = a.shape
    right = _right(nu, nv, cells).ravel()
    one = np.where(right[:, None], quads[:, [0, 1, 2]], quads[:, [0, 1, 3]])
    two = np.where(right[:, None], quads[:, [0, 2, 3]], quads[:, [1, 2, 3]])
    return np.stack([one, two], axis=1).reshape(-1, 3)


def _curved_cells(rows: Integers, cells: str) -> Integers:
    """Corners, then the middles of the sides, from rows of twice as fine a grid."""
    corners = _cells(np.arange(rows.size).reshape(rows.shape)[::2, ::2], cells)
    at = np.stack(np.unravel_index(corners, rows.shape))
    places = np.concatenate([at, (at + np.roll(at, -1, axis=2)) // 2], axis=2)
    return np.asarray(rows[places[0], places[1]])


def rectangle(a: float, b: float, skew: float = 0.0) -> Mapped:
    """A plate a × b in the plane z = 0; `skew` in radians leans the sides v, whose length stays b."""
    return lambda u, v: (a * u + b * v * np.sin(skew), b * v * np.cos(skew), 0.0 * u)


def cylinder(radius: float, length: float, start: float = 0.0, angle: float = 2.0 * np.pi) -> Mapped:
    """A cylinder about the z axis: u goes around from `start` by `angle` in radians, v along."""

    def place(u: Reals, v: Reals) -> tuple[Reals, Reals, Reals]:
        turn = start + angle * u
        return radius * np.cos(turn), radius * np.sin(turn), length * v

    return place


@dataclass(frozen=True)
class Isotropic:
    """A MAT1: Young's modulus, Poisson's ratio, density and loss factor."""

    E: float
    nu: float
    rho: float = 0.0
    GE: float = 0.0


@dataclass(frozen=True)
class Anisotropic:
    """A MAT2: entries of the plane-stress law by name ("11" to "33"), of transverse shear, density, loss factor."""

    law: Mapping[str, float]
    shear: Mapping[str, float] = field(default_factory=dict)
    rho: float = 0.0
    GE: float = 0.0


Material = Isotropic | Anisotropic


@dataclass(frozen=True)
class Section:
    """A PSHELL; `z0` None where no offset is given. Bending and shear are of `material` unless given apart."""

    material: Material
    t: float
    z0: float | None = None
    NSM: float = 0.0
    RI: float = 1.0
    TS: float = 5.0 / 6.0
    bending: Material | None = None
    shear: Material | None = None
    has_membrane: bool = True
    has_bending: bool = True


@dataclass(frozen=True, eq=False)
class ShellPart:
    """Cells (e, 4) or (e, 3) with one section; `theta` in radians and `direction` are the material's axis."""

    cells: Integers
    section: Section
    theta: ArrayLike = 0.0
    direction: ArrayLike = (0.0, 0.0, 0.0)


def shell_structure(
    xyz: ArrayLike,
    shells: Iterable[ShellPart],
    others: Iterable[Part] = (),
    frames: NDArray | None = None,
    held: Iterable[int] = (),
    **settings: Any,
) -> Structure:
    """A structure of shells, elements 1, 2, … and properties 1, 2, …, with other elements after them.

    Elements of a part share their values: ``PSHELL 1 T``, ``MAT1 1 E`` (``MAT1 11`` bending, ``MAT1 21`` shear
    where they differ). `held` are DOFs 6·node + component (0 to 5); `settings` are further fields of Structure.
    """
    points = np.array(xyz, float)
    basic = np.tile(np.eye(3), (len(points), 1, 1))
    nodes = NodeTable(np.arange(1, len(points) + 1), points, basic if frames is None else frames)
    table, batches, first = ValueTableBuilder(), [], 1
    for i, part in enumerate(shells):
        batches.append(_shell_batch(i + 1, first, part, table))
        first += len(part.cells)
    batches += [part_batch(first // 1000 + 1 + i, part, table) for i, part in enumerate(others)]
    fixed = np.unique(np.fromiter(held, dtype=np.int64))
    return Structure(nodes, table.table(), tuple(batches), permanent=fixed, **settings)


def _shell_batch(number: int, first: int, part: ShellPart, table: ValueTableBuilder) -> ElementBatch:
    cells = np.asarray(part.cells, np.int64)
    e, n = cells.shape
    kind, card = CARDS[n]
    dofs = np.where(cells[:, :, None] >= 0, 6 * cells[:, :, None] + np.arange(6), -1).reshape(e, -1)
    roles = {name: np.full(e, at) for name, at in _roles(number, part.section, table).items()}
    section = part.section
    flags = {
        "has_membrane": section.has_membrane,
        "has_bending": section.has_bending,
        "offset_given": section.z0 is not None,
    }
    facts = {name: np.full(e, flag) for name, flag in flags.items()}
    facts["theta"] = np.broadcast_to(np.asarray(part.theta, float), (e,)).copy()
    facts["direction"] = np.broadcast_to(np.asarray(part.direction, float), (e, 3)).copy()
    return ElementBatch(kind, card, first + np.arange(e), cells, dofs, roles, facts)


def _roles(number: int, section: Section, table: ValueTableBuilder) -> dict[str, int]:
    zero = table.add(FieldRef("", 0, "zero"), 0.0)
    own = {"t": section.t, "NSM": section.NSM, "RI": section.RI, "TS": section.TS}
    out = {name: table.add(FieldRef("PSHELL", number, name.upper()), value) for name, value in own.items()}
    out["z0"] = zero if section.z0 is None else table.add(FieldRef("PSHELL", number, "ZOFFS"), section.z0)
    laws = (
        ("M", "GE", MEMBRANE, section.material, number),
        ("B", "GEB", MEMBRANE, section.bending, 10 + number),
        ("S", "GES", SHEAR, section.shear, 20 + number),
    )
    for letter, loss, names, given, apart in laws:
        material, mid = (section.material, number) if given is None else (given, apart)
        entries = _law(material, mid, table, zero, shear=letter == "S")
        out |= {f"{letter}{name}": entries[name] for name in names}
        out[loss] = entries["GE"]
        out.setdefault("rho", entries["rho"])
    return out


def _law(material: Material, mid: int, table: ValueTableBuilder, zero: int, shear: bool) -> dict[str, int]:
    card = "MAT1" if isinstance(material, Isotropic) else "MAT2"
    out = {name: table.add(FieldRef(card, mid, name.upper()), getattr(material, name)) for name in ("rho", "GE")}
    if isinstance(material, Anisotropic):
        prefix, law, names = ("S", material.shear, SHEAR) if shear else ("G", material.law, MEMBRANE)
        return out | {k: table.add(FieldRef(card, mid, f"{prefix}{k}"), law.get(k, 0.0)) for k in names}
    E, nu = (table.add(FieldRef(card, mid, name.upper()), getattr(material, name)) for name in ("E", "nu"))
    D11 = table.derive(FieldRef(card, mid, "D11"), lambda E, nu: E / (1.0 - nu * nu), E, nu)
    D12 = table.derive(FieldRef(card, mid, "D12"), lambda E, nu: nu * E / (1.0 - nu * nu), E, nu)
    G = table.derive(FieldRef(card, mid, "G"), lambda E, nu: E / (2.0 + 2.0 * nu), E, nu)
    if shear:
        return out | {"11": G, "12": zero, "22": G}
    return out | {"11": D11, "12": D12, "13": zero, "22": D11, "23": zero, "33": G}


def dofs_of(nodes: ArrayLike, components: str) -> set[int]:
    """DOFs of the given components ("123456") of nodes."""
    return {6 * int(n) + int(c) - 1 for n in np.atleast_1d(nodes) for c in components}


def model_at_nominal(structure: Structure) -> ModelPoint:
    """The structure as a model without parameters."""
    return configure(parametric_model(structure, ParameterSet(()), ()), Configuration("nominal")).at(np.zeros(0))


def natural_frequencies(structure: Structure, count: int) -> Reals:
    """The lowest natural frequencies in Hz, rigid-body modes included."""
    return solve_modes(model_at_nominal(structure), count).freq_hz


def static_displacements(structure: Structure, force: Reals) -> Reals:
    """(n_g,) displacements under g-set forces (n_g,); what the structure holds stays zero."""
    free = np.setdiff1d(np.arange(structure.nodes.n_dofs), structure.permanent)
    K = assemble(structure, "stiffness")[free][:, free]
    out = np.zeros(structure.nodes.n_dofs)
    out[free] = factorise(K).solve(force[free])
    return out


def uniform_load(structure: Structure, direction: ArrayLike) -> Reals:
    """(n_g,) forces of the mass under a unit acceleration: with ρ·t = q a load q an area, shared as the mass is."""
    rigid = np.zeros(structure.nodes.n_dofs)
    n = 6 * len(structure.nodes.ids)
    rigid[:n].reshape(-1, 6)[:, :3] = np.einsum("nij,i->nj", structure.nodes.frames, np.asarray(direction, float))
    return np.asarray(assemble(structure, "mass") @ rigid)
