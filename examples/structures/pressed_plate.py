"""A clamped plate whose thickness varies as that of a pressed part: for studies of values that vary over a region."""

from __future__ import annotations

NX, NY, LENGTH, WIDTH, THICK = 10, 6, 0.6, 0.35, 2.0e-3
TRUTH = (-0.05, 0.08, -0.06)
"""Amplitudes of 1, u and 1 − v²."""


def thickness(i: int, j: int) -> float:
    """Of element (i, j): thinner towards the middle of the length, as by drawing."""
    u, v = (2.0 * i / (NX - 1) - 1.0), (2.0 * j / (NY - 1) - 1.0)
    return THICK * (1.0 + TRUTH[0] + TRUTH[1] * u + TRUTH[2] * (1.0 - v**2))


def plate(varied: bool) -> str:
    """The deck of a plate that is clamped at one end; `varied` with a card for the thickness of each element."""
    lines = ["SOL 103", "CEND", "SPC = 1", "BEGIN BULK", "MAT1,1,2.1+11,,.3,7850."]
    number = {(i, j): 1 + i + (NX + 1) * j for i in range(NX + 1) for j in range(NY + 1)}
    for (i, j), n in number.items():
        lines.append(f"GRID,{n},,{LENGTH * i / NX:.6f},{WIDTH * j / NY:.6f},0.")
    lines += [f"SPC1,1,123456,{number[0, j]}" for j in range(NY + 1)]
    lines += [] if varied else [f"PSHELL,1,1,{THICK},1,,1"]
    for j in range(NY):
        for i in range(NX):
            e = 1 + i + NX * j
            corners = ",".join(str(number[c]) for c in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)))
            lines.append(f"CQUAD4,{e},{e if varied else 1},{corners}")
            if varied:
                lines += [f"PSHELL,{e},1,{thickness(i, j):.9e},1,,1"]
    return "\n".join([*lines, "ENDDATA", ""])
