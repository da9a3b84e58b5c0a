"""A tube-and-muffler structure in two components and a clamp, as a deck of our own: a test bed for bottom-up studies.

In the manner of the exhaust system of Mottershead, Link, Friswell and Schedlinski (handbook chapter, section 9): a
front part with a converter, a rear part with a muffler, and a clamped joint between them. Tubes are bars, cans are
shells with rigid spiders where the tubes enter. Units m, kg, s; the components hang free.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.dofs import Dof, DofSet
from femtune.fem import FieldRef
from femtune.files.nastran import build_structure, format_real, read_deck
from femtune.files.uff import write_uff_frfs, write_uff_modes
from femtune.modal import FrfSet, ModeSet
from femtune.model import (
    Assignment,
    Configuration,
    ConfiguredModel,
    EigenSolution,
    configure,
    parametric_model,
    solve_modes,
)
from femtune.model.response import frf, make_ports, mass_response
from femtune.parameters import Parameter, ParameterSet
from femtune.testdata import ModalTest, WireFrame
from femtune.units import unit_system

FRONT, REAR, CLAMP = "front part", "rear part", "clamp"
_STEEL, _POISSON, _DENSITY, _LOSS = 2.1e11, 0.3, 7850.0, 0.01
_TUBE = {"front": (0.019, 0.0015), "rear": (0.022, 0.0015)}
_CLAMP_STIFFNESS, _CLAMP_DAMPING = (2.0e4, 1.2e4), (1.0, 1.0)
_FIRM = 1.0e8


@dataclass(frozen=True)
class Can:
    """A closed cylinder along X: from `start`, `length`, `radius`, `thickness`; elements `around` and `along`."""

    start: Reals
    length: float
    radius: float
    thickness: float
    around: int
    along: int


@dataclass
class Deck:
    """Cards in the making: grid points and elements count up by themselves."""

    cards: list[str] = field(default_factory=list)
    xyz: dict[int, Reals] = field(default_factory=dict)
    elements: dict[str, list[int]] = field(default_factory=lambda: {FRONT: [], REAR: [], CLAMP: []})
    part: str = FRONT

    def grid(self, at: Reals) -> int:
        """A grid point."""
        number = len(self.xyz) + 1
        self.xyz[number] = np.asarray(at, float)
        self.cards.append(",".join(["GRID", str(number), "", *(format_real(round(float(v), 6)) for v in at)]))
        return number

    def element(self, name: str, *fields: object) -> int:
        """An element of the part that is being built."""
        number = 1 + sum(map(len, self.elements.values()))
        self.elements[self.part].append(number)
        self.card(name, number, *fields)
        return number

    def card(self, name: str, *fields: object) -> None:
        """A card in free fields, continued after eight of them."""
        texts = [format_real(f) if isinstance(f, float) else "" if f is None else str(f) for f in fields]
        rows = [texts[i : i + 8] for i in range(0, len(texts), 8)] or [[]]
        self.cards += [",".join([name if i == 0 else "", *row]) for i, row in enumerate(rows)]


@dataclass(frozen=True)
class Exhaust:
    """The structure as text.

    Parameters
    ----------
    text : the deck
    elements : numbers of the elements of each part, rigid ones too
    sensors : grid points with sensors by part
    drives : grid points that are driven, by part
    xyz : coordinates of all grid points
    """

    text: str
    elements: dict[str, tuple[int, ...]]
    sensors: dict[str, tuple[int, ...]]
    drives: dict[str, tuple[int, ...]]
    xyz: dict[int, Reals]


def exhaust_deck(finer: int = 1) -> Exhaust:
    """The nominal model; `finer` multiplies the elements of cans and tubes (1: some 2300 degrees of freedom)."""
    deck = Deck()
    _materials(deck)
    front = _front(deck, finer)
    rear = _rear(deck, finer)
    _clamp(deck, front[-1], rear[0])
    head = ["SOL 103", "CEND", "TITLE = EXHAUST SYSTEM", "BEGIN BULK", "PARAM,AUTOSPC,YES", "PARAM,GRDPNT,0"]
    elements = {part: tuple(numbers) for part, numbers in deck.elements.items()}
    sensors: dict[str, tuple[int, ...]] = {FRONT: tuple(front), REAR: tuple(rear)}
    drives: dict[str, tuple[int, ...]] = {FRONT: (front[0],), REAR: (rear[-1],)}
    return Exhaust("\n".join([*head, *deck.cards, "ENDDATA", ""]), elements, sensors, drives, deck.xyz)


def _materials(deck: Deck) -> None:
    """1 and 2: tube and can of the front; 3 and 4: of the rear."""
    for number in (1, 2, 3, 4):
        deck.card("MAT1", number, _STEEL, None, _POISSON, _DENSITY, None, None, _LOSS)
    for number, part in ((1, "front"), (3, "rear")):
        radius, wall = _TUBE[part]
        area = np.pi * (radius**2 - (radius - wall) ** 2)
        inertia = np.pi / 4.0 * (radius**4 - (radius - wall) ** 4)
        deck.card("PBAR", number, number, float(area), float(inertia), float(inertia), float(2.0 * inertia))
    # ceramics of the converter, acoustic wool of the muffler: mass that stiffens nothing
    deck.card("PSHELL", 2, 2, 0.0025, 2, None, 2, None, 15.0)
    deck.card("PSHELL", 4, 4, 0.0012, 4, None, 4, None, 4.0)


def _front(deck: Deck, finer: int) -> list[int]:
    """Sensors from the inlet to the clamp."""
    deck.part = FRONT
    inlet = _tube(deck, 1, [(0.0, 0.0, 0.15), (0.10, 0.0, 0.04), (0.25, 0.0, 0.0)], 5 * finer)
    can = Can(np.array([0.25, 0.0, 0.0]), 0.25, 0.06, 0.0015, 12 * finer, 5 * finer)
    outlet_node, seen = _can(deck, 2, can, inlet[-1])
    outlet = _tube(deck, 1, [(0.5, 0.0, 0.0), (0.8, 0.0, -0.05), (1.1, 0.0, -0.05)], 6 * finer, outlet_node)
    return [*inlet[:: 2 * finer], *seen, *outlet[:: 2 * finer][1:], outlet[-1]]


def _rear(deck: Deck, finer: int) -> list[int]:
    """Sensors from the clamp to the tail pipe."""
    deck.part = REAR
    inlet = _tube(deck, 3, [(1.1, 0.0, -0.05), (1.45, 0.0, -0.05), (1.6, 0.15, 0.0), (1.9, 0.15, 0.0)], 5 * finer)
    can = Can(np.array([1.9, 0.15, 0.0]), 0.45, 0.09, 0.0012, 16 * finer, 8 * finer)
    outlet_node, seen = _can(deck, 4, can, inlet[-1])
    tail = _tube(deck, 3, [(2.35, 0.15, 0.0), (2.5, 0.15, 0.0), (2.65, 0.25, -0.1)], 4 * finer, outlet_node)
    return [*inlet[:: 3 * finer], *seen, *tail[:: 2 * finer][1:], tail[-1]]


def _tube(deck: Deck, number: int, corners: list[tuple[float, float, float]], each: int, first: int = 0) -> list[int]:
    """Bars through the corners, `each` to a straight; the grid points without repetition."""
    nodes = [first or deck.grid(np.array(corners[0]))]
    for a, b in itertools.pairwise(corners):
        for i in range(1, each + 1):
            nodes.append(deck.grid(np.array(a) + (np.array(b) - np.array(a)) * i / each))
            deck.element("CBAR", number, nodes[-2], nodes[-1], 0.0, 0.3, 1.0)
    return list(dict.fromkeys(nodes))


def _can(deck: Deck, number: int, can: Can, inlet: int) -> tuple[int, list[int]]:
    """Grid point in the outlet's middle, and sensors at mid-length; rings of the end plates are tied to the tubes."""
    rings = [_ring(deck, can, x, can.radius) for x in np.linspace(0.0, can.length, can.along + 1)]
    ends = [[_ring(deck, can, x, can.radius * s) for s in (0.65, 0.35)] for x in (0.0, can.length)]
    outlet = deck.grid(can.start + np.array([can.length, 0.0, 0.0]))
    for centre, (outer, inner), rim in zip((inlet, outlet), ends, (rings[0], rings[-1])):
        _quads(deck, number, rim, outer)
        _quads(deck, number, outer, inner)
        deck.element("RBE2", centre, 123456, *inner)
    for one, other in itertools.pairwise(rings):
        _quads(deck, number, one, other)
    middle = rings[len(rings) // 2]
    return outlet, [middle[i * len(middle) // 4] for i in range(4)]


def _ring(deck: Deck, can: Can, x: float, radius: float) -> list[int]:
    angles = 2.0 * np.pi * np.arange(can.around) / can.around
    return [deck.grid(can.start + np.array([x, radius * np.cos(a), radius * np.sin(a)])) for a in angles]


def _quads(deck: Deck, number: int, one: list[int], other: list[int]) -> None:
    for i in range(len(one)):
        j = (i + 1) % len(one)
        deck.element("CQUAD4", number, one[i], one[j], other[j], other[i])


def _clamp(deck: Deck, a: int, b: int) -> None:
    """A bush: firm along its axes, soft and damped in bending and twist."""
    deck.part = CLAMP
    (bend, twist), (bend_damping, twist_damping) = _CLAMP_STIFFNESS, _CLAMP_DAMPING
    deck.card("PBUSH", 9, "K", _FIRM, _FIRM, _FIRM, twist, bend, bend)
    damping = map(format_real, (0.0, 0.0, 0.0, twist_damping, bend_damping, bend_damping))
    deck.cards.append(",".join(["", "", "B", *damping]))
    deck.element("CBUSH", 9, a, b, None, None, None, 0)


# ----------------------------------------------------------------------------------------------------
# Simulated tests of the exhaust system, its parts and the whole: noisy modes and FRFs, and weighed masses.


WHOLE = "whole system"


@dataclass(frozen=True)
class Known:
    """A parameter whose true value is known: `fields` of the deck; value in the deck, and in truth."""

    name: str
    fields: tuple[str, ...]
    nominal: float
    truth: float
    kind: str
    unit: str = ""


KNOWN = (
    Known("m_converter", ("PSHELL 2 NSM",), 15.0, 17.5, "mass", "kg/m^2"),
    Known("m_wool", ("PSHELL 4 NSM",), 4.0, 3.1, "mass", "kg/m^2"),
    Known("E_front", ("MAT1 1 E",), 2.1e11, 1.95e11, "stiffness", "Pa"),
    Known("E_converter", ("MAT1 2 E",), 2.1e11, 2.35e11, "stiffness", "Pa"),
    Known("E_rear", ("MAT1 3 E",), 2.1e11, 2.23e11, "stiffness", "Pa"),
    Known("E_muffler", ("MAT1 4 E",), 2.1e11, 1.85e11, "stiffness", "Pa"),
    Known("k_bend", ("PBUSH 9 K5", "PBUSH 9 K6"), 2.0e4, 1.2e4, "joint", "N*m/rad"),
    Known("k_twist", ("PBUSH 9 K4",), 1.2e4, 1.7e4, "joint", "N*m/rad"),
    Known("eta_front", ("MAT1 1 GE",), 0.01, 0.0045, "damping"),
    Known("eta_converter", ("MAT1 2 GE",), 0.01, 0.02, "damping"),
    Known("eta_rear", ("MAT1 3 GE",), 0.01, 0.006, "damping"),
    Known("eta_muffler", ("MAT1 4 GE",), 0.01, 0.025, "damping"),
    Known("b_bend", ("PBUSH 9 B5", "PBUSH 9 B6"), 1.0, 3.0, "joint damping", "N*m*s/rad"),
    Known("b_twist", ("PBUSH 9 B4",), 1.0, 2.0, "joint damping", "N*m*s/rad"),
)


@dataclass(frozen=True)
class Noise:
    """Standard deviations: of frequencies and weighed masses (relative), of entries of shapes of unit norm, of FRFs.

    FRFs scatter by `frf` of their magnitude and by `floor` of the largest magnitude of each function, in real and
    imaginary part.
    """

    frequency: float = 1e-4
    shape: float = 0.005
    mass: float = 2e-3
    damping: float = 0.1
    frf: float = 0.03
    floor: float = 1e-4


@dataclass(frozen=True)
class Measured:
    """A simulated test with the elements that its state lacks, and what a balance says."""

    name: str
    elements_off: tuple[int, ...]
    test: ModalTest
    weighed: float


BANDS = {FRONT: 540.0, REAR: 560.0, WHOLE: 270.0}
"""Hz, up to which each state is tested."""
_BASIS_MODES = 70
_LOWEST_HZ = 5.0


def simulated_tests(
    exhaust: Exhaust, deck: Path, seed: int = 0, noise: Noise = Noise(), step_hz: float = 0.25
) -> tuple[Measured, ...]:
    """Tests of both parts and of the whole at the true parameters; `deck` is the file of the nominal model."""
    rng = np.random.default_rng(seed)
    whole = exhaust.sensors[FRONT] + exhaust.sensors[REAR]
    drives = exhaust.drives[FRONT]
    clamp = exhaust.elements[CLAMP]
    states = (
        (FRONT, exhaust.elements[REAR] + clamp, exhaust.sensors[FRONT], exhaust.drives[FRONT]),
        (REAR, exhaust.elements[FRONT] + clamp, exhaust.sensors[REAR], exhaust.drives[REAR]),
        (WHOLE, (), whole, drives),
    )
    model = true_model(deck)
    return tuple(_measured(exhaust, model, state, rng, noise, step_hz) for state in states)


def true_model(deck: Path) -> ConfiguredModel:
    """The deck with all parameters at their true values, in the state of the deck."""
    structure = build_structure(read_deck(deck)).structure
    parameters = ParameterSet(tuple(Parameter(k.name, k.truth, 0.5 * k.truth, 2.0 * k.truth) for k in KNOWN))
    fields = [Assignment(k.name, reference(f), relative=False) for k in KNOWN for f in k.fields]
    return configure(parametric_model(structure, parameters, fields), Configuration())


def reference(text: str) -> FieldRef:
    card, number, name = text.split()
    return FieldRef(card, int(number), name)


_State = tuple[str, tuple[int, ...], tuple[int, ...], tuple[int, ...]]


def _measured(
    exhaust: Exhaust, model: ConfiguredModel, state: _State, rng: np.random.Generator, noise: Noise, step_hz: float
) -> Measured:
    name, off, sensors, drives = state
    configured = configure(model.model, Configuration(name, elements_off=frozenset(off)))
    solution = solve_modes(configured.at(np.zeros(len(KNOWN))), _BASIS_MODES)
    nodes = list(dict.fromkeys((*sensors, *drives)))
    dofs = [Dof(n, d) for n in nodes for d in "XYZ"]
    modes = _modes(configured, solution, dofs, BANDS[name], rng, noise)
    seen = [d for d in dofs if d.direction != "X"]
    driven = [Dof(n, d) for n in drives for d in "YZ"]
    frfs = _frfs(configured, solution, seen, driven, BANDS[name], step_hz, rng, noise)
    frame = WireFrame(np.array(nodes), np.array([exhaust.xyz[n] for n in nodes]))
    test = ModalTest(name, unit_system("m-kg-s"), frame, modes=modes, frfs=frfs)
    mass = float(mass_response(configured.at(np.zeros(len(KNOWN)))).properties.mass)
    return Measured(name, off, test, mass * (1.0 + noise.mass * rng.standard_normal()))


def _modes(
    configured: ConfiguredModel,
    solution: EigenSolution,
    dofs: list[Dof],
    band: float,
    rng: np.random.Generator,
    noise: Noise,
) -> ModeSet:
    """Elastic modes in the band: undamped frequencies and shapes, damping ratios by energy, all with noise."""
    some = np.flatnonzero((solution.freq_hz > _LOWEST_HZ) & (solution.freq_hz < band))
    rows = make_ports(configured, dofs[:1], dofs).outputs
    shapes = np.asarray(rows @ solution.shapes[:, some])
    shapes = shapes / np.linalg.norm(shapes, axis=0)
    freq = solution.freq_hz[some] * (1.0 + noise.frequency * rng.standard_normal(len(some)))
    ratio = _ratios(solution, some) * (1.0 + noise.damping * rng.standard_normal(len(some)))
    order = np.argsort(freq)
    shapes = shapes + noise.shape * rng.standard_normal(shapes.shape)
    return ModeSet(freq[order], shapes[:, order], DofSet(dofs), damping_ratio=ratio[order], source="simulated")


def _ratios(solution: EigenSolution, some: NDArray[np.int64]) -> Reals:
    """φᵀ(ωC + H)φ/2ω²: what a fit finds of light damping."""
    phi, omega = solution.shapes[:, some], np.sqrt(solution.eigenvalues[some])
    viscous, hysteretic = (
        np.einsum("ij,ij->j", phi, m @ phi) for m in (solution.point.viscous, solution.point.hysteretic)
    )
    return np.asarray((omega * viscous + hysteretic) / (2.0 * omega**2))


def _frfs(
    configured: ConfiguredModel, solution: EigenSolution, outputs: list[Dof], inputs: list[Dof], band: float,
    step_hz: float, rng: np.random.Generator, noise: Noise,
) -> FrfSet:  # fmt: skip
    """Accelerances by real modes far beyond the band, with residual vectors."""
    lines = np.arange(_LOWEST_HZ, band, step_hz)
    exact = frf(solution, make_ports(configured, inputs, outputs), lines)
    size = np.abs(exact.values)
    sd = np.hypot(noise.frf * size, noise.floor * size.max(axis=2, keepdims=True))
    scatter = rng.standard_normal(size.shape) + 1j * rng.standard_normal(size.shape)
    return replace(exact, values=exact.values + sd * scatter, source="simulated")


def write_tests(measured: tuple[Measured, ...], folder: Path) -> dict[str, str]:
    """A Universal File for each state, modes and FRFs in one; names by state."""
    names = {}
    for one in measured:
        path = folder / f"{one.name.replace(' ', '_')}.uff"
        frfs = path.with_suffix(".frfs.uff")
        write_uff_modes(path, one.test)
        write_uff_frfs(frfs, one.test)
        with path.open("a", encoding="ascii") as out:
            out.write(functions_of(frfs.read_text(encoding="ascii")))
        frfs.unlink()
        names[one.name] = path.name
    return names


def functions_of(text: str) -> str:
    """The data sets 58 of a Universal File."""
    sets = text.split("    -1\n")
    return "".join(f"    -1\n{one}    -1\n" for one in sets if one.startswith("    58"))
