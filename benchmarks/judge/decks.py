"""Six small structures as Nastran decks (m, kg, s) whose values can be changed, with what a study of each updates.

A value is named by its field, "PSHELL 3 T". Keys that begin with a word in small letters are no fields of the deck:
they describe what the deck does not have at all, such as a forgotten mass. At their nominal value they are absent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

Values = Mapping[str, float]
Point = tuple[float, float, float]
Kind = Literal["material", "density", "thickness", "section", "joint", "mass"]

STEEL, ALUMINIUM = (2.1e11, 7850.0), (7.0e10, 2700.0)
"""Young's modulus in Pa, density in kg/m³."""


@dataclass(frozen=True)
class Range:
    """Factors on a value: bounds of a parameter, range of its truth, and sizes of an error of a value that is fixed.

    The bounds are those of `femtune init`; truths stay away from them, so that few estimates end at a bound.
    """

    lower: float
    upper: float
    truth: float
    smallest_error: float
    largest_error: float


RANGES: dict[Kind, Range] = {
    "material": Range(0.8, 1.25, 1.12, 1.05, 1.15),
    "density": Range(0.9, 1.1, 1.05, 1.03, 1.08),
    "thickness": Range(0.8, 1.25, 1.12, 1.05, 1.15),
    "section": Range(0.7, 1.4, 1.18, 1.08, 1.25),
    "joint": Range(0.1, 10.0, 1.5, 1.25, 2.0),
    "mass": Range(0.9, 1.1, 1.05, 1.04, 1.1),
}
"""`truth` and the errors are factors up or down. Errors are those of drawings, catalogues and guessed joints."""


def kind_of(field: str) -> Kind:
    """What a field is."""
    card, _, name = field.split()
    if card == "MAT1":
        return "density" if name == "RHO" else "material"
    kinds: dict[str, Kind] = {"PSHELL": "thickness", "PBAR": "section", "CONM2": "mass"}
    return kinds.get(card, "joint")


@dataclass(frozen=True)
class Hidden:
    """Something that the deck does not have, with its size in the structure.

    Parameters
    ----------
    key : its key among the values
    nominal : the value at which it is absent
    smallest, largest : of its value
    """

    key: str
    nominal: float
    smallest: float
    largest: float


@dataclass(frozen=True)
class Structure:
    """A structure, its test and its study.

    Parameters
    ----------
    name : one word
    values : nominal value of each field that may change
    bulk : values -> cards, without the values' names
    parameters : fields that the study updates
    fixed : fields that may be wrong and are not updated; the deck has them, so that they can be found by name. Those
        whose effect the parameters imitate are left out: even the smallest error of each leaves residuals of more than
        about 4 standard deviations, or harms no parameter. No test of residuals finds what leaves none
    hidden : errors that are no field of the deck
    sensors : of the simulated test
    modes : number of elastic modes of the test
    rigid : number of rigid-body modes
    inputs : DOFs of the exciters; FRFs are compared instead of modes if there are any
    band_hz : of the FRFs: first and last line, step
    """

    name: str
    values: Values
    bulk: Callable[[Values], Iterator[str]]
    parameters: tuple[str, ...]
    fixed: tuple[str, ...]
    hidden: tuple[Hidden, ...]
    sensors: tuple[str, ...]
    modes: int
    rigid: int = 0
    inputs: tuple[str, ...] = ()
    band_hz: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def deck(self, changed: Values) -> str:
        """The deck with some values changed by factors; hidden ones are given as values."""
        values = {field: value * changed.get(field, 1.0) for field, value in self.values.items()}
        hidden = {h.key: changed.get(h.key, h.nominal) for h in self.hidden}
        cards = list(self.bulk(values | hidden))
        held = ["SPC = 1"] if any(card.startswith("SPC1") for card in cards) else []
        case = ["SOL 103", "CEND", *held, "METHOD = 1", "BEGIN BULK", "EIGRL,1,,,10", "PARAM,COUPMASS,1"]
        return "\n".join([*case, *cards, "ENDDATA", ""])


# ----------------------------------------------------------------------------------------------------
# Cards.


def _real(value: float) -> str:
    """With a decimal point and all digits."""
    text = repr(float(value))
    return text if "." in text else text.replace("e", ".e")


def _grid(node: int, point: Point) -> str:
    return f"GRID,{node},,{point[0]:.8f},{point[1]:.8f},{point[2]:.8f}"


def _material(number: int, v: Values) -> str:
    return f"MAT1,{number},{_real(v[f'MAT1 {number} E'])},,0.3,{_real(v[f'MAT1 {number} RHO'])}"


def _shell(number: int, material: int, v: Values, factor: float = 1.0, copy: int = 0) -> str:
    return f"PSHELL,{copy or number},{material},{_real(factor * v[f'PSHELL {number} T'])},{material},,{material}"


def _bar(number: int, material: int, area: float, v: Values, torsion: float) -> str:
    i1, i2 = (v[f"PBAR {number} {name}"] for name in ("I1", "I2"))
    return f"PBAR,{number},{material},{_real(area)},{_real(i1)},{_real(i2)},{_real(torsion)}"


def _bush(number: int, v: Values, stiff: tuple[float, ...]) -> str:
    """K1 to K6; those that the values have are taken from there."""
    k = [v.get(f"PBUSH {number} K{i}", stiff[i - 1]) for i in range(1, 7)]
    return f"PBUSH,{number},K," + ",".join(_real(x) for x in k)


def _mass(number: int, node: int, v: Values) -> str:
    return f"CONM2,{number},{node},,{_real(v[f'CONM2 {number} M'])}"


def _forgotten(key: str, number: int, node: int, v: Values) -> Iterator[str]:
    if v[key]:
        yield f"CONM2,{number},{node},,{_real(v[key])}"


def _line(first: int, property_: int, nodes: list[int], axis: str) -> Iterator[str]:
    """Bars along a row of nodes."""
    for i, (a, b) in enumerate(pairwise(nodes)):
        yield f"CBAR,{first + i},{property_},{a},{b},{axis}"


def _clamp(nodes: list[int], key: str, first: int, v: Values) -> Iterator[str]:
    """Held nodes; with a stiffness in N m/rad, springs hold their rotations about all axes instead."""
    dofs = "123" if v[key] else "123456"
    for node in nodes:
        yield f"SPC1,1,{dofs},{node}"
    if v[key]:
        for i, node in enumerate(nodes):
            for c in (4, 5, 6):
                yield f"CELAS2,{first + 3 * i + c},{_real(v[key])},{node},{c}"


# ----------------------------------------------------------------------------------------------------
# A two-storey frame of tubes, elastic in its base.


def _frame(v: Values) -> Iterator[str]:
    corners = ((0.0, 0.0), (0.8, 0.0), (0.8, 0.6), (0.0, 0.6))
    for c, (x, y) in enumerate(corners):
        for k in range(7):
            yield _grid(100 * (c + 1) + k, (x, y, 0.2 * k))
        yield _grid(100 * (c + 1) + 50, (x, y, 0.0))
        yield f"CBUSH,{900 + c},1,{100 * (c + 1) + 50},{100 * (c + 1)},,,,0"
        yield f"SPC1,1,123456,{100 * (c + 1) + 50}"
        yield from _line(100 * (c + 1), 1, [100 * (c + 1) + k for k in range(4)], "1.,0.,0.")
        yield from _line(100 * (c + 1) + 3, 2, [100 * (c + 1) + k for k in range(3, 7)], "1.,0.,0.")
    for floor, k in ((1, 3), (2, 6)):
        z = 0.2 * k
        for side, (a, b) in enumerate(((1, 2), (4, 3))):
            y, at = (0.0, 0.6)[side], 1000 * floor + 10 * side
            yield _grid(at + 1, (0.25, y, z))
            yield _grid(at + 2, (0.5, y, z))
            yield from _line(at + 1, 3 if floor == 1 else 5, [100 * a + k, at + 1, at + 2, 100 * b + k], "0.,0.,1.")
        for side, (a, b) in enumerate(((1, 4), (2, 3))):
            x, at = (0.0, 0.8)[side], 1000 * floor + 100 + 10 * side
            yield _grid(at + 1, (x, 0.3, z))
            yield from _line(at + 1, 4, [100 * a + k, at + 1, 100 * b + k], "0.,0.,1.")
    yield from (_material(1, v), _material(2, v))
    for number, material in ((1, 1), (2, 1), (3, 2), (4, 2), (5, 2)):
        yield _bar(number, material, 2.3e-4, v, 4.0e-8)
    yield _bush(1, v, (1e8, 1e8, 1e8, 1e4, 1e4, 1e4))
    yield from (_mass(1, 1001, v), _mass(2, 2012, v), _mass(3, 406, v))
    yield from _forgotten("mass at 306", 91, 306, v)
    yield from _forgotten("mass at 1101", 92, 1101, v)
    if v["brace in frame 1"]:
        yield f"CELAS2,990,{_real(v['brace in frame 1'])},103,1,206,1"


FRAME = Structure(
    "frame",
    {
        "MAT1 1 E": STEEL[0], "MAT1 1 RHO": STEEL[1], "MAT1 2 E": STEEL[0], "MAT1 2 RHO": STEEL[1],
        "PBAR 1 I1": 2.9e-8, "PBAR 1 I2": 2.2e-8, "PBAR 2 I1": 2.9e-8, "PBAR 2 I2": 2.2e-8,
        "PBAR 3 I1": 2.5e-8, "PBAR 3 I2": 2.5e-8, "PBAR 4 I1": 2.5e-8, "PBAR 4 I2": 2.5e-8,
        "PBAR 5 I1": 2.5e-8, "PBAR 5 I2": 2.5e-8, "PBUSH 1 K4": 2.0e4, "PBUSH 1 K5": 3.0e4,
        "CONM2 1 M": 1.5, "CONM2 2 M": 2.0, "CONM2 3 M": 1.0,
    },
    _frame,
    ("PBAR 1 I1", "PBAR 1 I2", "PBAR 2 I1", "PBAR 2 I2", "PBAR 3 I1"),
    ("PBAR 3 I2", "PBAR 4 I2", "MAT1 2 E", "PBAR 5 I2", "CONM2 3 M", "MAT1 2 RHO"),
    (Hidden("mass at 306", 0.0, 0.2, 0.8), Hidden("mass at 1101", 0.0, 0.2, 0.8),
     Hidden("brace in frame 1", 0.0, 5e3, 3e4)),
    ("103:12", "203:12", "303:12", "106:12", "206:12", "306:12", "1001:23", "2001:23", "2012:23", "2101:13"),
    9,
)  # fmt: skip


# ----------------------------------------------------------------------------------------------------
# Fields of shells: (nx, ny) elements over a rectangle, nodes first + i + 100 j.


def _plane(
    first: int, cells: tuple[int, int], at: Callable[[float, float], Point], zone: Callable[[int, int], int]
) -> Iterator[str]:
    """Grid points and CQUAD4; `at` places (u, v) of the unit square, `zone` gives the property of a cell."""
    nx, ny = cells
    for j in range(ny + 1):
        for i in range(nx + 1):
            yield _grid(first + i + 100 * j, at(i / nx, j / ny))
    for j in range(ny):
        for i in range(nx):
            n = first + i + 100 * j
            yield f"CQUAD4,{n},{zone(i, j)},{n},{n + 1},{n + 101},{n + 100}"


def _plate(v: Values) -> Iterator[str]:
    def zone(i: int, j: int) -> int:
        if v["thickness of a patch"] != 1.0 and i in (5, 6) and j in (1, 2):
            return 52
        return 1 + (i > 4) + 2 * (j > 2)

    yield from _plane(1001, (9, 6), lambda x, y: (0.6 * x, 0.4 * y, 0.0), zone)
    yield from (_material(1, v), _material(2, v))
    yield from (_shell(n, 1 if n in (1, 4) else 2, v) for n in (1, 2, 3, 4))
    if v["thickness of a patch"] != 1.0:
        yield _shell(2, 2, v, v["thickness of a patch"], 52)
    yield from _clamp([1001 + 100 * j for j in range(7)], "clamp", 9000, v)
    yield from (_mass(1, 1309, v), _mass(2, 1607, v))
    yield f"CELAS2,3,{_real(v['CELAS2 3 K'])},1010,3"
    yield from _forgotten("mass at 1506", 91, 1506, v)


PLATE = Structure(
    "plate",
    {
        "MAT1 1 E": STEEL[0], "MAT1 1 RHO": STEEL[1], "MAT1 2 E": STEEL[0], "MAT1 2 RHO": STEEL[1],
        "PSHELL 1 T": 3.0e-3, "PSHELL 2 T": 3.0e-3, "PSHELL 3 T": 3.0e-3, "PSHELL 4 T": 3.0e-3,
        "CONM2 1 M": 0.3, "CONM2 2 M": 0.2, "CELAS2 3 K": 4.0e3,
    },
    _plate,
    ("PSHELL 1 T", "PSHELL 2 T", "PSHELL 3 T", "CELAS2 3 K"),
    ("PSHELL 4 T", "MAT1 1 E", "CONM2 1 M", "MAT1 2 RHO", "CONM2 2 M"),
    (Hidden("mass at 1506", 0.0, 0.03, 0.12), Hidden("clamp", 0.0, 5e2, 5e3),
     Hidden("thickness of a patch", 1.0, 0.75, 0.92)),
    ("1104:3", "1107:3", "1110:3", "1304:3", "1307:3", "1310:3", "1404:3", "1407:3", "1410:3", "1604:3", "1607:3",
     "1610:3"),
    8,
)  # fmt: skip


# ----------------------------------------------------------------------------------------------------
# A panel with two stiffeners and an edge frame on four mounts.


def _panel(v: Values) -> Iterator[str]:
    def zone(i: int, j: int) -> int:
        if v["thickness of a patch"] != 1.0 and i in (4, 5) and j in (2, 3):
            return 52
        return 1 + (i > 2) + (i > 5)

    yield from _plane(1001, (9, 6), lambda x, y: (0.9 * x, 0.6 * y, 0.0), zone)
    yield from (_material(1, v), _material(2, v))
    yield from (_shell(n, 1, v) for n in (1, 2, 3))
    if v["thickness of a patch"] != 1.0:
        yield _shell(2, 1, v, v["thickness of a patch"], 52)
    yield from (_bar(n, 2, area, v, 3.0e-9) for n, area in ((11, 1.2e-4), (12, 1.2e-4), (13, 1.6e-4)))
    yield from _line(5000, 11, [1201 + i for i in range(10)], "0.,0.,1.")
    yield from _line(5100, 12, [1401 + i for i in range(10)], "0.,0.,1.")
    yield from _line(5200, 13, [1001 + i for i in range(10)], "0.,0.,1.")
    yield from _line(5300, 13, [1601 + i for i in range(10)], "0.,0.,1.")
    yield from _line(5400, 13, [1001 + 100 * j for j in range(7)], "0.,0.,1.")
    yield from _line(5500, 13, [1010 + 100 * j for j in range(7)], "0.,0.,1.")
    for k, (node, mount) in enumerate(((1001, 1), (1601, 1), (1010, 2), (1610, 2))):
        yield f"CBUSH,{6000 + k},{mount},{node},,,,,0"
    yield from (_bush(n, v, (1e8, 1e8, 3e5, 10.0, 10.0, 10.0)) for n in (1, 2))
    yield from (_mass(1, 1304, v), _mass(2, 1508, v))
    yield from _forgotten("mass at 1107", 91, 1107, v)
    if v["third stiffener"]:
        yield f"PBAR,14,2,6.-5,{_real(v['third stiffener'])},{_real(v['third stiffener'])},1.-9"
        yield from _line(5600, 14, [1004 + 100 * j for j in range(7)], "1.,0.,0.")


PANEL = Structure(
    "panel",
    {
        "MAT1 1 E": ALUMINIUM[0], "MAT1 1 RHO": ALUMINIUM[1], "MAT1 2 E": ALUMINIUM[0], "MAT1 2 RHO": ALUMINIUM[1],
        "PSHELL 1 T": 2.5e-3, "PSHELL 2 T": 2.5e-3, "PSHELL 3 T": 2.5e-3,
        "PBAR 11 I1": 4.0e-9, "PBAR 11 I2": 4.0e-9, "PBAR 12 I1": 4.0e-9, "PBAR 12 I2": 4.0e-9,
        "PBAR 13 I1": 6.0e-9, "PBAR 13 I2": 6.0e-9, "PBUSH 1 K3": 1.0e5, "PBUSH 2 K3": 1.0e5,
        "CONM2 1 M": 0.25, "CONM2 2 M": 0.25,
    },
    _panel,
    ("PSHELL 1 T", "PSHELL 2 T", "PBAR 11 I1", "PBAR 13 I1", "PBUSH 1 K3"),
    ("PSHELL 3 T", "PBAR 12 I1", "PBUSH 2 K3", "MAT1 1 E", "MAT1 2 RHO", "CONM2 2 M"),
    (Hidden("mass at 1107", 0.0, 0.05, 0.25), Hidden("third stiffener", 0.0, 5e-10, 2e-9),
     Hidden("thickness of a patch", 1.0, 0.75, 0.92)),
    ("1002:3", "1005:3", "1008:3", "1102:3", "1105:3", "1109:3", "1302:3", "1305:3", "1308:3", "1403:3", "1406:3",
     "1502:3", "1507:3", "1509:3", "1604:3", "1610:3"),
    9,
)  # fmt: skip


# ----------------------------------------------------------------------------------------------------
# A welded shell: a floor and a wall that spot welds join, and a side sheet.


def _welded(v: Values) -> Iterator[str]:
    yield from _plane(1001, (6, 5), lambda x, y: (0.36 * x, 0.3 * y, 0.0), lambda _i, j: 1 if j < 3 else 4)
    yield from _plane(2001, (6, 4), lambda x, z: (0.36 * x, 0.3, 0.24 * z), lambda _i, _j: 2)
    # the side sheet shares its nodes with the wall along x = 0
    for j in range(5):
        for i in range(1, 3):
            yield _grid(3000 + i + 100 * j, (0.0, 0.3 - 0.06 * i, 0.06 * j))

    def side(i: int, j: int) -> int:
        return 2001 + 100 * j if i == 0 else 3000 + i + 100 * j

    for j in range(4):
        for i in range(2):
            corners = (side(i, j), side(i + 1, j), side(i + 1, j + 1), side(i, j + 1))
            yield f"CQUAD4,{3001 + i + 100 * j},3," + ",".join(map(str, corners))
    for i in range(7):
        if i != 3 or not v["missing weld"]:
            yield f"CBUSH,{6000 + i},{1 if i % 2 == 0 else 2},{1501 + i},{2001 + i},,,,0"
    yield from (_bush(n, v, (2e7, 2e7, 2e7, 1e3, 1e3, 1e3)) for n in (1, 2))
    yield from (_material(1, v), _material(2, v))
    yield from (_shell(n, 2 if n == 2 else 1, v) for n in (1, 2, 3, 4))
    yield from _clamp([1001 + i for i in range(7)], "clamp", 9000, v)
    yield from (_mass(1, 2407, v), _mass(2, 2404, v))
    yield from _forgotten("mass at 2206", 91, 2206, v)


WELDED = Structure(
    "welded shell",
    {
        "MAT1 1 E": STEEL[0], "MAT1 1 RHO": STEEL[1], "MAT1 2 E": STEEL[0], "MAT1 2 RHO": STEEL[1],
        "PSHELL 1 T": 2.0e-3, "PSHELL 2 T": 1.5e-3, "PSHELL 3 T": 1.5e-3, "PSHELL 4 T": 2.0e-3,
        "PBUSH 1 K4": 20.0, "PBUSH 2 K4": 20.0, "CONM2 1 M": 0.15, "CONM2 2 M": 0.1,
    },
    _welded,
    ("PSHELL 1 T", "PSHELL 2 T", "PSHELL 3 T", "PBUSH 1 K4"),
    ("PSHELL 4 T", "MAT1 1 E", "MAT1 2 RHO", "CONM2 1 M", "CONM2 2 M"),
    (Hidden("mass at 2206", 0.0, 0.02, 0.1), Hidden("clamp", 0.0, 60.0, 1000.0), Hidden("missing weld", 0.0, 1.0, 1.0)),
    ("1203:3", "1206:3", "1303:3", "1401:3", "1407:3", "2101:2", "2104:2", "2107:2", "2301:2", "2304:2", "2307:2",
     "2402:2", "2406:2", "3202:1", "3402:1"),
    8,
)  # fmt: skip


# ----------------------------------------------------------------------------------------------------
# An aeroplane: a fuselage of bars, wings and tail of shells, free.


def _aeroplane(v: Values) -> Iterator[str]:
    for i in range(9):
        yield _grid(1 + i, (0.2 * i, 0.0, 0.0))
    yield from _line(1, 1, list(range(1, 5)), "0.,0.,1.")
    yield from _line(4, 2, list(range(4, 10)), "0.,0.,1.")
    # the wing lies above the fuselage, on two links
    yield from _plane(
        1001, (2, 12), lambda u, s: (0.5 + 0.2 * u, 2.0 * s - 1.0, 0.05),
        lambda _i, j: 3 if 3 <= j < 9 else (4 if j >= 9 else 5),
    )  # fmt: skip
    yield "CBUSH,6001,1,4,1602,,,,0"
    yield "CBUSH,6002,2,3,1601,,,,0"
    yield from (_bush(n, v, (1e7, 1e7, 1e7, 2e4, 2e4, 2e4)) for n in (1, 2))
    yield from _plane(3001, (1, 3), lambda u, s: (1.5 + 0.12 * u, 0.0, 0.05 + 0.3 * s), lambda _i, _j: 6)
    yield "RBE2,7001,9,123456,3001,3002"
    yield from _plane(4001, (1, 6), lambda u, s: (1.5 + 0.12 * u, 0.6 * s - 0.3, 0.38), lambda _i, _j: 7)
    yield "RBE2,7002,3301,123456,4301,4302"
    yield from (_material(1, v), _material(2, v))
    yield from (_bar(n, 1, 6.0e-4, v, 5.0e-8) for n in (1, 2))
    yield from (_shell(n, 2, v) for n in (3, 4, 5, 6, 7))
    yield from (_mass(1, 1002, v), _mass(2, 2202, v), _mass(3, 1, v), _mass(4, 8, v))
    yield from _forgotten("mass at 2002", 91, 2002, v)
    yield from _forgotten("mass at 4601", 92, 4601, v)
    if v["strut"]:
        yield f"CELAS2,990,{_real(v['strut'])},4,3,1402,3"


AEROPLANE = Structure(
    "aeroplane",
    {
        "MAT1 1 E": ALUMINIUM[0], "MAT1 1 RHO": ALUMINIUM[1], "MAT1 2 E": ALUMINIUM[0], "MAT1 2 RHO": ALUMINIUM[1],
        "PBAR 1 I1": 8.0e-8, "PBAR 1 I2": 8.0e-8, "PBAR 2 I1": 8.0e-8, "PBAR 2 I2": 8.0e-8,
        "PSHELL 3 T": 8.0e-3, "PSHELL 4 T": 8.0e-3, "PSHELL 5 T": 8.0e-3, "PSHELL 6 T": 8.0e-3, "PSHELL 7 T": 8.0e-3,
        "PBUSH 1 K4": 2.0e4, "PBUSH 2 K3": 1.0e6,
        "CONM2 1 M": 0.3, "CONM2 2 M": 0.3, "CONM2 3 M": 1.0, "CONM2 4 M": 0.8,
    },
    _aeroplane,
    ("PSHELL 3 T", "PSHELL 4 T", "PSHELL 5 T", "PBAR 2 I1", "PBAR 2 I2", "PSHELL 6 T"),
    ("PSHELL 7 T", "PBAR 1 I2", "CONM2 3 M", "MAT1 2 E", "PBUSH 1 K4", "CONM2 1 M"),
    (Hidden("mass at 2002", 0.0, 0.05, 0.25), Hidden("mass at 4601", 0.0, 0.03, 0.15), Hidden("strut", 0.0, 5e3, 4e4)),
    ("1001:3", "1003:3", "1301:3", "1303:3", "1901:3", "1903:3", "2201:3", "2203:3", "1:23", "6:23", "9:23",
     "3302:2", "4001:3", "4002:1", "4602:3"),
    10, rigid=6,
)  # fmt: skip


# ----------------------------------------------------------------------------------------------------
# A subframe: a ladder of tubes on four bushings, compared by its FRFs.


def _subframe(v: Values) -> Iterator[str]:
    for side, y in ((1, 0.0), (2, 0.6)):
        for k in range(9):
            bend = 0.04 * (1.0 - (2.0 * k / 8 - 1.0) ** 2)
            yield _grid(100 * side + k, (0.125 * k, y + (bend if side == 1 else -bend), 0.05 * (k > 4)))
        yield from _line(100 * side, side, [100 * side + k for k in range(9)], "0.,0.,1.")
    for n, k in ((3, 1), (4, 4), (5, 7)):
        inner = [1000 * n + i for i in range(3)]
        y0, y1 = (y + s * 0.04 * (1.0 - (2.0 * k / 8 - 1.0) ** 2) for y, s in ((0.0, 1.0), (0.6, -1.0)))
        for i, node in enumerate(inner):
            yield _grid(node, (0.125 * k, y0 + (i + 1) / 4 * (y1 - y0), 0.05 * (k > 4)))
        yield from _line(1000 * n, n, [100 + k, *inner, 200 + k], "0.,0.,1.")
    for k, (node, mount) in enumerate(((100, 1), (200, 1), (108, 2), (208, 2))):
        yield f"CBUSH,{6000 + k},{mount},{node},,,,,0"
    yield from (_bush(n, v, (2e5, 2e5, 2e5, 50.0, 50.0, 50.0)) for n in (1, 2))
    yield from (_material(1, v), _material(2, v))
    yield from (_bar(n, 1 if n < 3 else 2, 3.0e-4, v, 1.2e-7) for n in range(1, 6))
    yield from (_mass(1, 4001, v), _mass(2, 206, v))
    yield from _forgotten("mass at 106", 91, 106, v)
    if v["brace"]:
        yield f"PROD,9,2,{_real(v['brace'])}"
        yield "CROD,9001,9,101,204"


SUBFRAME = Structure(
    "subframe",
    {
        "MAT1 1 E": STEEL[0], "MAT1 1 RHO": STEEL[1], "MAT1 2 E": STEEL[0], "MAT1 2 RHO": STEEL[1],
        **{f"PBAR {n} {i}": 6.0e-8 for n in range(1, 6) for i in ("I1", "I2")},
        "PBUSH 1 K3": 2.0e5, "PBUSH 2 K3": 2.0e5, "CONM2 1 M": 0.8, "CONM2 2 M": 0.5,
    },
    _subframe,
    ("PBAR 1 I1", "PBAR 2 I1", "PBAR 3 I1", "PBAR 4 I1", "PBUSH 1 K3"),
    ("PBAR 5 I1", "PBUSH 2 K3", "MAT1 2 E", "MAT1 2 RHO", "CONM2 1 M", "CONM2 2 M"),
    (Hidden("mass at 106", 0.0, 0.1, 0.4), Hidden("brace", 0.0, 1e-6, 1e-5)),
    ("102Z+", "105Z+", "203Z+", "206Z+", "3001Z+", "5002Z+"),
    0, inputs=("101Z+",), band_hz=(20.0, 220.0, 2.0),
)  # fmt: skip

STRUCTURES = (FRAME, PLATE, PANEL, WELDED, AEROPLANE, SUBFRAME)
