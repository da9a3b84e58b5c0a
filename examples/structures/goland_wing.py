"""The Goland wing of membranes, rods and masses, as a deck of pyNastran's test models has it.

Commercial Nastran lists its first mode, `LISTED_HZ`, and no stiffness at all for the rotations of its grid points:
K6ROT does not act where every shell is a membrane. Feet, slugs, seconds.
"""

from __future__ import annotations

from collections.abc import Iterator

LISTED_HZ = 1.981382
"""Of ``goland_final_test.bdf`` by MSC Nastran 2018.1; of its modes six are below 18.98444 Hz, four below 13.30429."""

_CHORD, _HEIGHT, _BAYS = (0.0, 2.0, 4.0), 0.166667, 10
_THICKNESS = {"skin": 0.0155, "edge": 0.0006, "centre": 0.0889, "rib": 0.0347}
_AREA = {"post": 0.0008, "rib cap": 0.0422, "edge cap": 0.0416, "centre cap": 0.1492}
_MASS = (1.965, 3.9442, 5.3398)


def goland_wing(parameters: str = "") -> str:
    """The deck; `parameters` are PARAM cards."""
    shells = {name: i for i, name in enumerate(_THICKNESS, 1)}
    rods = {name: i for i, name in enumerate(_AREA, 11)}
    cards = [f"GRID,{_id(k, j)},,{_CHORD[j % 3]},{2.0 * k},{_HEIGHT if j < 3 else -_HEIGHT}"
             for k in range(_BAYS + 1) for j in range(6)]  # fmt: skip
    cards += [f"CQUAD4,{n},{shells[name]},{a},{b},{c},{d}" for n, (name, a, b, c, d) in enumerate(_panels(), 1)]
    cards += [f"CROD,{n},{rods[name]},{a},{b}" for n, (name, a, b) in enumerate(_rods(), 101)]
    cards += [f"PSHELL,{shells[name]},1,{t}" for name, t in _THICKNESS.items()]
    cards += [f"PROD,{rods[name]},1,{area}" for name, area in _AREA.items()]
    for k in range(_BAYS + 1):
        half = 0.5 if k in (0, _BAYS) else 1.0
        cards += [f"CONM2,{1000 + _id(k, j)},{_id(k, j)},,{half * _MASS[j % 3]}" for j in range(6)]
    root = ",".join(str(_id(0, j)) for j in range(6))
    head = f"SOL 103\nCEND\nMETHOD = 1\nSPC = 1\nBEGIN BULK\n{parameters}EIGRL,1,,,6\nMAT1,1,1.4976+9,,.3333333,.0001\n"
    return head + "\n".join([*cards, f"SPC1,1,123456,{root}", "ENDDATA", ""])


def _id(k: int, j: int) -> int:
    """Station k of the span; three points of the upper skin, then three of the lower one."""
    return 10000 + 100 * k + j


def _panels() -> Iterator[tuple[str, int, int, int, int]]:
    for k in range(_BAYS):
        for j in (0, 1, 3, 4):
            yield "skin", _id(k, j), _id(k, j + 1), _id(k + 1, j + 1), _id(k + 1, j)
        for j, name in enumerate(("edge", "centre", "edge")):
            yield name, _id(k, j + 3), _id(k, j), _id(k + 1, j), _id(k + 1, j + 3)
    for k in range(_BAYS + 1):
        for j in (0, 1):
            yield "rib", _id(k, j + 3), _id(k, j), _id(k, j + 1), _id(k, j + 4)


def _rods() -> Iterator[tuple[str, int, int]]:
    for k in range(_BAYS + 1):
        for j in range(3):
            yield "post", _id(k, j + 3), _id(k, j)
        for j in (0, 1, 3, 4):
            # the deck has this rib cap from the leading edge, beside the one before it
            start = 0 if (k, j) == (5, 1) else j
            yield "rib cap", _id(k, start), _id(k, j + 1)
    for k in range(_BAYS):
        for j in range(6):
            yield "centre cap" if j % 3 == 1 else "edge cap", _id(k, j), _id(k + 1, j)
