"""Ten small sound decks in metres, kilograms and seconds, built card by card so that faults can be planted in them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

Point = tuple[float, float, float]
ALUMINIUM = "MAT1,1,7.+10,,.33,2700."


@dataclass
class Model:
    """A deck: case control, cards in free field as lists of their fields, and the directions that are measured."""

    name: str
    case: list[str] = field(default_factory=list)
    cards: list[list[str]] = field(default_factory=list)
    units: str = "m-kg-s"
    measured: str = "3"

    def add(self, *lines: str) -> Model:
        """With further cards."""
        self.cards += [line.split(",") for line in lines]
        return self

    def named(self, *names: str) -> list[list[str]]:
        """The cards of some names, to be changed in place."""
        return [card for card in self.cards if card[0] in names]

    @property
    def places(self) -> dict[int, Point]:
        """Coordinates of the grid points."""
        return {int(g[1]): (float(g[3]), float(g[4]), float(g[5])) for g in self.named("GRID")}

    def text(self) -> str:
        """The deck as a file."""
        bulk = "\n".join(",".join(card) for card in self.cards)
        return "\n".join(["SOL 103", "CEND", *self.case, "BEGIN BULK", bulk, "ENDDATA", ""])


def _supported(name: str, points: Sequence[int], components: str = "123456") -> Model:
    model = Model(name, ["SPC = 1"]).add(ALUMINIUM)
    return model.add(*(f"SPC1,1,{components},{p}" for p in points))


def _grid(model: Model, n: int, m: int, at: Callable[[float, float], Point], first: int = 1) -> None:
    for i in range(n + 1):
        for j in range(m + 1):
            x, y, z = at(i / n, j / m)
            model.add(f"GRID,{first + i * (m + 1) + j},,{x:.6f},{y:.6f},{z:.6f}")


def _cells(n: int, m: int, first: int = 1) -> list[tuple[int, int, int, int]]:
    corners = [(first + i * (m + 1) + j, first + (i + 1) * (m + 1) + j) for i in range(n) for j in range(m)]
    return [(a, b, b + 1, a + 1) for a, b in corners]


def _flat(u: float, v: float) -> Point:
    return u, 0.6 * v, 0.0


def _quads(
    model: Model, cells: Sequence[tuple[int, int, int, int]], pid: int = 1, first: int = 1, offset: str = ""
) -> None:
    model.add(
        *(f"CQUAD4,{first + k},{pid},{a},{b},{c},{d},{offset}".rstrip(",") for k, (a, b, c, d) in enumerate(cells))
    )


def plate() -> Model:
    """A cantilever plate of quadrilaterals."""
    model = _supported("plate", range(1, 6)).add("PSHELL,1,1,.01,1,,1")
    _grid(model, 6, 4, _flat)
    _quads(model, _cells(6, 4))
    return model


def triangles() -> Model:
    """The same of triangles."""
    model = _supported("plate of triangles", range(1, 6)).add("PSHELL,1,1,.01,1,,1")
    _grid(model, 6, 4, _flat)
    for k, (a, b, c, d) in enumerate(_cells(6, 4)):
        model.add(f"CTRIA3,{2 * k + 1},1,{a},{b},{c}", f"CTRIA3,{2 * k + 2},1,{a},{c},{d}")
    return model


def bracket() -> Model:
    """A folded plate."""
    model = _supported("bracket", range(1, 6)).add("PSHELL,1,1,.008,1,,1")
    model.measured = "123"
    _grid(model, 8, 4, lambda u, v: (min(2 * u, 1.0), 0.5 * v, max(2 * u - 1.0, 0.0)))
    _quads(model, _cells(8, 4))
    return model


def offset_plate() -> Model:
    """A plate whose mid-surface is offset to one side."""
    model = _supported("plate with offsets", range(1, 6)).add("PSHELL,1,1,.01,1,,1")
    _grid(model, 6, 4, _flat)
    _quads(model, _cells(6, 4), offset=",.005")
    return model


def block() -> Model:
    """A block of hexahedra."""
    model = _supported("block", range(1, 10), "123").add("PSOLID,1,1")
    model.measured = "123"
    for i in range(6):
        for j in range(3):
            for k in range(3):
                model.add(f"GRID,{1 + 9 * i + 3 * j + k},,{0.2 * i:.6f},{0.1 * j:.6f},{0.1 * k:.6f}")
    number = 0
    for i in range(5):
        for j in range(2):
            for k in range(2):
                a, number = 1 + 9 * i + 3 * j + k, number + 1
                model.add(f"CHEXA,{number},1,{a},{a + 9},{a + 12},{a + 3},{a + 1},{a + 10}", f",{a + 13},{a + 4}")
    return model


def frame() -> Model:
    """A portal frame of bars."""
    model = _supported("frame", (1, 13)).add("PBAR,1,1,1.-3,8.-7,8.-7,1.2-6")
    model.measured = "123"
    corners = [(0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0)]
    for k in range(13):
        side, part = divmod(k, 4)
        (x0, z0), (x1, z1) = corners[min(side, 3)], corners[min(side + 1, 3)]
        model.add(f"GRID,{k + 1},,{x0 + (x1 - x0) * part / 4:.6f},0.,{z0 + (z1 - z0) * part / 4:.6f}")
    return model.add(*(f"CBAR,{k},1,{k},{k + 1},0.,1.,0." for k in range(1, 13)))


def stiffened() -> Model:
    """A plate with stiffeners and an instrument."""
    model = plate()
    model.name = "stiffened plate"
    model.add("PBAR,2,1,2.-4,2.-9,8.-9,4.-9", "CONM2,900,33,,2.5")
    return model.add(*(f"CBAR,{700 + i},2,{3 + 5 * i},{8 + 5 * i},0.,0.,1." for i in range(6)))


def joined() -> Model:
    """Two plates with bushes along the seam."""
    model = plate()
    model.name = "plates on bushes"
    _grid(model, 4, 4, lambda u, v: (1.0 + 0.7 * u, 0.6 * v, 0.0), 101)
    _quads(model, _cells(4, 4, 101), first=101)
    model.add("PBUSH,9,K,1.+8,1.+8,1.+8,1.+5,1.+5,1.+5")
    return model.add(*(f"CBUSH,{901 + j},9,{31 + j},{101 + j},,,,0" for j in range(5)))


def laminate() -> Model:
    """A laminated plate whose reference surface is its lower side."""
    model = _supported("laminate", range(1, 6))
    model.add("PCOMP,1,0.,,,,,,", ",1,.002,0.,,1,.002,90.", ",1,.002,0.")
    _grid(model, 6, 4, _flat)
    _quads(model, _cells(6, 4))
    return model


def free_plate() -> Model:
    """A free plate."""
    model = Model("free plate").add(ALUMINIUM, "PSHELL,1,1,.01,1,,1")
    _grid(model, 6, 4, _flat)
    _quads(model, _cells(6, 4))
    return model


DECKS: tuple[Callable[[], Model], ...] = (
    plate, triangles, bracket, offset_plate, block, frame, stiffened, joined, laminate, free_plate,
)  # fmt: skip
"""The ten decks."""
