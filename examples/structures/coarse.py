"""Structures meshed at any fineness: for the error of a mesh against a fine one of the same elements.

A ``MeshedCase`` builds the same structure with n elements to the length that its lowest modes bend over, and says how
many modes are looked at and how fine its reference is. Rectangles are not square, so that modes are apart.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from femtune.arrays import Integers, Reals
from femtune.fem.structure import Structure
from structures.frames import bars, make_structure
from structures.shells import (
    Anisotropic,
    Isotropic,
    Material,
    Section,
    ShellMesh,
    ShellPart,
    cylinder,
    dofs_of,
    rectangle,
    shell_mesh,
    shell_structure,
)
from structures.solids import box, solid_mesh, solid_model

ALUMINIUM = Isotropic(7.0e10, 0.3, 2700.0)
COUPLED = Isotropic(7.0e10, 0.98, 2700.0)
SHELLS = ("quad", "union", "quad8", "union6")
SOLIDS = ("hexa8", "penta6", "tetra4", "pyram5", "hexa20", "penta15", "tetra10", "pyram13")


@dataclass(frozen=True)
class MeshedCase:
    """One structure with one kind of element and one kind of mass.

    Parameters
    ----------
    name, family, cells : what it is, the class that it counts in, and the kind of element
    build : number of elements a side -> structure
    sides : numbers of elements that are looked at
    reference : number of elements a side of the mesh that counts as exact
    rigid : number of rigid-body modes
    coupled : True for consistent mass
    """

    name: str
    family: str
    cells: str
    build: Callable[[int], Structure]
    sides: tuple[int, ...]
    reference: int
    rigid: int
    coupled: bool

    def modes(self, n: int) -> int:
        """Elastic modes that n elements a side resolve with about two or more grid intervals a half wave."""
        return _RESOLVED[min(n * (2 if self.quadratic else 1), 8)]

    @property
    def quadratic(self) -> bool:
        """Whether the elements have mid-side grid points."""
        return self.cells in _CURVED


_RESOLVED = {2: 1, 4: 3, 8: 6}
_CURVED = ("quad8", "union6", "hexa20", "penta15", "tetra10", "pyram13")


def laminate_45() -> Anisotropic:
    """A ±45° laminate of carbon fibre, balanced: its membrane law for bending too."""
    E1, E2, nu, G = 1.3e11, 9.0e9, 0.3, 5.0e9
    d = 1.0 - nu * nu * E2 / E1
    q11, q22, q12 = E1 / d, E2 / d, nu * E2 / d
    a = 0.25 * (q11 + q22 + 2.0 * q12)
    law = {"11": a + G, "12": a - G, "22": a + G, "33": 0.25 * (q11 + q22 - 2.0 * q12)}
    return Anisotropic(law, {"11": G, "22": G}, 1600.0)


def _mesh(mapping: Callable[[Reals, Reals], ArrayLike], nu: int, nv: int, cells: str, distort: float) -> ShellMesh:
    return shell_mesh(mapping, nu, nv, cells, distort=distort, seed=3)


def _sheet(mesh: ShellMesh, section: Section, held: set[int], coupled: bool) -> Structure:
    part = ShellPart(mesh.cells, section, direction=(1.0, 0.0, 0.0) if _anisotropic(section) else (0.0, 0.0, 0.0))
    return shell_structure(mesh.xyz, [part], held=held, consistent_mass=coupled)


def _anisotropic(section: Section) -> bool:
    return isinstance(section.material, Anisotropic)


def _nodes(rows: Integers) -> Integers:
    return np.asarray(rows[rows >= 0])


def plate(
    n: int,
    cells: str,
    coupled: bool,
    support: str,
    material: Material = ALUMINIUM,
    t: float = 0.004,
    distort: float = 0.0,
) -> Structure:
    """1 × 0.8 m in bending; "simple", "clamped", "free", "cantilever", or "corners" held."""
    mesh = _mesh(rectangle(1.0, 0.8), n, n, cells, distort)
    every = np.arange(len(mesh.xyz))
    held = dofs_of(every, "126")
    rim = _nodes(mesh.rim)
    corners = [mesh.rows[i, j] for i in (0, -1) for j in (0, -1)]
    held |= {
        "simple": lambda: dofs_of(rim, "3"),
        "clamped": lambda: dofs_of(rim, "345"),
        "free": set,
        "cantilever": lambda: dofs_of(_nodes(mesh.edge("u0")), "345"),
        "corners": lambda: dofs_of(corners, "3"),
    }[support]()
    return _sheet(mesh, Section(material, t), held, coupled)


def curved_panel(n: int, cells: str, coupled: bool, support: str, distort: float = 0.0) -> Structure:
    """A quarter of a cylinder of radius 0.5 m, 0.8 m long; "clamped" at both straight edges, or "cantilever"."""
    mesh = _mesh(cylinder(0.5, 0.8, 0.0, np.pi / 2.0), n, n, cells, distort)
    edges = {"clamped": ("u0", "u1"), "cantilever": ("v0",)}[support]
    held = dofs_of(np.concatenate([_nodes(mesh.edge(e)) for e in edges]), "123456")
    return _sheet(mesh, Section(ALUMINIUM, 0.003), held, coupled)


def tube(n: int, cells: str, coupled: bool) -> Structure:
    """A tube of radius 0.1 m, 0.5 m long, held at one end; 4 n elements around, 2 n along."""
    mesh = shell_mesh(cylinder(0.1, 0.5), 4 * n, 2 * n, cells, closed=True)
    return _sheet(mesh, Section(ALUMINIUM, 0.002), dofs_of(_nodes(mesh.edge("v0")), "123456"), coupled)


def _square_tube(u: Reals, v: Reals) -> tuple[Reals, Reals, Reals]:
    """Sides 0.2 and 0.15 m, 1 m along z."""
    s = 4.0 * np.mod(u, 1.0)
    x = np.interp(s, [0, 1, 2, 3, 4], [0, 0.2, 0.2, 0, 0])
    y = np.interp(s, [0, 1, 2, 3, 4], [0, 0, 0.15, 0.15, 0])
    return x, y, v


def box_beam(n: int, cells: str, coupled: bool) -> Structure:
    """A rectangular tube of 2 mm wall held at one end: n elements across each wall, 3 n along."""
    mesh = shell_mesh(_square_tube, 4 * n, 3 * n, cells, closed=True)
    return _sheet(mesh, Section(ALUMINIUM, 0.002), dofs_of(_nodes(mesh.edge("v0")), "123456"), coupled)


def _lug(u: Reals, v: Reals, w: Reals) -> tuple[Reals, Reals, Reals]:
    """A bracket: a bent bar of section 30 × 20 mm that goes through a quarter of a circle of radius 100 mm."""
    angle, r = 0.5 * np.pi * (1.0 - u), 0.085 + 0.03 * v
    return r * np.cos(angle), r * np.sin(angle), 0.02 * w


def solid_bracket(n: int, cells: str, coupled: bool) -> Structure:
    """The bent bar held at one end: 2 n elements along, n / 2 across and one or n / 2 through."""
    across = max(n // 2, 1)
    mesh = solid_mesh(_lug, (2 * n, across, across), cells)
    return solid_model(mesh, ALUMINIUM, held=dofs_of(mesh.face("u0"), "123"), consistent_mass=coupled)


def solid_plate(n: int, cells: str, coupled: bool, distort: float = 0.0) -> Structure:
    """A thick plate 1 × 0.8 × 0.1 m held at one side, one element (or n / 4) through."""
    through = max(n // 4, 1)
    mesh = solid_mesh(box(1.0, 0.8, 0.1), (n, n, through), cells, distort=distort, seed=3)
    return solid_model(mesh, ALUMINIUM, held=dofs_of(mesh.face("u0"), "123"), consistent_mass=coupled)


BAR = {"E": 2.1e11, "G": 8.1e10, "A": 4e-4, "I1": 3e-8, "I2": 1.2e-8, "J": 2e-8, "rho": 7850.0}


def frame(n: int, coupled: bool, shear: bool = False) -> Structure:
    """A portal with a cross bar, 1 m high and 1.2 m wide, in space; n bars a member."""
    ends = np.array([[0, 0, 0], [0, 0, 1.0], [1.2, 0, 1.0], [1.2, 0, 0], [0, 0.7, 1.0]])
    members = [(0, 1), (1, 2), (2, 3), (1, 4)]
    xyz, lines = [*ends], []
    for a, b in members:
        inner = [len(xyz) + k for k in range(n - 1)]
        xyz += [ends[a] + (ends[b] - ends[a]) * (k + 1) / n for k in range(n - 1)]
        lines += list(zip([a, *inner], [*inner, b]))
    own = {**BAR, "K1": 0.85, "K2": 0.85} if shear else BAR
    parts = [bars(lines, own, orientation=(0.3, 1.0, 0.2))]
    return make_structure(xyz, parts, permanent=np.array(sorted(dofs_of([0, 3], "123456"))), consistent_mass=coupled)


def cases() -> list[MeshedCase]:
    """All of them, with lumped and consistent mass."""
    return [case for coupled in (False, True) for case in _cases(coupled)]


def _cases(coupled: bool) -> list[MeshedCase]:
    out: list[MeshedCase] = []

    def add(name: str, family: str, cells: str, build: Callable[[int, str, bool], Structure], reference: int = 64,
            most: int = 16, rigid: int = 0) -> None:  # fmt: skip
        half = 2 if cells in _CURVED else 1
        sides = tuple(n for n in (2, 4, 8, 16) if n * half <= most)
        made = partial(_built, build, cells, coupled)
        out.append(MeshedCase(name, family, cells, made, sides, reference // half, rigid, coupled))

    for cells in SHELLS:
        for support in ("simple", "clamped", "free", "cantilever", "corners"):
            add(
                f"plate, {support}",
                "flat plates",
                cells,
                partial(plate, support=support),
                rigid=3 if support == "free" else 0,
            )
        add("thick plate, simple", "flat plates", cells, partial(plate, support="simple", t=0.08))
        add("±45 laminate, corners", "laminates", cells,
            partial(plate, support="corners", material=laminate_45()))  # fmt: skip
        add("NU12 0.98, corners", "strongly coupled law", cells,
            partial(plate, support="corners", material=COUPLED))  # fmt: skip
        add("distorted plate, clamped", "distorted plates", cells,
            partial(plate, support="clamped", distort=0.3))  # fmt: skip
        add("distorted plate, cantilever", "distorted plates", cells,
            partial(plate, support="cantilever", distort=0.3))  # fmt: skip
        for support in ("clamped", "cantilever"):
            add(f"curved panel, {support}", "curved shells", cells,
                partial(curved_panel, support=support))  # fmt: skip
        add("tube", "curved shells", cells, tube, reference=32, most=8)
        add("box beam", "box beams", cells, box_beam, reference=24, most=8)
    for cells in SOLIDS:
        add("solid bracket", "solids", cells, solid_bracket, reference=16, most=4)
        add("solid plate", "solids", cells, solid_plate, reference=24, most=8)
    for shear in (False, True):
        name = "frame with shear" if shear else "frame"
        made = partial(frame, coupled=coupled, shear=shear)
        out.append(MeshedCase(name, "frames of bars", "bar", made, (2, 4, 8), 64, 0, coupled))
    return out


def _built(build: Callable[[int, str, bool], Structure], cells: str, coupled: bool, n: int) -> Structure:
    return build(n, cells, coupled)
