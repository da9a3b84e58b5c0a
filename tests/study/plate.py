"""A rectangular plate, free or clamped along one side."""

from __future__ import annotations

NX, NY = 8, 6


def plate_deck(clamped: bool = False, *extra: str) -> str:
    """A plate of 0.8 × 0.6 m with its grid points numbered by row, 1 at the origin; clamped along x = 0 or free."""
    lines = ["SOL 103", "CEND", "METHOD = 1", *(["SPC = 1"] if clamped else []), "BEGIN BULK", "PARAM,COUPMASS,1"]
    for j in range(NY + 1):
        for i in range(NX + 1):
            lines.append(f"GRID,{grid_at(i, j)},,{0.1 * i:.2f},{0.1 * j:.2f},0.")
    for j in range(NY):
        for i in range(NX):
            corners = (grid_at(i, j), grid_at(i + 1, j), grid_at(i + 1, j + 1), grid_at(i, j + 1))
            lines.append(f"CQUAD4,{1 + i + NX * j},1,{','.join(map(str, corners))}")
    lines += ["PSHELL,1,1,.004,1,,1", "MAT1,1,7.+10,,.33,2700.", "EIGRL,1,,,12"]
    if clamped:
        held = ",".join(str(grid_at(0, j)) for j in range(NY + 1))
        first, rest = held.split(",")[:5], held.split(",")[5:]
        lines += [f"SPC1,1,123456,{','.join(first)}", f"SPC1,1,123456,{','.join(rest)}"]
    return "\n".join([*lines, *extra, "ENDDATA", ""])


def grid_at(i: int, j: int) -> int:
    return 1 + i + (NX + 1) * j
