"""A tube-and-muffler structure in two components and a clamp, as a deck of our own: a test bed for bottom-up studies.

In the manner of the exhaust system of Mottershead, Link, Friswell and Schedlinski (handbook chapter, section 9): a
front part with a converter, a rear part with a muffler, and a clamped joint between them. Tubes are bars, cans are
shells with rigid spiders where the tubes enter. Units m, kg, s; the components hang free.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from femtune.files.nastran import format_real

Reals = NDArray[np.float64]

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
