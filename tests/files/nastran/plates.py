"""Decks of shells that are flat, two beside each other, or a tube, as text."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

HEAD = "SOL 103\nCEND\nSPC = 1\nBEGIN BULK\nMAT1,1,7.+10,,.3,2700.\nPSHELL,1,1,.01,1,,1\nPSOLID,2,1\n"


def grid(n: int, at: Callable[[float, float], tuple[float, float, float]], first: int = 1, m: int = 4) -> str:
    places = [(i, j, at(i / n, j / m)) for i in range(n + 1) for j in range(m + 1)]
    return "".join(f"GRID,{first + i * (m + 1) + j},,{x:.6f},{y:.6f},{z:.6f}\n" for i, j, (x, y, z) in places)


def shells(n: int, first: int = 1, number: int = 1, m: int = 4, offset: str = "") -> str:
    rows = []
    for k, (i, j) in enumerate((i, j) for i in range(n) for j in range(m)):
        a, b = first + i * (m + 1) + j, first + (i + 1) * (m + 1) + j
        rows.append(f"CQUAD4,{number + k},1,{a},{b},{b + 1},{a + 1}{offset}\n")
    return "".join(rows)


def flat(u: float, v: float) -> tuple[float, float, float]:
    return u, 0.5 * v, 0.0


def beside(u: float, v: float) -> tuple[float, float, float]:
    return 1.0 + u, 0.5 * v, 0.0


def tube(u: float, v: float) -> tuple[float, float, float]:
    return float(np.cos(2 * np.pi * u)), float(np.sin(2 * np.pi * u)), v


PLATE = HEAD + "SPC1,1,123456,1,THRU,5\n" + grid(4, flat) + shells(4)
SECOND = grid(4, beside, 101) + shells(4, 101, 101)
