"""Cards of space frames at random."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from tests.deck_models import model_of

from femtune.model import solve_modes

HEAD = ["SOL 103", "CEND", "SPC = 1", "METHOD = 1", "BEGIN BULK", "EIGR,1,MGIV,,,1,10", "MAT1,1,2.1+11,,.3,7850."]
_PAIRS = ((1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (1, 4), (2, 5))


def _numbers(values: np.ndarray) -> str:
    return ",".join(f"{v:.5f}" for v in values)


def systems(rng: np.random.Generator) -> list[str]:
    lines = []
    for number in (1, 2, 3):
        origin = rng.uniform(-1, 1, 3)
        z, x = origin + rng.normal(size=3), origin + rng.normal(size=3)
        lines += [f"CORD2R,{number},,{_numbers(origin)},{_numbers(z)}", f",{_numbers(x)}"]
    return lines


def points(rng: np.random.Generator, rotated: bool) -> list[str]:
    xyz = np.cumsum(rng.uniform(0.4, 1.2, (6, 3)) * [1.0, 0.6, 0.5], axis=0)
    xyz = np.vstack([xyz, xyz[5] + rng.uniform(0.2, 0.5, 3), xyz[2] + rng.uniform(0.2, 0.5, 3)])
    systems = rng.integers(0, 4, 8) * rotated
    return [f"GRID,{i},,{_numbers(p)},{c}" for i, (p, c) in enumerate(zip(xyz, systems), start=1)]


def sections(rng: np.random.Generator, same: bool) -> list[str]:
    lines = []
    for number in (1, 2):
        i1, i2 = rng.uniform(1, 5, 2)
        size = f"{rng.uniform(1, 3):.3f}-3,{i1:.3f}-6,{i1 if same else i2:.3f}-6,{rng.uniform(1, 4):.3f}-6"
        lines.append(f"PBAR,{number},1,{size},{rng.uniform(0, 2):.3f}")
        if not same and rng.random() < 0.5:
            lines += [",,,,,,,,", f",{_numbers(rng.uniform(0.3, 0.9, 2))}"]
    return lines


def bars(rng: np.random.Generator, plain: bool) -> list[str]:
    lines = []
    for number, (a, b) in enumerate(_PAIRS, start=11):
        lines.append(f"CBAR,{number},{rng.integers(1, 3)},{a},{b},{_numbers(rng.normal(size=3))}")
        if not plain and (number == 16 or rng.random() < 0.4):
            # one bar may be pinned: two at one joint would make a mechanism, which the other solver refuses
            pin = rng.choice(["5", "6"]) if number == 16 else ""
            lines.append(f",{pin},,{_numbers(rng.uniform(-0.05, 0.05, 6))}")
    return lines


def frequencies(path: Path) -> np.ndarray:
    return solve_modes(model_of(path).at(np.zeros(0)), 10).freq_hz
