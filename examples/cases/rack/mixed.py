"""The rack of beams and shells as a Nastran deck: the mixed model, and the true rack.

In the mixed model all joints are rigid: bars run through from block to block, and the edges of panels are carried by
the bars beside them. The true rack has a finer mesh, joints that yield at both ends of each bar, panels held by single
screws, feet on bolts that yield, and a cable that no drawing shows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise, product

import numpy as np
from geometry import (
    BACK,
    BOARD,
    BOARDS,
    EDGE,
    HALF,
    MATERIALS,
    NOMINAL,
    POISSON,
    SHEET,
    SIDE,
    STEEL,
    WALL,
    Point,
    X,
    Y,
    Z,
    at_edge,
    beams,
    blocks,
    feet,
    sensors,
    stations,
)  # fmt: skip

from femtune.files.nastran import format_real

TUBE, JOINED_TUBE, BLOCK, BOARDS_OF, BACK_OF, EDGED = 1, 3, 20, 5, 6, 2
"""Numbers of properties; blocks with n arms have BLOCK + n, edges of panels EDGED more than their panels."""
BUSH, SCREW, BOLT, TABLE = 10, 14, 15, 8000
"""Bushings of joints along x, y and z (BUSH + 0, 1, 2), of screws and of bolts; first grid point of the table."""


@dataclass(frozen=True)
class Joints:
    """What the true rack has, and no model: stiffnesses in N/m and Nm/rad, masses in kg, loss factors.

    Parameters
    ----------
    push, bend, twist : of the joint of a tube and a block
    screw, screw_turn : of a screw of a panel
    bolt, bolt_turn : of a foot on the table
    cable : on the upper panel of the back
    joint_loss, screw_loss, bolt_loss, metal_loss : loss factors, of the bushings and of the metal
    divided : refinement of the mesh
    """

    push: float = 3.0e9
    bend: float = 1.2e5
    twist: float = 5.0e4
    screw: float = 2.0e9
    screw_turn: float = 2.0e4
    bolt: float = 1.0e10
    bolt_turn: float = 3.0e6
    cable: float = 0.3
    joint_loss: float = 0.06
    screw_loss: float = 0.05
    bolt_loss: float = 0.05
    metal_loss: float = 0.012
    divided: int = 2


@dataclass
class _Deck:
    """Cards in the making."""

    cards: list[str] = field(default_factory=list)
    points: dict[tuple[str, Point], int] = field(default_factory=dict)
    elements: int = 0

    def point(self, part: str, place: Point, number: int | None = None) -> int:
        """The grid point of a part at a place."""
        key = (part, tuple(round(float(c), 6) for c in place))
        if key not in self.points:
            self.points[key] = len(self.points) + 1001 if number is None else number
            self.card("GRID", self.points[key], None, *key[1])
        return self.points[key]

    def element(self, name: str, *fields: object) -> None:
        """An element."""
        self.elements += 1
        self.card(name, self.elements, *fields)

    def card(self, name: str, *fields: object) -> None:
        """A card in free fields, continued after eight of them."""
        texts = [format_real(f) if isinstance(f, float) else "" if f is None else str(f) for f in fields]
        rows = [texts[i : i + 8] for i in range(0, len(texts), 8)] or [[]]
        self.cards += [",".join([name if i == 0 else "", *row]) for i, row in enumerate(rows)]


def deck_text(
    values: dict[str, float] | None = None, joints: Joints | None = None, *, table: bool = False, modes: int = 20
) -> str:
    """The deck: of the mixed model, or of the true rack with `joints`; free, or with the true bolts on the table."""
    deck, divided = _Deck(), 1 if joints is None else joints.divided
    _properties(deck, {**NOMINAL, **(values or {})}, 0.0 if joints is None else joints.metal_loss)
    _frame(deck, divided, joints)
    for plane in (*((0, 1, 2, z) for z in BOARDS), (0, 2, 1, BACK)):
        _panels(deck, plane, divided, joints)
    for number, (axis, outside) in sensors().items():
        if axis != outside:
            deck.point("sensor", outside, number)
            deck.element("RBE2", deck.point("frame", axis), 123456, number)
    if joints is not None:
        deck.element("CONM2", deck.point("panel", (0.5 * sum(X), BACK, 0.5 * (Z[1] + Z[2]))), None, joints.cable)
    if joints is not None and table:
        _bolts(deck, joints)
    head = ["SOL 103", "CEND", "TITLE = RACK", *(["SPC = 1"] if table else []), "METHOD = 1", "BEGIN BULK"]
    return "\n".join([*head, f"EIGRL,1,,,{modes}", *deck.cards, "ENDDATA", ""])


def _properties(deck: _Deck, values: dict[str, float], loss: float) -> None:
    """Materials, with a loss factor, and properties of all elements but bushings."""
    for number, (_, E, density) in MATERIALS.items():
        deck.card("MAT1", number, values[E], None, POISSON[number], values[density], None, None, loss)
    for number in (TUBE, JOINED_TUBE):
        deck.card("PBARL", number, number, None, "BOX", *(None,) * 4, SIDE, SIDE, WALL, WALL)
    for arms in (3, 4):
        second = SIDE**4 / 12.0
        deck.card("PBAR", BLOCK + arms, STEEL, SIDE**3 / (arms * HALF), second, second, 1.69 * second)
    for number, thickness in ((BOARDS_OF, BOARD), (BACK_OF, SHEET)):
        for part, material in ((number, STEEL), (number + EDGED, EDGE)):
            deck.card("PSHELL", part, material, thickness, material, None, material)


def _frame(deck: _Deck, divided: int, joints: Joints | None) -> None:
    """Bars from block to block; in the true rack a bushing at each face of a block."""
    ends = [round_place(p) for beam in beams() for p in beam]
    arms = {place: ends.count(place) for place in map(round_place, blocks())}
    if joints is not None:
        for axis in range(3):
            turns = [joints.bend] * 3
            turns[axis] = joints.twist
            push = (joints.push,) * 3
            deck.card("PBUSH", BUSH + axis, "K", *push, *turns, None, "GE", joints.joint_loss)
    for first, last in beams():
        axis = int(np.argmax(np.subtract(last, first)))
        along = stations(first[axis], last[axis], divided)
        places = [tuple(s if i == axis else c for i, c in enumerate(first)) for s in along]
        numbers = [deck.point("frame", p) for p in places]  # type: ignore[arg-type]
        side = (1.0, 0.0, 0.0) if axis == 2 else (0.0, 0.0, 1.0)
        starts = list(numbers)
        if joints is not None:
            # the tube's end at the face of each block is a point of its own
            for at in (1, -2):
                starts[at] = deck.point("tube", places[at])  # type: ignore[arg-type]
                deck.element("CBUSH", BUSH + axis, numbers[at], starts[at], None, None, None, 0)
        deck.element("CBAR", BLOCK + arms[round_place(first)], numbers[0], numbers[1], *side)
        deck.element("CBAR", BLOCK + arms[round_place(last)], numbers[-2], numbers[-1], *side)
        inner = starts[1:-1]
        joined = 2 * divided
        for i, (a, b) in enumerate(pairwise(inner)):
            part = JOINED_TUBE if i < joined or i >= len(inner) - 1 - joined else TUBE
            deck.element("CBAR", part, a, b, *side)


def round_place(place: Point) -> Point:
    """A place as a key."""
    return tuple(round(float(c), 6) for c in place)  # type: ignore[return-value]


def _panels(deck: _Deck, plane: tuple[int, int, int, float], divided: int, joints: Joints | None) -> None:
    """Panels that fill the frames in one plane, normal to the third axis at a height."""
    u, v, w, height = plane
    spans = (X, Y, Z)
    if joints is not None and not any(c.startswith(f"PBUSH,{SCREW},") for c in deck.cards):
        turn = (joints.screw_turn,) * 3
        deck.card("PBUSH", SCREW, "K", *(joints.screw,) * 3, *turn, None, "GE", joints.screw_loss)
    for (a, b), (c, d) in product(pairwise(spans[u]), pairwise(spans[v])):
        lines_u, lines_v = stations(a, b, divided)[1:-1], stations(c, d, divided)[1:-1]

        def place(s: float, t: float) -> Point:
            found = [0.0, 0.0, 0.0]
            found[u], found[v], found[w] = s, t, height
            return tuple(found)  # type: ignore[return-value]

        centre = round_place(place(0.5 * (a + b), 0.5 * (c + d)))
        numbers = {round_place(axis): n for n, (axis, outside) in sensors().items() if axis == outside}
        deck.point("panel", centre, numbers.get(centre))
        for (s0, s1), (t0, t1) in product(pairwise(lines_u), pairwise(lines_v)):
            corners = [place(*st) for st in ((s0, t0), (s1, t0), (s1, t1), (s0, t1))]
            part = BACK_OF if w == 1 else BOARDS_OF
            if at_edge((0.5 * (s0 + s1), 0.5 * (t0 + t1)), (spans[u], spans[v])):
                part += EDGED
            deck.element("CQUAD4", part, *(deck.point("panel", p) for p in corners))
        for edge, axis_place in _edges(lines_u, lines_v, (a, b), (c, d)):
            carrier, at = place(*axis_place), place(*edge)
            _hold(deck, carrier, at, joints, (lines_u, lines_v), edge)


def _edges(
    us: list[float], vs: list[float], ends_u: tuple[float, float], ends_v: tuple[float, float]
) -> Iterator[tuple[tuple[float, float], tuple[float, float]]]:
    """Points of the edges, and the points of the bars beside them; corners once."""
    for s in us:
        yield (s, vs[0]), (s, ends_v[0])
        yield (s, vs[-1]), (s, ends_v[1])
    for t in vs[1:-1]:
        yield (us[0], t), (ends_u[0], t)
        yield (us[-1], t), (ends_u[1], t)


def _hold(
    deck: _Deck,
    carrier: Point,
    at: Point,
    joints: Joints | None,
    lines: tuple[list[float], list[float]],
    edge: tuple[float, float],
) -> None:
    """The edge of a panel on its bar: everywhere in the model, by single screws in the true rack."""
    on_panel = deck.point("panel", at)
    if joints is None:
        deck.element("RBE2", deck.point("frame", carrier), 123456, on_panel)
        return
    along = lines[0].index(edge[0]) if edge[1] in (lines[1][0], lines[1][-1]) else lines[1].index(edge[1])
    if along % 2 == 0 and edge[0] in lines[0] and along not in (0, len(lines[0]) - 1):
        carried = deck.point("screw", at)
        deck.element("RBE2", deck.point("frame", carrier), 123456, carried)
        deck.element("CBUSH", SCREW, carried, on_panel, None, None, None, 0)


def _bolts(deck: _Deck, joints: Joints) -> None:
    deck.card("PBUSH", BOLT, "K", *(joints.bolt,) * 3, *(joints.bolt_turn,) * 3, None, "GE", joints.bolt_loss)
    for i, foot in enumerate(feet()):
        deck.point("table", foot, TABLE + i)
        deck.element("CBUSH", BOLT, deck.point("frame", foot), TABLE + i, None, None, None, 0)
    deck.card("SPC1", 1, 123456, *(TABLE + i for i in range(len(feet()))))


def foot_points() -> list[int]:
    """Grid points at the feet of the mixed model."""
    deck = _Deck()
    _frame(deck, 1, None)
    return [deck.point("frame", foot) for foot in feet()]
