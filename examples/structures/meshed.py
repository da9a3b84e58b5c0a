"""A meshed structure as arrays, ready to be written as a deck: nodes, elements, properties, masses, rigid ties."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femtune.arrays import Integers, Reals
from femtune.errors import FemtuneError
from femtune.files.nastran import format_real

# ----------------------------------------------------------------------------------------------------
# Patches of structured mesh in a reference space of straight boxes, welded where their points coincide.
#
# Members are drawn as axis-parallel sheets and rings; two patches that use the same breaks have the same points on
# their common edge, so welding them is merging equal points. A smooth map bends the welded mesh afterwards.


# Points closer than this (metres) are one; the odd offset keeps the round coordinates of a drawing off the edges
# between two cells of the rounding grid.
_QUANTUM, _OFFSET, _REACH = 1e-6, 1.0 + 0.3718e-6, 2_097_152

_FINE = 0.065
"""Intervals at least this long (metres) have two cells or more."""


@dataclass(frozen=True, eq=False)
class Patch:
    """Points (n, 3) and the cells (e, k) of one group: k = 3 or 4 for shells, 8 for solids, 2 for bars."""

    group: str
    points: Reals
    cells: Integers


def ticks(breaks: Sequence[float], size: float | Sequence[float]) -> Reals:
    """Ascending coordinates that hit all breaks, with cells of about `size` (or one an interval) between them.

    The number of cells follows from the length of the interval and the size alone: equal intervals agree everywhere.
    """
    ordered = sorted(breaks)
    sizes = np.broadcast_to(size, len(ordered) - 1)
    spans = zip(ordered, ordered[1:], sizes, strict=False)
    parts = [np.linspace(a, b, cells_along(b - a, h), endpoint=False) for a, b, h in spans]
    return np.append(np.concatenate(parts), ordered[-1])


def cells_along(length: float, size: float) -> int:
    """Number of cells along an interval."""
    return max(2 if length > _FINE else 1, round(round(length, 9) / size))


def grid_rows(*counts: int) -> Integers:
    """Rows of the points of a grid with `counts` points along its axes."""
    return np.arange(int(np.prod(counts)), dtype=np.int64).reshape(counts)


def sheet(group: str, x: ArrayLike, y: ArrayLike, z: ArrayLike, outward: int = 1) -> Patch:
    """A flat sheet of quadrilaterals: one of x, y, z is a number, the others ticks; normal along ± that axis."""
    points, axes = _flat_grid(x, y, z)
    rows = grid_rows(*axes)
    return Patch(group, points, _turned(points, _quads(rows), outward))


def triangle_sheet(group: str, x: ArrayLike, y: ArrayLike, z: ArrayLike, outward: int = 1) -> tuple[Patch, Patch]:
    """Half of a square sheet with its right angle at the first ticks: quadrilaterals, and triangles on the slope.

    Both ticks hold the same number of cells; they may descend.
    """
    points, (n, _) = _flat_grid(x, y, z)
    rows, (i, j) = grid_rows(n, n), np.indices((n - 1, n - 1))
    whole, slope = (i + j < n - 2).ravel(), (i + j == n - 2).ravel()
    quads, tris = _quads(rows)[whole], _quads(rows)[slope][:, [0, 1, 3]]
    return (
        Patch(group, points, _turned(points, quads, outward)),
        Patch(group, points, _turned(points, tris, outward)),
    )


def _flat_grid(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> tuple[Reals, list[int]]:
    grids = np.meshgrid(*(np.atleast_1d(np.asarray(c, float)) for c in (x, y, z)), indexing="ij")
    axes = [n for n in grids[0].shape if n > 1]
    return np.stack(grids, axis=-1).reshape(-1, 3), axes


def _quads(rows: Integers) -> Integers:
    return np.stack([rows[:-1, :-1], rows[1:, :-1], rows[1:, 1:], rows[:-1, 1:]], axis=-1).reshape(-1, 4)


def _turned(points: Reals, cells: Integers, outward: int) -> Integers:
    """Cells of a flat sheet, reversed where their normal does not point along `outward` times its axis."""
    if not len(cells):
        return cells
    a, b, c = points[cells[0, 0]], points[cells[0, 1]], points[cells[0, -1]]
    return cells if np.cross(b - a, c - a).sum() * outward > 0 else cells[:, ::-1].copy()


@dataclass(frozen=True, eq=False)
class Hole:
    """A vertical round hole in the middle of a rectangle of ticks: the directions of its rim follow the rectangle."""

    x: Reals
    y: Reals
    radius: float

    @property
    def centre(self) -> Reals:
        """(2,) the middle."""
        return np.array([self.x[0] + self.x[-1], self.y[0] + self.y[-1]]) / 2.0

    @property
    def outline(self) -> Reals:
        """(m, 2) points of the rectangle, counter-clockwise from its first corner."""
        x, y = self.x, self.y
        sides = [
            (x[:-1], np.full(len(x) - 1, y[0])),
            (np.full(len(y) - 1, x[-1]), y[:-1]),
            (x[:0:-1], np.full(len(x) - 1, y[-1])),
            (np.full(len(y) - 1, x[0]), y[:0:-1]),
        ]
        return np.concatenate([np.stack(side, axis=-1) for side in sides])

    def ring(self, radius: float) -> Reals:
        """(m, 2) points of a circle about the middle, one opposite each point of the outline."""
        counts = np.array([len(self.x) - 1, len(self.y) - 1] * 2)
        quarter = np.concatenate([q + np.arange(n) / n for q, n in enumerate(counts)])
        angle = (quarter - 1.5) * np.pi / 2.0
        return np.asarray(self.centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1))

    def layers(self) -> Reals:
        """Fractions from rim to outline whose cells grow like their distance from the middle."""
        ratio = 0.565 * (np.ptp(self.x) + np.ptp(self.y)) / 2.0 / self.radius
        count = max(1, round(np.log(ratio) * len(self.outline) / (2.0 * np.pi)))
        return np.asarray((ratio ** (np.arange(count + 1) / count) - 1.0) / (ratio - 1.0))

    def rims(self) -> Reals:
        """(layers + 1, m, 2) closed lines from the rim to the outline."""
        s = self.layers()[:, None, None]
        return np.asarray((1.0 - s) * self.ring(self.radius) + s * self.outline)


def holed_sheet(group: str, hole: Hole, z: float, outward: int = 1) -> Patch:
    """The rectangle around a hole as a sheet at height z."""
    flat = hole.rims()
    points = lifted(flat.reshape(-1, 2), z)
    return Patch(group, points, _turned(points, _quads(_closed(grid_rows(*flat.shape[:2]))), outward))


def washer(group: str, hole: Hole, inner: float, z: float, outward: int = 1) -> Patch:
    """Rings of cells that narrow a hole to the radius `inner`."""
    ratio = hole.radius / inner
    count = max(1, int(0.5 * np.log(ratio) * len(hole.outline) / (2.0 * np.pi)))
    flat = np.array([hole.ring(inner * ratio ** (i / count)) for i in range(count)] + [hole.ring(hole.radius)])
    points = np.concatenate([lifted(ring, z) for ring in flat])
    return Patch(group, points, _turned(points, _quads(_closed(grid_rows(*flat.shape[:2]))), outward))


def lifted(flat: Reals, z: float) -> Reals:
    """Points (m, 2) at the height z."""
    return np.column_stack([flat, np.full(len(flat), z)])


def tube(group: str, ring: Reals, z: Reals) -> Patch:
    """A vertical tube through the points of a ring, normals outward."""
    points = _stacked(ring[None], z)
    cells = _quads(_closed(grid_rows(len(ring), len(z)).T).T)
    return Patch(group, points, cells)


def solid_ring(group: str, rings: Reals, z: Reals) -> Patch:
    """Hexahedra between closed lines (layers + 1, m, 2), from the inner to the outer, over the heights z."""
    layers, m, _ = rings.shape
    rows = grid_rows(layers, m, len(z))
    return Patch(group, _stacked(rings, z), hexahedra(np.concatenate([rows, rows[:, :1]], axis=1)))


def hexahedra(rows: Integers) -> Integers:
    """Cells (e, 8) of a grid of points (i, j, k) whose axes are right-handed."""
    low, up = slice(None, -1), slice(1, None)
    base = [(low, low), (up, low), (up, up), (low, up)]
    corners = [rows[i, j, k] for k in (low, up) for i, j in base]
    return np.stack(corners, axis=-1).reshape(-1, 8)


def _stacked(rings: Reals, z: Reals) -> Reals:
    layers, m, _ = rings.shape
    flat = np.broadcast_to(rings[:, :, None, :], (layers, m, len(z), 2))
    height = np.broadcast_to(z[:, None], (layers, m, len(z), 1))
    return np.concatenate([flat, height], axis=-1).reshape(-1, 3)


def _closed(rows: Integers) -> Integers:
    return np.concatenate([rows, rows[:, :1]], axis=1)


@dataclass(frozen=True, eq=False)
class Weld:
    """The joined mesh: points (n, 3) that cells use, and cells as rows of them by (group, corners)."""

    points: Reals
    cells: dict[tuple[str, int], Integers]
    keys: Integers

    def rows(self, points: Reals) -> Integers:
        """Rows of the mesh's points at the given places (m, 3).

        Raises
        ------
        ValueError : where the mesh has no such point: the drawing contradicts itself
        """
        wanted = _keys(points)
        found = np.minimum(np.searchsorted(self.keys, wanted), len(self.keys) - 1)
        if not np.array_equal(self.keys[found], wanted):
            raise ValueError(f"no mesh point at {points[self.keys[found] != wanted][0]}")
        return found


def weld(patches: Iterable[Patch]) -> Weld:
    """One mesh out of patches: points at the same place become one, points without cells are dropped."""
    patches = [patch for patch in patches if len(patch.cells)]
    starts = np.cumsum([0] + [len(patch.points) for patch in patches])
    used = np.zeros(starts[-1], bool)
    for patch, start in zip(patches, starts, strict=False):
        used[start + np.unique(patch.cells)] = True
    points = np.concatenate([patch.points for patch in patches])
    keys, first, row = np.unique(_keys(points[used]), return_index=True, return_inverse=True)
    rows = np.full(len(points), -1)
    rows[used] = row
    return Weld(points[used][first], _by_group(patches, starts, rows), keys)


def _by_group(patches: list[Patch], starts: NDArray, rows: Integers) -> dict[tuple[str, int], Integers]:
    gathered: dict[tuple[str, int], list[Integers]] = {}
    for patch, start in zip(patches, starts, strict=False):
        key = (patch.group, patch.cells.shape[1])
        gathered.setdefault(key, []).append(rows[patch.cells + start])
    return {key: np.concatenate(cells) for key, cells in gathered.items()}


def _keys(points: Reals) -> Integers:
    cell = np.floor((np.asarray(points) + _OFFSET) / _QUANTUM).astype(np.int64)
    if cell.min() < 0 or cell.max() >= _REACH:
        raise ValueError("a drawing lies within one metre of its origin along each axis")
    return np.asarray((cell[:, 0] * _REACH + cell[:, 1]) * _REACH + cell[:, 2])


FIRST_NODE = 1001
"""Number of the first ordinary grid; sensors, bolts and mounts lie below."""

_NEAR_ENOUGH, _MOST_OFF, _TRIALS = 0.03, 0.1, 7

_CARDS = {
    ("PSHELL", 3): "CTRIA3",
    ("PSHELL", 4): "CQUAD4",
    ("PSOLID", 8): "CHEXA",
    ("PBAR", 2): "CBAR",
}


@dataclass(frozen=True)
class Material:
    """A MAT1 in SI units: Pa, kg/m³, loss factor."""

    id: int
    name: str
    E: float
    nu: float
    rho: float
    GE: float = 0.0


@dataclass(frozen=True)
class Property:
    """A PSHELL (values: thickness in m), PSOLID (none) or PBAR (A, I1, I2, J); its name is the elements' group."""

    id: int
    name: str
    card: str
    material: int
    values: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Elements:
    """Elements of one card and one property: numbers (e,) and nodes (e, k) as rows of the node table."""

    card: str
    property: int
    ids: Integers
    rows: Integers


@dataclass(frozen=True, eq=False)
class RigidTie:
    """An RBE2: the components of the nodes at `rows` follow the node at row `centre`."""

    id: int
    name: str
    centre: int
    rows: Integers
    components: str = "123456"


@dataclass(frozen=True)
class PointMass:
    """A CONM2 in kg (and kg·m² about its three axes) on the node at `row`."""

    id: int
    name: str
    row: int
    mass: float
    inertia: float = 0.0


@dataclass(frozen=True, eq=False)
class MeshedStructure:
    """Nodes and everything that hangs on them, in metres, newtons and kilograms.

    Parameters
    ----------
    title : one line for the deck
    node_ids : (n,) numbers of the grids
    xyz : (n, 3) positions in m
    """

    title: str
    node_ids: Integers
    xyz: Reals
    elements: tuple[Elements, ...]
    properties: tuple[Property, ...]
    materials: tuple[Material, ...]
    rigid: tuple[RigidTie, ...] = ()
    masses: tuple[PointMass, ...] = ()

    @property
    def thickness_groups(self) -> dict[int, str]:
        """Names of the groups that have a thickness, by PSHELL number."""
        return {p.id: p.name for p in self.properties if p.card == "PSHELL"}

    @cached_property
    def n_dofs(self) -> int:
        """Degrees of freedom that are left when rotations of solids and what RBE2 tie are taken away."""
        return free_dofs(len(self.xyz), self.elements, self.rigid)

    def group(self, name: str) -> tuple[Elements, ...]:
        """Elements of the property of that name."""
        ids = {p.id for p in self.properties if p.name == name}
        return tuple(batch for batch in self.elements if batch.property in ids)


def free_dofs(count: int, elements: Sequence[Elements], rigid: Sequence[RigidTie] = ()) -> int:
    """6 for a node of a shell, a bar or in the middle of a tie, 3 for one of solids only, less what follows ties."""
    dofs = np.full(count, 3)
    for batch in elements:
        if batch.card != "CHEXA":
            dofs[batch.rows] = 6
    dofs[[tie.centre for tie in rigid]] = 6
    for tie in rigid:
        dofs[tie.rows] -= len(tie.components)
    return int(dofs.sum())


def element_batches(mesh: Weld, properties: Sequence[Property]) -> tuple[Elements, ...]:
    """The cells of a mesh numbered through from 1, in the order of the properties."""
    batches, start = [], 1
    for entry in properties:
        for corners in (2, 3, 4, 8):
            cells = mesh.cells.get((entry.name, corners))
            if cells is not None:
                ids = np.arange(start, start + len(cells))
                batches.append(Elements(_CARDS[entry.card, corners], entry.id, ids, cells))
                start += len(cells)
    return tuple(batches)


def node_numbers(count: int, named: Mapping[int, int]) -> Integers:
    """Numbers of the grids: those `named` (by row), the others from FIRST_NODE on."""
    numbers = np.arange(FIRST_NODE, FIRST_NODE + count)
    numbers[list(named)] = list(named.values())
    return numbers


def sized(builds: Sequence[Callable[[float], MeshedStructure]], n_dofs: int, guess: float) -> MeshedStructure:
    """The mesh that comes closest to a number of degrees of freedom, over element sizes (m) from `guess` on.

    Each of `builds` makes a mesh of a size; where the first has a gap at this number, the next ones are tried.

    Raises
    ------
    FemtuneError : ``testing.mesh-size`` where no mesh comes within ten per cent
    """
    closest: list[MeshedStructure] = []
    for build in builds:
        closest.append(_closest(build, n_dofs, guess))
        if _off(closest[-1], n_dofs) < _NEAR_ENOUGH:
            return closest[-1]
    best = min(closest, key=lambda one: _off(one, n_dofs))
    if _off(best, n_dofs) > _MOST_OFF:
        raise _no_such_size(n_dofs, best.n_dofs)
    return best


def _closest(build: Callable[[float], MeshedStructure], n_dofs: int, size: float) -> MeshedStructure:
    """Bracketing by the power law of the numbers; they grow in steps, so the best of all trials counts."""
    best = made = build(size)
    low, high = 0.0, np.inf
    for _ in range(_TRIALS):
        if _off(best, n_dofs) < _NEAR_ENOUGH:
            break
        low, high = (size, high) if made.n_dofs > n_dofs else (low, size)
        size = _next_size(size * np.sqrt(made.n_dofs / n_dofs), low, high)
        made = build(size)
        best = min(best, made, key=lambda one: _off(one, n_dofs))
    return best


def _off(made: MeshedStructure, n_dofs: int) -> float:
    return abs(made.n_dofs / n_dofs - 1.0)


def _next_size(size: float, low: float, high: float) -> float:
    """The size that is aimed at, or one inside the bracket where that would leave it."""
    if np.isinf(high):
        return max(size, 1.3 * low)
    return size if low < size < high else (low + high) / 2.0


def _no_such_size(wanted: int, closest: int) -> FemtuneError:
    return FemtuneError("testing.mesh-size", values={"wanted": wanted, "closest": closest})


# ----------------------------------------------------------------------------------------------------
# Writing a meshed structure as a Nastran deck for normal modes: fixed columns, grids in large field.
#
# Made for generated test beds only. Rows are formatted in bulk, so that a million degrees of freedom take seconds.


MODES = 56
_CHUNK = 20_000
# direction of a bar's first plane of bending: no bar of a test bed stands upright
_UPRIGHT = (0.0, 0.0, 1.0)


def write_structure(
    structure: MeshedStructure, path: Path | str, held: Sequence[int] = (), added: Sequence[PointMass] = ()
) -> Path:
    """Write the deck (m, N, kg; SOL 103; 56 modes); returns its path.

    Parameters
    ----------
    held : numbers of grids whose six components are held
    added : masses beside those of the structure
    """
    with Path(path).open("w", encoding="ascii", newline="\n") as out:
        out.writelines(f"{line}\n" for line in _head(structure, bool(held)))
        _write_grids(out, structure)
        for entry in structure.properties:
            _write_property(out, structure, entry)
        lines = [*_materials(structure), *_rigid(structure), *_masses(structure, added), *_held(held)]
        out.writelines(f"{line}\n" for line in [*lines, "ENDDATA"])
    return Path(path)


def _head(structure: MeshedStructure, held: bool) -> Iterator[str]:
    yield f"$ {structure.title}: generated by femtune.testing, {structure.n_dofs} degrees of freedom"
    yield "$ units: m, N, kg, s"
    yield from ("SOL 103", "CEND", f"TITLE = {structure.title.upper()}", "METHOD = 1")
    if held:
        yield "SPC = 1"
    yield from ("BEGIN BULK", "PARAM   AUTOSPC YES")
    yield _card("EIGRL", 1, None, None, MODES, None, None, None, "MASS")


def _write_grids(out: TextIO, structure: MeshedStructure) -> None:
    out.write("$ grids\n")
    columns = [structure.node_ids, *structure.xyz.T]
    _write_rows(out, "GRID*   %16d                %16.9E%16.9E*\n*       %16.9E\n", columns)


def _write_rows(out: TextIO, row: str, columns: Sequence[NDArray]) -> None:
    """The format of a row filled with columns; many rows at once, which is what makes it quick."""
    lists = [column.tolist() for column in columns]
    for start in range(0, len(lists[0]), _CHUNK):
        part = list(zip(*(values[start : start + _CHUNK] for values in lists), strict=True))
        out.write((row * len(part)) % tuple(value for values in part for value in values))


def _write_property(out: TextIO, structure: MeshedStructure, entry: Property) -> None:
    out.write(f"$ group {entry.id}: {entry.name}\n{_property(entry)}\n")
    for batch in structure.elements:
        if batch.property == entry.id:
            _write_rows(out, _element_row(batch), [batch.ids, *structure.node_ids[batch.rows].T])


def _element_row(batch: Elements) -> str:
    head = f"{batch.card:<8}%8d{batch.property:>8}"
    if batch.card == "CHEXA":
        return head + "%8d" * 6 + "+\n+       " + "%8d" * 2 + "\n"
    tail = "".join(f"{value:>8}" for value in _UPRIGHT) if batch.card == "CBAR" else ""
    return head + "%8d" * batch.rows.shape[1] + tail + "\n"


def _property(entry: Property) -> str:
    if entry.card == "PSHELL":
        return _card("PSHELL", entry.id, entry.material, entry.values[0], entry.material, None, entry.material)
    return _card(entry.card, entry.id, entry.material, *entry.values)


def _materials(structure: MeshedStructure) -> Iterator[str]:
    for material in structure.materials:
        yield f"$ material {material.id}: {material.name}"
        loss = material.GE or None
        yield _card("MAT1", material.id, material.E, None, material.nu, material.rho, None, None, loss)


def _rigid(structure: MeshedStructure) -> Iterator[str]:
    for tie in structure.rigid:
        yield f"$ {tie.name} {structure.node_ids[tie.centre]}"
        yield _tie_card(tie, structure.node_ids)


def _tie_card(tie: RigidTie, node_ids: NDArray[np.int64]) -> str:
    return _card("RBE2", tie.id, int(node_ids[tie.centre]), int(tie.components), *node_ids[tie.rows].tolist())


def _masses(structure: MeshedStructure, added: Sequence[PointMass]) -> Iterator[str]:
    for mass in (*structure.masses, *added):
        number = int(structure.node_ids[mass.row])
        yield f"$ {mass.name} {number}"
        own = (mass.inertia, None, mass.inertia, None, None, mass.inertia) if mass.inertia else ()
        yield _card("CONM2", mass.id, number, None, mass.mass, None, None, None, None, *own)


def _held(held: Sequence[int]) -> Iterator[str]:
    if held:
        yield _card("SPC1", 1, 123456, *held)


def _card(name: str, *fields: float | str | None) -> str:
    """One card in fields of eight columns, continued after eight of them."""
    texts = [_field(value) for value in fields]
    while texts and not texts[-1].strip():
        texts.pop()
    rows = [texts[i : i + 8] for i in range(0, len(texts), 8)]
    return "\n".join("".join([f"{name if i == 0 else '':<8}", *row]).rstrip() for i, row in enumerate(rows))


def _field(value: float | str | None) -> str:
    if value is None:
        return " " * 8
    if isinstance(value, float):
        return f"{format_real(value):>8}"
    return f"{value:>8}"
